//! Polygons to triangles.

use crate::error::{Location, ReadErrorKind};

/// Collects polygons as triangles.
#[derive(Default)]
pub(super) struct Faces {
    triangles: Vec<[u32; 3]>,
    polygons: usize,
    lines: usize,
}

impl Faces {
    /// Adds a polygon, cut into triangles by a fan from its first corner.
    pub(super) fn push(&mut self, corners: &[u32]) {
        let &[first, ref others @ ..] = corners else {
            self.lines += 1;
            return;
        };
        self.polygons += usize::from(corners.len() > 3);
        self.lines += usize::from(corners.len() < 3);
        self.triangles.extend(others.windows(2).map(|pair| [first, pair[0], pair[1]]));
    }

    /// Adds the triangles of a strip: each corner from the third on makes one with the two before it, turned about in every
    /// second one so that all look the same way. Triangles with two equal corners only lead the strip on.
    pub(super) fn push_strip(&mut self, corners: &[u32]) {
        for (at, corner) in corners.windows(3).enumerate() {
            let &[a, b, c] = corner else { continue };
            if a != b && b != c && c != a {
                self.triangles.push(if at % 2 == 0 { [a, b, c] } else { [b, a, c] });
            }
        }
    }

    /// The triangles, and notes on what was done to get them.
    pub(super) fn finish(self, notes: &mut Vec<String>) -> Option<Vec<[u32; 3]>> {
        if self.polygons > 0 {
            notes.push(format!("{} faces with more than 3 corners were cut into triangles", self.polygons));
        }
        if self.lines > 0 {
            notes.push(format!("{} faces with fewer than 3 corners were skipped", self.lines));
        }
        (!self.triangles.is_empty()).then_some(self.triangles)
    }
}

/// A vertex index counted from 0, if the mesh has that vertex.
pub(super) fn vertex_index(
    index: i64,
    count: usize,
    location: impl FnOnce() -> Location,
) -> Result<u32, ReadErrorKind> {
    u32::try_from(index).ok().filter(|&i| (i as usize) < count).ok_or_else(|| ReadErrorKind::IndexOutOfRange {
        location: location(),
        index,
        count,
    })
}
