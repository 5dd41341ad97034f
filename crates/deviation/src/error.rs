//! What can be wrong with a surface that is to be measured.

use thiserror::Error;

/// Errors of this crate.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum Error {
    /// The image of the map is not space.
    #[error("the image lies in a space of dimension {given}; what is measured lies in space, of dimension 3")]
    Dimension {
        /// Dimension of the image.
        given: usize,
    },
    /// A length that must be positive and finite.
    #[error("{what} is {given}; it must be positive and finite")]
    Length {
        /// Name of the length.
        what: &'static str,
        /// The length.
        given: f64,
    },
    /// Two arrays that must have one entry for the same things have different lengths.
    #[error("{given} {what}, but {expected} are needed")]
    Count {
        /// What is counted.
        what: &'static str,
        /// Number given.
        given: usize,
        /// Number needed.
        expected: usize,
    },
    /// A parameter of the surface's space.
    #[error(transparent)]
    Space(#[from] thb_core::Error),
    /// The parameters of a point.
    #[error("point {index}: {source}")]
    Parameter {
        /// Row of the point.
        index: usize,
        /// What is wrong.
        source: thb_core::Error,
    },
    /// Nothing to compare with.
    #[error("there are no points")]
    NoPoints,
    /// A surface without any extent has no area to measure.
    #[error("the surface has no area: all its triangles are degenerate")]
    NoArea,
}
