//! Layouts of surfaces in patches of four sides: which patches there are, how they are glued, and where each point of the surface lies
//! in the unit square of its patch.
//!
//! A [`QuadLayout`] is made of patches given by corners, paths of vertices between them, and triangles with parameters. It is checked
//! whole: patches are glued path to path ([`thb_core::PatchTopology`]), and patches whose triangles fold in the parameters are mapped anew.
//! [`QuadLayout::of_mesh`] makes one of a closed mesh alone. [`QuadLayout::sharp_arcs`] tells where the surface itself has a crease.
//!
//! The crate reads no file and knows nothing of how the surface is fitted.

mod build;
#[cfg(test)]
mod build_tests;
mod creases;
mod edge;
mod error;
mod injective;
mod layout;
mod patch;

pub use build::{BuildOptions, CreaseRule, creases};
pub use error::LayoutError;
pub use layout::{QuadLayout, RawPatch};
pub use patch::LayoutPatch;
