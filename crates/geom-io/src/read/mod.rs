//! Readers of scans: the formats, and what they have in common.

mod asc;
mod decoder;
mod e57;
mod faces;
mod format;
mod geotiff;
mod gismo;
mod glb;
mod height_field;
mod heights;
mod las;
mod number;
mod obj;
mod off;
mod pcd;
mod ply;
mod ptx;
mod source;
mod stl;
mod surfer;
mod table;
mod text;
mod three_mf;
mod xml;

use std::path::Path;

use ndarray::{Array2, ArrayView2, Axis};
use point_cloud::{MAX_COORDINATE, PointCloud};
use serde::Serialize;

pub use self::format::Format;
pub use self::number::Decimal;
use self::source::Unpacked;
pub(crate) use self::source::read as read_bytes;
use self::text::Lines;
pub(crate) use self::xml::check as check_xml;
use crate::error::{ReadError, ReadErrorKind, quote};
use crate::model::LengthUnit;

/// How to read where a file leaves it open.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ReadOptions {
    /// The format; `None` goes by the file's extension. Standard input needs one.
    pub format: Option<Format>,
    /// Columns of a text file that hold the coordinates, in their order: names, upper and lower case being the
    /// same, or numbers from 1 on. Empty stands for `x`, `y` and, where it is there, `z`, or names that mean these; without
    /// names for the first three columns of numbers that do not merely count. Given, no other columns are guessed to be
    /// grid indices or normals.
    pub columns: Vec<String>,
    /// Columns of a text file that hold the normal of the surface at each point, three, by names or numbers; of an empty list none
    /// do, and `None` stands for columns that are named so.
    pub normals: Option<Vec<String>>,
    /// Columns of a text file that hold the row and the column of each point in a grid, two, by names or numbers; of an empty list
    /// none do, and `None` stands for columns that are named so.
    pub grid: Option<Vec<String>>,
    /// Lines at the start of a text file that are not looked at.
    pub skip: usize,
    /// The decimal sign of a text file; `None` goes by its numbers.
    pub decimal: Option<Decimal>,
    /// Classes of a LAS or LAZ file whose points are read; empty for all.
    pub classes: Vec<u8>,
    /// Column of a CSV file that holds the confidence in each point, a name or a number from 1 on; `None` reads none.
    pub weights: Option<String>,
    /// How many times their own size compressed data (gzip, zip, LAZ, 3MF, GeoTIFF) may expand to; `None` for 200, and the
    /// first MiB to 12 MiB at most. A MiB is always allowed.
    pub max_expand: Option<usize>,
    /// Whether x and y, each from 0 to 1 over its own extent, become the parameters of points that have none.
    pub height_field: bool,
}

/// What a file held.
#[derive(Clone, Debug, PartialEq)]
pub struct Scan {
    /// The points that were read, in the order of the file; a grid in row order (see [`PointCloud::grid`]).
    /// Coordinates and parameters are as in the file and finite.
    pub cloud: PointCloud,
    /// Which of the points of the file each one is, from 0; of those of all scans of an E57 file, of the cells of a grid of heights line by line.
    /// Differs from its place where points were left out, and where those of a grid were sorted.
    pub rows: Vec<u32>,
    /// Triangles of a mesh whose vertices are the points; indices are in range.
    pub triangles: Option<Vec<[u32; 3]>>,
    /// Whether each point lies on the outer boundary, where a CSV file has a column `boundary`: 0 for inside.
    pub on_boundary: Option<Vec<bool>>,
    /// The confidence in each point, where the options name a column: 0 or more.
    pub weights: Option<Vec<f64>>,
    /// The normal of the surface at each point, as in the file, where it has such; NaN where a point has none. Not
    /// of unit length in general.
    pub normals: Option<Vec<[f64; 3]>>,
    /// Which columns of a text file were taken for what; empty for other formats.
    pub columns: Vec<TakenColumn>,
    /// Lines of a text file that hold its points; empty for other formats.
    pub(crate) lines: RowLines,
    /// Size of the cells of a grid of heights along x and y.
    pub cell: Option<[f64; 2]>,
    /// Length unit of the coordinates, where the file tells it: E57, 3MF, and LAS and GeoTIFF with a coordinate system.
    pub unit: Option<LengthUnit>,
    /// The format that was read.
    pub format: Format,
    /// What was left out or changed, in words for a person.
    pub notes: Vec<String>,
}

/// A column of a text file that was read.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct TakenColumn {
    /// Which one, from 1.
    pub number: usize,
    /// Its name, as in the file.
    pub name: Option<String>,
    /// What it was taken for: `x`, `u`, `weight`, `normal x`, `grid row` and so on.
    #[serde(rename = "as")]
    pub role: &'static str,
}

/// Line numbers of rows, kept for the rows before which lines were left out.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct RowLines(Vec<(u32, usize)>);

impl RowLines {
    /// Adds the line of a row; rows increase.
    fn push(&mut self, row: u32, line: usize) {
        if self.of(row) != Some(line) {
            self.0.push((row, line));
        }
    }

    fn of(&self, row: u32) -> Option<usize> {
        let after = self.0.partition_point(|&(start, _)| start <= row);
        let (start, line) = *self.0.get(after.checked_sub(1)?)?;
        Some(line + (row - start) as usize)
    }
}

impl Scan {
    /// Points in memory, shape `(m, 3)`, and nothing else.
    pub fn in_memory(points: Array2<f64>) -> Self {
        Self::new(Format::Memory, points)
    }

    /// Heights in memory over a grid with cells of the given size: row i, column j at `(j · cell[0], i · cell[1])`; NaN for none.
    ///
    /// # Errors
    /// As of files of heights: too few cells, coordinates that are too large.
    pub fn of_heights(heights: ArrayView2<'_, f64>, cell: [f64; 2]) -> Result<Self, ReadErrorKind> {
        let axis = |step, count| heights::Axis { origin: 0.0, step, shift: 0.0, count };
        let grid = heights::Grid {
            format: Format::Memory,
            x: axis(cell[0], heights.ncols()),
            y: axis(cell[1], heights.nrows()),
            from_north: false,
            no_data: heights::NoData::None,
        };
        grid.check()?;
        heights::scan(&heights.iter().copied().collect::<Vec<_>>(), &grid)
    }

    /// The line, from 1, of a text file that holds the point at a place; `None` for other formats.
    pub fn line(&self, place: usize) -> Option<usize> {
        self.line_of_row(*self.rows.get(place)?)
    }

    /// The same of a point by its row in the file, as in [`Self::rows`].
    pub fn line_of_row(&self, row: u32) -> Option<usize> {
        self.lines.of(row)
    }

    /// Keeps the points at these places, in this order, with all that belongs to them, and the triangles of which all vertices are kept.
    /// They are no grid any more.
    ///
    /// # Panics
    /// If a place is beyond the points.
    pub fn select(&mut self, places: &[usize]) {
        fn chosen<T: Copy>(all: &[T], places: &[usize]) -> Vec<T> {
            places.iter().map(|&at| all[at]).collect()
        }
        if let Some(triangles) = &mut self.triangles {
            let mut new = vec![u32::MAX; self.rows.len()];
            places.iter().enumerate().for_each(|(at, &old)| new[old] = at as u32);
            *triangles =
                triangles.iter().map(|t| t.map(|v| new[v as usize])).filter(|t| !t.contains(&u32::MAX)).collect();
        }
        self.cloud.points = self.cloud.points.select(Axis(0), places);
        self.cloud.parameters = self.cloud.parameters.take().map(|parameters| parameters.select(Axis(0), places));
        self.cloud.grid = None;
        self.on_boundary = self.on_boundary.take().map(|labels| chosen(&labels, places));
        self.weights = self.weights.take().map(|weights| chosen(&weights, places));
        self.normals = self.normals.take().map(|normals| chosen(&normals, places));
        self.rows = chosen(&self.rows, places);
    }

    fn new(format: Format, points: Array2<f64>) -> Self {
        let rows = (0..points.nrows() as u32).collect();
        Self {
            rows,
            cell: None,
            unit: None,
            cloud: PointCloud { points, parameters: None, grid: None },
            triangles: None,
            on_boundary: None,
            weights: None,
            normals: None,
            columns: Vec::new(),
            lines: RowLines::default(),
            format,
            notes: Vec::new(),
        }
    }
}

/// Reads a point cloud or mesh from a file, which may be compressed by gzip or lie alone in a zip archive; the path `-` is
/// standard input.
///
/// # Errors
/// [`ReadError`] with the path and the violated condition; see [`ReadErrorKind`].
pub fn read_scan(path: &Path, options: &ReadOptions) -> Result<Scan, ReadError> {
    let read = || {
        let of_path = match options.format {
            Some(format) => Ok(format),
            None if source::is_standard_input(path) => return Err(ReadErrorKind::FormatNeeded),
            None => Format::from_path(path),
        };
        // The name of an archive tells nothing of what is inside; names of other files must.
        let of_path = match of_path {
            Err(ReadErrorKind::UnknownExtension { extension, supported }) if extension != "zip" => {
                return Err(ReadErrorKind::UnknownExtension { extension, supported });
            }
            of_path => of_path,
        };
        let bytes = source::read(path)?;
        let unpacked = source::unpack(&bytes, options.max_expand)?;
        let of_member = unpacked.member.as_deref().map(|name| Format::from_path(Path::new(name)));
        let format = match (of_path, of_member) {
            (Ok(format), _) if options.format.is_some() => format,
            (_, Some(Ok(format))) => format,
            (Err(_), _) if unpacked.is_3mf => Format::ThreeMf,
            (Err(_), Some(unknown)) => unknown?,
            (of_path, _) => of_path?,
        };
        parse_unpacked(unpacked, format, options)
    };
    let scan = read().map_err(|kind| ReadError { path: path.to_owned(), kind })?;
    tracing::debug!(
        path = %path.display(), format = ?scan.format, points = scan.cloud.points.nrows(),
        triangles = scan.triangles.as_ref().map_or(0, Vec::len), notes = ?scan.notes, "scan read"
    );
    Ok(scan)
}

/// Reads a text that stands beside a scan, such as a list of rows.
///
/// # Errors
/// [`ReadError`] with the path: what the system says, [`ReadErrorKind::Endless`], [`ReadErrorKind::NotText`].
pub fn read_text(path: &Path) -> Result<String, ReadError> {
    let read = || {
        let bytes = source::read(path)?;
        String::from_utf8(bytes).map_err(|error| {
            let before = &error.as_bytes()[..error.utf8_error().valid_up_to()];
            ReadErrorKind::NotText { line: 1 + before.iter().filter(|&&byte| byte == b'\n').count() }
        })
    };
    read().map_err(|kind| ReadError { path: path.to_owned(), kind })
}

/// The bytes of a file, without compression by gzip or zip.
pub(crate) fn read_unpacked(path: &Path) -> Result<Vec<u8>, ReadErrorKind> {
    let bytes = source::read(path)?;
    Ok(source::unpack(&bytes, None)?.bytes.into_owned())
}

/// Reads a point cloud or mesh from the bytes of a file, which may be compressed by gzip or lie alone in a zip archive;
/// `options.format` is not used.
///
/// # Errors
/// [`ReadErrorKind`], the violated condition.
pub fn parse_scan(bytes: &[u8], format: Format, options: &ReadOptions) -> Result<Scan, ReadErrorKind> {
    parse_unpacked(source::unpack(bytes, options.max_expand)?, format, options)
}

fn parse_unpacked(unpacked: Unpacked<'_>, format: Format, options: &ReadOptions) -> Result<Scan, ReadErrorKind> {
    let Unpacked { bytes, member, is_3mf, mut budget } = unpacked;
    let format = if is_3mf { Format::ThreeMf } else { format };
    let bytes = if format.opens_with_text() { source::without_mark(&bytes)? } else { &*bytes };
    if bytes.iter().all(u8::is_ascii_whitespace) {
        return Err(ReadErrorKind::Empty);
    }
    let mut scan = match format {
        Format::Ply => ply::read(bytes),
        Format::Obj => obj::read(bytes),
        Format::Off => off::read(bytes),
        Format::Stl => stl::read(bytes),
        Format::Glb => glb::read(bytes, &mut budget),
        Format::ThreeMf => three_mf::read(bytes, &mut budget),
        Format::Xyz | Format::Csv | Format::EsriGrid | Format::SurferGrid | Format::Ptx => {
            by_content(bytes, format, options)
        }
        Format::GeoTiff => geotiff::read(bytes, &mut budget),
        Format::Pcd => pcd::read(bytes),
        Format::Las => las::read(bytes, &options.classes, &mut budget),
        Format::E57 => e57::read(bytes),
        Format::GismoXml => gismo::read(bytes),
        Format::Memory => Err(ReadErrorKind::FormatNeeded),
    }?;
    if let Some(member) = member {
        scan.notes.push(format!("read from {:?} in a zip archive", quote(&member)));
    }
    leave_out_non_finite(&mut scan)?;
    // What was asked for and cannot be had is no result.
    let is_table = matches!(scan.format, Format::Xyz | Format::Csv);
    let is_text = is_table || matches!(scan.format, Format::EsriGrid | Format::SurferGrid | Format::Ptx);
    for (is_given, option, of, is_known) in [
        (!options.columns.is_empty(), "columns", "XYZ and CSV", is_table),
        (options.normals.is_some(), "normals", "XYZ and CSV", is_table),
        (options.grid.is_some(), "grid", "XYZ and CSV", is_table),
        (options.weights.is_some(), "weights", "XYZ and CSV", is_table),
        (options.skip > 0, "skip", "text", is_text),
        (options.decimal.is_some(), "decimal", "text", is_text),
    ] {
        if is_given && !is_known {
            return Err(ReadErrorKind::OptionOfOtherFormat { option, of, format: scan.format.name() });
        }
    }
    if !options.classes.is_empty() && scan.format != Format::Las {
        return Err(ReadErrorKind::OptionOfOtherFormat { option: "class", of: "LAS", format: scan.format.name() });
    }
    if scan.cloud.points.is_empty() {
        return Err(ReadErrorKind::NoPoints);
    }
    check_range(&scan)?;
    if options.height_field {
        height_field::parameterize(&mut scan)?;
    }
    Ok(scan)
}

/// Leaves out points of which a coordinate is NaN or infinite, as pixels of a depth camera that saw nothing, with their triangles.
fn leave_out_non_finite(scan: &mut Scan) -> Result<(), ReadErrorKind> {
    let points = &scan.cloud.points;
    let given = points.nrows();
    if points.iter().all(|coordinate| coordinate.is_finite()) {
        return Ok(());
    }
    let kept: Vec<usize> = (0..given).filter(|&at| points.row(at).iter().all(|c| c.is_finite())).collect();
    if kept.is_empty() {
        return Err(ReadErrorKind::NoneFinite { points: given });
    }
    let triangles = scan.triangles.as_ref().map_or(0, Vec::len);
    scan.select(&kept);
    let lost = triangles - scan.triangles.as_ref().map_or(0, Vec::len);
    let mut note = format!("{} points are not a number (nothing was seen there) and were left out", given - kept.len());
    if lost > 0 {
        note += &format!(", with {lost} triangles");
    }
    scan.notes.push(note);
    Ok(())
}

/// Checks that coordinates can be computed with: their squares, and sums of these, must not overflow.
fn check_range(scan: &Scan) -> Result<(), ReadErrorKind> {
    let points = &scan.cloud.points;
    match points.iter().enumerate().find(|&(_, &value)| value.abs() > MAX_COORDINATE) {
        Some((place, &value)) => {
            let row = scan.rows[place / points.ncols()];
            Err(ReadErrorKind::CoordinateRange { row, value, limit: MAX_COORDINATE })
        }
        None => Ok(()),
    }
}

/// Room for as many values as a file announces and has bytes for.
///
/// # Errors
/// [`ReadErrorKind::Memory`].
fn with_room<T>(count: usize) -> Result<Vec<T>, ReadErrorKind> {
    let mut values = Vec::new();
    let reserved = values.try_reserve_exact(count);
    reserved.map_err(|_| ReadErrorKind::Memory { bytes: count.saturating_mul(size_of::<T>()) })?;
    Ok(values)
}

/// Reads a file of text by what it holds: grids of heights and PTX open with lines of their own, whatever the file is called;
/// anything else is a table, if its name promises no grid.
fn by_content(bytes: &[u8], format: Format, options: &ReadOptions) -> Result<Scan, ReadErrorKind> {
    // DOS ends a text by this sign.
    let bytes = bytes.strip_suffix(b"\x1a").unwrap_or(bytes);
    let (bytes, latin_from) = text::decoded(bytes);
    let mut scan = by_opening(Lines::after(&bytes, options.skip), format, options)?;
    if let Some(line) = latin_from {
        scan.notes.push(format!("line {line} is not in UTF-8; the file was read as Latin-1"));
    }
    Ok(scan)
}

fn by_opening(lines: Lines<'_>, format: Format, options: &ReadOptions) -> Result<Scan, ReadErrorKind> {
    let first = lines.clone().next_data(table::before_comment);
    if surfer::opens(lines.rest()) || format == Format::SurferGrid {
        surfer::read(lines, options)
    } else if first.is_some_and(asc::opens) {
        asc::read(lines, options)
    } else if format == Format::Ptx || ptx::opens(lines.clone()) {
        ptx::read(lines, options)
    } else {
        table::read(lines, if format == Format::Csv { Format::Csv } else { Format::Xyz }, options)
    }
}

/// Row-major `values` as an array of `columns` columns.
fn rows(mut values: Vec<f64>, columns: usize) -> Array2<f64> {
    let count = values.len() / columns;
    values.truncate(count * columns);
    Array2::from_shape_vec((count, columns), values).expect("the length is rows times columns")
}
