//! Point clouds and triangle meshes as plain data: checks, cleaning, topology, boundary loops and corners.
//!
//! The way from a raw mesh to the map of `param-classic`: [`merge_duplicate_vertices`], then [`largest_piece`] (or
//! [`drop_unreferenced`]), then [`DiskMesh::new`], which checks everything a map onto the square relies on, then
//! [`disk_corners`].
//!
//! This crate never reads a file and knows nothing about splines.

mod bounds;
mod check;
mod cloud;
mod corners;
mod disk;
mod duplicates;
mod edges;
mod error;
mod loop_curve;
mod orient;
mod pieces;

pub use bounds::{BoundingBox, Normalization};
pub use check::{LINE_TOLERANCE, MAX_COORDINATE, MIN_EXTENT, check_curve_cloud, check_finite, check_surface_cloud};
pub use cloud::{GridShape, PointCloud, TriangleMesh};
pub use corners::{CornerChoice, CornerParams, Corners, EDGES_PER_TANGENT, disk_corners, find_corners};
pub use disk::{BoundaryLoop, DiskMesh};
pub use duplicates::{Duplicates, merge_duplicate_points, merge_duplicate_vertices};
pub use edges::{EdgeMap, HalfEdge};
pub use error::CloudError;
pub use orient::orient_consistently;
pub use pieces::{Pieces, SubMesh, drop_unreferenced, largest_piece, unreferenced_vertices};
