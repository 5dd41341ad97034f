//! Whole parts: from a mesh and a layout in patches to one surface of many faces, a solid where the mesh is closed.

mod mesh;
mod options;
mod report;
mod sampling;

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use geom_io::{read_layout, read_scan};
use multi_patch::{Fitted, Surface};
use quad_layout::{QuadLayout, RawPatch};
use thb_core::MultiPatchSpace;

use crate::{Error, Event, Watch, units};
use mesh::SolidMesh;
pub use options::{Sharp, Smoothness, SolidOptions};
pub use report::{SolidDistances, SolidLayoutReport, SolidReason, SolidReport, SolidVolume};

/// A surface of many faces that was fitted to a whole part.
#[derive(Debug)]
pub struct SolidFit {
    /// The surface.
    pub surface: Surface,
    /// The samples of the mesh that were fitted, at their foot points.
    pub samples: multi_patch::Samples,
    /// The distance of each from the surface.
    pub distances: Vec<f64>,
    /// How good it is.
    pub report: SolidReport,
    /// Unit of its coordinates.
    pub unit: geom_io::LengthUnit,
    /// Whether `S_u × S_v` points inward.
    pub reversed: bool,
}

impl SolidFit {
    /// Whether the surface is near the mesh as asked and folds nowhere.
    pub fn reached(&self) -> bool {
        self.report.reasons.is_empty()
    }
}

/// Fits the patches of a layout to a mesh, both in files.
///
/// # Errors
/// [`Error`]. A tolerance that is not reached and folds are no errors: the report has them.
pub fn fit_solid_file(path: &Path, options: &SolidOptions, watch: &mut Watch<'_>) -> Result<SolidFit, Error> {
    let start = Instant::now();
    options.check()?;
    let _ = watch(Event::Step("reading"));
    let scan = read_scan(path, &options.read)?;
    let unit = units::resolve(options.units, scan.unit);
    let mesh = SolidMesh::new(scan)?;
    let layout = layout_of(&options.layout, &mesh)?;
    let sharp = match options.sharp {
        Sharp::Angle(degrees) => layout.sharp_arcs(degrees),
        Sharp::Off => vec![false; layout.topology().arcs().len()],
    };
    let space = Arc::new(MultiPatchSpace::uniform(Arc::clone(layout.topology()), options.degree, options.elements)?);
    let _ = watch(Event::Step("finding parameters"));
    let samples = sampling::samples(&mesh, &layout, &sharp, &space);
    let _ = watch(Event::Step("fitting"));
    let fit_options = multi_patch::Options {
        plates: options.plates,
        smoothness: options.smoothness.weight(),
        diagonal: mesh.diagonal,
        ..multi_patch::Options::default()
    };
    let fitted = multi_patch::fit(&space, &sharp, samples, &fit_options)?;
    let _ = watch(Event::Step("measuring"));
    let mut report = report::measured(path, &mesh, &layout, &sharp, &fitted, options);
    report.seconds = start.elapsed().as_secs_f64();
    let reversed = (report.volume.as_ref().is_some_and(|volume| volume.surface < 0.0)) != options.flip;
    let Fitted { surface, samples, distances, .. } = fitted;
    Ok(SolidFit { surface, samples, distances, report, unit, reversed })
}

/// Share of the diagonal by which the box of a layout may differ from that of the mesh: vertices were slid along the surface.
///
/// Limit: a layout of another part differs by far more in one of three directions.
const SAME_BOX: f64 = 0.05;

/// The layout in the coordinates of the mesh. A file has those, or those in which the mesh's box has its centre at 0 and diagonal 1.
fn layout_of(path: &Path, mesh: &SolidMesh) -> Result<QuadLayout, Error> {
    let file = read_layout(path)?;
    let corner = |patch: usize, corner: u32| {
        let known = file.corners.get(corner as usize).copied();
        known.ok_or(Error::LayoutCorner { patch, corner, corners: file.corners.len() })
    };
    let mut patches = Vec::with_capacity(file.quads.len());
    for (number, quad) in file.quads.iter().enumerate() {
        let [a, b, c, d] = quad.corners;
        patches.push(RawPatch {
            corners: [corner(number, a)?, corner(number, b)?, corner(number, c)?, corner(number, d)?],
            paths: quad.paths.clone(),
            triangles: quad.triangles.clone(),
            vertices: quad.vertices.clone(),
            uv: quad.uv.clone(),
        });
    }
    let layout = QuadLayout::new(file.vertices, patches)?;
    let used = layout.patches().iter().flat_map(|patch| &patch.vertices);
    let found = mesh::box_of(used.map(|&vertex| layout.vertices()[vertex as usize]));
    let [lower, upper] = mesh.bounds;
    let unit = mesh.diagonal;
    let centre: [f64; 3] = std::array::from_fn(|k| 0.5 * (lower[k] + upper[k]));
    let off = |found: [[f64; 3]; 2]| {
        let offs = (0..2).flat_map(|end| (0..3).map(move |k| (end, k)));
        offs.map(|(end, k)| (found[end][k] - mesh.bounds[end][k]).abs()).fold(0.0, f64::max)
    };
    if off(found) <= SAME_BOX * unit {
        return Ok(layout);
    }
    let place = |p: [f64; 3]| std::array::from_fn(|k| centre[k] + unit * p[k]);
    if off(found.map(place)) <= SAME_BOX * unit {
        return Ok(layout.moved(place));
    }
    Err(Error::ForeignLayout { path: path.to_owned(), layout: found, mesh: mesh.bounds })
}
