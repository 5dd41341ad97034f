//! Local least squares and hierarchical quasi-interpolation with THB-splines (Imperatore 2024, §3.2).
//!
//! Each coefficient comes from a small problem of its own: a penalized least-squares spline on the points near the support
//! of one B-spline (Algorithm 3). No global system is solved. With the *truncated* basis the coefficient of a function of
//! level ℓ is the one that its mother B-spline has in the tensor-product space of level ℓ (Speleers & Manni 2016), so a
//! refinement solves for the new functions only and keeps all other coefficients.
//!
//! [`QuasiInterpolation`] is a method for [`adaptive::run`], with the marking of Algorithm 4 by functions that have points
//! enough to be refined.
//!
//! ```
//! use std::{ops::ControlFlow, sync::Arc};
//! use fit_qi::{LocalLambda, Options, QuasiInterpolation};
//! use ndarray::Array2;
//! use thb_core::{HierarchicalSpace, Kind, KnotVector, Refinement};
//!
//! // A steep ridge over a plane.
//! let parameters = Array2::from_shape_fn((6400, 2), |(i, d)| ([i % 80, i / 80][d] as f64 + 0.5) / 80.0);
//! let points = Array2::from_shape_fn((6400, 1), |(i, _)| {
//!     let (u, v) = (parameters[[i, 0]], parameters[[i, 1]]);
//!     v + 0.1 * (-400.0 * (u - 0.3) * (u - 0.3)).exp()
//! });
//! let knots = KnotVector::uniform(2, 8)?;
//! let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots])?);
//! let options = Options { lambda: LocalLambda::Constant(1e-9), ..Options::default() };
//! let mut method = QuasiInterpolation::new(parameters.view(), points.view(), None, options)?;
//! let rules = adaptive::Options {
//!     tolerance: 1e-3,
//!     within: 0.95,
//!     refinement: Refinement { extension: [0, 0], ..Refinement::default() },
//!     ..adaptive::Options::default()
//! };
//! let outcome = adaptive::run(&mut method, space, &rules, &mut |_: &adaptive::Iteration| ControlFlow::Continue(()))?;
//! assert_eq!(outcome.stop, adaptive::Stop::ToleranceReached);
//! // After the first iteration only new functions are solved for.
//! assert!(method.work()[1..].iter().all(|work| work.solved < work.functions));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # How it is organized
//! Points are sorted along a Morton curve once, so the points of any cell of any level lie side by side. For each level
//! the points of a cell are reduced to sums once, whatever the number of functions whose problems they enter; sums stay
//! valid as long as the points do not move. A local problem adds up the sums of its cells and eliminates all unknowns but
//! the wanted one.

mod band;
mod cells;
mod error;
mod level;
mod local;
mod mark;
mod options;
mod order;
mod quasi;
mod region;
mod span;

pub use error::Error;
pub use options::{LocalLambda, Options};
pub use quasi::{QuasiInterpolation, Work};
