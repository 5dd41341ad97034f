//! The data types: a cloud, its optional parameters and grid order, and a triangle mesh.

use ndarray::Array2;

/// The order of a gridded cloud: point `(i, j)` is row `i * n_v + j`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GridShape {
    /// Number of points along the first direction (u).
    pub n_u: usize,
    /// Number of points along the second direction (v).
    pub n_v: usize,
}

/// A point cloud in R^N, in the units of its source.
#[derive(Clone, Debug, PartialEq)]
pub struct PointCloud {
    /// Points, shape `(m, N)`.
    pub points: Array2<f64>,
    /// Parameters that came with the points, shape `(m, D)`.
    pub parameters: Option<Array2<f64>>,
    /// Grid order, where the cloud is a full grid.
    pub grid: Option<GridShape>,
}

/// A triangle mesh; its vertices are the points of a cloud.
#[derive(Clone, Debug, PartialEq)]
pub struct TriangleMesh {
    /// Vertices, shape `(m, 3)`.
    pub vertices: Array2<f64>,
    /// Vertex indices of each triangle, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}
