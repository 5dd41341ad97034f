//! BIDGCN: parameters of scattered clouds from points and boundary (Imperatore 2024, §4.3).

mod frame;
mod layers;
mod layout;
mod network;

pub use layout::Variant;
