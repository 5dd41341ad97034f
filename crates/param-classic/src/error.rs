//! What can prevent a parameterization.

use point_cloud::CloudError;
use thiserror::Error;

/// A violated condition, with the numbers and what to do about it.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ParamError {
    /// The points, the mesh or its corners are not usable.
    #[error(transparent)]
    Cloud(#[from] CloudError),
    /// A sequence or a grid line without length: all its points are equal.
    #[error(
        "all {points} points of {what} are equal, so {rule} has no length to divide by; use the uniform rule, or drop them"
    )]
    NoLength {
        /// The sequence, or the lines of a grid.
        what: &'static str,
        /// The rule that was asked for.
        rule: &'static str,
        /// Number of points.
        points: usize,
    },
    /// The grid shape does not belong to the points.
    #[error("a grid of {n_u} x {n_v} needs {required} points, {given} are given")]
    GridMismatch {
        /// Points along u.
        n_u: usize,
        /// Points along v.
        n_v: usize,
        /// `n_u · n_v`.
        required: usize,
        /// Number of points given.
        given: usize,
    },
    /// A direction of the grid has fewer than two points.
    #[error("the grid has {given} point(s) along {direction}, at least 2 are needed")]
    GridTooThin {
        /// `u` or `v`.
        direction: char,
        /// Number of points along it.
        given: usize,
    },
    /// Two vertices joined by an edge are equal, or so close that the map cannot tell them apart.
    #[error(
        "vertices {} and {} are joined by an edge of length {length:e}; merge duplicate vertices, or use uniform weights and the uniform rule",
        .vertices[0], .vertices[1]
    )]
    ShortEdge {
        /// The two vertices.
        vertices: [u32; 2],
        /// Length of the edge, in the units of the mesh.
        length: f64,
    },
    /// The linear system of the barycentric map could not be solved.
    #[error("the linear system of {unknowns} unknowns could not be solved: {reason}; try uniform weights")]
    Solve {
        /// Number of unknown vertices.
        unknowns: usize,
        /// What the solver reported.
        reason: String,
    },
    /// The map folds triangles over, so it is not one-to-one.
    #[error(
        "the map folds {count} of {triangles} triangles, the first are {first:?}; try uniform weights, other corners, or a finer mesh there"
    )]
    FoldedTriangles {
        /// Number of folded triangles.
        count: usize,
        /// Number of triangles.
        triangles: usize,
        /// The first few of them.
        first: Vec<u32>,
    },
    /// An edge of a tube that reaches half way round it.
    #[error(
        "the edge between vertices {} and {} goes {share:.2} of the way round the tube, beyond one half; refine the mesh there",
        .vertices[0], .vertices[1]
    )]
    LongWayRound {
        /// The two vertices.
        vertices: [u32; 2],
        /// The share of a turn between them.
        share: f64,
    },
    /// The corners do not cut the loop into four sides.
    #[error("the corners {corners:?} must be four different places in a loop of {points} points, in loop order")]
    BadCorners {
        /// Places of the corners.
        corners: [usize; 4],
        /// Number of points of the loop.
        points: usize,
    },
    /// A boundary point that cannot serve: not a row of the cloud, given twice, or not on the boundary of the square.
    #[error("boundary point {index} (row {point} of the cloud, parameters {parameters:?}) {problem}")]
    BadBoundaryPoint {
        /// Place in the list of boundary points.
        index: usize,
        /// Row of the cloud that it names.
        point: u32,
        /// Its parameters.
        parameters: [f64; 2],
        /// What is wrong.
        problem: &'static str,
    },
    /// Interior points without a path of neighbours to the boundary, so that nothing ties them (Floater and Reimers,
    /// Meshless parameterization and surface reconstruction, CAGD 18, 2001, Proposition 3.3).
    #[error(
        "{count} of {interior} interior points have no path of neighbours to the boundary at radius {radius:e}, the first are {first:?}; take a larger radius, allow more neighbours, or remove these points"
    )]
    CutOffPoints {
        /// Number of such points.
        count: usize,
        /// Number of interior points.
        interior: usize,
        /// Radius of the neighbourhoods, in the units of the points.
        radius: f64,
        /// The first few of them.
        first: Vec<u32>,
    },
    /// Points of the parameter plane could not be triangulated.
    #[error("{points} parameters could not be triangulated: {reason}; check them for values that are not finite")]
    Triangulation {
        /// Number of parameters.
        points: usize,
        /// What the triangulation reported.
        reason: String,
    },
    /// An array of the wrong shape.
    #[error("{what} has shape {given:?}, {required:?} is needed")]
    WrongShape {
        /// Which array.
        what: &'static str,
        /// Its shape.
        given: [usize; 2],
        /// The shape it must have.
        required: [usize; 2],
    },
}

impl ParamError {
    /// The same about corners whose points the caller numbers otherwise: `number` tells it of each vertex.
    pub fn renumbered(self, number: impl Fn(u32) -> u32) -> Self {
        match self {
            Self::Cloud(error) => Self::Cloud(error.renumbered(number)),
            other => other,
        }
    }
}
