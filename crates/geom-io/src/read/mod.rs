//! Readers of scans: the formats, and what they have in common.

mod asc;
mod csv;
mod faces;
mod gismo;
mod obj;
mod off;
mod ply;
mod text;
mod xyz;

use std::path::Path;

use ndarray::Array2;
use point_cloud::PointCloud;

use crate::error::{ReadError, ReadErrorKind};

/// A file format that holds a scan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Format {
    /// Stanford PLY, ASCII or binary: cloud or mesh.
    Ply,
    /// Wavefront OBJ: cloud or mesh.
    Obj,
    /// Object File Format (OFF, and its variants with colours, normals, texture): cloud or mesh.
    Off,
    /// Text with one point a line.
    Xyz,
    /// Text with one point a line and a line that names the columns.
    Csv,
    /// ESRI ASCII grid of heights.
    EsriGrid,
    /// G+Smo XML with a matrix of parameters and one of points.
    GismoXml,
}

impl Format {
    /// All formats.
    pub const ALL: [Self; 7] = [Self::Ply, Self::Obj, Self::Off, Self::Xyz, Self::Csv, Self::EsriGrid, Self::GismoXml];

    /// The format's name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ply => "PLY",
            Self::Obj => "OBJ",
            Self::Off => "OFF",
            Self::Xyz => "XYZ",
            Self::Csv => "CSV",
            Self::EsriGrid => "ESRI ASCII grid",
            Self::GismoXml => "G+Smo XML",
        }
    }

    /// Extensions of the format's files, in lower case and without the dot.
    pub fn extensions(self) -> &'static [&'static str] {
        match self {
            Self::Ply => &["ply"],
            Self::Obj => &["obj"],
            Self::Off => &["off"],
            Self::Xyz => &["xyz", "txt", "pts"],
            Self::Csv => &["csv"],
            Self::EsriGrid => &["asc"],
            Self::GismoXml => &["xml"],
        }
    }

    /// The format that the extension of a path, in upper or lower case, stands for.
    ///
    /// # Errors
    /// [`ReadErrorKind::UnknownExtension`].
    pub fn from_path(path: &Path) -> Result<Self, ReadErrorKind> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
        let known = Self::ALL.into_iter().find(|f| f.extensions().contains(&extension.as_str()));
        known.ok_or_else(|| {
            let supported: Vec<_> = Self::ALL.iter().flat_map(|f| f.extensions()).map(|e| format!(".{e}")).collect();
            ReadErrorKind::UnknownExtension { extension, supported: supported.join(", ") }
        })
    }
}

/// How to read where a file leaves it open.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ReadOptions {
    /// The format; `None` goes by the file's extension.
    pub format: Option<Format>,
    /// Names of the CSV columns that hold the coordinates, in their order; empty stands for
    /// `x`, `y` and, where it is there, `z`. Upper and lower case are the same.
    pub coordinate_columns: Vec<String>,
}

/// What a file held.
#[derive(Clone, Debug, PartialEq)]
pub struct Scan {
    /// The points, in the order of the file; a grid in row order (see [`PointCloud::grid`]).
    /// Coordinates and parameters are as in the file and finite.
    pub cloud: PointCloud,
    /// Triangles of a mesh whose vertices are the points; indices are in range.
    pub triangles: Option<Vec<[u32; 3]>>,
    /// The format that was read.
    pub format: Format,
    /// What was left out or changed, in words for a person.
    pub notes: Vec<String>,
}

impl Scan {
    fn new(format: Format, points: Array2<f64>) -> Self {
        Self { cloud: PointCloud { points, parameters: None, grid: None }, triangles: None, format, notes: Vec::new() }
    }
}

/// Reads a point cloud or mesh.
///
/// # Errors
/// [`ReadError`] with the path and the violated condition; see [`ReadErrorKind`].
pub fn read_scan(path: &Path, options: &ReadOptions) -> Result<Scan, ReadError> {
    let read = || {
        let format = options.format.map_or_else(|| Format::from_path(path), Ok)?;
        parse_scan(&std::fs::read(path)?, format, options)
    };
    let scan = read().map_err(|kind| ReadError { path: path.to_owned(), kind })?;
    tracing::debug!(
        path = %path.display(), format = ?scan.format, points = scan.cloud.points.nrows(),
        triangles = scan.triangles.as_ref().map_or(0, Vec::len), notes = ?scan.notes, "scan read"
    );
    Ok(scan)
}

/// Reads a point cloud or mesh from the bytes of a file; `options.format` is not used.
///
/// # Errors
/// [`ReadErrorKind`], the violated condition.
pub fn parse_scan(bytes: &[u8], format: Format, options: &ReadOptions) -> Result<Scan, ReadErrorKind> {
    const UTF8_MARK: &[u8] = b"\xef\xbb\xbf";
    const UTF16_MARKS: [&[u8]; 2] = [b"\xff\xfe", b"\xfe\xff"];
    let bytes = bytes.strip_prefix(UTF8_MARK).unwrap_or(bytes);
    if UTF16_MARKS.iter().any(|mark| bytes.starts_with(mark)) {
        return Err(ReadErrorKind::NotText { line: 1 });
    }
    if bytes.iter().all(u8::is_ascii_whitespace) {
        return Err(ReadErrorKind::Empty);
    }
    let scan = match format {
        Format::Ply => ply::read(bytes),
        Format::Obj => obj::read(bytes),
        Format::Off => off::read(bytes),
        Format::Xyz => xyz::read(bytes, options),
        Format::Csv => csv::read(bytes, options),
        Format::EsriGrid => asc::read(bytes, options),
        Format::GismoXml => gismo::read(bytes),
    }?;
    match scan.cloud.points.is_empty() {
        true => Err(ReadErrorKind::NoPoints),
        false => Ok(scan),
    }
}

/// Row-major `values` as an array of `columns` columns.
fn rows(mut values: Vec<f64>, columns: usize) -> Array2<f64> {
    let count = values.len() / columns;
    values.truncate(count * columns);
    Array2::from_shape_vec((count, columns), values).expect("the length is rows times columns")
}
