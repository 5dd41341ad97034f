//! PARCNN: parameters of point sequences and grids (Imperatore 2024, §4.1).

mod axes;
#[cfg(feature = "candle")]
pub(crate) mod comparison;
mod curve;
mod features;
pub(crate) mod fit;
pub(crate) mod grid;
pub(crate) mod layout;
pub(crate) mod model;
pub(crate) mod network;
pub(crate) mod pass;

#[cfg(feature = "candle")]
pub use comparison::ComparisonNetwork;
pub(crate) use curve::SplineCurve;
pub use fit::SplineSpace;
#[cfg(test)]
pub(crate) use fit::{CONSTANTS, GridFit};
pub use layout::{Architecture, Form, SHIPPED_FORM};
pub use model::{LARGEST_GRID, Parcnn, grid_parameters, sequence_parameters};
