//! Wavefront OBJ: vertices with their normals, and faces; everything else is ignored.
//!
//! A backslash at the end of a line continues it on the next one. A fourth number of a vertex is its weight w, by which the
//! others are divided; colours come in threes.

use std::borrow::Cow;

use super::faces::Faces;
use super::text::{Fields, Line, Lines, before_hash, is_text, parse_number};
use super::{Format, Scan, rows};
use crate::error::{Location, ReadErrorKind};

pub(super) fn read(bytes: &[u8]) -> Result<Scan, ReadErrorKind> {
    let mut lines = Lines::new(bytes);
    let mut coordinates: Vec<f64> = Vec::new();
    let mut faces = Faces::default();
    let mut corners = Vec::new();
    // Corners that name a vertex further down, and their lines.
    let mut ahead = Vec::new();
    let (mut has_texture, mut polylines, mut weighted) = (false, 0_usize, 0_usize);
    let mut normals = Normals::default();
    while let Some(first) = lines.next_filled() {
        let text = continued(first, &mut lines);
        let line = Line { number: first.number, text: &text };
        let mut fields = line.fields();
        match fields.next() {
            Some(b"v") => {
                let mut xyz = line.xyz(fields.clone())?;
                if let Some(w) = weight(fields) {
                    xyz = xyz.map(|coordinate| coordinate / w);
                    weighted += 1;
                }
                coordinates.extend(xyz);
            }
            Some(b"f") => {
                let count = coordinates.len() / 3;
                corners.clear();
                for field in fields {
                    let (written, index) = corner(line, field, count)?;
                    if index as usize >= count {
                        ahead.push((line.number, written));
                    }
                    corners.push(index);
                    normals.add_corner(index, field);
                }
                faces.push(&corners);
            }
            Some(b"vt") => has_texture = true,
            Some(b"l") => polylines += 1,
            Some(b"vn") => {
                normals.given.push([(); 3].map(|()| fields.next().and_then(parse_number).unwrap_or(f64::NAN)))
            }
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
    scan.normals = normals.of_vertices(count);
    scan.triangles = faces.finish(&mut scan.notes);
    if has_texture {
        scan.notes.push("texture coordinates were ignored".to_owned());
    }
    if polylines > 0 {
        scan.notes.push(format!("{polylines} polylines were ignored; their points were read"));
    }
    if weighted > 0 {
        scan.notes.push(format!("{weighted} vertices have a weight w; x, y and z were divided by it"));
    }
    Ok(scan)
}

/// The text of a line before its comment, with that of the lines that continue it. A backslash that ends a comment, such as
/// a folder's name, continues nothing.
fn continued<'a>(first: Line<'a>, lines: &mut Lines<'a>) -> Cow<'a, [u8]> {
    let text = before_hash(first.text);
    let Some(before) = text.trim_ascii_end().strip_suffix(b"\\") else {
        return Cow::Borrowed(text);
    };
    let mut joined = before.to_vec();
    for next in lines {
        let text = before_hash(next.text).trim_ascii_end();
        joined.push(b' ');
        match text.strip_suffix(b"\\") {
            Some(before) => joined.extend_from_slice(before),
            None => {
                joined.extend_from_slice(text);
                break;
            }
        }
    }
    Cow::Owned(joined)
}

/// The weight of a vertex `v x y z w`, where it is another than 1.
fn weight(fields: Fields<'_>) -> Option<f64> {
    let mut further = fields.skip(3);
    let w = parse_number(further.next()?)?;
    (further.next().is_none() && w != 1.0).then_some(w)
}

/// Normals, which faces give to their corners.
#[derive(Default)]
struct Normals {
    given: Vec<[f64; 3]>,
    /// Corners as a vertex and a normal, both from 0.
    corners: Vec<(u32, u32)>,
}

impl Normals {
    /// Takes the normal of a corner `v//vn` or `v/vt/vn`. One that names no normal has none: surfaces are told their outside by others.
    fn add_corner(&mut self, vertex: u32, field: &[u8]) {
        let written = field.split(|&b| b == b'/').nth(2).and_then(|text| std::str::from_utf8(text).ok()?.parse().ok());
        let Some(written): Option<i64> = written else { return };
        let index = if written > 0 { written - 1 } else { self.given.len() as i64 + written };
        self.corners.extend(u32::try_from(index).ok().map(|normal| (vertex, normal)));
    }

    /// The sum of the normals at the corners of each vertex; without faces that name any, one a vertex, if there are as many.
    fn of_vertices(self, count: usize) -> Option<Vec<[f64; 3]>> {
        if self.corners.is_empty() {
            return Some(self.given).filter(|given| !given.is_empty() && given.len() == count);
        }
        let mut sums = vec![[0.0; 3]; count];
        for (vertex, normal) in self.corners {
            if let (Some(sum), Some(normal)) = (sums.get_mut(vertex as usize), self.given.get(normal as usize)) {
                // One that is not finite says nothing.
                if normal.iter().all(|c| c.is_finite()) {
                    (0..3).for_each(|k| sum[k] += normal[k]);
                }
            }
        }
        Some(sums)
    }
}

/// The index of a corner `v`, `v/vt`, `v//vn` or `v/vt/vn` as written and counted from 0.
/// Negative ones count back from the last of the `count` vertices so far.
fn corner(line: Line<'_>, field: &[u8], count: usize) -> Result<(i64, u32), ReadErrorKind> {
    let vertex = field.split(|&b| b == b'/').next().unwrap_or_default();
    let written: i64 =
        std::str::from_utf8(vertex).ok().and_then(|text| text.parse().ok()).ok_or_else(|| line.not_an_index(field))?;
    let index = if written > 0 { written - 1 } else { count as i64 + written };
    let index = u32::try_from(index).ok().filter(|_| written != 0);
    Ok((written, index.ok_or_else(|| out_of_range(line.number, written, count))?))
}

fn out_of_range(line: usize, index: i64, count: usize) -> ReadErrorKind {
    ReadErrorKind::IndexOutOfRange { location: Location::Line(line), index, count }
}
