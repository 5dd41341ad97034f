//! STL, ASCII and binary: triangles that share no points. Normals and attributes are ignored.

use super::faces::{Faces, vertex_index};
use super::text::{Line, Lines};
use super::{Format, Scan, rows, with_room};
use crate::error::{Location, ReadErrorKind};

/// Bytes of the title of a binary file.
const TITLE: usize = 80;

/// Bytes of a triangle of a binary file: normal, three points, attribute.
const RECORD: usize = 50;

/// Bytes at the start of a file by which text is told from binary data: a line or two.
const SNIFFED: usize = 512;

/// The number of triangles that a program announces which did not know it when it wrote the header.
const UNKNOWN_COUNT: usize = u32::MAX as usize;

/// Both kinds may open with `solid`: a binary file is told by its size, or by bytes that no text holds.
pub(super) fn read(bytes: &[u8]) -> Result<Scan, ReadErrorKind> {
    let count = bytes.get(TITLE..).and_then(<[u8]>::first_chunk).map(|&count| u32::from_le_bytes(count) as usize);
    let binary_size = count.map(|count| TITLE + 4 + count.saturating_mul(RECORD));
    let opens_solid = bytes.trim_ascii_start().get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    let is_control = |&byte: &u8| byte.is_ascii_control() && !byte.is_ascii_whitespace() && byte != 0x0b;
    let is_text = opens_solid && !bytes[..bytes.len().min(SNIFFED)].iter().any(is_control);
    match count {
        Some(count) if binary_size == Some(bytes.len()) || !is_text => read_binary(&bytes[TITLE + 4..], count),
        None if !opens_solid => Err(ReadErrorKind::Malformed {
            format: "STL",
            reason: "text opens with `solid`, binary data with 80 bytes of title and a count".to_owned(),
        }),
        _ => read_text(bytes),
    }
}

/// The triangles that the count announces; those that there are where it is 0, the largest number, or less than what follows,
/// as programs write that make the header first. More than there are is a file that was cut off.
fn read_binary(bytes: &[u8], announced: usize) -> Result<Scan, ReadErrorKind> {
    let (records, rest) = bytes.as_chunks::<RECORD>();
    let is_unknown = announced == UNKNOWN_COUNT || announced == 0;
    let count = match records.get(announced..) {
        _ if is_unknown => records.len(),
        Some(further) if rest.is_empty() && further.iter().all(is_triangle) => records.len(),
        // Other bytes stand at the end: there is less to tell triangles by, so their normals must be such, too.
        Some(further) => announced + further.iter().take_while(|r| is_triangle(r) && has_normal(r)).count(),
        None => announced,
    };
    if records.len() < count {
        return Err(ReadErrorKind::Truncated { element: "triangle".to_owned(), expected: count, found: records.len() });
    }
    let mut coordinates: Vec<f64> = with_room(9 * count)?;
    for record in &records[..count] {
        coordinates.extend(corners(record).map(f64::from));
    }
    let mut scan = separate_triangles(coordinates)?;
    if count != announced && count > 0 {
        scan.notes.push(format!("the header announces {announced} triangles; the {count} that are there were read"));
    }
    let surplus = bytes.len() - count * RECORD;
    if surplus > 0 {
        scan.notes.push(format!("{surplus} bytes after the last triangle were ignored"));
    }
    Ok(scan)
}

/// Whether a record that can be a triangle has a normal of length 1, or none, as many programs write; zeros alone only fill up a file.
fn has_normal(record: &[u8; RECORD]) -> bool {
    let (numbers, _) = record.as_chunks::<4>();
    let normal: [f32; 3] = std::array::from_fn(|k| f32::from_le_bytes(numbers[k]));
    let length = normal.iter().map(|n| n * n).sum::<f32>().sqrt();
    (length == 0.0 || (length - 1.0).abs() < 1e-3) && record.iter().any(|&byte| byte != 0)
}

/// The nine coordinates of a triangle, behind its normal.
fn corners(record: &[u8; RECORD]) -> [f32; 9] {
    let (numbers, _) = record.as_chunks::<4>();
    std::array::from_fn(|k| f32::from_le_bytes(numbers[3 + k]))
}

/// Whether a record can be a triangle: the bytes of anything else are, in single precision, hardly all of ordinary size.
fn is_triangle(record: &[u8; RECORD]) -> bool {
    corners(record).iter().all(|c| *c == 0.0 || (1e-20..1e20).contains(&c.abs()))
}

/// Three rows a triangle.
fn separate_triangles(coordinates: Vec<f64>) -> Result<Scan, ReadErrorKind> {
    let points = rows(coordinates, 3);
    let count = points.nrows();
    let index = |k: usize| vertex_index(k as i64, count, || Location::Record { element: "point".to_owned(), index: k });
    let mut triangles = with_room(count / 3)?;
    for t in 0..count / 3 {
        triangles.push([index(3 * t)?, index(3 * t + 1)?, index(3 * t + 2)?]);
    }
    let mut scan = Scan::new(Format::Stl, points);
    scan.triangles = (count > 0).then_some(triangles);
    Ok(scan)
}

fn read_text(bytes: &[u8]) -> Result<Scan, ReadErrorKind> {
    let mut lines = Lines::new(bytes);
    let mut coordinates = Vec::new();
    let mut faces = Faces::default();
    let (mut solid, mut facet) = (None, None);
    let mut corners: Vec<u32> = Vec::new();
    while let Some(line) = lines.next_filled() {
        let mut fields = line.fields();
        let mut keyword = fields.next().unwrap_or_default().to_ascii_lowercase();
        // Some write two words.
        if keyword == b"end" {
            keyword.extend(fields.next().unwrap_or_default().to_ascii_lowercase());
        }
        match keyword.as_slice() {
            // An extension of some programs, before a facet or a solid.
            b"color" | b"colour" => {}
            b"solid" => solid = Some(line.number),
            b"facet" => facet = Some(line.number),
            b"outer" => corners.clear(),
            b"vertex" if facet.is_some() => {
                let index = coordinates.len() / 3;
                coordinates.extend(line.xyz(fields)?);
                corners.push(vertex_index(index as i64, index + 1, || line.location())?);
            }
            b"endloop" => faces.push(&corners),
            b"endfacet" => facet = None,
            b"endsolid" => solid = None,
            _ => return Err(unexpected(line)),
        }
    }
    for (element, opened) in [("facet", facet), ("solid", solid)] {
        if let Some(line) = opened {
            return Err(ReadErrorKind::Unclosed { element, line });
        }
    }
    let mut scan = Scan::new(Format::Stl, rows(coordinates, 3));
    scan.triangles = faces.finish(&mut scan.notes);
    Ok(scan)
}

fn unexpected(line: Line<'_>) -> ReadErrorKind {
    line.bad_header("expected solid, facet, outer loop, vertex, endloop, endfacet or endsolid")
}
