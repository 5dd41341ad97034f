//! Curves: B-splines through sequences of points, and through functions given by values.
//!
//! [`fit_curve_file`] reads a sequence, [`fit_sequence`] takes an array. Corners and whether the curve is closed are found
//! or given, parameters laid out, and knots placed: adaptively, by inserting dyadic points into the spans with the largest
//! errors (Imperatore 2024, §4.1.6 (c)), or a fixed number by averaging. Where the curve swings out between points it is
//! fitted again with points on the line between them. [`CurveResult::verdict`] says whether it is near its points everywhere.
//!
//! ```
//! use ndarray::Array2;
//! use reconstruct::{CurveOptions, Tolerance, fit_sequence};
//!
//! // A circle of radius 2, sampled at 60 places.
//! let points = Array2::from_shape_fn((60, 2), |(i, k)| {
//!     let t = std::f64::consts::TAU * i as f64 / 60.0;
//!     2.0 * [t.cos(), t.sin()][k]
//! });
//! let options = CurveOptions { tol: Tolerance::Absolute(1e-3), ..CurveOptions::default() };
//! let fit = fit_sequence(points.view(), "circle", &options)?;
//! assert!(fit.reached() && fit.report.input.closed == "periodic" && fit.report.result.control_points < 20);
//! # Ok::<(), reconstruct::Error>(())
//! ```

mod choices;
mod closing;
mod corners;
mod crossing;
mod fitting;
mod method;
mod options;
mod output;
mod polygon;
mod report;
mod sequence;
mod start;
mod support;
mod verdict;

pub use choices::{ClosedChoice, CornerChoice, CurveParameters, Ends, KnotChoice};
pub use fitting::{CurveFit, fit_curve_file, fit_sequence};
pub use options::CurveOptions;
pub use output::{check_curve_outputs, write_curve};
pub use report::{CurveInput, CurveIteration, CurveReport, CurveResult};
pub use verdict::CurveLimits;

#[cfg(test)]
mod tests;
