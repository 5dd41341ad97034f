//! What can prevent a learned parameterization.

use point_cloud::CloudError;
use thiserror::Error;

/// A violated condition, with the numbers and what to do about it.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum NnError {
    /// The points are not usable.
    #[error(transparent)]
    Cloud(#[from] CloudError),
    /// An option out of its range.
    #[error("{name} = {value} is not {range}")]
    BadOption {
        /// The option.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The values it may have.
        range: &'static str,
    },
    /// An array of another shape than the others ask for.
    #[error("{what} has shape {given:?}, {required:?} is required")]
    WrongShape {
        /// The array.
        what: &'static str,
        /// Its shape.
        given: [usize; 2],
        /// The shape it must have.
        required: [usize; 2],
    },
    /// A parameter that is not in the unit square.
    #[error("parameter {index} is {value:?}; parameters lie in the unit square")]
    Parameter {
        /// Its row.
        index: usize,
        /// The parameter.
        value: [f64; 2],
    },
}
