//! Spline spaces on several patches that are glued along arcs and at vertices.
//!
//! A [`PatchTopology`] says which sides of which patches are one arc. A [`MultiPatchSpace`] numbers the functions of all patches
//! together: functions that meet along an arc or at a vertex get one number, so that joins are continuous to the last bit and every
//! algorithm that works cell by cell ([`crate::CellSpace`]) works as it stands.

mod numbering;
mod space;
mod topology;

pub use space::{MultiPatchSpace, PatchPlace};
pub use topology::{ArcUse, Crossing, PatchSide, PatchTopology, TopologyError, side_point};
