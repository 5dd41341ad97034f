//! Learned parameterization of point sequences, grids and scattered clouds.
//!
//! - Synthetic clouds with known parameters: [`ScatteredSpec`].
//! - Least squares with one Bézier patch, the yardstick of all networks: [`BezierFit`].
//!
//! This crate reads no file: weights go in and out as bytes.

mod bezier;
mod bidgcn;
mod error;
mod graph;
mod real;
mod synthetic;

pub use bezier::{BezierFit, LARGEST_DEGREE};
pub use bidgcn::Variant;
pub use error::NnError;
pub use synthetic::{ControlPoints, ScatteredCloud, ScatteredSpec, stream};
