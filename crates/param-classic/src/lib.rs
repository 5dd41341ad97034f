//! Classical parameterizations onto the unit interval and the unit square.
//!
//! - Point sequences: [`parameterize_sequence`] (uniform, chord-length, centripetal).
//! - Gridded clouds: [`parameterize_grid`], the same rules averaged over the lines of the grid.
//! - Triangle meshes: [`map_disk`], barycentric maps with uniform or mean-value weights, and [`map_quality`].
//!
//! This crate knows nothing about splines and never reads a file.

mod barycentric;
mod error;
mod grid;
mod mesh_map;
mod quality;
mod sequence;
mod weights;

pub use error::ParamError;
pub use grid::{GridReport, parameterize_grid};
pub use mesh_map::{MeshMap, MeshMapParams, MeshMapReport, map_disk};
pub use quality::{Distortion, MapQuality, map_quality};
pub use sequence::{Rule, parameterize_sequence};
pub use weights::{HALF_TANGENT_LIMIT, Weights};
