//! What can go wrong in a fit of several patches.

use thiserror::Error;

/// Errors of this crate.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Error {
    /// There is nothing to fit.
    #[error("there are no samples of positive weight")]
    NoSamples,
    /// A sample has a coordinate or a weight that is no number.
    #[error("sample {index} (counted from 0) has a coordinate that is not finite, or a weight that is not positive")]
    BadSample {
        /// Its number.
        index: usize,
    },
    /// A sample is tied to an arc that its patch does not have.
    #[error("sample {index} (counted from 0) is tied to arc {arc}, which is no side of its patch {patch}")]
    ForeignArc {
        /// The sample.
        index: usize,
        /// The arc.
        arc: u32,
        /// The patch of its place.
        patch: u32,
    },
    /// A patch has no length or no width.
    #[error("patch {patch} (counted from 0) is {} by {} in size, which are not both positive numbers", size[0], size[1])]
    BadSize {
        /// The patch.
        patch: usize,
        /// What it was given.
        size: [f64; 2],
    },
    /// An option lies outside its range.
    #[error("{name} = {value} is not {range}")]
    Option {
        /// The option.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What is possible.
        range: &'static str,
    },
    /// The equations have no unique solution.
    #[error("the equations of {functions} functions cannot be solved: {cause}; more smoothing or more samples help")]
    Solve {
        /// Number of functions.
        functions: usize,
        /// Why.
        cause: fit_ls::FactorizationError,
    },
    /// The number of flags of sharp arcs or of sizes is wrong, or a place lies outside its patch.
    #[error(transparent)]
    Space(#[from] thb_core::Error),
}
