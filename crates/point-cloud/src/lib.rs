//! Point clouds and triangle meshes as plain data.
//!
//! This crate never reads a file and knows nothing about splines.

mod cloud;

pub use cloud::{GridShape, PointCloud, TriangleMesh};
