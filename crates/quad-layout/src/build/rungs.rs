//! Narrow faces between two creases: crossings of one are put across from those of the other, and what lies between two such pairs becomes
//! one region. Regions of both creases would meet halfway, at flat angles.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, BinaryHeap, VecDeque};

use point_cloud::vec3::{norm, sub};

use super::lines::{Line, Lines, sectors};
use super::mesh::{Neighbours, WorkMesh};

/// Widest face that counts as narrow, as a share of the spacing of crossings.
///
/// Limit: tried on eleven parts with creases at this value only.
const NARROW: f64 = 0.7;

/// How far, in widths, a crossing across may be off, and how much longer a way along edges is than a straight one.
const OFF: f64 = 0.6;
const DETOUR: f64 = 1.35;

/// Nearest crossings of a line, as a share of their spacing, unless two faces ask for both.
const NEAREST: f64 = 0.2;

/// Distance of a crease's end, in widths, up to which another crease that begins there is none across.
const CORNER: f64 = 2.0;

/// Crossings of a closed crease, at least.
const ROUND: f64 = 4.0;

/// What lies across a face from a vertex on a crease.
struct Across {
    line: usize,
    /// Place in its path.
    at: usize,
    width: f64,
    /// Whether the face lies to the left of that line.
    is_left: bool,
}

/// A mesh with its creases.
struct Search<'a> {
    mesh: &'a WorkMesh,
    neighbours: &'a Neighbours,
    lines: &'a [Line],
    /// Line and place of each vertex inside a line.
    place: BTreeMap<u32, (usize, usize)>,
    beside: Vec<Vec<u32>>,
    reach: f64,
}

/// Places of crossings on all lines, as vertices: evenly along each, longer ones first, and across from those of others.
pub(super) fn crossings(mesh: &WorkMesh, neighbours: &Neighbours, lines: &Lines, spacing: f64) -> BTreeSet<u32> {
    let search = Search::new(mesh, neighbours, &lines.lines, spacing);
    let lengths: Vec<Vec<f64>> = lines.lines.iter().map(|line| line.lengths(mesh)).collect();
    let total = |line: usize| lengths[line][lengths[line].len() - 1];
    let mut order: Vec<usize> = (0..lines.lines.len()).collect();
    order.sort_by(|&a, &b| total(b).total_cmp(&total(a)).then(a.cmp(&b)));
    let mut at: Vec<BTreeSet<usize>> = vec![BTreeSet::new(); lines.lines.len()];
    for line in order {
        let mut queue: VecDeque<(usize, usize)> = VecDeque::new();
        for place in filled(&lines.lines[line], &lengths[line], &at[line], spacing) {
            at[line].insert(place);
            queue.push_back((line, place));
        }
        while let Some((line, place)) = queue.pop_front() {
            for is_left in [true, false] {
                let Some(across) = search.across(line, place, is_left) else { continue };
                let (other, along) = (across.line, &lengths[across.line]);
                let ends = (!lines.lines[other].is_closed).then_some([0, along.len() - 1]);
                let known = at[other].iter().copied().chain(ends.into_iter().flatten());
                let near = known.map(|p| apart(&lines.lines[other], along, p, across.at)).fold(f64::INFINITY, f64::min);
                if near > (OFF * across.width).max(NEAREST * spacing) {
                    at[other].insert(across.at);
                    queue.push_back((other, across.at));
                }
            }
        }
    }
    let vertices = at.iter().enumerate().flat_map(|(line, at)| at.iter().map(move |&p| (line, p)));
    vertices.map(|(line, p)| lines.lines[line].path[p]).collect()
}

/// Pairs of half-edges, each to the left of which lies the same narrow face between two crossings of either line.
pub(super) fn joined(mesh: &WorkMesh, neighbours: &Neighbours, lines: &Lines, spacing: f64) -> Vec<[(u32, u32); 2]> {
    let search = Search::new(mesh, neighbours, &lines.lines, spacing);
    // The crossing across from each, with its line and side.
    let mut partner: BTreeMap<(usize, usize, bool), (usize, usize, bool)> = BTreeMap::new();
    for (number, line) in lines.lines.iter().enumerate() {
        for &place in &line.crossings {
            for is_left in [true, false] {
                let Some(across) = search.across(number, place, is_left) else { continue };
                let other = &lines.lines[across.line];
                let along = other.lengths(mesh);
                let off = |p: &usize| apart(other, &along, *p, across.at);
                let nearest = other.crossings.iter().copied().min_by(|a, b| off(a).total_cmp(&off(b)));
                if let Some(nearest) = nearest.filter(|p| off(p) <= OFF * across.width) {
                    partner.insert((number, place, is_left), (across.line, nearest, across.is_left));
                }
            }
        }
    }
    let mut joined = Vec::new();
    for (number, line) in lines.lines.iter().enumerate() {
        let ends = line.ends();
        for pair in ends.windows(2) {
            for is_left in [true, false] {
                // The last place of a closed line is its first.
                let closing = |p: usize| if line.is_closed && p + 1 == line.path.len() { 0 } else { p };
                let [a, b] = [pair[0], closing(pair[1])].map(|p| partner.get(&(number, p, is_left)));
                if let (Some(a), Some(b)) = (a, b)
                    && a.0 == b.0
                    && a.2 == b.2
                    && let Some(half_edge) = between(&lines.lines[a.0], a.1, b.1, a.2)
                {
                    joined.push([half_edge_at(line, pair[0], is_left), half_edge]);
                }
            }
        }
    }
    joined
}

/// The half-edge of the interval between two neighbouring crossings of a line.
fn between(line: &Line, a: usize, b: usize, is_left: bool) -> Option<(u32, u32)> {
    let ends = line.ends();
    let closing = |p: usize| if line.is_closed && p + 1 == line.path.len() { 0 } else { p };
    let pair = ends.windows(2).find(|pair| {
        let (p, q) = (pair[0], closing(pair[1]));
        (p, q) == (a, b) || (p, q) == (b, a)
    })?;
    Some(half_edge_at(line, pair[0], is_left))
}

fn half_edge_at(line: &Line, place: usize, is_left: bool) -> (u32, u32) {
    let (a, b) = (line.path[place], line.path[place + 1]);
    if is_left { (a, b) } else { (b, a) }
}

/// Distance of two places along a line.
fn apart(line: &Line, lengths: &[f64], p: usize, q: usize) -> f64 {
    let direct = (lengths[p] - lengths[q]).abs();
    if line.is_closed { direct.min(lengths[lengths.len() - 1] - direct) } else { direct }
}

/// Places to be added to those that a line has.
fn filled(line: &Line, lengths: &[f64], has: &BTreeSet<usize>, spacing: f64) -> Vec<usize> {
    let end = lengths.len() - 1;
    let total = lengths[end];
    let mut ends: Vec<usize> = has.iter().copied().collect();
    let mut added = Vec::new();
    if line.is_closed {
        // A closed line begins at a crossing.
        if !has.contains(&0) {
            ends.insert(0, 0);
            added.push(0);
        }
    } else {
        ends.insert(0, 0);
    }
    ends.push(end);
    for pair in ends.windows(2) {
        let gap = lengths[pair[1]] - lengths[pair[0]];
        let least = if line.is_closed { (ROUND * gap / total - 0.3).ceil().max(1.0) } else { 1.0 };
        let parts = (gap / spacing).round().max(least) as usize;
        for i in 1..parts {
            let t = lengths[pair[0]] + gap * i as f64 / parts as f64;
            let after = lengths.partition_point(|&l| l < t).clamp(pair[0] + 1, pair[1]);
            let at = if t - lengths[after - 1] < lengths[after] - t { after - 1 } else { after };
            if at > pair[0] && at < pair[1] && !added.contains(&at) {
                added.push(at);
            }
        }
    }
    added
}

impl<'a> Search<'a> {
    fn new(mesh: &'a WorkMesh, neighbours: &'a Neighbours, lines: &'a [Line], spacing: f64) -> Self {
        let mut place = BTreeMap::new();
        for (number, line) in lines.iter().enumerate() {
            let inner = if line.is_closed { 0..line.path.len() - 1 } else { 1..line.path.len() - 1 };
            inner.for_each(|at| {
                place.insert(line.path[at], (number, at));
            });
        }
        let mut beside = vec![Vec::new(); mesh.points.len()];
        for [a, b, c] in &mesh.faces {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                beside[*from as usize].push(*to);
            }
        }
        Self { mesh, neighbours, lines, place, beside, reach: NARROW * spacing }
    }

    /// What lies across the face on a side of a line.
    fn across(&self, number: usize, at: usize, is_left: bool) -> Option<Across> {
        let line = &self.lines[number];
        let vertex = line.path[at];
        let next = *line.path.get(at + 1)?;
        let sectors = sectors(self.mesh, self.neighbours, vertex);
        let begins_at = |first: &(u32, usize)| self.mesh.faces[first.0 as usize][(first.1 + 1) % 3];
        let sector = sectors.iter().find(|sector| (begins_at(&sector.faces[0]) == next) == is_left)?;
        let from = self.mesh.points[vertex as usize];
        let mut heap = BinaryHeap::new();
        let mut reached: BTreeMap<u32, f64> = BTreeMap::new();
        let mut best: Option<(f64, u32, u32)> = None;
        for &(face, k) in sector.faces.iter().skip(1) {
            let to = self.mesh.faces[face as usize][(k + 1) % 3];
            heap.push(Reverse((self.mesh.length(vertex, to).to_bits(), to, vertex)));
        }
        while let Some(Reverse((bits, now, before))) = heap.pop() {
            let far = f64::from_bits(bits);
            if best.is_some_and(|(width, ..)| far > DETOUR * width) {
                break;
            }
            if far > DETOUR * self.reach || reached.contains_key(&now) || now == vertex {
                continue;
            }
            reached.insert(now, far);
            if let Some(&(other, _)) = self.place.get(&now) {
                let width = norm(sub(self.mesh.points[now as usize], from));
                if self.is_across(number, other, vertex, width) && best.is_none_or(|(least, ..)| width < least) {
                    best = Some((width, now, before));
                }
                continue;
            }
            if self.lines.iter().any(|line| line.path[0] == now || line.path[line.path.len() - 1] == now) {
                continue;
            }
            for &to in &self.beside[now as usize] {
                heap.push(Reverse(((far + self.mesh.length(now, to)).to_bits(), to, now)));
            }
        }
        let (width, found, before) = best.filter(|(width, ..)| *width < self.reach)?;
        let (other, at) = self.place[&found];
        let next = self.lines[other].path[at + 1];
        let of_found = super::lines::sectors(self.mesh, self.neighbours, found);
        let arrived = of_found
            .iter()
            .find(|sector| sector.faces.iter().any(|&(face, _)| self.mesh.faces[face as usize].contains(&before)))?;
        Some(Across { line: other, at, width, is_left: begins_at(&arrived.faces[0]) == next })
    }

    /// Whether a line is across from a vertex of another, and not just beyond a corner that both end in.
    fn is_across(&self, from: usize, to: usize, vertex: u32, width: f64) -> bool {
        let ends = |line: usize| {
            let line = &self.lines[line];
            if line.is_closed { Vec::new() } else { vec![line.path[0], line.path[line.path.len() - 1]] }
        };
        let shared: Vec<u32> = ends(from).into_iter().filter(|end| ends(to).contains(end)).collect();
        from != to && shared.iter().all(|&corner| self.mesh.length(corner, vertex) > CORNER * width)
    }
}
