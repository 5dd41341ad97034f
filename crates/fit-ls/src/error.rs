//! What can be wrong with a fitting problem.

use thiserror::Error;

/// Errors of this crate.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum Error {
    /// Error of the spline space, for instance a parameter outside its domain.
    #[error(transparent)]
    Space(#[from] thb_core::Error),
    /// A parameter outside the domain, or not finite.
    #[error("parameters of point {index}: {source}")]
    Parameter {
        /// Index of the point.
        index: usize,
        /// What is wrong.
        source: thb_core::Error,
    },
    /// Arrays of different lengths, or of a wrong width.
    #[error("{what}: {given} given, {expected} expected")]
    Shape {
        /// What was counted.
        what: &'static str,
        /// The number found.
        given: usize,
        /// The number expected.
        expected: usize,
    },
    /// No points at all.
    #[error("there are no points to fit")]
    NoPoints,
    /// More points than can be indexed.
    #[error("{given} points are more than {limit}")]
    TooManyPoints {
        /// Number of points.
        given: usize,
        /// The limit.
        limit: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("coordinate {component} of point {index} is not finite")]
    NotFinite {
        /// Index of the point.
        index: usize,
        /// The coordinate.
        component: usize,
    },
    /// A weight is negative or not finite.
    #[error("weight {value} of point {index} is negative or not finite")]
    Weight {
        /// Index of the point.
        index: usize,
        /// The weight.
        value: f64,
    },
    /// A smoothing weight is negative or not finite.
    #[error("the smoothing weight {value} is negative or not finite")]
    Lambda {
        /// The weight.
        value: f64,
    },
    /// A noise level is not positive or not finite.
    #[error("the noise level {value} is not a positive length")]
    Noise {
        /// The level.
        value: f64,
    },
    /// The exponent of an ℓp fit is out of its range.
    #[error("the exponent p = {value} of an ℓp fit is not in 1 < p ≤ 2")]
    Exponent {
        /// The exponent.
        value: f64,
    },
    /// The least scale of residuals is negative or not finite.
    #[error("the least scale {value} of residuals is negative or not finite")]
    Scale {
        /// The scale.
        value: f64,
    },
    /// The share of the points that may be set aside is none.
    #[error("the share {value} of the points that may be set aside is not from 0 to 1")]
    Share {
        /// The share.
        value: f64,
    },
    /// A marker names no point.
    #[error("marker {index} names no point: there are {points}, counted from 0")]
    Marker {
        /// The index.
        index: usize,
        /// Number of points.
        points: usize,
    },
    /// A point is marked twice.
    #[error("point {index} is marked twice; a marker is of type I or of type II, once")]
    MarkedTwice {
        /// Index of the point.
        index: usize,
    },
    /// A rule for markers is out of its range.
    #[error("rule of markers: {value} given, {what} expected")]
    MarkerRule {
        /// What is expected.
        what: &'static str,
        /// The number given.
        value: f64,
    },
    /// The equations do not determine all coefficients.
    #[error("the points do not determine the surface: {}", deficiency(*without_data, *functions, first, *lambda))]
    RankDeficient {
        /// Number of functions without a point in their support.
        without_data: usize,
        /// Number of functions.
        functions: usize,
        /// The first few of them.
        first: Vec<usize>,
        /// The smoothing weight.
        lambda: f64,
    },
    /// The factorization ran out of memory.
    #[error("not enough memory to factorize the equations of {functions} functions")]
    OutOfMemory {
        /// Number of functions.
        functions: usize,
    },
    /// The curve that a boundary should follow is not in the space of boundary curves.
    #[error(
        "the boundary curve deviates by {deviation:e} from the nearest curve of the space; refine the space along that side"
    )]
    BoundaryCurve {
        /// Largest deviation at the sampled parameters.
        deviation: f64,
    },
    /// A boundary curve was given where the surface closes.
    #[error("there is no boundary in direction {direction}: the surface is closed there")]
    Seam {
        /// The direction, from 0.
        direction: usize,
    },
    /// Statistics of different problems cannot be merged.
    #[error("normal equations of different spaces cannot be merged")]
    DifferentSpaces,
    /// There are more subsets of points than can be gone through.
    #[error(
        "the subsets of {points} points that determine {functions} functions are more than {limit}: take fewer points, or a \
         smaller space"
    )]
    TooManySubsets {
        /// Number of points.
        points: usize,
        /// Number of functions.
        functions: usize,
        /// Largest number of subsets.
        limit: usize,
    },
    /// No subset of the points has an interpolant.
    #[error("no subset of {points} points determines the {functions} functions of the space")]
    NoInterpolant {
        /// Number of points.
        points: usize,
        /// Number of functions.
        functions: usize,
    },
}

fn deficiency(without_data: usize, functions: usize, first: &[usize], lambda: f64) -> String {
    let what = match without_data {
        0 => format!(
            "each of {functions} functions has points in its support, but the equations are singular to working precision"
        ),
        _ => format!("{without_data} of {functions} functions have no point in their support (first: {first:?})"),
    };
    let weight = if lambda > 0.0 { "another smoothing weight" } else { "a positive smoothing weight" };
    format!(
        "{what}, smoothing weight {lambda:e}; use {weight}, a coarser mesh, or points that do not all lie on a line of the parameter \
         domain"
    )
}
