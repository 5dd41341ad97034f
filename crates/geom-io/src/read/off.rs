//! Object File Format: a line of counts, a line for each vertex, a line for each face.
//!
//! The prefixes `N` (normal), `C` (colour) and `ST` (texture) add numbers behind the coordinates, in this order: normals are read, the
//! others ignored.

use super::faces::{Faces, vertex_index};
use super::text::{Line, Lines, before_hash, number_or_nan, parse_count};
use super::{Format, Scan, rows, with_room};
use crate::error::ReadErrorKind;

/// Shortest vertex line, `0 0 0` and its end: bounds the memory reserved for an announced number of vertices.
const SHORTEST_LINE: usize = 6;

pub(super) fn read(bytes: &[u8]) -> Result<Scan, ReadErrorKind> {
    let mut lines = Lines::new(bytes);
    let mut next_line = || lines.next_data(before_hash);

    let first = next_line().ok_or(ReadErrorKind::NoPoints)?;
    let mut fields = first.fields();
    let has_keyword = !is_counts(first);
    let has_normals = has_keyword && check_keyword(first, fields.next().unwrap_or_default())?;
    let (counts_line, mut counts) = match fields.clone().next() {
        Some(b"BINARY") => return Err(first.bad_header("binary OFF cannot be read; save it as text")),
        Some(_) => (first, fields),
        None => {
            let line = next_line().ok_or_else(|| first.bad_header("no line with counts follows"))?;
            (line, line.fields())
        }
    };
    let mut count = || {
        let count = counts.next().and_then(parse_count);
        count.ok_or_else(|| counts_line.bad_header("expected the numbers of vertices, faces and edges"))
    };
    let (vertex_count, face_count) = (count()?, count()?);

    let mut coordinates: Vec<f64> = with_room(3 * vertex_count.min(bytes.len() / SHORTEST_LINE))?;
    let mut normals = Vec::new();
    for found in 0..vertex_count {
        let line = next_line().ok_or_else(|| truncated("vertex", vertex_count, found))?;
        coordinates.extend(line.xyz(line.fields())?);
        if has_normals {
            let mut further = line.fields().skip(3);
            normals.push([(); 3].map(|()| further.next().and_then(number_or_nan).unwrap_or(f64::NAN)));
        }
    }
    let mut faces = Faces::default();
    let mut corners = Vec::new();
    for found in 0..face_count {
        let line = next_line().ok_or_else(|| truncated("face", face_count, found))?;
        read_corners(line, vertex_count, &mut corners)?;
        faces.push(&corners);
    }
    let surplus = std::iter::from_fn(next_line).count();

    let mut scan = Scan::new(Format::Off, rows(coordinates, 3));
    scan.triangles = faces.finish(&mut scan.notes);
    scan.normals = has_normals.then_some(normals);
    if !has_keyword {
        scan.notes
            .push("the word OFF is missing; the first line was taken as the numbers of vertices and faces".to_owned());
    }
    if surplus > 0 {
        scan.notes.push(format!("{surplus} lines after the last face were ignored"));
    }
    Ok(scan)
}

/// Whether a line is that of the numbers of vertices, faces and edges, without a keyword before it.
fn is_counts(line: Line<'_>) -> bool {
    line.fields().count() == 3 && line.fields().all(|field| parse_count(field).is_some())
}

/// `OFF` with any of the prefixes that keep the first three numbers of a vertex its coordinates; whether a normal follows them.
fn check_keyword(line: Line<'_>, keyword: &[u8]) -> Result<bool, ReadErrorKind> {
    let keyword = keyword.to_ascii_uppercase();
    let prefix = keyword.strip_suffix(b"OFF").ok_or_else(|| line.bad_header("expected OFF"))?;
    match prefix {
        b"" | b"C" | b"N" | b"CN" | b"ST" | b"STC" | b"STN" | b"STCN" => Ok(prefix.ends_with(b"N")),
        _ => Err(line.bad_header("expected OFF, COFF, NOFF or CNOFF; other dimensions than 3 cannot be read")),
    }
}

fn read_corners(line: Line<'_>, vertex_count: usize, corners: &mut Vec<u32>) -> Result<(), ReadErrorKind> {
    corners.clear();
    let mut fields = line.fields();
    let length = fields.next().unwrap_or_default();
    let length = parse_count(length).ok_or_else(|| line.not_an_index(length))?;
    for field in fields.by_ref().take(length) {
        let index = std::str::from_utf8(field).ok().and_then(|text| text.parse().ok());
        let index = index.ok_or_else(|| line.not_an_index(field))?;
        corners.push(vertex_index(index, vertex_count, || line.location())?);
    }
    match corners.len() == length {
        true => Ok(()),
        false => Err(line.row_length(length.saturating_add(1), corners.len() + 1)),
    }
}

fn truncated(element: &str, expected: usize, found: usize) -> ReadErrorKind {
    ReadErrorKind::Truncated { element: element.to_owned(), expected, found }
}
