//! The terms of the objective, a file each.

pub(crate) mod lost_area;
pub(crate) mod map_barrier;
pub(crate) mod neighbour_weights;
pub(crate) mod springs;
pub(crate) mod triangle_centres;
