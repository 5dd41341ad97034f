//! Creases as lines from corner to corner, where arcs cross them, and the regions that begin along them.
//!
//! Where arcs end on a crease is decided before regions grow: at *crossings*, at which one arc leaves on each side. So arcs never end on
//! the middle of a side of a patch across the crease.

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::TAU;

use point_cloud::DisjointSets;
use point_cloud::vec3::{add, scale, sub, unit};

use super::mesh::{Neighbours, WorkMesh, angle_at};
use crate::edge::edge;

/// Turn of a crease, in radians, from which on its vertex is a corner, and the length of the directions on both sides of it.
const CORNER_TURN: f64 = 0.87;
const TURN_LENGTH: f64 = 0.02;

/// Length of these directions on a closed crease, as a share of its length.
const TURN_SHARE: f64 = 1.0 / 16.0;

/// Angle between two creases, in radians, beyond which arcs part it, and what their parts are made about as large as.
///
/// Derived: corners of patches stay below 155°.
const WIDE: f64 = 2.45;
const PART: f64 = 1.75;

/// A crease from corner to corner, or closed: then its first vertex is its last.
#[derive(Clone, Debug)]
pub(super) struct Line {
    pub(super) path: Vec<u32>,
    /// Places in `path` at which arcs cross, increasing; on a closed line the first is 0.
    pub(super) crossings: Vec<usize>,
    pub(super) is_closed: bool,
}

/// All creases.
#[derive(Clone, Debug, Default)]
pub(super) struct Lines {
    pub(super) lines: Vec<Line>,
    pub(super) corners: BTreeSet<u32>,
    /// Pairs of half-edges to the left of which one region lies.
    pub(super) joined: Vec<[(u32, u32); 2]>,
    /// Corners whose wide sectors have one part fewer than by their angle.
    pub(super) fewer: BTreeSet<u32>,
}

/// What grows from creases.
pub(super) struct Seeds {
    /// The faces along creases, of each region that begins there.
    pub(super) faces: Vec<Vec<u32>>,
    /// Region of each half-edge of a crease: that of the face to its left.
    pub(super) of_half_edge: BTreeMap<(u32, u32), usize>,
    /// Vertices round which there are too few faces.
    pub(super) crowded: Vec<u32>,
}

impl Line {
    /// Lengths from the first vertex to each.
    pub(super) fn lengths(&self, mesh: &WorkMesh) -> Vec<f64> {
        let mut sum = 0.0;
        let mut lengths = vec![0.0];
        for pair in self.path.windows(2) {
            sum += mesh.length(pair[0], pair[1]);
            lengths.push(sum);
        }
        lengths
    }

    /// Places of the ends of the intervals between crossings.
    pub(super) fn ends(&self) -> Vec<usize> {
        let mut ends = self.crossings.clone();
        if !self.is_closed {
            ends.insert(0, 0);
        }
        ends.push(self.path.len() - 1);
        ends
    }

    /// The place in the middle of an interval; none if it is one edge.
    pub(super) fn middle(&self, lengths: &[f64], [a, b]: [usize; 2]) -> Option<usize> {
        let middle = 0.5 * (lengths[a] + lengths[b]);
        (a + 1..b).min_by(|&i, &j| (lengths[i] - middle).abs().total_cmp(&(lengths[j] - middle).abs()))
    }
}

impl Lines {
    /// Traces the sharp edges of a mesh.
    pub(super) fn trace(mesh: &WorkMesh) -> Self {
        let mut at: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for &[a, b] in &mesh.sharp {
            at.entry(a).or_default().push(b);
            at.entry(b).or_default().push(a);
        }
        let mut corners: BTreeSet<u32> = at.iter().filter(|(_, others)| others.len() != 2).map(|(&v, _)| v).collect();
        let turns = Self::walk(&at, &corners).into_iter().flat_map(|line| turning_corners(mesh, &line));
        corners.extend(turns.collect::<Vec<_>>());
        Self { lines: Self::walk(&at, &corners), corners, joined: Vec::new(), fewer: BTreeSet::new() }
    }

    fn walk(at: &BTreeMap<u32, Vec<u32>>, corners: &BTreeSet<u32>) -> Vec<Line> {
        let mut used: BTreeSet<(u32, u32)> = BTreeSet::new();
        let mut lines = Vec::new();
        let starts = corners.iter().copied().chain(at.keys().copied());
        for start in starts {
            let is_corner = corners.contains(&start);
            for &first in at.get(&start).into_iter().flatten() {
                if used.contains(&(start, first)) || (!is_corner && used.iter().any(|&(a, _)| a == start)) {
                    continue;
                }
                let mut path = vec![start, first];
                let (mut before, mut now) = (start, first);
                used.extend([(start, first), (first, start)]);
                while now != start && !corners.contains(&now) {
                    let next = if at[&now][0] == before { at[&now][1] } else { at[&now][0] };
                    used.extend([(now, next), (next, now)]);
                    path.push(next);
                    (before, now) = (now, next);
                }
                lines.push(Line { path, crossings: Vec::new(), is_closed: !is_corner });
            }
        }
        lines
    }

    /// The regions that begin along creases.
    pub(super) fn seeds(&self, mesh: &WorkMesh, neighbours: &Neighbours) -> Seeds {
        let mut of_half_edge: BTreeMap<(u32, u32), u32> = BTreeMap::new();
        let mut sets = DisjointSets::new(0);
        let mut crossings: BTreeSet<u32> = BTreeSet::new();
        for line in &self.lines {
            crossings.extend(line.crossings.iter().map(|&at| line.path[at]));
            for pair in line.ends().windows(2) {
                let slots = [sets.add(), sets.add()];
                for i in pair[0]..pair[1] {
                    of_half_edge.insert((line.path[i], line.path[i + 1]), slots[0]);
                    of_half_edge.insert((line.path[i + 1], line.path[i]), slots[1]);
                }
            }
        }
        for [a, b] in &self.joined {
            if let (Some(&a), Some(&b)) = (of_half_edge.get(a), of_half_edge.get(b)) {
                sets.join(a, b);
            }
        }
        let vertices: BTreeSet<u32> = mesh.sharp.iter().flatten().copied().collect();
        let (mut groups, mut crowded) = (Vec::new(), Vec::new());
        for vertex in vertices {
            for sector in sectors(mesh, neighbours, vertex) {
                let Some((start, end)) = slots_of(mesh, &sector, &of_half_edge) else { continue };
                let parts = self.parts(&sector, vertex, crossings.contains(&vertex));
                if parts > sector.faces.len() {
                    crowded.push(vertex);
                }
                let mut slots = vec![start];
                slots.extend((2..parts).map(|_| sets.add()));
                if parts == 1 {
                    sets.join(start, end);
                } else {
                    slots.push(end);
                }
                groups.extend(sector.split(parts).into_iter().zip(&slots).map(|(faces, &slot)| (slot, faces)));
            }
        }
        let mut number: BTreeMap<u32, usize> = BTreeMap::new();
        let mut faces: Vec<Vec<u32>> = Vec::new();
        for (slot, of) in groups {
            let next = faces.len();
            let region = *number.entry(sets.root(slot)).or_insert(next);
            if region == next {
                faces.push(Vec::new());
            }
            faces[region].extend(of);
        }
        let of_half_edge =
            of_half_edge.into_iter().filter_map(|(side, slot)| Some((side, *number.get(&sets.root(slot))?))).collect();
        Seeds { faces, of_half_edge, crowded }
    }

    fn parts(&self, sector: &Sector, vertex: u32, is_crossing: bool) -> usize {
        if is_crossing {
            return 2;
        }
        let angle: f64 = sector.angles.iter().sum();
        if !self.corners.contains(&vertex) || angle <= WIDE {
            return 1;
        }
        let parts = (angle / PART).round() as usize;
        parts.saturating_sub(usize::from(self.fewer.contains(&vertex))).max(2)
    }
}

/// Faces round a vertex between two sharp edges, counter-clockwise.
pub(super) struct Sector {
    pub(super) vertex: u32,
    pub(super) faces: Vec<(u32, usize)>,
    angles: Vec<f64>,
}

impl Sector {
    /// Groups of about the same angle.
    fn split(&self, parts: usize) -> Vec<Vec<u32>> {
        let all: f64 = self.angles.iter().sum();
        let mut groups = vec![Vec::new(); parts];
        let mut before = 0.0;
        for (i, (&(face, _), angle)) in self.faces.iter().zip(&self.angles).enumerate() {
            let by_angle = ((before + 0.5 * angle) / all.max(f64::MIN_POSITIVE) * parts as f64) as usize;
            // The first and the last face touch the creases.
            let most = i.min(parts - 1);
            let least = (i + parts).saturating_sub(self.faces.len()).min(most);
            groups[by_angle.clamp(least, most)].push(face);
            before += angle;
        }
        groups
    }
}

/// The sectors round a vertex on creases.
pub(super) fn sectors(mesh: &WorkMesh, neighbours: &Neighbours, vertex: u32) -> Vec<Sector> {
    let fan = mesh.fan(neighbours, vertex);
    let begins = |&(face, k): &(u32, usize)| mesh.sharp.contains(&edge(vertex, mesh.faces[face as usize][(k + 1) % 3]));
    let Some(first) = fan.iter().position(begins) else { return Vec::new() };
    let mut sectors: Vec<Sector> = Vec::new();
    for i in 0..fan.len() {
        let at = fan[(first + i) % fan.len()];
        if begins(&at) {
            sectors.push(Sector { vertex, faces: Vec::new(), angles: Vec::new() });
        }
        if let Some(sector) = sectors.last_mut() {
            sector.faces.push(at);
            sector.angles.push(mesh.angle(at.0, at.1));
        }
    }
    sectors
}

fn slots_of(mesh: &WorkMesh, sector: &Sector, of: &BTreeMap<(u32, u32), u32>) -> Option<(u32, u32)> {
    let (first, last) = (sector.faces.first()?, sector.faces.last()?);
    let to = mesh.faces[first.0 as usize][(first.1 + 1) % 3];
    let from = mesh.faces[last.0 as usize][(last.1 + 2) % 3];
    Some((*of.get(&(sector.vertex, to))?, *of.get(&(from, sector.vertex))?))
}

/// Vertices of a line at which it turns most, and by more than [`CORNER_TURN`].
fn turning_corners(mesh: &WorkMesh, line: &Line) -> Vec<u32> {
    let n = line.path.len() - 1;
    let lengths = line.lengths(mesh);
    let total = lengths[n];
    let reach = if line.is_closed { TURN_LENGTH.min(TURN_SHARE * total) } else { TURN_LENGTH };
    let point = |t: f64| {
        let t = if line.is_closed { t.rem_euclid(total) } else { t.clamp(0.0, total) };
        let i = lengths.partition_point(|&l| l < t).clamp(1, n);
        let share = (t - lengths[i - 1]) / (lengths[i] - lengths[i - 1]).max(f64::MIN_POSITIVE);
        let [p, q] = [line.path[i - 1], line.path[i]].map(|v| mesh.points[v as usize]);
        add(p, scale(share, sub(q, p)))
    };
    let inner = if line.is_closed { 0..n } else { 1..n };
    let turn = |i: usize| {
        let at = mesh.points[line.path[i] as usize];
        let (before, after) = (unit(sub(point(lengths[i] - reach), at)), unit(sub(point(lengths[i] + reach), at)));
        0.5 * TAU - angle_at([0.0; 3], before, after)
    };
    let turns: Vec<(usize, f64)> = inner.map(|i| (i, turn(i))).collect();
    let is_most = |&&(i, t): &&(usize, f64)| {
        let near = |j: usize| {
            let apart = (lengths[i] - lengths[j]).abs();
            apart.min(if line.is_closed { total - apart } else { apart }) < reach
        };
        t > CORNER_TURN && turns.iter().all(|&(j, other)| !near(j) || (other, i) <= (t, j) || i == j)
    };
    turns.iter().filter(is_most).map(|&(i, _)| line.path[i]).collect()
}
