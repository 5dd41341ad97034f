//! Polygons cut into patches.

use super::choose::{Choice, sides};
use super::disk::{Disk, SNAPS};
use super::patchwork::Patchwork;
use super::patterns::Cut;
use crate::RawPatch;

/// A part of a polygon: triangles, its sides, and the numbers that the vertices at which they begin have in the polygon.
struct Part {
    faces: Vec<[u32; 3]>,
    sides: Vec<Vec<u32>>,
    vertices: Vec<usize>,
}

/// Patches of all regions; points that cuts need are added. The regions that cannot be cut, as an
/// error.
pub(super) fn patches(work: &mut Patchwork, choice: &Choice) -> Result<Vec<RawPatch>, Vec<u32>> {
    let (mut patches, mut failed) = (Vec::new(), Vec::new());
    for region in 0..work.polygons.len() {
        let sides = sides(work, &work.polygons[region], &choice.halved);
        let vertices = (0..sides.len()).collect();
        let part = Part { faces: work.faces[region].clone(), sides, vertices };
        if cut(&mut work.points, part, &choice.cuts[region], &mut patches).is_none() {
            failed.push(region as u32);
        }
    }
    if failed.is_empty() { Ok(patches) } else { Err(failed) }
}

/// Cuts a part along the first of its lines, and what is left in turn.
fn cut(points: &mut Vec<[f64; 3]>, part: Part, pattern: &Cut, patches: &mut Vec<RawPatch>) -> Option<()> {
    let place = |vertex: &usize| part.vertices.iter().position(|v| v == vertex);
    let n = part.vertices.len();
    // Lines that are sides of the part are drawn.
    let line = pattern.lines.iter().find_map(|[a, b]| {
        let (a, b) = (place(a)?, place(b)?);
        let apart = a.abs_diff(b);
        (apart > 1 && apart < n - 1).then_some([a.min(b), a.max(b)])
    });
    if let Some(line) = line {
        let halves = SNAPS.iter().find_map(|&snap| halves(points, &part, line, snap))?;
        return halves.into_iter().try_for_each(|half| cut(points, half, pattern, patches));
    }
    if let Some(star) =
        pattern.stars.iter().find(|star| star.len() == n && star.iter().all(|v| part.vertices.contains(v)))
    {
        let first = place(&star[0])?;
        let quads = SNAPS.iter().find_map(|&snap| starred(points, &part, first, snap))?;
        patches.extend(quads);
        return Some(());
    }
    let sides: [Vec<u32>; 4] = part.sides.try_into().ok()?;
    patches.push(patch(sides, part.faces));
    Some(())
}

/// The parts on both sides of the line between two vertices.
fn halves(points: &mut Vec<[f64; 3]>, part: &Part, [a, b]: [usize; 2], snap: f64) -> Option<[Part; 2]> {
    let mut disk = Disk::new(points, &part.faces, &part.sides)?;
    let (from, to) = (disk.local(0, part.sides[a][0])?, disk.local(0, part.sides[b][0])?);
    let path = disk.cut(from, to, snap)?;
    let (group, count) = disk.groups();
    if count != 2 {
        return None;
    }
    // Left of the line from a to b lie the sides from b on round to a.
    let left = group[disk.left_of(path[0], path[1])?];
    let faces = |is_left: bool| {
        let of = (0..group.len()).filter(|&face| (group[face] == left) == is_left);
        of.map(|face| disk.triangle(face)).collect::<Vec<_>>()
    };
    let path = disk.whole(&path);
    let backward: Vec<u32> = path.iter().rev().copied().collect();
    let n = part.sides.len();
    let between = |from: usize, to: usize| (from..if to > from { to } else { to + n }).map(move |i| i % n);
    let of = |from: usize, to: usize, line: Vec<u32>, is_left: bool| {
        let mut sides: Vec<Vec<u32>> = between(from, to).map(|i| part.sides[i].clone()).collect();
        let mut vertices: Vec<usize> = between(from, to).map(|i| part.vertices[i]).collect();
        sides.push(line);
        vertices.push(part.vertices[to]);
        Part { faces: faces(is_left), sides, vertices }
    };
    let halves = [of(a, b, backward, false), of(b, a, path, true)];
    points.extend_from_slice(disk.new_points());
    Some(halves)
}

/// Patches from a vertex in the middle to every second vertex from `first` on.
fn starred(points: &mut Vec<[f64; 3]>, part: &Part, first: usize, snap: f64) -> Option<Vec<RawPatch>> {
    let mut disk = Disk::new(points, &part.faces, &part.sides)?;
    let n = part.sides.len();
    let joined: Vec<usize> = (0..n / 2).map(|i| (first + 2 * i) % n).collect();
    let ends: Vec<u32> = joined.iter().map(|&i| disk.local(0, part.sides[i][0])).collect::<Option<_>>()?;
    let mean = [0, 1].map(|d| ends.iter().map(|&end| disk.uv[end as usize][d]).sum::<f64>() / ends.len() as f64);
    let centre = disk.vertex_at(mean)?;
    let spokes: Vec<Vec<u32>> = ends.iter().map(|&end| disk.cut(centre, end, snap)).collect::<Option<_>>()?;
    let (group, count) = disk.groups();
    if count != spokes.len() {
        return None;
    }
    let mut quads = Vec::new();
    for (i, &at) in joined.iter().enumerate() {
        let (spoke, next) = (&spokes[i], &spokes[(i + 1) % spokes.len()]);
        let of = group[disk.left_of(spoke[0], spoke[1])?];
        let faces = (0..group.len()).filter(|&face| group[face] == of).map(|face| disk.triangle(face)).collect();
        let back: Vec<u32> = disk.whole(next).into_iter().rev().collect();
        let sides = [disk.whole(spoke), part.sides[at].clone(), part.sides[(at + 1) % n].clone(), back];
        quads.push(patch(sides, faces));
    }
    points.extend_from_slice(disk.new_points());
    Some(quads)
}

pub(super) fn patch(paths: [Vec<u32>; 4], triangles: Vec<[u32; 3]>) -> RawPatch {
    let mut vertices: Vec<u32> = triangles.iter().flatten().copied().collect();
    vertices.sort_unstable();
    vertices.dedup();
    let uv = vec![[0.0; 2]; vertices.len()];
    RawPatch { corners: std::array::from_fn(|k| paths[k][0]), paths, triangles, vertices, uv }
}
