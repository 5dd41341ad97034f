//! BIDGCN: parameters of scattered clouds from points and boundary (Imperatore 2024, §4.3).

pub(crate) mod cloud;
mod frame;
mod inference;
pub(crate) mod layers;
pub(crate) mod layout;
pub(crate) mod midpoints;
pub(crate) mod model;
pub(crate) mod network;
#[cfg(feature = "candle")]
pub(crate) mod op;
mod symmetry;

pub use layout::Variant;
pub use model::{Bidgcn, LARGEST_CLOUD, Reading};
pub use symmetry::Symmetries;
