//! How good a surface or a curve is, whoever made it: distances both ways by area, coverage, folds, crossings, and one
//! verdict.
//!
//! Everything is measured on a [`Tessellation`] of the surface with a known chord error. This crate knows surfaces, curves,
//! points and triangles; it does not know how they were fitted.

mod adjacency;
mod crossings;
mod error;
mod folds;
mod tessellation;
#[cfg(test)]
mod testing;
mod thickness;

pub use crossings::{Crossing, Crossings, self_crossings};
pub use error::Error;
pub use folds::{Fold, Folds, creases, folds, tilted};
pub use tessellation::Tessellation;
pub use thickness::{CurvatureRadii, curvature_radii};
