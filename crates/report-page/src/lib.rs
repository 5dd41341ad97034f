//! A report of a fit as one HTML page that needs nothing else: no server, no network, no other file.
//!
//! [`Page`] holds what is shown as plain arrays; [`Page::to_html`] makes the text. Points and triangles go into the page as whole numbers
//! of 16 bits, compressed; a viewer, written in the files under `assets/`, draws them with the bundled library three.js. [`index`] is
//! the page of a batch. This crate knows no splines, no files and no options: who calls it says what stands where.

mod bytes;
mod decimate;
mod html;
mod index;
mod picture;
mod statistics;

pub use bytes::{LARGEST_NUMBER, Sections, dequantize, quantize};
pub use decimate::{MOST_POINTS, morton_order, shown_points};
pub use html::{Fact, Headline, Page, Place, Reason, Step, Tone};
pub use index::{IndexRow, index};
pub use picture::{BANDS, Picture, View, draw};
pub use statistics::quantiles;

/// What was scanned, with its distances from the surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scan {
    /// The points.
    pub points: Vec<[f64; 3]>,
    /// Their signed distances, as many.
    pub deviations: Vec<f64>,
    /// What each counts in shares, as many, or none: all alike.
    pub weights: Vec<f64>,
    /// Unit normals of the surface near them, as many, or none: triangles have their own.
    pub normals: Vec<[f64; 3]>,
    /// Their parameters from 0 to 1, as many, or none.
    pub parameters: Vec<[f64; 2]>,
    /// Whether the fit set them aside, as many, or none: no point.
    pub set_aside: Vec<bool>,
    /// The triangles of a mesh, which name points.
    pub triangles: Vec<[u32; 3]>,
    /// Points that were left out before the fit.
    pub left_out: Vec<[f64; 3]>,
}

/// A surface as it is drawn.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    /// Vertices of triangles.
    pub vertices: Vec<[f64; 3]>,
    /// Unit normals, as many.
    pub normals: Vec<[f64; 3]>,
    /// Triangles.
    pub triangles: Vec<[u32; 3]>,
    /// Pieces of the lines between cells, each between two vertices.
    pub cell_lines: Vec<[u32; 2]>,
    /// Pieces of the lines between faces, each between two vertices.
    pub face_lines: Vec<[u32; 2]>,
    /// Control points.
    pub control_points: Vec<[f64; 3]>,
    /// Lines of the control net, each between two control points.
    pub control_lines: Vec<[u32; 2]>,
    /// Cells in the parameter plane: lower and upper corner, each from 0 to 1.
    pub cells: Vec<[f64; 4]>,
}

/// A surface and what it was fitted to.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Part {
    /// What to call it where there are several.
    pub name: String,
    /// The scan.
    pub scan: Scan,
    /// The surface.
    pub surface: Surface,
}
