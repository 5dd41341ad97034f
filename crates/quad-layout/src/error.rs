//! What can be wrong with a layout.

use thiserror::Error;

/// Why a layout cannot be used.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum LayoutError {
    /// A number of a vertex is beyond the vertices there are.
    #[error("patch {patch} (counted from 0) names vertex {vertex}, but there are only {vertices}")]
    NoSuchVertex {
        /// The patch.
        patch: usize,
        /// The vertex.
        vertex: usize,
        /// Number of vertices.
        vertices: usize,
    },
    /// A coordinate or parameter is no finite number.
    #[error("{what} {index} (counted from 0) is not finite")]
    NotFinite {
        /// "vertex", or "the parameter of a vertex of patch".
        what: &'static str,
        /// Its number.
        index: usize,
    },
    /// A side of a patch does not lead from its corner to the next.
    #[error(
        "side {side} of patch {patch} (both counted from 0) does not lead from its corner, vertex {from}, to the next, {to}"
    )]
    BrokenPath {
        /// The patch.
        patch: usize,
        /// The side.
        side: usize,
        /// The vertex at its corner.
        from: u32,
        /// The vertex at the next corner.
        to: u32,
    },
    /// A triangle or path uses a vertex without parameters, or there are more or fewer parameters than vertices.
    #[error("vertex {vertex} of patch {patch} (counted from 0) has no parameters")]
    NoParameters {
        /// The patch.
        patch: usize,
        /// The vertex.
        vertex: u32,
    },
    /// Patches cannot be glued.
    #[error("the layout cannot be glued: {0}")]
    Topology(#[from] thb_core::TopologyError),
    /// Neighbours disagree on which side is outside.
    #[error("the patches on both sides of arc {arc} (counted from 0) are oriented differently")]
    Misoriented {
        /// The arc.
        arc: usize,
    },
    /// A patch cannot be laid out on the square.
    #[error("patch {patch} (counted from 0) cannot be laid out on the unit square: {reason}")]
    NotADisk {
        /// The patch.
        patch: usize,
        /// Why.
        reason: String,
    },
    /// There is no triangle.
    #[error("the mesh has no triangles")]
    NoMesh,
    /// Triangles do not close.
    #[error("the mesh is open: {edges} edges have one triangle; close its holes first")]
    OpenMesh {
        /// Such edges.
        edges: usize,
    },
    /// More than two triangles meet in an edge.
    #[error("{edges} edges have more than two triangles; the mesh is not the surface of one body")]
    EdgeOfMany {
        /// Such edges.
        edges: usize,
    },
    /// Neighbouring triangles disagree on which side is outside.
    #[error("the triangles at {edges} edges are oriented differently; make them agree on the outside first")]
    MixedOrientation {
        /// Such edges.
        edges: usize,
    },
    /// The surface touches itself in a vertex.
    #[error("the surface touches itself at vertex {vertex} (counted from 0); make it two vertices first")]
    PinchedVertex {
        /// The vertex.
        vertex: usize,
    },
    /// The mesh has several pieces.
    #[error("the mesh has {pieces} pieces; a layout is made for one: fit each by itself")]
    Pieces {
        /// How many.
        pieces: usize,
    },
    /// No layout was found.
    #[error(
        "no layout in patches was found: {regions} regions are left, {reason}; smaller ones or a finer mesh may help"
    )]
    NotCut {
        /// Regions that could not be cut.
        regions: usize,
        /// Why.
        reason: &'static str,
    },
}
