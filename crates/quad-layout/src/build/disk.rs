//! A disk of triangles, mapped one to one onto a round disk, and cut along straight lines there.
//!
//! The map has positive weights and a circle as its rim, so it folds nowhere (Tutte 1963; Floater 2003). A line that is straight in it
//! stays inside and crosses no other line from end to end twice. Edges that it crosses are halved there.

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::TAU;

use fit_ls::Cholesky;
use ndarray::Array2;
use point_cloud::vec3::{add, cross, dot, norm, scale, sub};
use thb_core::{SymmetricMatrix, SymmetricPattern};

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
    blocked: BTreeSet<u32>,
    /// Edges that lines must not cross.
    walls: BTreeSet<[u32; 2]>,
    next: u32,
    /// Number of vertices that it was made of.
    given: usize,
    local: BTreeMap<(usize, u32), u32>,
}

fn turn(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

fn minus(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

fn root(parent: &BTreeMap<(usize, u32), (usize, u32)>, mut at: (usize, u32)) -> Option<(usize, u32)> {
    loop {
        let next = *parent.get(&at)?;
        if next == at {
            return Some(at);
        }
        at = next;
    }
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
        let mut local: BTreeMap<(usize, u32), (usize, u32)> = BTreeMap::new();
        for (part, faces) in parts.iter().enumerate() {
            local.extend(faces.iter().flatten().map(|&v| ((part, v), (part, v))));
        }
        for ([a, b], seam) in seams {
            for &vertex in seam {
                let (p, q) = (root(&local, (*a, vertex))?, root(&local, (*b, vertex))?);
                local.insert(p.max(q), p.min(q));
            }
        }
        let keys: Vec<(usize, u32)> = local.keys().copied().collect();
        let mut number = BTreeMap::new();
        let mut ids = Vec::new();
        for &key in keys.iter().filter(|key| local[key] == **key) {
            number.insert(key, ids.len() as u32);
            ids.push(key.1);
        }
        let local: BTreeMap<(usize, u32), u32> =
            keys.iter().map(|&key| Some((key, number[&root(&local, key)?]))).collect::<Option<_>>()?;
        let faces = parts.iter().enumerate();
        let faces = faces.flat_map(|(part, faces)| faces.iter().map(move |t| t.map(|v| (part, v))));
        let mut disk = Self {
            points: ids.iter().map(|&v| points[v as usize]).collect(),
            faces: faces.map(|t| t.map(|key| local[&key])).collect(),
            uv: vec![[0.0; 2]; ids.len()],
            blocked: BTreeSet::new(),
            walls: BTreeSet::new(),
            next: points.len() as u32,
            given: ids.len(),
            ids,
            local,
        };
        disk.pin(sides)?;
        disk.is_disk().then_some(())?;
        disk.solve()?;
        disk.is_one_to_one().then_some(disk)
    }

    /// The number here of a vertex of a part.
    pub(super) fn local(&self, part: usize, vertex: u32) -> Option<u32> {
        self.local.get(&(part, vertex)).copied()
    }

    fn pin(&mut self, sides: &[(usize, Vec<u32>)]) -> Option<()> {
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
        let starts = turns(&whole);
        let mut pinned = Vec::new();
        for (i, ((part, side), sums)) in sides.iter().zip(&lengths).enumerate() {
            let share = starts.get(i + 1).copied().unwrap_or(TAU) - starts[i];
            for (vertex, sum) in side.iter().zip(sums).take(side.len() - 1) {
                let (sin, cos) = (starts[i] + share * sum / whole[i]).sin_cos();
                pinned.push((self.local(*part, *vertex)?, [cos, sin]));
            }
        }
        for &(vertex, place) in &pinned {
            self.uv[vertex as usize] = place;
            self.blocked.insert(vertex);
        }
        let n = pinned.len();
        (0..n).for_each(|i| {
            self.walls.insert(edge(pinned[i].0, pinned[(i + 1) % n].0));
        });
        (self.blocked.len() == n).then_some(())
    }

    /// Whether the rim is what is pinned, and the Euler number 1.
    fn is_disk(&self) -> bool {
        let mut uses: BTreeMap<[u32; 2], usize> = BTreeMap::new();
        self.faces.iter().flat_map(|&face| sides(face)).for_each(|side| *uses.entry(side).or_default() += 1);
        let euler = self.ids.len() as isize - uses.len() as isize + self.faces.len() as isize;
        euler == 1
            && uses.values().all(|uses| *uses <= 2)
            && uses.iter().all(|(side, uses)| (*uses == 1) == self.walls.contains(side))
    }

    /// Free vertices to the weighted means of their neighbours.
    fn solve(&mut self) -> Option<()> {
        let mut weights: BTreeMap<[u32; 2], f64> = BTreeMap::new();
        for &face in &self.faces {
            for k in 0..3 {
                let [a, b, c] = [0, 1, 2].map(|i| face[(k + i) % 3]);
                let [p, q, r] = [a, b, c].map(|v| self.points[v as usize]);
                let (x, y) = (sub(p, r), sub(q, r));
                let cotangent = dot(x, y) / norm(cross(x, y)).max(f64::MIN_POSITIVE);
                *weights.entry(edge(a, b)).or_default() += 0.5 * cotangent.clamp(-1e3, 1e3);
            }
        }
        self.balance(weights.into_iter().map(|(ends, weight)| (ends, weight.clamp(WEIGHTS[0], WEIGHTS[1]))))
    }

    /// Moves free vertices to where the springs along edges are at rest.
    fn balance(&mut self, springs: impl Iterator<Item = ([u32; 2], f64)>) -> Option<()> {
        let mut free = Vec::new();
        let mut row = vec![None; self.ids.len()];
        for vertex in (0..self.ids.len() as u32).filter(|v| !self.blocked.contains(v)) {
            row[vertex as usize] = Some(free.len() as u32);
            free.push(vertex);
        }
        if free.is_empty() {
            return Some(());
        }
        let mut right = Array2::zeros((free.len(), 2));
        let mut groups: Vec<Vec<u32>> = Vec::new();
        let mut stiffness: Vec<f64> = Vec::new();
        for ([a, b], weight) in springs {
            match (row[a as usize], row[b as usize]) {
                (Some(i), Some(j)) => {
                    groups.push(vec![i.min(j), i.max(j)]);
                    stiffness.push(weight);
                }
                (Some(i), None) | (None, Some(i)) => {
                    let held = self.uv[if row[a as usize].is_none() { a } else { b } as usize];
                    (0..2).for_each(|d| right[[i as usize, d]] += weight * held[d]);
                    groups.push(vec![i]);
                    stiffness.push(weight);
                }
                (None, None) => {}
            }
        }
        let pattern = SymmetricPattern::of_groups(free.len(), groups.len(), |group| &groups[group]);
        let mut matrix = SymmetricMatrix::zeros(&pattern);
        for (group, &k) in groups.iter().zip(&stiffness) {
            let spring = [k, -k, -k, k];
            matrix.add_cell(group, if group.len() == 1 { &spring[..1] } else { &spring });
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
            if w[k] > 0.7 && !self.blocked.contains(&corners[k]) {
                self.blocked.insert(corners[k]);
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
        self.blocked.insert(m);
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
                self.blocked.insert(now);
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
            if share < snap && !self.blocked.contains(&end) {
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
        let mut beside: BTreeMap<[u32; 2], Vec<usize>> = BTreeMap::new();
        for (face, &corners) in self.faces.iter().enumerate() {
            for side in sides(corners) {
                if !self.walls.contains(&side) {
                    beside.entry(side).or_default().push(face);
                }
            }
        }
        let mut group = vec![usize::MAX; self.faces.len()];
        let mut count = 0;
        for start in 0..self.faces.len() {
            if group[start] != usize::MAX {
                continue;
            }
            group[start] = count;
            let mut stack = vec![start];
            while let Some(face) = stack.pop() {
                for side in sides(self.faces[face]) {
                    for &next in beside.get(&side).into_iter().flatten() {
                        if group[next] == usize::MAX {
                            group[next] = count;
                            stack.push(next);
                        }
                    }
                }
            }
            count += 1;
        }
        (group, count)
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

/// Follows straight lines of the map without cutting.
pub(super) struct Tracer<'a> {
    disk: &'a Disk,
    /// The face to the left of each half-edge, with its third vertex.
    left: BTreeMap<(u32, u32), u32>,
    /// The other two vertices of the faces at each vertex of the rim, counter-clockwise.
    at: BTreeMap<u32, Vec<[u32; 2]>>,
}

impl<'a> Tracer<'a> {
    pub(super) fn new(disk: &'a Disk) -> Self {
        let mut left = BTreeMap::new();
        let mut at: BTreeMap<u32, Vec<[u32; 2]>> = BTreeMap::new();
        for &face in &disk.faces {
            for k in 0..3 {
                let [a, b, c] = [0, 1, 2].map(|i| face[(k + i) % 3]);
                left.insert((a, b), c);
                if disk.blocked.contains(&a) {
                    at.entry(a).or_default().push([b, c]);
                }
            }
        }
        Self { disk, left, at }
    }

    /// The line between two vertices of the rim, in space.
    pub(super) fn line(&self, from: u32, to: u32) -> Option<Vec<[f64; 3]>> {
        let (uv, points) = (&self.disk.uv, &self.disk.points);
        let start = uv[from as usize];
        let way = minus(uv[to as usize], start);
        let off = |v: u32| turn(way, minus(uv[v as usize], start));
        let ends = [points[from as usize], points[to as usize]];
        let beside = self.at.get(&from)?;
        if beside.iter().any(|pair| pair.contains(&to)) {
            return Some(ends.to_vec());
        }
        let clear = |pair: &[u32; 2]| (-off(pair[0])).min(off(pair[1]));
        let ahead = |pair: &&[u32; 2]| off(pair[1]) > off(pair[0]);
        let &[mut right, mut left] = beside.iter().filter(ahead).max_by(|a, b| clear(a).total_cmp(&clear(b)))?;
        let mut line = vec![ends[0]];
        for _ in 0..self.disk.faces.len() {
            let (r, l) = (off(right).abs(), off(left).abs());
            let [p, q] = [right, left].map(|v| points[v as usize]);
            line.push(add(p, scale(r / (r + l).max(f64::MIN_POSITIVE), sub(q, p))));
            let third = *self.left.get(&(left, right))?;
            if third == to {
                line.push(ends[1]);
                return Some(line);
            }
            *(if off(third) > 0.0 { &mut left } else { &mut right }) = third;
        }
        None
    }
}
