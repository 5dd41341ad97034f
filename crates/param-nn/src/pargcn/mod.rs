//! PARGCN: weights of a barycentric map of scattered clouds, learned (Imperatore 2024, §4.2).

pub(crate) mod edges;
pub(crate) mod layout;
pub(crate) mod model;
pub(crate) mod network;
mod prior;
pub(crate) mod solve;

pub use layout::PargcnForm;
pub use model::{Pargcn, PargcnOptions};
