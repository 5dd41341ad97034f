//! Point clouds and triangle meshes as plain data: checks, cleaning, topology, boundary loops and corners.
//!
//! The way from a raw mesh to the map of `param-classic`: [`FarValues::of_mesh`], [`weld`], then [`largest_piece`] (or
//! [`drop_unreferenced`]), then [`DiskMesh::new`], which checks everything a map onto the square relies on, then
//! [`disk_corners`]. [`largest_disk`] makes a disk of a mesh that is not quite one.
//!
//! The way from an unordered cloud: [`FarValues::of_cloud`], [`Duplicates::find_near`], [`find_isolated`], then [`find_outliers`],
//! [`find_stray_pieces`] and [`thin`] where needed, [`find_layers`] where scans may lie a little apart, then [`find_boundary`], which
//! spans a mesh over the cloud (over rows of points that are far apart once [`thin_rows`] has thinned them); its
//! [`CloudBoundary::disk_mesh`] goes the same way as a raw mesh from there.
//!
//! This crate never reads a file and knows nothing about splines.

mod boundary;
mod bounds;
mod box_tree;
mod canonical;
mod check;
mod clean;
mod cloud;
mod cloud_mesh;
mod corners;
mod disk;
mod duplicates;
mod edges;
mod error;
mod fans;
mod far_values;
mod handles;
mod isolated;
mod layers;
mod local_frame;
mod loop_curve;
mod near_duplicates;
mod neighbour_lists;
mod neighbours;
mod noise;
mod normalization;
mod order_loop;
mod orient;
mod orient_normals;
mod pieces;
mod quadric;
mod relief;
mod repair;
mod rounding;
mod rows;
mod sampling;
mod search;
mod star;
mod thickness;
mod thin;
mod tube;
pub mod vec3;
mod vertex_fans;

pub use boundary::{BoundaryParams, CloudBoundary, find_boundary};
pub use bounds::BoundingBox;
pub use box_tree::{Foot, PointTree, TriangleTree, barycentric_in_plane};
pub use canonical::{canonical_order, canonical_triangles};
pub use check::{LINE_TOLERANCE, MAX_COORDINATE, MIN_EXTENT, check_curve_cloud, check_finite, check_surface_cloud};
pub use clean::{CloudPieces, Outliers, find_outliers, find_stray_pieces};
pub use cloud::{GridShape, PointCloud, TriangleMesh};
pub use corners::{CornerChoice, CornerParams, Corners, EDGES_PER_TANGENT, disk_corners, find_corners};
pub use disk::{BoundaryLoop, DiskMesh};
pub use duplicates::{Duplicates, merge_duplicate_points, merge_duplicate_vertices};
pub use edges::{DisjointSets, EdgeMap, HalfEdge};
pub use error::CloudError;
pub use far_values::{FarValues, robust_diagonal};
pub use isolated::find_isolated;
pub use layers::{Layers, find_layers};
pub use local_frame::{LocalFrames, SPACING_NEIGHBOURS};
pub use near_duplicates::{Welded, weld};
pub use neighbour_lists::{Neighbour, Neighbours};
pub use noise::noise_sigma;
pub use normalization::Normalization;
pub use order_loop::{loop_length, order_loop};
pub use orient::orient_consistently;
pub use pieces::{Pieces, SubMesh, drop_unreferenced, largest_piece, unreferenced_vertices};
pub use quadric::{PrincipalAxes, principal_axes};
pub use relief::{relief, ring_radius};
pub use repair::{LargestDisk, largest_disk};
pub use rounding::rounding_step;
pub use rows::{Rows, find_rows, thin_rows};
pub use search::CloudTree;
pub use thickness::{thickness, thickness_of_cloud};
pub use thin::{Thinned, spread_subset, thin};
pub use tube::{TubeEnds, TubeShape};
