//! Triangles over a spline surface, as close to it as asked.

/// Triangles over a spline surface. Neighbouring cells share their vertices, so the triangles have no gaps.
#[derive(Clone, Debug)]
pub struct Tessellation {
    /// Vertices in space.
    pub vertices: Vec<[f64; 3]>,
    /// Their parameters `(u, v)`.
    pub parameters: Vec<[f64; 2]>,
    /// Triangles, counter-clockwise in the parameter plane.
    pub triangles: Vec<[u32; 3]>,
    /// The cell of the space that each triangle lies in.
    pub cells: Vec<u32>,
    /// Estimate of the largest distance between the surface and the triangles.
    pub chord: f64,
}
