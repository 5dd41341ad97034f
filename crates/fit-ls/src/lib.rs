//! Penalized weighted least squares in spline spaces.
//!
//! The minimizer of `½ Σ_i ω_i |s(u_i) − p_i|² + ½ λ J(s)` solves `(BᵀWB + λG) c = BᵀWp` (Imperatore 2024, §3.1.8; there
//! the factor ½ before `λJ` is missing). [`LeastSquares`] keeps points sorted by cell and solves in one space after the
//! other, as the adaptive loop asks; [`NormalEquations`] is the mergeable statistic that the points are reduced to.
//!
//! ```
//! use std::sync::Arc;
//! use fit_ls::{LeastSquares, Lambda, Options};
//! use ndarray::Array2;
//! use thb_core::{HierarchicalSpace, KnotVector, Kind};
//!
//! // Points of the plane z = u + v.
//! let parameters = Array2::from_shape_fn((400, 2), |(i, d)| if d == 0 { (i % 20) as f64 } else { (i / 20) as f64 } / 19.0);
//! let points = Array2::from_shape_fn((400, 1), |(i, _)| parameters[[i, 0]] + parameters[[i, 1]]);
//!
//! let knots = KnotVector::uniform(2, 4)?;
//! let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots])?);
//! let options = Options { lambda: Lambda::Fixed(1e-7), ..Options::default() };
//! let mut fit = LeastSquares::new(parameters.view(), points.view(), None, options)?;
//! let surface = fit.fit(&space)?;
//! assert!((surface.eval([0.5, 0.25])?[0] - 0.75).abs() < 1e-12);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The crate does not know where parameters come from.

mod block;
mod boundary;
mod cholesky;
mod cross_validation;
mod detect;
mod distances;
mod error;
mod interpolants;
mod kernel;
mod lambda;
mod least_squares;
mod normal;
mod plain;
mod reweight;
mod reweighted;
mod sorted;

pub use block::BlockEquations;
pub use boundary::{Side, boundary_coefficients, boundary_functions};
pub use cholesky::{Cholesky, FactorizationError};
pub use detect::{Detection, detect_markers};
pub use error::Error;
pub use interpolants::{
    Interpolant, Interpolants, collocation_matrix, schoenberg_whitney, wls_as_interpolants, wls_limit,
};
pub use kernel::CellSums;
pub use lambda::{Lambda, automatic_lambda};
pub use least_squares::{Fixed, LeastSquares, LocalSmoothing, Options, eliminate};
pub use normal::{NormalEquations, PointBox, box_sums};
pub use plain::weighted_least_squares;
pub use reweight::{
    Loss, MAX_SET_ASIDE, MarkerRules, Markers, PointWeights, Reweighting, Robust, Update, median_scale,
};
pub use reweighted::{Reweighted, ReweightingReport, Weighted};
pub use sorted::SortedPoints;
