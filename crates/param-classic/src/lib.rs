//! Classical parameterizations onto the unit interval and the unit square.
//!
//! - Point sequences: [`parameterize_sequence`] (uniform, chord-length, centripetal).
//! - Gridded clouds: [`parameterize_grid`], the same rules averaged over the lines of the grid.
//! - Triangle meshes: [`map_disk`], barycentric maps with uniform or mean-value weights, [`refine_injective`] for less
//!   distortion without folds, and [`map_quality`].
//! - Meshes of tubes: [`map_tube`], a barycentric map that wraps round, and [`unroll`], which lays it in the plane.
//! - Scattered clouds with known boundary: [`side_parameters`] for the boundary, [`map_cloud`] for the interior,
//!   [`correct_shape`], [`triangulate_parameters`] and [`cloud_quality`].
//! - Scattered clouds with a mesh spanned over them: [`map_spanned`], all of the above for meshes at once.
//! - Clouds too large for a mesh of their own: [`extend_map`] carries the map of a mesh over a part of them to all points.
//!
//! This crate knows nothing about splines and never reads a file.

mod barycentric;
mod cloud_map;
mod correction;
mod dirichlet;
mod error;
mod extend;
mod grid;
mod injective;
mod local_star;
mod mesh_map;
mod quality;
mod radius_graph;
mod sequence;
mod shape_preserving;
mod sides;
mod spanned;
mod spread;
mod triangulate;
mod tube_map;
mod unroll;
mod weights;

pub use cloud_map::{BOUNDARY_TOLERANCE, CloudMap, CloudMapParams, CloudMapReport, CloudWeights, Radius, map_cloud};
pub use correction::correct_shape;
pub use error::ParamError;
pub use extend::{ExtendedMap, extend_map};
pub use grid::{GridReport, parameterize_grid};
pub use injective::{InjectiveMap, InjectiveParams, InjectiveReport, InjectiveStop, refine_injective};
pub use mesh_map::{MeshMap, MeshMapParams, MeshMapReport, map_disk};
pub use quality::{Distortion, MapQuality, map_quality};
pub use sequence::{Rule, parameterize_sequence};
pub use sides::{BoundaryParameters, side_parameters};
pub use spanned::{SpannedMap, SpannedMapParams, SpannedMapReport, map_mesh, map_spanned};
pub use spread::{Assessment, CloudQuality, Verdict, Void, cloud_quality};
pub use triangulate::triangulate_parameters;
pub use tube_map::{TubeMap, TubeMapParams, TubeMapReport, map_tube};
pub use unroll::{UnrolledMesh, unroll};
pub use weights::{HALF_TANGENT_LIMIT, Weights};
