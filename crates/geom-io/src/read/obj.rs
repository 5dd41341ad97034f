//! Wavefront OBJ: vertices with their normals, and faces; everything else is ignored.

use super::faces::Faces;
use super::text::{Line, Lines, is_text, parse_number};
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
    let mut normals = Normals::default();
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
                    normals.add_corner(index, field);
                }
                faces.push(&corners);
            }
            Some(b"vt") => has_texture = true,
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
    Ok(scan)
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
    Ok((written, index.ok_or_else(|| out_of_range(line, written, count))?))
}

fn out_of_range(line: Line<'_>, index: i64, count: usize) -> ReadErrorKind {
    ReadErrorKind::IndexOutOfRange { location: line.location(), index, count }
}
