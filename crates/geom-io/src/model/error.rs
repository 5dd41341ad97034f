//! What can go wrong between a model and its file.

use std::path::PathBuf;

use crate::error::{ReadErrorKind, WriteError, plain};

/// A model could not be read or written: which file, and why.
#[derive(Debug, thiserror::Error)]
#[error("{}: {kind}", path.display())]
pub struct ModelError {
    /// The file.
    pub path: PathBuf,
    /// The violated condition.
    pub kind: ModelErrorKind,
}

/// Why a model could not be read or written. Texts quoted from a file are shortened and escaped.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ModelErrorKind {
    /// The operating system refused, or a source has no end.
    #[error(transparent)]
    Read(#[from] ReadErrorKind),
    /// The operating system refused to write.
    #[error("cannot be written: {0}")]
    Write(#[source] std::io::Error),
    /// The file name's extension names no model format.
    #[error("unknown extension {extension:?} of a model; supported are {supported}")]
    UnknownExtension {
        /// The extension, empty where there is none.
        extension: String,
        /// The extensions that are possible here.
        supported: &'static str,
    },
    /// The file is not JSON, is cut off, or lacks a field.
    #[error("line {line}, column {column}: {}; this is no intact model file", plain(reason))]
    Json {
        /// Line, counted from 1.
        line: usize,
        /// Column, counted from 1.
        column: usize,
        /// What the parser says.
        reason: String,
    },
    /// The file is JSON, but of another format.
    #[error("the field `format` is {found:?}, not {expected:?}: this is no spline model")]
    ForeignFormat {
        /// What the file says, empty where it says nothing.
        found: String,
        /// The name of the format.
        expected: &'static str,
    },
    /// The file was written by a later version of this software.
    #[error("version {found} of the format is unknown: this software reads up to version {supported}; update it")]
    Version {
        /// Version in the file.
        found: u64,
        /// Latest version that can be read.
        supported: u64,
    },
    /// The parameter dimension is neither 1 nor 2, or lists are not as long as it asks for.
    #[error("{what}: {found} found, {expected} expected")]
    Count {
        /// What was counted.
        what: &'static str,
        /// The number found.
        found: usize,
        /// The number, or numbers, possible.
        expected: String,
    },
    /// The rim of a hole does not lie inside the parameter domain.
    #[error(
        "the control points of hole {hole} (counted from 0) reach from {lower} to {upper} in direction {direction}, beyond the inside of \
         the domain, {} to {}; leave the hole out, or move the seam of a closed surface away from it",
        .domain[0], .domain[1]
    )]
    HoleOutside {
        /// Index of the hole.
        hole: usize,
        /// 0 for u, 1 for v.
        direction: usize,
        /// Smallest coordinate of its control points.
        lower: f64,
        /// Largest.
        upper: f64,
        /// Ends of the domain.
        domain: [f64; 2],
    },
    /// Two patches disagree on which side of them is outside.
    #[error(
        "the patches on both sides of arc {arc} (counted from 0) are oriented differently: no side of the surface is outside"
    )]
    Misoriented {
        /// The arc.
        arc: usize,
    },
    /// A coefficient has another number of components than the first one.
    #[error("coefficient {row} (counted from 0) has {found} components, the first one has {expected}")]
    RaggedCoefficients {
        /// Index of the coefficient.
        row: usize,
        /// Its number of components.
        found: usize,
        /// That of the first one.
        expected: usize,
    },
    /// A coefficient is NaN, infinite, or too large to be computed with.
    #[error("coefficient {row} (counted from 0): {value:e} is not a number up to {limit:e}; the file is damaged")]
    Coefficient {
        /// Index of the coefficient.
        row: usize,
        /// The component.
        value: f64,
        /// The limit.
        limit: f64,
    },
    /// A split cell is split twice, or does not exist before its parent is split.
    #[error("split {index} (counted from 0): cell {cell:?} of level {level} is no leaf cell at that point")]
    Split {
        /// Index among the file's splits.
        index: usize,
        /// The cell's level.
        level: usize,
        /// Its index in the grid of the level.
        cell: Vec<u32>,
    },
    /// The mesh needs more memory than its coefficients can justify.
    #[error("{what}: {given} is beyond the limit of {limit}; the file is damaged, or not a fitted surface")]
    TooLarge {
        /// What is too large.
        what: &'static str,
        /// The number in the file.
        given: u64,
        /// The limit.
        limit: u64,
    },
    /// The spline space refuses the file's numbers, or the model lies outside what the space can do.
    #[error(transparent)]
    Spline(#[from] thb_core::Error),
    /// The XML is not well-formed, or not text.
    #[error("not well-formed XML: {}", plain(reason))]
    Xml {
        /// What the XML parser says, with its position.
        reason: String,
    },
    /// The file has no geometry, or more than one.
    #[error("the file holds {found} geometries; exactly one is needed")]
    Geometries {
        /// Number of geometries.
        found: usize,
    },
    /// The geometry has a type that cannot be read.
    #[error("geometry of type {found:?}; supported are BSpline, TensorBSpline2, THBSpline1/2 and HBSpline1/2")]
    GeometryType {
        /// Type as in the file.
        found: String,
    },
    /// An element or attribute that is needed is missing.
    #[error("element {element} of the geometry is missing, or occurs more than once")]
    Element {
        /// The element, with its type.
        element: &'static str,
    },
    /// An attribute or a text has a value that cannot be used.
    #[error("{what}: {text:?} is not {expected}")]
    Value {
        /// Name of the attribute or element.
        what: &'static str,
        /// The text.
        text: String,
        /// What is expected.
        expected: &'static str,
    },
    /// A refined region is not made of whole cells of the level above.
    #[error(
        "the boxes of level {level} cover cell {cell:?} of level {} in part only; \
         refined regions must be unions of cells of the next coarser level", level - 1
    )]
    BoxAlignment {
        /// Level of the boxes.
        level: usize,
        /// Index of the coarser cell.
        cell: Vec<u32>,
    },
    /// A box is empty, or does not lie in the grid of its level.
    #[error(
        "box {index} (counted from 0), {numbers:?}, is empty or does not lie in the grid {grid:?} of level {level}"
    )]
    Box {
        /// Index of the box.
        index: usize,
        /// Its numbers, lower corner first.
        numbers: Vec<u32>,
        /// Its level.
        level: usize,
        /// Number of cells of the level per direction.
        grid: Vec<usize>,
    },
    /// A surface was to go where only curves can.
    #[error("{format} files hold curves, and the model is a surface; write .step, .xml or .json")]
    CurvesOnly {
        /// The format.
        format: &'static str,
    },
    /// The points of the model have a dimension that the format cannot hold.
    #[error("points of dimension {given}; STEP and DXF take 3, or 2 for curves and surfaces in the plane")]
    PointDimension {
        /// Dimension of the points.
        given: usize,
    },
    /// A knot line along which the map may jump.
    #[error(
        "knot {value} in direction {direction} occurs {given} times: the map may jump there, which STEP forbids; \
         at most {limit} times is possible"
    )]
    Discontinuous {
        /// The direction, from 0.
        direction: usize,
        /// The knot.
        value: f64,
        /// How often it occurs.
        given: usize,
        /// The degree.
        limit: usize,
    },
    /// A patch, or the whole model, is as good as a point.
    #[error(
        "the image of the box from {lower:?} to {upper:?} is smaller than {tolerance:e}: no face or curve can be made"
    )]
    Degenerate {
        /// Lower corner, in parameters.
        lower: Vec<f64>,
        /// Upper corner.
        upper: Vec<f64>,
        /// The tolerance, in the unit of the model.
        tolerance: f64,
    },
}

impl From<WriteError> for ModelErrorKind {
    /// Keeps the system's reason; the path stands in [`ModelError`].
    fn from(error: WriteError) -> Self {
        match error {
            WriteError::Io { reason, .. } => Self::Write(reason),
            other => Self::Write(std::io::Error::other(other)),
        }
    }
}
