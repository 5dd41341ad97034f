//! Edges of triangles without direction, and paths of them.

use point_cloud::vec3::{norm, sub};

/// An edge, the smaller vertex first.
pub(crate) fn edge(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

/// The length of a path of vertices.
pub(crate) fn path_length(points: &[[f64; 3]], path: &[u32]) -> f64 {
    path.windows(2).map(|pair| norm(sub(points[pair[1] as usize], points[pair[0] as usize]))).sum()
}

/// The edges of a triangle.
pub(crate) fn sides([a, b, c]: [u32; 3]) -> [[u32; 2]; 3] {
    [edge(a, b), edge(b, c), edge(c, a)]
}
