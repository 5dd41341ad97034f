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
