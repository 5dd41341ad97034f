//! What can be wrong with a quasi-interpolation.

use thiserror::Error;

/// Errors of this crate.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum Error {
    /// Error of points, weights or parameters.
    #[error(transparent)]
    Points(#[from] fit_ls::Error),
    /// Error of the spline space.
    #[error(transparent)]
    Space(#[from] thb_core::Error),
    /// The basis is not truncated.
    #[error("quasi-interpolation needs the truncated basis: make the space with Kind::Thb")]
    NotTruncated,
    /// Fewer points than a single local problem needs.
    #[error("{given} points are fewer than the {needed} that a local problem needs; give more points or lower n_min")]
    TooFewPoints {
        /// Number of points.
        given: usize,
        /// The smallest number.
        needed: usize,
    },
    /// An option is not a number of the allowed range.
    #[error("{name} is {value}, but must be {allowed}")]
    Option {
        /// The option.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What would be possible.
        allowed: &'static str,
    },
    /// All points together do not determine a coefficient (Imperatore 2024, Theorem 2: they do for every positive
    /// smoothing weight as soon as their parameters are not on a line).
    #[error(
        "coefficient {function} of level {level} is not determined by all {points} points with the smoothing weight \
         {lambda:e}; use a positive smoothing weight, points that are not all on a line of the parameter domain, or a \
         coarser mesh"
    )]
    NotDetermined {
        /// Tensor index of the function.
        function: usize,
        /// Its level.
        level: usize,
        /// Number of points.
        points: usize,
        /// The smoothing weight of the local problem.
        lambda: f64,
    },
}
