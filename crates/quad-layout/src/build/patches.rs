//! Polygons cut into patches.

use std::collections::BTreeMap;

use super::choose::{Choice, all_halved};
use super::disk::{Disk, SNAPS};
use super::patchwork::Patchwork;
use super::patterns::Cut;
use crate::RawPatch;

/// Patches of all regions; points that cuts need are added. The regions that cannot be cut, as an
/// error.
pub(super) fn patches(work: &mut Patchwork, choice: &Choice) -> Result<Vec<RawPatch>, Vec<u32>> {
    let (mut patches, mut failed) = (Vec::new(), Vec::new());
    for region in 0..work.polygons.len() {
        let sides = all_halved(work, &work.polygons[region]);
        match drawn(&mut work.points, &work.faces[region], &sides, &choice.cuts[region]) {
            Some(drawn) => patches.extend(drawn),
            None => failed.push(region as u32),
        }
    }
    if failed.is_empty() { Ok(patches) } else { Err(failed) }
}

/// The patches of a cut of a disk of triangles; `sides` are the paths between neighbouring vertices of the cut's numbering.
pub(super) fn drawn(
    points: &mut Vec<[f64; 3]>,
    faces: &[[u32; 3]],
    sides: &[Vec<u32>],
    cut: &Cut,
) -> Option<Vec<RawPatch>> {
    let disk = Disk::new(points, faces, sides)?;
    let (drawing, patches) = SNAPS.iter().find_map(|&snap| {
        let mut drawing = Drawing { disk: disk.clone(), sides, lines: BTreeMap::new() };
        let patches = drawing.patches(cut, snap)?;
        Some((drawing, patches))
    })?;
    points.extend_from_slice(drawing.disk.new_points());
    Some(patches)
}

/// A disk on which lines are drawn.
struct Drawing<'a> {
    disk: Disk,
    sides: &'a [Vec<u32>],
    /// Lines by their ends, in both directions.
    lines: BTreeMap<[usize; 2], Vec<u32>>,
}

impl Drawing<'_> {
    fn vertex(&self, number: usize) -> Option<u32> {
        self.disk.local(0, self.sides[number][0])
    }

    fn patches(&mut self, cut: &Cut, snap: f64) -> Option<Vec<RawPatch>> {
        for &[a, b] in &cut.lines {
            let mut line = self.disk.cut(self.vertex(a)?, self.vertex(b)?, snap)?;
            self.lines.insert([a, b], line.clone());
            line.reverse();
            self.lines.insert([b, a], line);
        }
        let mut quads: Vec<[Vec<u32>; 4]> = Vec::with_capacity(cut.len());
        for quad in &cut.quads {
            let paths: Vec<Vec<u32>> = (0..4).map(|k| self.path(quad[k], quad[(k + 1) % 4])).collect::<Option<_>>()?;
            quads.push(paths.try_into().ok()?);
        }
        for star in &cut.stars {
            self.star(star, snap, &mut quads)?;
        }
        let (group, count) = self.disk.groups();
        if count != quads.len() {
            return None;
        }
        let mut faces = vec![Vec::new(); count];
        (0..group.len()).for_each(|face| faces[group[face]].push(self.disk.triangle(face)));
        let patch_of = |paths: [Vec<u32>; 4]| {
            let within = group[self.disk.left_of(paths[0][0], paths[0][1])?];
            Some(patch(paths.map(|path| self.disk.whole(&path)), std::mem::take(&mut faces[within])))
        };
        quads.into_iter().map(patch_of).collect()
    }

    /// The line between two vertices, or the sides from one on to the other.
    fn path(&self, from: usize, to: usize) -> Option<Vec<u32>> {
        if let Some(line) = self.lines.get(&[from, to]) {
            return Some(line.clone());
        }
        let mut path = vec![self.vertex(from)?];
        let mut at = from;
        while at != to {
            path.extend(self.sides[at][1..].iter().map(|&v| self.disk.local(0, v)).collect::<Option<Vec<_>>>()?);
            at = (at + 1) % self.sides.len();
        }
        Some(path)
    }

    /// Patches from a vertex in the middle to every second vertex.
    fn star(&mut self, star: &[usize], snap: f64, quads: &mut Vec<[Vec<u32>; 4]>) -> Option<()> {
        let joined: Vec<u32> = star.iter().step_by(2).map(|&v| self.vertex(v)).collect::<Option<_>>()?;
        let uv = &self.disk.uv;
        let mean = [0, 1].map(|d| joined.iter().map(|&v| uv[v as usize][d]).sum::<f64>() / joined.len() as f64);
        let centre = self.disk.vertex_at(mean)?;
        let spokes: Vec<Vec<u32>> =
            joined.iter().map(|&end| self.disk.cut(centre, end, snap)).collect::<Option<_>>()?;
        for (i, spoke) in spokes.iter().enumerate() {
            let [a, b, c] = [0, 1, 2].map(|k| star[(2 * i + k) % star.len()]);
            let back = spokes[(i + 1) % spokes.len()].iter().rev().copied().collect();
            quads.push([spoke.clone(), self.path(a, b)?, self.path(b, c)?, back]);
        }
        Some(())
    }
}

pub(super) fn patch(paths: [Vec<u32>; 4], triangles: Vec<[u32; 3]>) -> RawPatch {
    let mut vertices: Vec<u32> = triangles.iter().flatten().copied().collect();
    vertices.sort_unstable();
    vertices.dedup();
    let uv = vec![[0.0; 2]; vertices.len()];
    RawPatch { corners: std::array::from_fn(|k| paths[k][0]), paths, triangles, vertices, uv }
}
