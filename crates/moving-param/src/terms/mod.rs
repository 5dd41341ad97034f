//! The terms of the objective, a file each.

pub(crate) mod area_samples;
#[cfg(test)]
pub(crate) mod check;
pub(crate) mod data;
pub(crate) mod lost_area;
pub(crate) mod map_barrier;
mod neighbour_weights;
pub(crate) mod rim_edges;
pub(crate) mod smoothing;
pub(crate) mod springs;
pub(crate) mod triangle_centres;
