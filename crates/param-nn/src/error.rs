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
    /// A boundary point that cannot be one.
    #[error("boundary point {index} is row {point} with parameters {parameters:?}; it {problem}")]
    BadBoundaryPoint {
        /// Its place among the boundary points.
        index: usize,
        /// Its row in the cloud.
        point: u32,
        /// Its parameters.
        parameters: [f64; 2],
        /// What is wrong.
        problem: &'static str,
    },
    /// A sequence or grid that cannot be parameterized.
    #[error("grid, direction {direction}, line {line}, point {place}: it {problem}")]
    BadGrid {
        /// Direction along which the line runs: 0 or 1.
        direction: usize,
        /// The line; 0 for a sequence.
        line: usize,
        /// The point on it.
        place: usize,
        /// What is wrong.
        problem: &'static str,
    },
    /// A kind of points that no network was trained for.
    #[error(
        "there is no network for points of dimension {dimension} along {directions} direction(s); there are some for \
         sequences in the plane and in space and for grids in space. Take chord-length parameters"
    )]
    NoNetwork {
        /// Dimension of the points.
        dimension: usize,
        /// Directions of the grid.
        directions: usize,
    },
    /// More points than the network is run on at once.
    #[error("{given} points are more than {limit}; parameterize a subset and carry its map to the others")]
    TooManyPoints {
        /// Number of points.
        given: usize,
        /// Largest number.
        limit: usize,
    },
    /// A network gave a parameter that is no number.
    #[error("the network gave no number for the point in row {row}; use a classical map for this cloud")]
    NotFinite {
        /// Row of the point in the cloud.
        row: usize,
    },
    /// A weights file that was cut, changed, or is something else.
    #[error("a weights file of {bytes} bytes cannot be read: {reason}")]
    DamagedWeights {
        /// Its size.
        bytes: usize,
        /// What is wrong.
        reason: String,
    },
    /// A weights file that belongs to something else.
    #[error("the weights file has {what} {found:?}, {required} is required")]
    OtherWeights {
        /// What differs.
        what: &'static str,
        /// What the file has.
        found: String,
        /// What is needed.
        required: &'static str,
    },
    /// Automatic differentiation failed.
    #[error("training failed at step {step}: {reason}")]
    Training {
        /// The step.
        step: u64,
        /// What candle says.
        reason: String,
    },
    /// A classical map that the network is compared with failed.
    #[error(transparent)]
    Classical(#[from] param_classic::ParamError),
}
