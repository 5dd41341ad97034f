//! STL, ASCII and binary: triangles that share no points. Normals and attributes are ignored.

use super::faces::{Faces, vertex_index};
use super::text::{Line, Lines, finite};
use super::{Format, Scan, rows};
use crate::error::{Location, ReadErrorKind};

/// Bytes of the title of a binary file.
const TITLE: usize = 80;

/// Bytes of a triangle of a binary file: normal, three points, attribute.
const RECORD: usize = 50;

/// A binary file is told by its size; both kinds may open with `solid`.
pub(super) fn read(bytes: &[u8]) -> Result<Scan, ReadErrorKind> {
    let count = bytes.get(TITLE..).and_then(<[u8]>::first_chunk).map(|&count| u32::from_le_bytes(count) as usize);
    let binary_size = count.map(|count| TITLE + 4 + count.saturating_mul(RECORD));
    let opens_solid = bytes.trim_ascii_start().get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    match count {
        Some(count) if binary_size == Some(bytes.len()) || !opens_solid => read_binary(&bytes[TITLE + 4..], count),
        None if !opens_solid => Err(ReadErrorKind::Malformed {
            format: "STL",
            reason: "text opens with `solid`, binary data with 80 bytes of title and a count".to_owned(),
        }),
        _ => read_text(bytes),
    }
}

fn read_binary(bytes: &[u8], count: usize) -> Result<Scan, ReadErrorKind> {
    let (records, _) = bytes.as_chunks::<RECORD>();
    if records.len() < count {
        return Err(ReadErrorKind::Truncated { element: "triangle".to_owned(), expected: count, found: records.len() });
    }
    let mut coordinates = Vec::with_capacity(9 * count);
    for (index, record) in records[..count].iter().enumerate() {
        let (numbers, _) = record.as_chunks::<4>();
        for number in &numbers[3..12] {
            let location = || Location::Record { element: "triangle".to_owned(), index };
            coordinates.push(finite(f64::from(f32::from_le_bytes(*number)), location)?);
        }
    }
    let mut scan = separate_triangles(coordinates)?;
    let surplus = bytes.len() - count * RECORD;
    if surplus > 0 {
        scan.notes.push(format!("{surplus} bytes after the last triangle were ignored"));
    }
    Ok(scan)
}

/// Three rows a triangle.
fn separate_triangles(coordinates: Vec<f64>) -> Result<Scan, ReadErrorKind> {
    let points = rows(coordinates, 3);
    let count = points.nrows();
    let index = |k: usize| vertex_index(k as i64, count, || Location::Record { element: "point".to_owned(), index: k });
    let mut triangles = Vec::with_capacity(count / 3);
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
        let keyword = fields.next().unwrap_or_default().to_ascii_lowercase();
        match keyword.as_slice() {
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
