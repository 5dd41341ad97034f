//! Regions as polygons: nodes where arcs meet, arcs between regions, and the triangles of each region.

use std::collections::{BTreeMap, BTreeSet};

use point_cloud::vec3::{add, norm, scale, sub};

use super::mesh::{WorkMesh, angle_at};
use super::regions::{Ground, Regions, runs};
use crate::RawPatch;
use crate::edge::{edge, path_length};

/// Edges of a border, at least.
const EDGES: usize = 4;

/// Share of a border's length at which its direction is taken.
///
/// Limit: the first edges of a border go through vertices near it.
pub(super) const AHEAD: f64 = 0.15;

/// Angle of a region's triangles at a node, in radians, beyond which the directions of its borders no longer tell it.
const ROUND: f64 = 2.8;

/// The border between two regions, from node to node.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Border {
    pub(super) path: Vec<u32>,
    pub(super) is_sharp: bool,
    /// The regions on the left and on the right.
    pub(super) sides: [usize; 2],
}

/// A side of a region: a border, and whether the region passes it backward.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Side {
    pub(super) border: usize,
    pub(super) reversed: bool,
}

/// A surface cut into polygons.
#[derive(Clone, Debug, Default)]
pub(super) struct Patchwork {
    pub(super) points: Vec<[f64; 3]>,
    /// Number of points before borders were drawn.
    pub(super) given: usize,
    /// Triangles of each region.
    pub(super) faces: Vec<Vec<[u32; 3]>>,
    pub(super) borders: Vec<Border>,
    /// Sides of each region, counter-clockwise.
    pub(super) polygons: Vec<Vec<Side>>,
}

impl Patchwork {
    /// The polygons of regions that are disks; the regions that have no node, as an error.
    pub(super) fn new(ground: &Ground<'_>, regions: &Regions, corners: &BTreeSet<u32>) -> Result<Self, Vec<u32>> {
        let mesh = ground.mesh;
        let nodes = nodes(ground, regions, corners);
        let mut faces = vec![Vec::new(); regions.count];
        let mut next: Vec<BTreeMap<u32, u32>> = vec![BTreeMap::new(); regions.count];
        for (face, &label) in regions.label.iter().enumerate() {
            let triangle = mesh.faces[face];
            faces[label as usize].push(triangle);
            for k in 0..3 {
                let across = ground.neighbours.across[face][k] as usize;
                let side = [triangle[k], triangle[(k + 1) % 3]];
                if regions.label[across] != label || mesh.sharp.contains(&edge(side[0], side[1])) {
                    next[label as usize].insert(side[0], side[1]);
                }
            }
        }
        let (points, given) = (mesh.points.clone(), mesh.points.len());
        let mut work = Self { points, given, faces, borders: Vec::new(), polygons: Vec::new() };
        let mut known: BTreeMap<(u32, u32), Side> = BTreeMap::new();
        let mut bare = Vec::new();
        for (region, next) in next.iter().enumerate() {
            let Some(&start) = next.keys().find(|v| nodes.contains(v)) else {
                bare.push(region as u32);
                work.polygons.push(Vec::new());
                continue;
            };
            let mut polygon = Vec::new();
            let (mut path, mut steps) = (vec![start], 0);
            while let Some(&to) = next.get(&path[path.len() - 1]) {
                path.push(to);
                steps += 1;
                if nodes.contains(&to) {
                    polygon.push(work.side(&mut known, std::mem::replace(&mut path, vec![to]), region, &mesh.sharp));
                }
                if to == start || steps > next.len() {
                    break;
                }
            }
            work.polygons.push(polygon);
        }
        if !bare.is_empty() {
            return Err(bare);
        }
        work.lengthen_borders();
        Ok(work)
    }

    /// Patches as polygons of a surface whose sharp edges are known.
    pub(super) fn of_patches(
        points: Vec<[f64; 3]>,
        given: usize,
        patches: Vec<RawPatch>,
        sharp: &BTreeSet<[u32; 2]>,
    ) -> Self {
        let mut work = Self { points, given, ..Self::default() };
        let mut known: BTreeMap<(u32, u32), Side> = BTreeMap::new();
        for (region, patch) in patches.into_iter().enumerate() {
            let sides = patch.paths.into_iter().map(|path| work.side(&mut known, path, region, sharp)).collect();
            work.polygons.push(sides);
            work.faces.push(patch.triangles);
        }
        work
    }

    /// Halves the edges of borders of few, so that each has a middle.
    pub(super) fn lengthen_borders(&mut self) {
        for border in 0..self.borders.len() {
            while self.borders[border].path.len() <= EDGES {
                let path = std::mem::take(&mut self.borders[border].path);
                let mut longer = vec![path[0]];
                for pair in path.windows(2) {
                    longer.extend([self.halve(border, [pair[0], pair[1]]), pair[1]]);
                }
                self.borders[border].path = longer;
            }
        }
    }

    /// Halves an edge of a border: the new vertex.
    fn halve(&mut self, border: usize, [a, b]: [u32; 2]) -> u32 {
        let middle = self.points.len() as u32;
        let [p, q] = [a, b].map(|v| self.points[v as usize]);
        self.points.push(scale(0.5, add(p, q)));
        let [left, right] = self.borders[border].sides;
        for region in [left, right] {
            for (from, to) in [(a, b), (b, a)] {
                let begins = |t: &[u32; 3]| (0..3).position(|k| t[k] == from && t[(k + 1) % 3] == to);
                let found = self.faces[region].iter().enumerate().find_map(|(i, t)| Some((i, begins(t)?)));
                if let Some((i, k)) = found {
                    let third = self.faces[region][i][(k + 2) % 3];
                    self.faces[region][i] = [from, middle, third];
                    self.faces[region].push([middle, to, third]);
                }
            }
        }
        middle
    }

    pub(super) fn side(
        &mut self,
        known: &mut BTreeMap<(u32, u32), Side>,
        path: Vec<u32>,
        region: usize,
        sharp: &BTreeSet<[u32; 2]>,
    ) -> Side {
        let n = path.len();
        if let Some(&side) = known.get(&(path[0], path[1])) {
            self.borders[side.border].sides[usize::from(side.reversed)] = region;
            return side;
        }
        let border = self.borders.len();
        known.insert((path[0], path[1]), Side { border, reversed: false });
        known.insert((path[n - 1], path[n - 2]), Side { border, reversed: true });
        let is_sharp = sharp.contains(&edge(path[0], path[1]));
        self.borders.push(Border { path, is_sharp, sides: [region; 2] });
        Side { border, reversed: false }
    }

    /// The vertices along a side in the direction of its region.
    pub(super) fn path(&self, side: Side) -> Vec<u32> {
        let mut path = self.borders[side.border].path.clone();
        if side.reversed {
            path.reverse();
        }
        path
    }

    /// The node at which a side begins.
    pub(super) fn start(&self, side: Side) -> u32 {
        let path = &self.borders[side.border].path;
        if side.reversed { path[path.len() - 1] } else { path[0] }
    }

    /// The node at which a side ends.
    pub(super) fn end(&self, side: Side) -> u32 {
        self.start(Side { reversed: !side.reversed, ..side })
    }

    pub(super) fn length(&self, path: &[u32]) -> f64 {
        path_length(&self.points, path)
    }

    /// The angle of a region at each of its nodes, the starts of its sides; at smooth nodes all angles sum to a full turn. Borders count
    /// by where they lead, a share of their length from the node; but where a region goes round a node by more than [`ROUND`], its
    /// triangles count.
    pub(super) fn angles(&self) -> Vec<Vec<f64>> {
        let on_crease = self.on_crease();
        let mut all: BTreeMap<u32, f64> = BTreeMap::new();
        let mut angles = Vec::with_capacity(self.polygons.len());
        for (polygon, faces) in self.polygons.iter().zip(&self.faces) {
            let n = polygon.len();
            let angle =
                |i: usize| self.angle_between(&self.path(polygon[i]), &self.path(polygon[(i + n - 1) % n]), faces);
            let of: Vec<f64> = (0..n).map(angle).collect();
            polygon.iter().zip(&of).for_each(|(&side, angle)| *all.entry(self.start(side)).or_default() += angle);
            angles.push(of);
        }
        for (polygon, of) in self.polygons.iter().zip(&mut angles) {
            for (&side, angle) in polygon.iter().zip(of) {
                let node = self.start(side);
                if !on_crease.contains(&node) {
                    *angle *= std::f64::consts::TAU / all[&node];
                }
            }
        }
        angles
    }

    /// The angle between a side of a region and the side before it, as [`Patchwork::angles`] has it but for the full turn.
    pub(super) fn angle_between(&self, next: &[u32], before: &[u32], faces: &[[u32; 3]]) -> f64 {
        let node = next[0];
        let mut of_faces = 0.0;
        for face in faces {
            if let Some(k) = face.iter().position(|&v| v == node) {
                let [p, q, r] = [0, 1, 2].map(|i| self.points[face[(k + i) % 3] as usize]);
                of_faces += angle_at(p, q, r);
            }
        }
        if of_faces > ROUND {
            return of_faces;
        }
        let before: Vec<u32> = before.iter().rev().copied().collect();
        angle_at(self.points[node as usize], self.along(next), self.along(&before))
    }

    /// The four sides of a patch.
    pub(super) fn sides_of(&self, number: usize) -> [Vec<u32>; 4] {
        std::array::from_fn(|k| self.path(self.polygons[number][k]))
    }

    /// The angles of a patch with these sides and triangles, at the starts of its sides, and the lengths of these.
    pub(super) fn corners_and_sides(&self, sides: &[Vec<u32>; 4], faces: &[[u32; 3]]) -> ([f64; 4], [f64; 4]) {
        let angle = |k: usize| self.angle_between(&sides[k], &sides[(k + 3) % 4], faces);
        (std::array::from_fn(angle), std::array::from_fn(|k| self.length(&sides[k])))
    }

    /// The point of a path at a share of its length.
    fn along(&self, path: &[u32]) -> [f64; 3] {
        let points: Vec<[f64; 3]> = path.iter().map(|&v| self.points[v as usize]).collect();
        along(&points, AHEAD)
    }
}

/// The point of a line at a share of its length.
pub(super) fn along(line: &[[f64; 3]], share: f64) -> [f64; 3] {
    let sought = share * length(line);
    let mut sum = 0.0;
    for pair in line.windows(2) {
        let step = norm(sub(pair[1], pair[0]));
        if sum + step >= sought {
            return add(pair[0], scale((sought - sum) / step.max(f64::MIN_POSITIVE), sub(pair[1], pair[0])));
        }
        sum += step;
    }
    line[line.len() - 1]
}

/// The length of a line.
pub(super) fn length(line: &[[f64; 3]]) -> f64 {
    line.windows(2).map(|pair| norm(sub(pair[1], pair[0]))).sum()
}

/// Vertices at which three borders meet, or the course of a crease breaks.
fn nodes(ground: &Ground<'_>, regions: &Regions, corners: &BTreeSet<u32>) -> BTreeSet<u32> {
    let mesh = ground.mesh;
    let mut nodes = corners.clone();
    for vertex in 0..mesh.points.len() as u32 {
        let fan = mesh.fan(ground.neighbours, vertex);
        let sharp =
            fan.iter().filter(|(face, k)| mesh.sharp.contains(&edge(vertex, mesh.faces[*face as usize][(k + 1) % 3])));
        let is_node = match sharp.count() {
            0 => runs(&fan, &regions.label).len() > 2,
            sharp => borders(mesh, &fan, &regions.label, vertex) != sharp || sharp != 2,
        };
        if is_node {
            nodes.insert(vertex);
        }
    }
    nodes
}

/// Number of edges at a vertex that are sharp or have two regions.
fn borders(mesh: &WorkMesh, fan: &[(u32, usize)], label: &[u32], vertex: u32) -> usize {
    let is_border = |i: &usize| {
        let ((face, k), (before, _)) = (fan[*i], fan[(i + fan.len() - 1) % fan.len()]);
        let side = edge(vertex, mesh.faces[face as usize][(k + 1) % 3]);
        label[face as usize] != label[before as usize] || mesh.sharp.contains(&side)
    };
    (0..fan.len()).filter(is_border).count()
}
