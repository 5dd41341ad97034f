//! A disk of triangles, mapped one to one onto a round disk, and cut along straight lines there.
//!
//! The map has positive weights and a circle as its rim, so it folds nowhere (Tutte 1963; Floater 2003). A line that is straight in it
//! stays inside and crosses no other line from end to end twice. Edges that it crosses are halved there.

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::TAU;

use fit_ls::Cholesky;
use ndarray::Array2;
use point_cloud::DisjointSets;
use point_cloud::vec3::{add, cross, dot, norm, scale, sub};
use thb_core::{SymmetricMatrix, SymmetricPattern};

use super::numbers::Numbers;
use crate::edge::{edge, sides};

/// Smallest and largest weight of an edge in the map.
///
/// Limit: weights must be positive; cotangents of flat triangles are not.
const WEIGHTS: [f64; 2] = [0.05, 20.0];

/// How near, as a share of an edge, a line goes through its end instead, in the first try, in the second and in the third.
pub(super) const SNAPS: [f64; 3] = [0.15, 0.01, 1e-7];

/// The same for the edge that is crossed first.
const FIRST_SNAP: f64 = 0.02;

/// A disk with its map.
#[derive(Clone, Debug)]
pub(super) struct Disk {
    /// Numbers of its vertices in the whole; those of new ones follow from `next`.
    pub(super) ids: Vec<u32>,
    pub(super) points: Vec<[f64; 3]>,
    pub(super) faces: Vec<[u32; 3]>,
    pub(super) uv: Vec<[f64; 2]>,
    /// Vertices that lines must not pass through, of the rim and of lines there are.
    blocked: Vec<bool>,
    /// Edges that lines must not cross.
    walls: BTreeSet<[u32; 2]>,
    next: u32,
    /// Number of vertices that it was made of.
    given: usize,
    numbers: Numbers,
}

/// A side of a face: its edge, and the face with its number there.
type FaceSide = ([u32; 2], [u32; 2]);

pub(super) fn turn(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

pub(super) fn minus(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

/// Angles on a circle at which sides of given lengths begin: half of it is shared out by lengths, half evenly.
pub(super) fn turns(lengths: &[f64]) -> Vec<f64> {
    let total: f64 = lengths.iter().sum();
    let mut before = 0.0;
    let turn = |length: &f64| {
        let at = before;
        before += TAU * (0.5 * length / total + 0.5 / lengths.len() as f64);
        at
    };
    lengths.iter().map(turn).collect()
}

impl Disk {
    /// Maps triangles onto the unit square, sides by their lengths. The map has no triangle turned over, but where an edge joins two
    /// vertices of one side it has some without area. None if the triangles are no disk.
    pub(super) fn on_square(points: &[[f64; 3]], faces: &[[u32; 3]], sides: &[Vec<u32>; 4]) -> Option<Self> {
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let sides: Vec<(usize, Vec<u32>)> = sides.iter().map(|side| (0, side.clone())).collect();
        Self::mapped(points, &[faces], &[], &sides, |_| {
            move |side: usize, share: f64| {
                let [from, to]: [[f64; 2]; 2] = [corners[side], corners[(side + 1) % 4]];
                [0, 1].map(|d| from[d] + share * (to[d] - from[d]))
            }
        })
    }

    /// Maps triangles whose rim is made of `sides`, paths from corner to corner, counter-clockwise. None if the triangles are no disk.
    pub(super) fn new(points: &[[f64; 3]], faces: &[[u32; 3]], sides: &[Vec<u32>]) -> Option<Self> {
        let sides: Vec<(usize, Vec<u32>)> = sides.iter().map(|side| (0, side.clone())).collect();
        Self::glued(points, &[faces], &[], &sides)
    }

    /// The same for several parts, glued along seams between two of them and nowhere else: where they touch besides, vertices are taken
    /// for different ones. Sides of the rim say to which part they belong.
    pub(super) fn glued(
        points: &[[f64; 3]],
        parts: &[&[[u32; 3]]],
        seams: &[([usize; 2], Vec<u32>)],
        sides: &[(usize, Vec<u32>)],
    ) -> Option<Self> {
        let on_circle = |lengths: &[f64]| {
            let starts = turns(lengths);
            move |side: usize, share: f64| {
                let end = starts.get(side + 1).copied().unwrap_or(TAU);
                let (sin, cos) = (starts[side] + (end - starts[side]) * share).sin_cos();
                [cos, sin]
            }
        };
        Self::mapped(points, parts, seams, sides, on_circle).filter(Self::is_one_to_one)
    }

    /// Glues parts and maps them; `rim` gives, for the lengths of the sides, the place of a side's point by a share of its length.
    fn mapped<P: Fn(usize, f64) -> [f64; 2]>(
        points: &[[f64; 3]],
        parts: &[&[[u32; 3]]],
        seams: &[([usize; 2], Vec<u32>)],
        sides: &[(usize, Vec<u32>)],
        rim: impl FnOnce(&[f64]) -> P,
    ) -> Option<Self> {
        let (numbers, faces) = Numbers::new(points.len(), parts, seams)?;
        let ids = numbers.ids();
        let mut disk = Self {
            points: ids.iter().map(|&v| points[v as usize]).collect(),
            faces,
            uv: vec![[0.0; 2]; ids.len()],
            blocked: vec![false; ids.len()],
            walls: BTreeSet::new(),
            next: points.len() as u32,
            given: ids.len(),
            ids,
            numbers,
        };
        disk.pin(sides, rim)?;
        let edges = disk.edges();
        disk.is_disk(&edges).then_some(())?;
        disk.solve(&edges)?;
        Some(disk)
    }

    /// The number here of a vertex of a part.
    pub(super) fn local(&self, part: usize, vertex: u32) -> Option<u32> {
        self.numbers.of(part, vertex)
    }

    /// Whether lines must not pass through a vertex.
    pub(super) fn is_blocked(&self, vertex: u32) -> bool {
        self.blocked[vertex as usize]
    }

    fn pin<P: Fn(usize, f64) -> [f64; 2]>(
        &mut self,
        sides: &[(usize, Vec<u32>)],
        rim: impl FnOnce(&[f64]) -> P,
    ) -> Option<()> {
        let length = |(part, side): &(usize, Vec<u32>)| -> Option<Vec<f64>> {
            let mut sums = vec![0.0];
            for pair in side.windows(2) {
                let [p, q] =
                    [self.local(*part, pair[0])?, self.local(*part, pair[1])?].map(|v| self.points[v as usize]);
                sums.push(sums[sums.len() - 1] + norm(sub(q, p)));
            }
            Some(sums)
        };
        let lengths: Vec<Vec<f64>> = sides.iter().map(length).collect::<Option<_>>()?;
        let whole: Vec<f64> = lengths.iter().map(|sums| sums[sums.len() - 1]).collect();
        let place = rim(&whole);
        let mut pinned = Vec::new();
        for (i, ((part, side), sums)) in sides.iter().zip(&lengths).enumerate() {
            for (vertex, sum) in side.iter().zip(sums).take(side.len() - 1) {
                pinned.push((self.local(*part, *vertex)?, place(i, sum / whole[i])));
            }
        }
        for &(vertex, place) in &pinned {
            self.uv[vertex as usize] = place;
            if std::mem::replace(&mut self.blocked[vertex as usize], true) {
                return None;
            }
        }
        let n = pinned.len();
        (0..n).for_each(|i| {
            self.walls.insert(edge(pinned[i].0, pinned[(i + 1) % n].0));
        });
        Some(())
    }

    /// Sides of all faces, those of an edge side by side.
    fn edges(&self) -> Vec<FaceSide> {
        let of_face = |(number, &face): (usize, &[u32; 3])| {
            sides(face).into_iter().enumerate().map(move |(k, side)| (side, [number as u32, k as u32]))
        };
        let mut edges: Vec<FaceSide> = self.faces.iter().enumerate().flat_map(of_face).collect();
        edges.sort_unstable();
        edges
    }

    /// Whether the rim is what is pinned, and the Euler number 1.
    fn is_disk(&self, edges: &[FaceSide]) -> bool {
        let (mut count, mut rim) = (0, 0);
        for uses in edges.chunk_by(|a, b| a.0 == b.0) {
            count += 1;
            match uses.len() {
                1 if self.walls.contains(&uses[0].0) => rim += 1,
                2 => {}
                _ => return false,
            }
        }
        rim == self.walls.len() && self.ids.len() as isize - count as isize + self.faces.len() as isize == 1
    }

    /// Free vertices to the weighted means of their neighbours.
    fn solve(&mut self, edges: &[FaceSide]) -> Option<()> {
        let half_cotangent = |[face, k]: [u32; 2]| {
            let [a, b, c] = [0, 1, 2].map(|i| self.faces[face as usize][(k as usize + i) % 3]);
            let [p, q, r] = [a, b, c].map(|v| self.points[v as usize]);
            let (x, y) = (sub(p, r), sub(q, r));
            let cotangent = dot(x, y) / norm(cross(x, y)).max(f64::MIN_POSITIVE);
            0.5 * cotangent.clamp(-1e3, 1e3)
        };
        let spring = |uses: &[FaceSide]| {
            let weight: f64 = uses.iter().map(|(_, side)| half_cotangent(*side)).sum();
            (uses[0].0, weight.clamp(WEIGHTS[0], WEIGHTS[1]))
        };
        let springs: Vec<([u32; 2], f64)> = edges.chunk_by(|a, b| a.0 == b.0).map(spring).collect();
        self.balance(&springs)
    }

    /// Moves free vertices to where the springs along edges are at rest.
    fn balance(&mut self, springs: &[([u32; 2], f64)]) -> Option<()> {
        let mut free = Vec::new();
        let mut row = vec![None; self.ids.len()];
        for vertex in (0..self.ids.len() as u32).filter(|&v| !self.is_blocked(v)) {
            row[vertex as usize] = Some(free.len() as u32);
            free.push(vertex);
        }
        if free.is_empty() {
            return Some(());
        }
        let mut right = Array2::zeros((free.len(), 2));
        // Rows that a spring joins, twice the same if only one end is free.
        let mut groups: Vec<[u32; 2]> = Vec::with_capacity(springs.len());
        let mut stiffness: Vec<f64> = Vec::with_capacity(springs.len());
        for &([a, b], weight) in springs {
            match (row[a as usize], row[b as usize]) {
                (Some(i), Some(j)) => groups.push(edge(i, j)),
                (Some(i), None) | (None, Some(i)) => {
                    let held = self.uv[if row[a as usize].is_none() { a } else { b } as usize];
                    (0..2).for_each(|d| right[[i as usize, d]] += weight * held[d]);
                    groups.push([i, i]);
                }
                (None, None) => continue,
            }
            stiffness.push(weight);
        }
        let rows = |group: &'_ [u32; 2]| if group[0] == group[1] { 1 } else { 2 };
        let pattern = SymmetricPattern::of_groups(free.len(), groups.len(), |g| &groups[g][..rows(&groups[g])]);
        let mut matrix = SymmetricMatrix::zeros(&pattern);
        for (group, &k) in groups.iter().zip(&stiffness) {
            let spring = [k, -k, -k, k];
            let n = rows(group);
            matrix.add_cell(&group[..n], &spring[..n * n]);
        }
        let mut solver = Cholesky::new(&pattern).ok()?;
        solver.factorize(&matrix).ok()?;
        let solution = solver.solve(&right).ok()?;
        for (row, &vertex) in free.iter().enumerate() {
            self.uv[vertex as usize] = [solution[[row, 0]], solution[[row, 1]]];
        }
        Some(())
    }

    fn is_one_to_one(&self) -> bool {
        self.faces.iter().all(|t| {
            let [p, q, r] = t.map(|v| self.uv[v as usize]);
            turn(minus(q, p), minus(r, p)) > 0.0
        })
    }

    fn add(&mut self, a: u32, b: u32, t: f64) -> u32 {
        let [p, q] = [a, b].map(|v| self.points[v as usize]);
        let [u, v] = [a, b].map(|v| self.uv[v as usize]);
        let mixed = [0, 1].map(|d| u[d] + t * (v[d] - u[d]));
        self.add_at(add(p, scale(t, sub(q, p))), mixed)
    }

    fn add_at(&mut self, point: [f64; 3], uv: [f64; 2]) -> u32 {
        let vertex = self.points.len() as u32;
        self.points.push(point);
        self.uv.push(uv);
        self.blocked.push(false);
        self.ids.push(self.next);
        self.next += 1;
        vertex
    }

    /// A vertex at a place of the map, or one near it.
    pub(super) fn vertex_at(&mut self, place: [f64; 2]) -> Option<u32> {
        let weights = |t: &[u32; 3]| {
            let [p, q, r] = t.map(|v| minus(self.uv[v as usize], place));
            let all = turn(minus(q, p), minus(r, p));
            [turn(q, r) / all, turn(r, p) / all, turn(p, q) / all]
        };
        let (face, w) = self.faces.iter().map(weights).enumerate().max_by(|(i, a), (j, b)| {
            let least = |w: &[f64; 3]| w.iter().copied().fold(f64::INFINITY, f64::min);
            least(a).total_cmp(&least(b)).then(j.cmp(i))
        })?;
        let corners = self.faces[face];
        for k in 0..3 {
            if w[k] > 0.7 && !self.is_blocked(corners[k]) {
                self.blocked[corners[k] as usize] = true;
                return Some(corners[k]);
            }
        }
        let w = w.map(|w| w.max(0.1));
        let all: f64 = w.iter().sum();
        let mut point = [0.0; 3];
        let mut uv = [0.0; 2];
        for k in 0..3 {
            point = add(point, scale(w[k] / all, self.points[corners[k] as usize]));
            (0..2).for_each(|d| uv[d] += w[k] / all * self.uv[corners[k] as usize][d]);
        }
        let [a, b, c] = corners;
        let m = self.add_at(point, uv);
        self.faces[face] = [a, b, m];
        self.faces.extend([[b, c, m], [c, a, m]]);
        self.blocked[m as usize] = true;
        Some(m)
    }

    /// Cuts along the line between two vertices: its vertices, in numbers here. None where another line is in the way.
    pub(super) fn cut(&mut self, from: u32, to: u32, snap: f64) -> Option<Vec<u32>> {
        let mut path = vec![from];
        let mut now = from;
        while now != to {
            if path.len() > self.faces.len() {
                return None;
            }
            now = self.step(now, to, snap, path.len() == 1)?;
            if now != to {
                self.blocked[now as usize] = true;
            }
            path.push(now);
        }
        path.windows(2).for_each(|pair| {
            self.walls.insert(edge(pair[0], pair[1]));
        });
        Some(path)
    }

    /// The next vertex on the way, a new one where an edge is crossed.
    fn step(&mut self, now: u32, to: u32, snap: f64, is_first: bool) -> Option<u32> {
        let at = self.uv[now as usize];
        let way = minus(self.uv[to as usize], at);
        let mut ahead: Option<(f64, usize, [u32; 2], f64)> = None;
        for (face, corners) in self.faces.iter().enumerate() {
            let Some(k) = corners.iter().position(|&v| v == now) else { continue };
            let (p, q) = (corners[(k + 1) % 3], corners[(k + 2) % 3]);
            // Beside a wall, such as the rim, `to` may be near without being the next on the way.
            if p == to || q == to {
                let is_wall = self.walls.contains(&edge(now, to));
                if !(is_wall && is_first) {
                    return (!is_wall).then_some(to);
                }
                continue;
            }
            let (left, right) = (turn(minus(self.uv[p as usize], at), way), turn(way, minus(self.uv[q as usize], at)));
            let best = left.min(right);
            if left + right > 0.0 && ahead.is_none_or(|(least, ..)| best > least) {
                ahead = Some((best, face, [p, q], left / (left + right)));
            }
        }
        let (_, face, [p, q], t) = ahead?;
        // The direction at the begin is that of the angle there.
        let snap = if is_first { snap.min(FIRST_SNAP) } else { snap };
        for (end, share) in [(p, t), (q, 1.0 - t)] {
            if share < snap && !self.is_blocked(end) {
                return Some(end);
            }
        }
        if self.walls.contains(&edge(p, q)) {
            return None;
        }
        let least = snap.min(0.02);
        let m = self.add(p, q, t.clamp(least, 1.0 - least));
        let other = self.faces.iter().position(|t| (0..3).any(|k| t[k] == q && t[(k + 1) % 3] == p))?;
        let r = *self.faces[other].iter().find(|&&v| v != p && v != q)?;
        self.faces[face] = [now, p, m];
        self.faces.push([now, m, q]);
        self.faces[other] = [q, m, r];
        self.faces.push([m, p, r]);
        Some(m)
    }

    /// Groups of faces that no line parts: of each face its group, and the number of groups.
    pub(super) fn groups(&self) -> (Vec<usize>, usize) {
        let mut sets = DisjointSets::new(self.faces.len());
        for uses in self.edges().chunk_by(|a, b| a.0 == b.0) {
            if let [(side, [a, _]), (_, [b, _])] = *uses
                && !self.walls.contains(&side)
            {
                sets.join(a, b);
            }
        }
        let mut number: BTreeMap<u32, usize> = BTreeMap::new();
        let of_face = |face: usize| {
            let count = number.len();
            *number.entry(sets.root(face as u32)).or_insert(count)
        };
        let group = (0..self.faces.len()).map(of_face).collect();
        (group, number.len())
    }

    /// The face to the left of an edge from `a` to `b`.
    pub(super) fn left_of(&self, a: u32, b: u32) -> Option<usize> {
        self.faces.iter().position(|t| (0..3).any(|k| t[k] == a && t[(k + 1) % 3] == b))
    }

    /// The points that were added, in the order of their numbers in the whole.
    pub(super) fn new_points(&self) -> &[[f64; 3]] {
        &self.points[self.given..]
    }

    /// Faces in numbers of the whole.
    pub(super) fn triangle(&self, face: usize) -> [u32; 3] {
        self.faces[face].map(|v| self.ids[v as usize])
    }

    /// A path in numbers of the whole.
    pub(super) fn whole(&self, path: &[u32]) -> Vec<u32> {
        path.iter().map(|&v| self.ids[v as usize]).collect()
    }
}
