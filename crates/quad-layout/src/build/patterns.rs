//! How a polygon is cut into patches of four sides, by lines between its vertices or from a vertex in the middle, and what that costs.

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

use point_cloud::vec3::{norm, sub};

use super::disk::Disk;
use super::mesh::angle_at;
use super::patchwork::{AHEAD, along, length};
use super::trace::Tracer;

/// Angles of corners, in radians, beyond which a pattern is all but forbidden: a margin within 25° and 155°.
const ANGLES: [f64; 2] = [0.61, 2.5];

/// Ratio of opposite sides below which it is.
const RATIO: f64 = 0.25;

/// What a broken rule costs, and how much more the farther.
pub(super) const BROKEN: f64 = 50.0;

/// What a polygon costs that has no cut.
///
/// Limit: more than any that has one.
const NO_CUT: f64 = 1e5;

/// What a patch costs.
///
/// Calibrated: against angles, of which one 30° off a right angle costs 0.27.
const PATCH: f64 = 0.8;

/// A polygon with all lines between its vertices that are straight in its map.
#[derive(Clone, Debug)]
pub(super) struct Polygon {
    /// Places of the vertices on the circle of the map, counter-clockwise.
    uv: Vec<[f64; 2]>,
    points: Vec<[f64; 3]>,
    /// For each two vertices the angle in space, at the first, from its side to the next vertex to the line to the second.
    turns: Vec<f64>,
    /// For each two vertices the length of the line between them; of neighbours, of the side.
    lengths: Vec<f64>,
}

/// How a polygon is cut: by lines between its vertices, and in some of the parts that they leave, from a vertex in the middle to every
/// second vertex of the part.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Cut {
    pub(super) lines: Vec<[usize; 2]>,
    /// Corners of parts of four sides, counter-clockwise.
    pub(super) quads: Vec<[usize; 4]>,
    /// The vertices of parts with a vertex in the middle, counter-clockwise from one that is joined.
    pub(super) stars: Vec<Vec<usize>>,
}

impl Cut {
    /// The same with other numbers of the vertices.
    fn numbered(self, number: &[usize]) -> Self {
        Self {
            lines: self.lines.into_iter().map(|line| line.map(|v| number[v])).collect(),
            quads: self.quads.into_iter().map(|quad| quad.map(|v| number[v])).collect(),
            stars: self.stars.into_iter().map(|star| star.into_iter().map(|v| number[v]).collect()).collect(),
        }
    }

    /// Number of patches.
    pub(super) fn len(&self) -> usize {
        self.quads.len() + self.stars.iter().map(|star| star.len() / 2).sum::<usize>()
    }
}

impl Polygon {
    /// The polygon of a disk with these sides, at whose begins it has these angles in space.
    pub(super) fn new(disk: &Disk, sides: &[Vec<u32>], angles: &[f64]) -> Option<Self> {
        let n = sides.len();
        let at: Vec<u32> = sides.iter().map(|side| disk.local(0, side[0])).collect::<Option<_>>()?;
        let rim: Vec<Vec<[f64; 3]>> = sides
            .iter()
            .map(|side| side.iter().map(|&v| Some(disk.points[disk.local(0, v)? as usize])).collect())
            .collect::<Option<_>>()?;
        let tracer = Tracer::new(disk);
        let mut lines: Vec<Vec<[f64; 3]>> = vec![Vec::new(); n * n];
        for i in 0..n {
            for j in i + 1..n {
                let line = if j == i + 1 {
                    rim[i].clone()
                } else if i == 0 && j == n - 1 {
                    rim[j].iter().rev().copied().collect()
                } else {
                    tracer.line(at[i], at[j])?
                };
                lines[j * n + i] = line.iter().rev().copied().collect();
                lines[i * n + j] = line;
            }
        }
        let ahead: Vec<[f64; 3]> =
            lines.iter().map(|line| if line.is_empty() { [0.0; 3] } else { along(line, AHEAD) }).collect();
        let points: Vec<[f64; 3]> = at.iter().map(|&v| disk.points[v as usize]).collect();
        let mut turns = vec![0.0; n * n];
        for i in 0..n {
            for step in 2..n {
                let [before, now] = [step - 1, step].map(|step| i * n + (i + step) % n);
                turns[now] = turns[before] + angle_at(points[i], ahead[before], ahead[now]);
            }
            let all = turns[i * n + (i + n - 1) % n].max(1e-9);
            turns[i * n..(i + 1) * n].iter_mut().for_each(|turn| *turn *= angles[i] / all);
        }
        let uv = at.iter().map(|&v| disk.uv[v as usize]).collect();
        Some(Self { uv, points, turns, lengths: lines.iter().map(|line| length(line)).collect() })
    }

    /// The polygon of some of its vertices, whose sides run along its own.
    fn of(&self, kept: &[usize]) -> Self {
        let (n, m) = (self.len(), kept.len());
        let pairs =
            |of: &[f64]| kept.iter().flat_map(|&i| kept.iter().map(move |&j| i * n + j)).map(|k| of[k]).collect();
        let mut part = Self {
            uv: kept.iter().map(|&i| self.uv[i]).collect(),
            points: kept.iter().map(|&i| self.points[i]).collect(),
            turns: pairs(&self.turns),
            lengths: pairs(&self.lengths),
        };
        for k in 0..m {
            let (i, next) = (kept[k], (k + 1) % m);
            let (mut v, mut side) = (i, 0.0);
            while v != kept[next] {
                side += self.lengths[v * n + (v + 1) % n];
                v = (v + 1) % n;
            }
            part.turns[k * m + next] = 0.0;
            part.turns[k * m + (k + m - 1) % m] = self.turns[i * n + (i + n - 1) % n];
            (part.lengths[k * m + next], part.lengths[next * m + k]) = (side, side);
        }
        part
    }

    /// The best cut with some of the vertices, and what it costs. Much for an odd number of them.
    pub(super) fn best_of(&self, kept: &[usize]) -> (f64, Cut) {
        let (cost, cut) = self.of(kept).best();
        (cost, cut.numbered(kept))
    }

    fn len(&self) -> usize {
        self.points.len()
    }

    /// The angle in space at a vertex, from the line to one to the line to another.
    fn angle(&self, at: usize, from: usize, to: usize) -> f64 {
        self.turns[at * self.len() + to] - self.turns[at * self.len() + from]
    }

    fn length(&self, a: usize, b: usize) -> f64 {
        self.lengths[a * self.len() + b]
    }

    fn quad(&self, v: [usize; 4]) -> f64 {
        let angle = |k: usize| self.angle(v[k], v[(k + 1) % 4], v[(k + 3) % 4]);
        let length = |k: usize| self.length(v[k], v[(k + 1) % 4]);
        cost(std::array::from_fn(angle), std::array::from_fn(length))
    }

    /// The turn of the line to a place in the map, between those to vertices on both sides of it.
    fn turn_to(&self, at: usize, place: [f64; 2]) -> f64 {
        let n = self.len();
        let first = self.uv[(at + 1) % n];
        let sought = turn_at(self.uv[at], first, place);
        let (mut before, mut reached) = (0.0, 0.0);
        for step in 2..n {
            let v = (at + step) % n;
            let (there, turn) = (turn_at(self.uv[at], first, self.uv[v]), self.turns[at * n + v]);
            if there >= sought {
                let share = (sought - before) / (there - before).max(1e-12);
                return reached + share.clamp(0.0, 1.0) * (turn - reached);
            }
            (before, reached) = (there, turn);
        }
        reached
    }

    /// The best cut and what it costs. Much for an odd number of vertices.
    pub(super) fn best(&self) -> (f64, Cut) {
        let n = self.len();
        let mut cut = Cut::default();
        if n % 2 == 1 || n < 4 {
            return (NO_CUT, cut);
        }
        let mut known = BTreeMap::new();
        let cost = self.part(0, n - 1, &mut known);
        self.collect((0, n - 1), &known, &mut cut);
        (cost, cut)
    }

    /// The cost of the part with vertices from `i` to `j`, closed by the line between them.
    fn part(&self, i: usize, j: usize, known: &mut BTreeMap<(usize, usize), (f64, Choice)>) -> f64 {
        if j - i < 3 {
            return if j - i == 1 { 0.0 } else { NO_CUT };
        }
        if let Some((cost, _)) = known.get(&(i, j)) {
            return *cost;
        }
        let mut best = (NO_CUT, Choice::Quad(i, j));
        for a in (i + 1..j).step_by(2) {
            for b in (a + 1..j).step_by(2) {
                let quad = self.quad([i, a, b, j]);
                if quad < best.0 {
                    let cost = quad + self.part(i, a, known) + self.part(a, b, known) + self.part(b, j, known);
                    if cost < best.0 {
                        best = (cost, Choice::Quad(a, b));
                    }
                }
            }
        }
        if j - i >= 5 {
            for first in 0..2 {
                let cost = self.star(&star_vertices(i, j, first));
                if cost < best.0 {
                    best = (cost, Choice::Star(first));
                }
            }
        }
        known.insert((i, j), best);
        best.0
    }

    /// Patches from a vertex in the middle to every second vertex.
    fn star(&self, v: &[usize]) -> f64 {
        let n = v.len();
        let joined: Vec<usize> = v.iter().copied().step_by(2).collect();
        let centre = middle(joined.iter().map(|&v| self.uv[v]));
        let in_space = middle3(joined.iter().map(|&v| self.points[v]));
        let mut sum = 0.0;
        for k in (0..n).step_by(2) {
            let [a, b, c] = [0, 1, 2].map(|i| v[(k + i) % n]);
            let at_centre = turn_at(centre, self.uv[a], self.uv[c]);
            let own = self.len();
            let at_a = self.turn_to(a, centre) - self.turns[a * own + b];
            let at_c = self.turns[c * own + b] - self.turn_to(c, centre);
            let angles = [at_centre, at_a, self.angle(b, c, a), at_c];
            let spoke = |v: usize| norm(sub(self.points[v], in_space));
            sum += cost(angles, [spoke(a), self.length(a, b), self.length(b, c), spoke(c)]);
        }
        sum
    }

    fn collect(&self, (i, j): (usize, usize), known: &BTreeMap<(usize, usize), (f64, Choice)>, cut: &mut Cut) {
        let Some((_, choice)) = known.get(&(i, j)) else { return };
        match *choice {
            Choice::Star(first) => cut.stars.push(star_vertices(i, j, first)),
            Choice::Quad(a, b) => {
                cut.quads.push([i, a, b, j]);
                for (p, q) in [(i, a), (a, b), (b, j)] {
                    if q - p > 1 {
                        cut.lines.push([p, q]);
                        self.collect((p, q), known, cut);
                    }
                }
            }
        }
    }
}

#[derive(Clone, Copy, Debug)]
enum Choice {
    /// The patch at the closing line has these two other vertices.
    Quad(usize, usize),
    /// A star that joins vertices from this one on.
    Star(usize),
}

/// Vertices of a part, beginning with one that is joined.
fn star_vertices(i: usize, j: usize, first: usize) -> Vec<usize> {
    let mut v: Vec<usize> = (i..=j).collect();
    v.rotate_left(first);
    v
}

/// The turn from the direction to `from` to that to `to`, counter-clockwise, from 0 to 2π.
fn turn_at(at: [f64; 2], from: [f64; 2], to: [f64; 2]) -> f64 {
    let angle = |p: [f64; 2]| (p[1] - at[1]).atan2(p[0] - at[0]);
    (angle(to) - angle(from)).rem_euclid(TAU)
}

fn middle(places: impl ExactSizeIterator<Item = [f64; 2]>) -> [f64; 2] {
    let n = places.len() as f64;
    places.fold([0.0; 2], |sum, p| [sum[0] + p[0] / n, sum[1] + p[1] / n])
}

fn middle3(points: impl ExactSizeIterator<Item = [f64; 3]>) -> [f64; 3] {
    let n = points.len() as f64;
    points.fold([0.0; 3], |sum, p| std::array::from_fn(|k| sum[k] + p[k] / n))
}

/// What any cut of a polygon with these angles costs at least: the fewest patches, and angles shared out evenly.
pub(super) fn cost_at_least(angles: &[f64]) -> f64 {
    let shared = |angle: f64, among: f64| among * (angle / among - 0.5 * PI).powi(2);
    let least = |&angle: &f64| (1..=4).map(|among| shared(angle, f64::from(among))).fold(f64::INFINITY, f64::min);
    PATCH * (0.5 * angles.len() as f64 - 1.0) + angles.iter().map(least).sum::<f64>()
}

/// What a patch with these corners and sides costs.
pub(super) fn cost(angles: [f64; 4], lengths: [f64; 4]) -> f64 {
    let mut sum = PATCH;
    for angle in angles {
        sum += (angle - 0.5 * PI).powi(2);
        let beyond = (ANGLES[0] - angle).max(angle - ANGLES[1]);
        if beyond > 0.0 {
            sum += BROKEN * (1.0 + beyond);
        }
    }
    for (a, b) in [(lengths[0], lengths[2]), (lengths[1], lengths[3])] {
        let ratio = a.min(b) / a.max(b).max(f64::MIN_POSITIVE);
        sum += 0.3 * ratio.max(1e-3).ln().powi(2);
        if ratio < RATIO {
            sum += BROKEN * (1.0 - ratio);
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An even polygon of radius 1, with these angles in space: lines fan out evenly at each vertex, as angles over equal arcs do.
    fn even(angles: &[f64]) -> Polygon {
        let n = angles.len();
        let uv: Vec<[f64; 2]> =
            (0..n).map(|i| (TAU * i as f64 / n as f64).sin_cos()).map(|(sin, cos)| [cos, sin]).collect();
        let points: Vec<[f64; 3]> = uv.iter().map(|[x, y]| [*x, *y, 0.0]).collect();
        let step = |i: usize, j: usize| (n + j - i) % n;
        let pairs = || (0..n * n).map(|k| (k / n, k % n));
        let turn = |(i, j)| angles[i] * (step(i, j).max(1) - 1) as f64 / (n - 2) as f64;
        let length = |(i, j): (usize, usize)| norm(sub(points[i], points[j]));
        Polygon { turns: pairs().map(turn).collect(), lengths: pairs().map(length).collect(), uv, points }
    }

    fn regular(n: usize) -> Polygon {
        even(&vec![PI - TAU / n as f64; n])
    }

    #[test]
    fn even_polygons_are_cut_into_the_fewest_patches_with_good_corners() {
        assert_eq!(regular(4).best().1, Cut { quads: vec![[0, 1, 2, 3]], ..Cut::default() });
        let (cost, cut) = regular(6).best();
        assert!(cut.lines.len() == 1 && cut.stars.is_empty(), "{cut:?}");
        assert!(cost < BROKEN);
        assert_eq!(regular(5).best().0, NO_CUT);
    }

    /// Without the middles of the sides of a hexagon's halves, its angles are those of the hexagon.
    #[test]
    fn vertices_that_are_left_out_leave_sides_along_the_rim() {
        let all = even(&[2.0, PI, 2.0, PI, 2.0, PI, 2.0, PI]);
        let (cost, cut) = all.best_of(&[0, 2, 4, 6]);
        assert_eq!(cut, Cut { quads: vec![[0, 2, 4, 6]], ..Cut::default() });
        assert!((cost - PATCH - 4.0 * (2.0 - 0.5 * PI).powi(2)).abs() < 1e-12, "{cost}");
        assert!(cost >= cost_at_least(&[2.0; 4]) - 1e-12);
    }

    /// A triangle with the middles of its sides: only a vertex in its middle gives three patches.
    #[test]
    fn a_triangle_with_halved_sides_gets_a_vertex_in_the_middle() {
        let polygon = even(&[PI / 3.0, PI, PI / 3.0, PI, PI / 3.0, PI]);
        let (cost, cut) = polygon.best();
        assert_eq!(cut, Cut { stars: vec![vec![1, 2, 3, 4, 5, 0]], ..Cut::default() });
        assert!(cost < BROKEN, "{cost}");
    }
}
