//! A patch of a layout.

/// A patch with its map onto the unit square.
#[derive(Clone, Debug, PartialEq)]
pub struct LayoutPatch {
    /// Corners of its triangles: numbers into `vertices` of the patch.
    pub triangles: Vec<[u32; 3]>,
    /// Its vertices, numbers into those of the layout.
    pub vertices: Vec<u32>,
    /// The parameters of each of its vertices.
    pub uv: Vec<[f64; 2]>,
}
