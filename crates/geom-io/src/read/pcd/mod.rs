//! Point Cloud Data, version 0.7 and before: ASCII, binary and compressed binary.
//!
//! Of the fields `x`, `y`, `z` and those of a normal are read. Points that are not a number are the format's way to say that a pixel of
//! the sensor saw nothing; they are left out as in all formats. The viewpoint is not applied, as in the Point Cloud Library.

mod header;
mod lzf;

use point_cloud::GridShape;

use self::header::{Encoding, Field, Header, total};
use super::text::{Lines, before_hash};
use super::{Format, Scan, rows, with_room};
use crate::error::ReadErrorKind;

/// Shortest line of a point, `0 0 0` and its end: bounds the memory reserved for an announced number of points.
const SHORTEST_LINE: usize = 6;

pub(super) fn read(bytes: &[u8]) -> Result<Scan, ReadErrorKind> {
    let mut lines = Lines::new(bytes);
    let header = Header::parse(&mut lines)?;
    let points = match header.encoding {
        Encoding::Ascii => read_text(&header, lines),
        Encoding::Binary => read_binary(&header, lines.rest(), Layout::ByPoint),
        Encoding::Compressed => {
            let expanded = expand(&header, lines.rest())?;
            read_binary(&header, &expanded, Layout::ByField)
        }
    }?;
    let mut scan = Scan::new(Format::Pcd, rows(points.coordinates, 3));
    scan.normals = header.normal.map(|_| points.normals);
    if header.height > 1 && header.width > 1 && header.width.checked_mul(header.height) == Some(header.points) {
        scan.cloud.grid = Some(GridShape { n_u: header.height, n_v: header.width });
    }
    Ok(scan)
}

/// The points of a file, numbers or not.
struct Points {
    coordinates: Vec<f64>,
    /// Their normals, where the file has some.
    normals: Vec<[f64; 3]>,
}

impl Points {
    fn with_room(points: usize) -> Result<Self, ReadErrorKind> {
        Ok(Self { coordinates: with_room(3 * points)?, normals: Vec::new() })
    }

    fn push(&mut self, xyz: [f64; 3], normal: Option<[f64; 3]>) {
        self.coordinates.extend(xyz);
        self.normals.extend(normal);
    }
}

fn read_text(header: &Header, mut lines: Lines<'_>) -> Result<Points, ReadErrorKind> {
    let columns_of = |fields: [usize; 3]| fields.map(|field| total(&header.fields[..field], |f| f.count));
    let (columns, normal) = (columns_of(header.coordinates), header.normal.map(columns_of));
    let expected = total(&header.fields, |f| f.count);
    let mut points = Points::with_room(header.points.min(lines.rest().len() / SHORTEST_LINE))?;
    let mut row = Vec::new();
    for found in 0..header.points {
        let line = lines.next_data(before_hash).ok_or_else(|| truncated(header, found))?;
        row.clear();
        row.extend(line.fields());
        if row.len() != expected {
            return Err(line.row_length(expected, row.len()));
        }
        let number = |column: usize| line.number(row[column]);
        let three = |[x, y, z]: [usize; 3]| -> Result<_, ReadErrorKind> { Ok([number(x)?, number(y)?, number(z)?]) };
        points.push(three(columns)?, normal.map(three).transpose()?);
    }
    Ok(points)
}

/// The order of binary values.
#[derive(Clone, Copy)]
enum Layout {
    /// All fields of the first point, then of the second.
    ByPoint,
    /// The first field of all points, then the second.
    ByField,
}

fn read_binary(header: &Header, bytes: &[u8], layout: Layout) -> Result<Points, ReadErrorKind> {
    let record = total(&header.fields, Field::width);
    let found = bytes.len() / record;
    if found < header.points {
        return Err(truncated(header, found));
    }
    let with_offsets = |fields: [usize; 3]| fields.map(|f| (f, total(&header.fields[..f], Field::width)));
    let (coordinates, normal) = (with_offsets(header.coordinates), header.normal.map(with_offsets));
    let mut points = Points::with_room(header.points)?;
    for index in 0..header.points {
        let number = |(field, offset): (usize, usize)| {
            let field = &header.fields[field];
            let start = match layout {
                Layout::ByPoint => index * record + offset,
                Layout::ByField => offset * header.points + index * field.width(),
            };
            let number = bytes.get(start..).and_then(|bytes| field.number(bytes));
            number.ok_or_else(|| truncated(header, index))
        };
        let three =
            |[x, y, z]: [(usize, usize); 3]| -> Result<_, ReadErrorKind> { Ok([number(x)?, number(y)?, number(z)?]) };
        points.push(three(coordinates)?, normal.map(three).transpose()?);
    }
    Ok(points)
}

/// Compressed data: their size, their size when expanded, and they.
fn expand(header: &Header, bytes: &[u8]) -> Result<Vec<u8>, ReadErrorKind> {
    let damaged = |reason: &str| ReadErrorKind::Malformed { format: "PCD", reason: reason.to_owned() };
    let size = |bytes: &[u8]| bytes.first_chunk().map(|&size| u32::from_le_bytes(size) as usize);
    let sizes = size(bytes).zip(bytes.get(4..).and_then(size));
    let (compressed, expanded) = sizes.ok_or_else(|| damaged("they are cut off"))?;
    if header.points.checked_mul(total(&header.fields, Field::width)) != Some(expanded) {
        return Err(damaged("the expanded size is not that of the points in the header"));
    }
    let data = bytes.get(8..).and_then(|data| data.get(..compressed));
    let data = data.ok_or_else(|| damaged("they are cut off"))?;
    lzf::decompress(data, expanded).ok_or_else(|| damaged("the compressed bytes are damaged"))
}

fn truncated(header: &Header, found: usize) -> ReadErrorKind {
    ReadErrorKind::Truncated { element: "point".to_owned(), expected: header.points, found }
}
