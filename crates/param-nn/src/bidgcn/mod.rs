//! BIDGCN: parameters of scattered clouds from points and boundary (Imperatore 2024, §4.3).

pub(crate) mod cloud;
mod frame;
pub(crate) mod layers;
pub(crate) mod layout;
pub(crate) mod model;
pub(crate) mod network;
pub(crate) mod op;

pub use layout::Variant;
pub use model::{Bidgcn, LARGEST_CLOUD};
