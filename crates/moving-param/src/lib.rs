//! Fitting with moving parameters (Imperatore 2024, ch. 5): the parameters of the points are optimized together with the
//! surface, inside the adaptive loop, so that far fewer functions reach the same tolerance.
//!
//! [`MovingFit`] is a method for [`adaptive::run`]. In each space it fits the coefficients at the present parameters, then
//! moves the parameters as [`Options::method`] says, and reports errors after that: cells are refined only where moving
//! parameters was not enough. [`foot_points`] and [`project`] serve on their own.
//!
//! # Which method
//! - [`Method::Joint`], the default: Levenberg–Marquardt for coefficients and parameters together, from which the parameters
//!   are eliminated exactly. From a mesh of some 4 × 4 elements it needed the fewest functions on the clouds compared (on a
//!   ship hull of 3025 points 331 where A-PDM with three corrections needs 826), for several times the time of A-PDM. Where
//!   points are many bends away from a very coarse first mesh it can settle in a poor minimum: start finer, or allow more
//!   steps ([`JointOptions`]).
//! - [`Method::Alternating`] with [`Distance::Point`] (A-PDM): the fastest, for millions of points, or where the parameters
//!   should stay near those given. It converges linearly; [`Distance::Hybrid`] (A-HDM) is faster per correction but couples
//!   the coordinates, and so costs as much as a step of the joint method, without its control of the step.
//! - [`MovingQuasi`] (A-QI): quasi-interpolation instead of least squares, for points that are uneven or have voids, and
//!   where no global system should be solved.
//! - [`Method::JointLbfgs`] (J-PDM): hundreds of iterations, in unknowns measured by the matrix of a joint step; it needs as few functions
//!   as the joint method without its penalty on folds, for several times the time.
//! - [`Method::SquareMap`]: all parameters moved by one smooth map with few control points, for comparison: it cannot
//!   follow noise, nor much detail of the parameterization.
//!
//! The guard ([`Options::guard`]) undoes corrections wherever fixed parameters would meet the tolerance at more points. The
//! barrier ([`MovingFit::with_triangles`]) forbids moves that fold a triangulation of the parameters; it costs functions.
//!
//! ```
//! use std::{ops::ControlFlow, sync::Arc};
//! use fit_ls::Lambda;
//! use moving_param::{JointOptions, Method, MovingFit, Options};
//! use ndarray::Array2;
//! use thb_core::{HierarchicalSpace, Kind, KnotVector};
//!
//! // A parabolic cylinder, parameterized unevenly along its curved side.
//! let parameters = Array2::from_shape_fn((400, 2), |(i, d)| [i % 20, i / 20][d] as f64 / 19.0);
//! let points = Array2::from_shape_fn((400, 3), |(i, k)| {
//!     let u = parameters[[i, 0]];
//!     let x = u + 0.1 * (6.0 * u).sin() * u * (1.0 - u);
//!     [x, parameters[[i, 1]], x * x][k]
//! });
//! let knots = KnotVector::uniform(2, 1)?;
//! let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots])?);
//! let fitting = fit_ls::Options { lambda: Lambda::Fixed(0.0), ..fit_ls::Options::default() };
//! let method = Method::Joint(JointOptions::WITHOUT_SPRINGS);
//! let options = Options { method, tolerance: 1e-6, ..Options::default() };
//! let mut method = MovingFit::new(parameters.view(), points.view(), None, fitting, options)?;
//! let loop_options = adaptive::Options { tolerance: 1e-6, within: 1.0, ..adaptive::Options::default() };
//! let outcome = adaptive::run(&mut method, space, &loop_options, &mut |_: &adaptive::Iteration| ControlFlow::Continue(()))?;
//! // Nine functions suffice once the parameters have moved.
//! assert_eq!(outcome.history.last().map(|i| i.dofs), Some(9));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod damping;
mod driver;
mod equations;
mod error;
mod methods;
mod moving;
mod options;
mod points;
mod safeguards;
mod state;
mod step_system;
mod term;
mod terms;

pub use driver::{Step, StepWatch};
pub use equations::{CoefficientBlocks, Linearization, PointBlock, Spring};
pub use error::Error;
pub use methods::quasi::{MovingQuasi, QuasiOptions};
pub use moving::{Moves, MovingFit};
pub use options::{Blend, Distance, JointOptions, Method, Options, Schedule, SquareMapOptions};
pub use points::constraint::{Boundary, Constraints};
pub use points::descent::Descent;
pub use points::foot_point::{FootPointOptions, FootPointReport, FootPoints, Start, foot_points, project};
pub use points::frame::Frame;
pub use points::vector::Vector;
pub use safeguards::{Admission, CoefficientStep, Parameters, Safeguard};
pub use state::{State, StepStart};
pub use term::Term;
