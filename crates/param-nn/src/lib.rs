//! Learned parameterization of point sequences, grids and scattered clouds.
//!
//! - Point sequences and grids: [`sequence_parameters`] and [`grid_parameters`], [`Parcnn`] for other weights,
//!   [`GridTrainer`] for making them.
//! - Scattered clouds with known boundary: [`Bidgcn`], and [`Trainer`] for its weights; [`Pargcn`], and [`PargcnTrainer`].
//! - Synthetic clouds with known parameters: [`ScatteredSpec`], [`GriddedSpec`].
//! - Least squares with one Bézier patch, the yardstick of all networks: [`BezierFit`].
//!
//! This crate reads no file: weights go in and out as bytes. Its feature `candle`, on by default, has training and the networks that
//! PARCNN is compared with; weights are applied without.

// Backward passes, for one: with them left out as well, half of the functions would carry a condition.
#![cfg_attr(not(feature = "candle"), allow(dead_code))]

mod archive;
mod bezier;
mod bidgcn;
mod error;
mod graph;
mod gridded;
mod parcnn;
mod pargcn;
mod real;
mod slots;
mod synthetic;
#[cfg(feature = "candle")]
mod train;

pub use bezier::{BezierFit, LARGEST_DEGREE};
pub use bidgcn::{Bidgcn, LARGEST_CLOUD, Reading, Symmetries, Variant};
pub use error::NnError;
pub use graph::Neighbours;
pub use gridded::{GriddedCloud, GriddedSpec, Shape};
#[cfg(feature = "candle")]
pub use parcnn::ComparisonNetwork;
pub use parcnn::{
    Architecture, Form, LARGEST_GRID, Parcnn, SHIPPED_FORM, SplineSpace, grid_parameters, sequence_parameters,
};
pub use pargcn::{Pargcn, PargcnForm, PargcnOptions};
pub use synthetic::{ControlPoints, ScatteredCloud, ScatteredSpec, stream};
#[cfg(feature = "candle")]
pub use train::{
    Comparison, ComparisonOptions, ComparisonTrainer, GridScore, GridTrainOptions, GridTrainer, GridValidation,
    PargcnTrainOptions, PargcnTrainer, Recipe, Score, StepReport, TrainOptions, Trainer, Validation,
};

// Named so that its feature `x86-v4` reaches the products of candle.
#[cfg(feature = "candle")]
use gemm as _;

/// The code of the book's page on clouds, as a test.
#[cfg(doctest)]
#[doc = include_str!("../../../docs/src/learned-clouds.md")]
struct Book;
