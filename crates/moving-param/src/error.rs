//! What can be wrong with a fit with moving parameters.

use thiserror::Error;

/// Errors of this crate.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum Error {
    /// Error of the least-squares problem, for instance a parameter outside the domain.
    #[error(transparent)]
    Fit(#[from] fit_ls::Error),
    /// Error of the quasi-interpolation.
    #[error(transparent)]
    Quasi(#[from] fit_qi::Error),
    /// Error of the spline space.
    #[error(transparent)]
    Space(#[from] thb_core::Error),
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
    /// Points of more dimensions than the foot points handle.
    #[error("points of dimension {given}: moving parameters are possible up to dimension {limit}")]
    Dimension {
        /// Dimension of the points.
        given: usize,
        /// The largest one.
        limit: usize,
    },
    /// Tangents span no proper subspace: there is no distance to a tangent line or plane.
    #[error(
        "maps from dimension {parameters} to dimension {points} have no tangent distance; use the point distance, or points \
         of a higher dimension"
    )]
    NoNormal {
        /// Dimension of the parameters.
        parameters: usize,
        /// Dimension of the points.
        points: usize,
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
    /// A triangle names a point that does not exist.
    #[error("triangle {triangle} names point {point}, but there are only {points} points")]
    Triangle {
        /// Index of the triangle.
        triangle: usize,
        /// The point it names.
        point: usize,
        /// Number of points.
        points: usize,
    },
    /// The joint minimization failed.
    #[error("the joint minimization failed: {reason}")]
    Minimization {
        /// What the minimizer reported.
        reason: String,
    },
}
