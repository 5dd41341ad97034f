//! Wavefront OBJ: vertices and faces; everything else is ignored.

use super::faces::Faces;
use super::text::{Line, Lines, is_text};
use super::{Format, Scan, rows};
use crate::error::ReadErrorKind;

pub(super) fn read(bytes: &[u8]) -> Result<Scan, ReadErrorKind> {
    let mut lines = Lines::new(bytes);
    let mut coordinates: Vec<f64> = Vec::new();
    let mut faces = Faces::default();
    let mut corners = Vec::new();
    // Corners that name a vertex further down.
    let mut ahead = Vec::new();
    let mut has_texture = false;
    while let Some(line) = lines.next_filled() {
        let mut fields = line.fields();
        match fields.next() {
            Some(b"v") => coordinates.extend(line.xyz(fields)?),
            Some(b"f") => {
                let count = coordinates.len() / 3;
                corners.clear();
                for field in fields.take_while(|field| !field.starts_with(b"#")) {
                    let (written, index) = corner(line, field, count)?;
                    if index as usize >= count {
                        ahead.push((line, written));
                    }
                    corners.push(index);
                }
                faces.push(&corners);
            }
            Some(b"vt") => has_texture = true,
            Some(keyword) if !keyword.starts_with(b"#") && !is_text(keyword) => {
                return Err(ReadErrorKind::NotText { line: line.number });
            }
            _ => {}
        }
    }
    let count = coordinates.len() / 3;
    for (line, written) in ahead {
        if written > count as i64 {
            return Err(out_of_range(line, written, count));
        }
    }
    let mut scan = Scan::new(Format::Obj, rows(coordinates, 3));
    scan.triangles = faces.finish(&mut scan.notes);
    if has_texture {
        scan.notes.push("texture coordinates were ignored".to_owned());
    }
    Ok(scan)
}

/// The index of a corner `v`, `v/vt`, `v//vn` or `v/vt/vn` as written and counted from 0.
/// Negative ones count back from the last of the `count` vertices so far.
fn corner(line: Line<'_>, field: &[u8], count: usize) -> Result<(i64, u32), ReadErrorKind> {
    let vertex = field.split(|&b| b == b'/').next().unwrap_or_default();
    let written: i64 =
        std::str::from_utf8(vertex).ok().and_then(|text| text.parse().ok()).ok_or_else(|| line.not_an_index(field))?;
    let index = if written > 0 { written - 1 } else { count as i64 + written };
    let index = u32::try_from(index).ok().filter(|_| written != 0);
    Ok((written, index.ok_or_else(|| out_of_range(line, written, count))?))
}

fn out_of_range(line: Line<'_>, index: i64, count: usize) -> ReadErrorKind {
    ReadErrorKind::IndexOutOfRange { location: line.location(), index, count }
}
