//! What can be wrong with a cloud or a mesh.

use thiserror::Error;

/// A violated condition, with the numbers and what to do about it.
///
/// Points, vertices and triangles are named by their row, counted from 0.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum CloudError {
    /// A coordinate is NaN or infinite.
    #[error("point {point} has the coordinate {value} in column {column}; remove the point or repair its source")]
    NonFinite {
        /// Row of the point.
        point: usize,
        /// Column of the coordinate.
        column: usize,
        /// The coordinate.
        value: f64,
    },
    /// A coordinate is so large that its square would overflow.
    #[error(
        "point {point} has the coordinate {value:e} in column {column}, beyond the limit {limit:e}; choose a larger unit"
    )]
    TooLarge {
        /// Row of the point.
        point: usize,
        /// Column of the coordinate.
        column: usize,
        /// The coordinate.
        value: f64,
        /// Largest absolute value that is accepted.
        limit: f64,
    },
    /// Fewer points than the task needs.
    #[error("the cloud has {given} points, at least {required} are needed")]
    TooFewPoints {
        /// Number of points given.
        given: usize,
        /// Number of points needed.
        required: usize,
    },
    /// The cloud is too small for squared distances to be told from zero.
    #[error("the cloud is {extent:e} across, below the limit of {limit:e}; scale it up")]
    TooSmall {
        /// Longest side of its bounding box.
        extent: f64,
        /// The limit.
        limit: f64,
    },
    /// Every point is the same point.
    #[error("all {count} points are equal; there is nothing to fit")]
    AllEqual {
        /// Number of points.
        count: usize,
    },
    /// The points lie on a line, so no surface is determined by them.
    #[error(
        "all {count} points lie on a line (width {width:e} over length {length:e}); fit a curve instead of a surface"
    )]
    Collinear {
        /// Number of points.
        count: usize,
        /// Largest distance of a point from the line.
        width: f64,
        /// Length of the cloud along the line.
        length: f64,
    },
    /// The points have the wrong number of coordinates.
    #[error("the points have {given} coordinates, {required} are needed")]
    WrongDimension {
        /// Number of coordinates given.
        given: usize,
        /// Number of coordinates needed.
        required: usize,
    },
    /// The mesh has no triangle.
    #[error("the mesh has no triangle; give a mesh with faces, or use the method for unconnected points")]
    NoTriangles,
    /// A triangle names a vertex that is not there.
    #[error("triangle {triangle} uses vertex {vertex}, but the mesh has {count} vertices")]
    VertexOutOfRange {
        /// The triangle.
        triangle: usize,
        /// The vertex it names.
        vertex: u32,
        /// Number of vertices of the mesh.
        count: usize,
    },
    /// A triangle uses one vertex twice.
    #[error("triangle {triangle} uses vertex {vertex} twice; merging duplicate vertices also drops such triangles")]
    RepeatedVertex {
        /// The triangle.
        triangle: usize,
        /// The repeated vertex.
        vertex: u32,
    },
    /// Edges with more than two triangles.
    #[error(
        "{count} non-manifold edge(s), the first between vertices {} and {} with {triangles} triangles; remove the extra triangles",
        .vertices[0], .vertices[1]
    )]
    NonManifoldEdges {
        /// Number of such edges.
        count: usize,
        /// Vertices of the first one.
        vertices: [u32; 2],
        /// Number of triangles at the first one.
        triangles: usize,
    },
    /// The mesh consists of several pieces.
    #[error("the mesh has {count} pieces with {sizes:?} triangles; keep the largest one, or fit the pieces one by one")]
    SeveralPieces {
        /// Number of pieces.
        count: usize,
        /// Triangles of each piece, largest first.
        sizes: Vec<usize>,
    },
    /// No choice of flips gives neighbouring triangles the same orientation.
    #[error(
        "the surface has only one side (a Möbius band), seen at the edge between vertices {} and {}; cut it open",
        .vertices[0], .vertices[1]
    )]
    NotOrientable {
        /// An edge where the orientation comes back reversed.
        vertices: [u32; 2],
    },
    /// Vertices that no triangle uses.
    #[error("{count} vertices belong to no triangle, the first is vertex {first}; drop them before the map")]
    UnreferencedVertices {
        /// Number of such vertices.
        count: usize,
        /// The first one.
        first: u32,
    },
    /// Vertices where the surface touches itself in a single point.
    #[error(
        "{count} pinched vertices, where the surface touches itself in a single point; the first is vertex {vertex} with {fans} fans of \
         triangles; remove all but one fan, or split the vertex"
    )]
    PinchedVertices {
        /// Number of such vertices.
        count: usize,
        /// The first one.
        vertex: u32,
        /// Number of separate fans of triangles there.
        fans: usize,
    },
    /// The mesh has no boundary.
    #[error(
        "the mesh of {triangles} triangles is closed; cut it along edges into patches with one boundary each, and fit them one by one"
    )]
    Closed {
        /// Number of triangles.
        triangles: usize,
    },
    /// A surface with too few boundary loops for a tube.
    #[error(
        "the surface has {loops} boundary loop of length {length:.4e}; one that closes in one direction has two ends, each a loop: cut \
         off a tip that is closed, close a gap along it, or fit the surface as an open one"
    )]
    NoTube {
        /// Number of boundary loops.
        loops: usize,
        /// Length of the longest, in the units of the mesh.
        length: f64,
    },
    /// The mesh has handles, so it cannot be laid flat.
    #[error(
        "the mesh has {handles} handle(s) (Euler characteristic {euler}, {loops} boundary loop(s)); cut or fill them"
    )]
    Handles {
        /// Number of handles (the genus).
        handles: usize,
        /// Vertices − edges + triangles.
        euler: i64,
        /// Number of boundary loops.
        loops: usize,
    },
    /// Fewer than four vertices on a loop.
    #[error("a loop of {given} vertices has no four corners; refine the boundary")]
    LoopTooShort {
        /// Vertices of the loop.
        given: usize,
    },
    /// A loop of length zero.
    #[error("all {count} vertices of the loop are equal; it has no corners")]
    LoopWithoutLength {
        /// Vertices of the loop.
        count: usize,
    },
    /// A given corner is not on the loop.
    #[error("corner {vertex} is not on the boundary loop; choose four vertices of the loop")]
    CornerNotOnLoop {
        /// The vertex given.
        vertex: u32,
    },
    /// A corner is given twice.
    #[error("vertex {vertex} is given for two corners; choose four different vertices")]
    RepeatedCorner {
        /// The vertex given twice.
        vertex: u32,
    },
    /// No four vertices of the loop are far enough apart.
    #[error(
        "no four of the {vertices} loop vertices are {separation} of the perimeter apart; give the corners, or refine the boundary"
    )]
    CornersTooClose {
        /// Vertices of the loop.
        vertices: usize,
        /// Smallest share of the perimeter between two corners.
        separation: f64,
    },
    /// A cloud whose triangulation has no boundary.
    #[error(
        "the cloud of {points} points is closed, it has no boundary loop; cut it into open patches (for instance by a plane), or give \
         the boundary points"
    )]
    ClosedCloud {
        /// Number of points.
        points: usize,
    },
    /// A cloud that consists of several large pieces.
    #[error(
        "the cloud has {} pieces with {sizes:?} points at gaps beyond {reach:.1} spacings; fit the pieces one by one; if they are rows of \
         one surface, thin the points along the rows or give the grid order",
        sizes.len()
    )]
    CloudPieces {
        /// Points of each piece that is too large to be stray, largest first.
        sizes: Vec<usize>,
        /// Largest circumradius of a triangle that was tried, in local spacings.
        reach: f64,
    },
    /// No surface could be spanned over a cloud.
    #[error(
        "only {connected} of {points} points could be joined to one surface, at noise {noise:e} and spacing {spacing:e}; remove \
         outliers, thin the cloud until its spacing exceeds the noise, or give the boundary points"
    )]
    NoSurface {
        /// Points on the largest connected surface found.
        connected: usize,
        /// Number of points.
        points: usize,
        /// Estimated noise, in the units of the points.
        noise: f64,
        /// Median spacing, in the units of the points.
        spacing: f64,
    },
    /// The points follow one curve.
    #[error(
        "the {points} points follow one curve, and no surface is determined beside it; fit a curve (thb fit-curve), or give points to \
         both sides of it"
    )]
    AlongCurve {
        /// Number of points.
        points: usize,
    },
    /// An option lies outside its range.
    #[error("{name} is {value}, it must be {range}")]
    BadOption {
        /// Name of the option.
        name: &'static str,
        /// Value given.
        value: f64,
        /// What it may be.
        range: &'static str,
    },
}

impl CloudError {
    /// The same about corners whose points the caller numbers otherwise: `number` tells it of each vertex.
    pub fn renumbered(self, number: impl Fn(u32) -> u32) -> Self {
        match self {
            Self::CornerNotOnLoop { vertex } => Self::CornerNotOnLoop { vertex: number(vertex) },
            Self::RepeatedCorner { vertex } => Self::RepeatedCorner { vertex: number(vertex) },
            other => other,
        }
    }
}
