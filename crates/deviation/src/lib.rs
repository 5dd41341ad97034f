//! How good a surface or a curve is, whoever made it: distances both ways by area, coverage, folds, crossings, and one
//! verdict.
//!
//! A [`Scan`] is prepared once; [`measure`] compares a surface with it; [`Thresholds`] make a [`Verdict`] of the measures. Surfaces
//! are measured on a [`Tessellation`] with a known chord error. This crate knows surfaces, curves, points and triangles; it does not
//! know how they were fitted.

mod creases;
mod crossings;
mod curved;
mod distances;
mod error;
mod feet;
mod gathered;
mod hausdorff;
mod measure;
mod parts;
mod scan;
mod search;
mod tessellation;
#[cfg(test)]
mod testing;
mod thickness;
mod thresholds;
mod tilted;
mod verdict;

pub use creases::creases;
pub use crossings::{Crossing, Crossings, TessellatedPatch, self_crossings};
pub use curved::{CREASE_DEGREES, CurvedTriangles};
pub use distances::Distances;
pub use error::Error;
pub use feet::SignedDistance;
pub use gathered::{Gathered, Patch};
pub use hausdorff::{Hausdorff, directed_hausdorff, hausdorff, map_to_points};
pub use measure::{Bend, Deviation, Measured, Miss, ScanSide, measure, tessellate};
pub use scan::Scan;
pub use search::distance_across;
pub use tessellation::Tessellation;
pub use thickness::{CurvatureRadii, curvature_radii};
pub use thresholds::Thresholds;
pub use tilted::tilted;
pub use verdict::{Reason, SCAN_NOT_WITHIN, Verdict, verdict};
