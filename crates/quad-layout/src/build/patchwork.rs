//! Regions as polygons: nodes where arcs meet, arcs between regions, and the triangles of each region.

use std::collections::{BTreeMap, BTreeSet};

use super::mesh::{WorkMesh, angle_at, edge};
use super::regions::{Ground, Regions, runs};

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
        let mut work = Self { points: mesh.points.clone(), faces, borders: Vec::new(), polygons: Vec::new() };
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
                    polygon.push(work.side(&mut known, std::mem::replace(&mut path, vec![to]), region, mesh));
                }
                if to == start || steps > next.len() {
                    break;
                }
            }
            work.polygons.push(polygon);
        }
        if bare.is_empty() { Ok(work) } else { Err(bare) }
    }

    fn side(
        &mut self,
        known: &mut BTreeMap<(u32, u32), Side>,
        path: Vec<u32>,
        region: usize,
        mesh: &WorkMesh,
    ) -> Side {
        let n = path.len();
        if let Some(&side) = known.get(&(path[0], path[1])) {
            self.borders[side.border].sides[usize::from(side.reversed)] = region;
            return side;
        }
        let border = self.borders.len();
        known.insert((path[0], path[1]), Side { border, reversed: false });
        known.insert((path[n - 1], path[n - 2]), Side { border, reversed: true });
        let is_sharp = mesh.sharp.contains(&edge(path[0], path[1]));
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

    pub(super) fn length(&self, path: &[u32]) -> f64 {
        path.windows(2)
            .map(|pair| {
                point_cloud::vec3::norm(point_cloud::vec3::sub(
                    self.points[pair[1] as usize],
                    self.points[pair[0] as usize],
                ))
            })
            .sum()
    }

    /// The angle of a region at each of its nodes, the starts of its sides; at smooth nodes all angles sum to a full turn.
    pub(super) fn angles(&self) -> Vec<Vec<f64>> {
        let mut sums: Vec<BTreeMap<u32, f64>> = Vec::with_capacity(self.faces.len());
        let mut all: BTreeMap<u32, f64> = BTreeMap::new();
        let mut on_crease: BTreeSet<u32> = BTreeSet::new();
        for border in self.borders.iter().filter(|border| border.is_sharp) {
            on_crease.extend([border.path[0], border.path[border.path.len() - 1]]);
        }
        for (polygon, faces) in self.polygons.iter().zip(&self.faces) {
            let mut sum: BTreeMap<u32, f64> = polygon.iter().map(|&side| (self.start(side), 0.0)).collect();
            for face in faces {
                for k in 0..3 {
                    if let Some(sum) = sum.get_mut(&face[k]) {
                        let [p, q, r] = [0, 1, 2].map(|i| self.points[face[(k + i) % 3] as usize]);
                        let angle = angle_at(p, q, r);
                        *sum += angle;
                        *all.entry(face[k]).or_default() += angle;
                    }
                }
            }
            sums.push(sum);
        }
        let angle = |region: usize, side: &Side| {
            let node = self.start(*side);
            let factor = if on_crease.contains(&node) { 1.0 } else { std::f64::consts::TAU / all[&node] };
            factor * sums[region][&node]
        };
        let of = |(region, polygon): (usize, &Vec<Side>)| polygon.iter().map(|side| angle(region, side)).collect();
        self.polygons.iter().enumerate().map(of).collect()
    }
}

/// Vertices at which three borders meet, or the course of a crease breaks.
fn nodes(ground: &Ground<'_>, regions: &Regions, corners: &BTreeSet<u32>) -> BTreeSet<u32> {
    let mesh = ground.mesh;
    let mut nodes = corners.clone();
    for vertex in 0..mesh.points.len() as u32 {
        let fan = mesh.fan(ground.neighbours, vertex);
        let sharp = fan.iter().filter(|(face, k)| {
            mesh.sharp.contains(&edge(vertex, mesh.faces[*face as usize][(k + 1) % 3]))
        });
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
