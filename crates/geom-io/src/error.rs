//! What can go wrong between a file and memory.

use std::fmt;
use std::path::PathBuf;

/// Longest quotation from a file in an error, so that a damaged or binary file does not flood the terminal.
const QUOTE_LENGTH: usize = 40;

/// A text as errors quote it.
pub(crate) fn quote(text: &str) -> String {
    match text.char_indices().nth(QUOTE_LENGTH) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

/// Longest text of a parser or of a file in an error that doesn't quote it.
const PLAIN_LENGTH: usize = 200;

/// A text of a file, or one that may hold such, as errors show it where they don't quote: shortened, and without characters that a
/// terminal would obey.
pub(crate) fn plain(text: &str) -> String {
    let mut shown: String =
        text.chars().map(|c| if c.is_control() { char::REPLACEMENT_CHARACTER } else { c }).take(PLAIN_LENGTH).collect();
    if text.chars().nth(PLAIN_LENGTH).is_some() {
        shown.push('…');
    }
    shown
}

/// Most names that an error gives where all would be too many.
const NAMED: usize = 24;

/// The first names and how many there are beyond.
fn named(names: &[String]) -> String {
    let shown: Vec<String> = names.iter().take(NAMED).map(|name| plain(&quote(name))).collect();
    match names.len() - shown.len() {
        0 => shown.join(", "),
        more => format!("{} and {more} more", shown.join(", ")),
    }
}

/// Most names that an error lists.
const LISTED: usize = 8;

/// The first names, quoted, and how many there are beyond.
fn listed(names: &[String]) -> String {
    let shown: Vec<String> = names.iter().take(LISTED).map(|name| format!("{name:?}")).collect();
    match names.len() - shown.len() {
        0 => shown.join(", "),
        more => format!("{} and {more} more", shown.join(", ")),
    }
}

/// A scan could not be read: which file, and why.
#[derive(Debug, thiserror::Error)]
#[error("{}: {kind}", path.display())]
pub struct ReadError {
    /// The file.
    pub path: PathBuf,
    /// The violated condition.
    pub kind: ReadErrorKind,
}

/// Where in a file a value stands.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Location {
    /// A line of a text file, counted from 1.
    Line(usize),
    /// A record of a binary file, counted from 0.
    Record {
        /// Name of the element, as in the header of the file.
        element: String,
        /// Index of the record among its element's.
        index: usize,
    },
    /// A byte of a file, or of a part of it, counted from 0.
    Byte(u64),
    /// A value of a matrix, counted from 0 in the order of the file.
    MatrixValue {
        /// The matrix's `id`.
        id: usize,
        /// Index of the value.
        index: usize,
    },
}

impl fmt::Display for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(f, "line {line}"),
            Self::Record { element, index } => write!(f, "{} {index} (counted from 0)", plain(element)),
            Self::Byte(byte) => write!(f, "byte {byte}"),
            Self::MatrixValue { id, index } => write!(f, "matrix {id}, value {index} (counted from 0)"),
        }
    }
}

/// Why a scan could not be read. Texts quoted from a file are shortened and escaped; options are named by the fields of
/// [`crate::ReadOptions`], and how they are typed is for the program to say.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadErrorKind {
    /// The operating system refused.
    #[error("cannot be read: {0}")]
    Io(#[from] std::io::Error),
    /// The file name's extension names no format that can be read.
    #[error("unknown extension {extension:?}; supported are {supported}; convert the file, or name its format")]
    UnknownExtension {
        /// The extension, empty where there is none.
        extension: String,
        /// The extensions that can be read.
        supported: String,
    },
    /// Standard input, whose name tells no format, was given without one.
    #[error("standard input has no extension that tells its format; name it")]
    FormatNeeded,
    /// Compressed data expand beyond what scans do.
    #[error(
        "{compressed} compressed bytes expand to more than {limit}, far beyond what scans do; if they are wanted, allow more, or \
         decompress them first"
    )]
    Expansion {
        /// Number of compressed bytes.
        compressed: usize,
        /// Number of bytes they may expand to.
        limit: usize,
    },
    /// A source has no end, or holds nothing.
    #[error("no scan can be read here: {what}; give a file")]
    Endless {
        /// What it is.
        what: &'static str,
    },
    /// The system has not as much memory as a file needs.
    #[error(
        "{bytes} bytes of memory are needed and cannot be had; thin the scan, or read it where there is more memory"
    )]
    Memory {
        /// How many bytes were asked for.
        bytes: usize,
    },
    /// Not one scan in a zip archive.
    #[error(
        "the zip archive holds {}: {}; unpack the file that is meant",
        if *scans == 0 { "no scan".to_owned() } else { format!("{scans} files that may be the scan") }, listed(files)
    )]
    Archive {
        /// How many of its files may be scans.
        scans: usize,
        /// These files; where there is none, all.
        files: Vec<String>,
    },
    /// Nothing is left where points that are not a number are left out.
    #[error("none of the {points} points has finite coordinates")]
    NoneFinite {
        /// Number of points in the file.
        points: usize,
    },
    /// A coordinate is too large to be computed with.
    #[error("row {row} (counted from 0): coordinate {value:e} is beyond {limit:e}; remove the point or mend the value")]
    CoordinateRange {
        /// Which of the points of the file it is, from 0.
        row: u32,
        /// The coordinate.
        value: f64,
        /// The limit.
        limit: f64,
    },
    /// A decoder gave up.
    #[error("the {format} data cannot be read: {reason}")]
    Malformed {
        /// Name of the format.
        format: &'static str,
        /// What the decoder says.
        reason: String,
    },
    /// An option was given that has no meaning for the format.
    #[error("the option `{option}` is for {of}; it has no meaning for {format}")]
    OptionOfOtherFormat {
        /// The option.
        option: &'static str,
        /// Formats that it is for.
        of: &'static str,
        /// The format that was read.
        format: &'static str,
    },
    /// A column was asked for by name where none has one, or by a number that is none.
    #[error("no line names the columns; they are numbers from 1 on here, not {column:?}")]
    ColumnNumber {
        /// The column as given.
        column: String,
    },
    /// A column was asked for in a file whose columns have no names.
    #[error(
        "no line names the columns, so that the option `{option}` takes a number from 1 on; or begin the file with their names"
    )]
    NoNames {
        /// The option.
        option: &'static str,
    },
    /// A confidence is negative.
    #[error("line {line}: the confidence {value} is negative; 0 leaves a point out, larger numbers trust it more")]
    NegativeWeight {
        /// The line, counted from 1.
        line: usize,
        /// The number.
        value: f64,
    },
    /// No point has a class that was asked for.
    #[error(
        "no point has a class among {wanted:?}; the file has the classes {}",
        found.iter().map(|(class, points)| format!("{class} ({points} points)")).collect::<Vec<_>>().join(", ")
    )]
    NoPointsOfClass {
        /// The classes asked for.
        wanted: Vec<u8>,
        /// The classes that are there, with their numbers of points.
        found: Vec<(u8, usize)>,
    },
    /// A height field needs x, y and a height.
    #[error("a height field needs x, y and z; the points have {columns} coordinates")]
    HeightFieldColumns {
        /// Number of coordinates.
        columns: usize,
    },
    /// The points of a height field lie on a line of its plane.
    #[error("no height field: all {axis} are {value}")]
    FlatHeightField {
        /// `x` or `y`.
        axis: &'static str,
        /// Their value.
        value: f64,
    },
    /// A file ends before it should, without a count that says so.
    #[error("the file is cut off: the {element} that opens on line {line} has no end")]
    Unclosed {
        /// What is open.
        element: &'static str,
        /// Line where it opens, counted from 1.
        line: usize,
    },
    /// The file has no content.
    #[error("the file is empty")]
    Empty,
    /// The file is well-formed, but has no point (no vertex, no cell with data).
    #[error("the file holds no points")]
    NoPoints,
    /// Control characters, invalid UTF-8 or UTF-16 where text is expected.
    #[error("line {line} is not text (control characters or another encoding); save the file as UTF-8 text")]
    NotText {
        /// The line, counted from 1.
        line: usize,
    },
    /// The text is in UTF-16.
    #[error("the file is UTF-16 text, as some programs call \"Unicode\"; save it as UTF-8 text")]
    Utf16,
    /// Commas may be decimal ones, or stand between columns or groups of digits.
    #[error(
        "line {line}: in {text:?} commas may be decimal ones or stand between columns or thousands; give the decimal sign"
    )]
    AmbiguousComma {
        /// The line, counted from 1.
        line: usize,
        /// The field, or the line.
        text: String,
    },
    /// A number has groups of digits, where separators are not beyond doubt.
    #[error(
        "line {line}: {text:?} has both a comma and a point; give the decimal sign, the other one then parts thousands"
    )]
    GroupedNumber {
        /// The line, counted from 1.
        line: usize,
        /// The field.
        text: String,
    },
    /// Text in which no line holds numbers, however its fields are separated.
    #[error("no line holds numbers that stand apart; the first is line {line}: {text:?}")]
    NoNumbers {
        /// The first line with data, counted from 1.
        line: usize,
        /// The line.
        text: String,
    },
    /// The header of a grid puts cells where nothing can be computed.
    #[error(
        "the header of the grid puts cells at {axis} = {value:e}, beyond {limit:e}; mend its origin or the size of its cells"
    )]
    GridRange {
        /// `x` or `y`.
        axis: &'static str,
        /// The coordinate of the outermost cell.
        value: f64,
        /// The limit.
        limit: f64,
    },
    /// No point has all its coordinates.
    #[error("none of the {rows} points has a value in all coordinates, the first is on line {line}")]
    NoValues {
        /// Number of points.
        rows: usize,
        /// Line of the first one, counted from 1.
        line: usize,
    },
    /// An option names more or fewer columns than what they are for has.
    #[error("the option `{option}` takes {expected} columns, not {given}")]
    OptionColumns {
        /// The option.
        option: &'static str,
        /// Columns that it takes.
        expected: usize,
        /// Columns that were given.
        given: usize,
    },
    /// A field of a table is not a number.
    #[error("line {line}, column {column}: {text:?} is not a number")]
    NotANumberInTable {
        /// The line, counted from 1.
        line: usize,
        /// The column, counted from 1.
        column: usize,
        /// The field.
        text: String,
    },
    /// A field is not a number.
    #[error("{location}: {text:?} is not a number; write numbers with a decimal point, and one separator throughout")]
    NotANumber {
        /// Where.
        location: Location,
        /// The field.
        text: String,
    },
    /// A line has too few or too many values.
    #[error("line {line} has {found} values where {expected} are expected")]
    RowLength {
        /// The line, counted from 1.
        line: usize,
        /// How many the line must have; where further values are allowed, the least number.
        expected: usize,
        /// How many it has.
        found: usize,
    },
    /// A header line does not say what it must.
    #[error("line {line} of the header, {text:?}: {reason}")]
    Header {
        /// The line, counted from 1.
        line: usize,
        /// The line's text.
        text: String,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// The file ends before all that its header announced.
    #[error("the file is cut off: its header announces {expected} records of {}, {found} are there", plain(element))]
    Truncated {
        /// What is counted (vertex, face, cell, …).
        element: String,
        /// How many were announced.
        expected: usize,
        /// How many complete ones were found.
        found: usize,
    },
    /// A grid file holds more values than its header announced.
    #[error("the file holds {found} values where its header announces {expected}")]
    Surplus {
        /// How many were announced.
        expected: usize,
        /// How many were found.
        found: usize,
    },
    /// A face's corner is not a whole number.
    #[error("{location}: {text:?} is not a vertex index")]
    NotAnIndex {
        /// Where.
        location: Location,
        /// The text.
        text: String,
    },
    /// A face names a vertex that does not exist.
    #[error("{location}: vertex index {index}, as written, is out of range; the mesh has {count} vertices")]
    IndexOutOfRange {
        /// Where.
        location: Location,
        /// The index as written in the file.
        index: i64,
        /// Number of vertices that the index may refer to.
        count: usize,
    },
    /// The length of a list is no whole number, or negative.
    #[error("{location}: {length} is not the length of a list")]
    ListLength {
        /// Where.
        location: Location,
        /// The length as read.
        length: f64,
    },
    /// A PLY element lacks a property.
    #[error("element `vertex` has no property `{property}`; its properties are: {}", named(found))]
    MissingProperty {
        /// The property.
        property: &'static str,
        /// The names that are there.
        found: Vec<String>,
    },
    /// A table lacks a column.
    #[error("no column named {}; the columns are: {}", named(missing), named(found))]
    ColumnsNotFound {
        /// Names that are looked for, and missing.
        missing: Vec<String>,
        /// Names that are there.
        found: Vec<String>,
    },
    /// A column that is needed occurs twice.
    #[error("two columns are named {}; take one by its number", plain(name))]
    DuplicateColumn {
        /// The name.
        name: String,
    },
    /// A grid index is not a whole number.
    #[error("line {line}: {text:?} is not a grid index; the columns of these hold whole numbers")]
    GridIndex {
        /// The line, counted from 1.
        line: usize,
        /// The field.
        text: String,
    },
    /// A grid is too narrow to have parameters in both directions.
    #[error("the grid has {n_u} × {n_v} cells; a surface needs at least 2 × 2")]
    GridTooSmall {
        /// Columns, west to east.
        n_u: usize,
        /// Rows, south to north.
        n_v: usize,
    },
    /// A key is missing in the header of a grid file.
    #[error("the header has no {key}")]
    MissingKey {
        /// The key, with its alternatives.
        key: &'static str,
    },
    /// The XML is not well-formed.
    #[error("not well-formed XML: {}", plain(reason))]
    Xml {
        /// What the XML parser says, with its position.
        reason: String,
    },
    /// The XML holds a spline model and no cloud.
    #[error("the file holds a model ({}), not a point cloud; there is nothing to fit", plain(geometry))]
    HoldsModel {
        /// Type of the geometry, as in the file.
        geometry: String,
    },
    /// The two matrices of a cloud are not there exactly once each.
    #[error(
        "a cloud is a matrix with id 0 (parameters) and one with id 1 (points), each once; the file has: {}",
        if ids.is_empty() { "no matrix".to_owned() } else { named(ids) }
    )]
    MatrixIds {
        /// The ids that are there, in file order; `none` for a matrix without id.
        ids: Vec<String>,
    },
    /// An attribute of a matrix is missing or has a value that cannot be used.
    #[error("matrix {id}: attribute {attribute} is {value:?}; {expected}")]
    MatrixAttribute {
        /// The matrix's id.
        id: usize,
        /// The attribute.
        attribute: &'static str,
        /// Its value, empty where it is missing.
        value: String,
        /// What is expected instead.
        expected: &'static str,
    },
    /// A matrix has more or fewer values than rows times columns.
    #[error("matrix {id} has {found} values, not {rows} × {cols}")]
    MatrixSize {
        /// The matrix's id.
        id: usize,
        /// Attribute `rows`.
        rows: usize,
        /// Attribute `cols`.
        cols: usize,
        /// Number of values.
        found: usize,
    },
    /// The shapes of the two matrices are not those of parameters and points.
    #[error(
        "matrix 0 is {} × {}, matrix 1 is {} × {}; parameters must be 2 × m and points 3 × m with the same m",
        parameters.0, parameters.1, points.0, points.1
    )]
    MatrixShapes {
        /// Rows and columns of matrix 0.
        parameters: (usize, usize),
        /// Rows and columns of matrix 1.
        points: (usize, usize),
    },
}

/// Why a file could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// The operating system refused; a file of that name, if there was one, is as before.
    #[error("{}: cannot be written: {reason}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        reason: std::io::Error,
    },
    /// The file name's extension names no mesh format.
    #[error("{}: unknown mesh extension; supported are {supported}", path.display())]
    UnknownExtension {
        /// The file.
        path: PathBuf,
        /// The extensions that can be written.
        supported: String,
    },
    /// Vertices are not in space.
    #[error("vertices have {columns} coordinates; a mesh file takes 3")]
    NotSpatial {
        /// Number of columns.
        columns: usize,
    },
    /// Not one scalar a vertex.
    #[error("{values} values of {name:?} for {vertices} vertices")]
    ScalarCount {
        /// Name of the scalars.
        name: String,
        /// Number of values.
        values: usize,
        /// Number of vertices.
        vertices: usize,
    },
    /// A coordinate or scalar is NaN or infinite.
    #[error("vertex {vertex} (counted from 0): {quantity} is {value}")]
    NonFinite {
        /// Index of the vertex.
        vertex: usize,
        /// `coordinate`, or the name of the scalars.
        quantity: String,
        /// The value.
        value: f64,
    },
    /// A triangle names a vertex that does not exist.
    #[error("triangle {triangle} (counted from 0) names vertex {index}; there are {count}")]
    IndexOutOfRange {
        /// Index of the triangle.
        triangle: usize,
        /// The vertex index.
        index: u32,
        /// Number of vertices.
        count: usize,
    },
    /// A format's counters are 32 bit wide.
    #[error("{count} vertices or triangles; the format counts up to {limit}")]
    TooLarge {
        /// Number of vertices or triangles.
        count: usize,
        /// The limit.
        limit: usize,
    },
}
