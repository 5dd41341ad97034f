//! Learned parameterization of point sequences, grids and scattered clouds.
//!
//! - Scattered clouds with known boundary: [`Bidgcn`], and [`Trainer`] for its weights.
//! - Synthetic clouds with known parameters: [`ScatteredSpec`].
//! - Least squares with one Bézier patch, the yardstick of all networks: [`BezierFit`].
//!
//! This crate reads no file: weights go in and out as bytes.

mod archive;
mod bezier;
mod bidgcn;
mod error;
mod graph;
mod real;
mod synthetic;
mod train;

pub use bezier::{BezierFit, LARGEST_DEGREE};
pub use bidgcn::{Bidgcn, LARGEST_CLOUD, Variant};
pub use error::NnError;
pub use synthetic::{ControlPoints, ScatteredCloud, ScatteredSpec, stream};
pub use train::{Score, StepReport, TrainOptions, Trainer, Validation};

// Named so that its feature `x86-v4` reaches the products of candle.
use gemm as _;
