//! How a polygon is cut into patches of four sides, by lines between its vertices or from a vertex in the middle, and what that costs.

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

use point_cloud::vec3::{norm, sub};

/// Angles of corners, in radians, beyond which a pattern is all but forbidden: a margin within 25° and 155°.
const ANGLES: [f64; 2] = [0.61, 2.5];

/// Ratio of opposite sides below which it is.
const RATIO: f64 = 0.25;

/// What a broken rule costs, and how much more the farther.
const BROKEN: f64 = 50.0;

/// What a patch costs.
///
/// Calibrated: against angles, of which one 30° off a right angle costs 0.27.
const PATCH: f64 = 0.8;

/// A polygon with vertices on the unit circle, at which it has angles in space.
#[derive(Clone, Debug)]
pub(super) struct Polygon {
    /// Places on a circle, counter-clockwise.
    pub(super) uv: Vec<[f64; 2]>,
    /// In space.
    pub(super) points: Vec<[f64; 3]>,
    /// Angles in space.
    pub(super) angles: Vec<f64>,
    /// Lengths of the sides, from each vertex to the next.
    pub(super) lengths: Vec<f64>,
}

/// How a polygon is cut: by lines between its vertices, and in some of the parts that they leave, from a vertex in the middle to every
/// second vertex of the part. Parts without one have four sides.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Cut {
    pub(super) lines: Vec<[usize; 2]>,
    /// The vertices of such parts, beginning with one that is joined.
    pub(super) stars: Vec<Vec<usize>>,
}

impl Polygon {
    fn len(&self) -> usize {
        self.points.len()
    }

    /// The angle in space between the directions from vertex `at` to two places of the circle, as far as the angle there has been
    /// spread over the polygon's own.
    fn angle(&self, at: usize, from: [f64; 2], to: [f64; 2]) -> f64 {
        let n = self.len();
        let own = turn_at(self.uv[at], self.uv[(at + 1) % n], self.uv[(at + n - 1) % n]);
        let part = turn_at(self.uv[at], from, to);
        self.angles[at] * (part / own.max(1e-9)).min(1.0)
    }

    /// Length between two vertices along the border or through the inside.
    fn length(&self, a: usize, b: usize) -> f64 {
        let n = self.len();
        if (a + 1) % n == b {
            self.lengths[a]
        } else if (b + 1) % n == a {
            self.lengths[b]
        } else {
            norm(sub(self.points[a], self.points[b]))
        }
    }

    /// Directions from each vertex to each, and the vertex's own angle.
    fn directions(&self) -> Directions {
        let n = self.len();
        let direction = |i: usize| {
            let (p, q) = (self.uv[i / n], self.uv[i % n]);
            (q[1] - p[1]).atan2(q[0] - p[0])
        };
        let own = |at: usize| turn_at(self.uv[at], self.uv[(at + 1) % n], self.uv[(at + n - 1) % n]).max(1e-9);
        Directions { n, all: (0..n * n).map(direction).collect(), own: (0..n).map(own).collect() }
    }

    fn quad(&self, v: [usize; 4], to: &Directions) -> f64 {
        let angle = |k: usize| {
            let (at, next, before) = (v[k], v[(k + 1) % 4], v[(k + 3) % 4]);
            let part = (to.all[at * to.n + before] - to.all[at * to.n + next]).rem_euclid(TAU);
            self.angles[at] * (part / to.own[at]).min(1.0)
        };
        let length = |k: usize| self.length(v[k], v[(k + 1) % 4]);
        cost(std::array::from_fn(angle), std::array::from_fn(length))
    }

    /// The best cut and what it costs. Infinite for an odd number of vertices.
    pub(super) fn best(&self) -> (f64, Cut) {
        let n = self.len();
        if n % 2 == 1 || n < 4 {
            return (f64::INFINITY, Cut::default());
        }
        let mut known = BTreeMap::new();
        let cost = self.part(0, n - 1, &self.directions(), &mut known);
        let mut cut = Cut::default();
        self.collect((0, n - 1), &known, &mut cut);
        (cost, cut)
    }

    /// The cost of the part with vertices from `i` to `j`, closed by the line between them.
    fn part(&self, i: usize, j: usize, to: &Directions, known: &mut BTreeMap<(usize, usize), (f64, Choice)>) -> f64 {
        if j - i < 3 {
            return if j - i == 1 { 0.0 } else { f64::INFINITY };
        }
        if let Some((cost, _)) = known.get(&(i, j)) {
            return *cost;
        }
        let mut best = (f64::INFINITY, Choice::Quad(i, j));
        for a in (i + 1..j).step_by(2) {
            for b in (a + 1..j).step_by(2) {
                let quad = self.quad([i, a, b, j], to);
                if quad < best.0 {
                    let cost =
                        quad + self.part(i, a, to, known) + self.part(a, b, to, known) + self.part(b, j, to, known);
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
            let [ua, ub, uc] = [a, b, c].map(|v| self.uv[v]);
            let at_centre = turn_at(centre, ua, uc);
            let angles = [at_centre, self.angle(a, ub, centre), self.angle(b, uc, ua), self.angle(c, centre, ub)];
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

/// Directions between the vertices of a polygon in the plane.
struct Directions {
    n: usize,
    all: Vec<f64>,
    own: Vec<f64>,
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

/// What a patch with these corners and sides costs.
fn cost(angles: [f64; 4], lengths: [f64; 4]) -> f64 {
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

    /// An even polygon of radius 1.
    fn even(n: usize) -> Polygon {
        let uv: Vec<[f64; 2]> =
            (0..n).map(|i| (TAU * i as f64 / n as f64).sin_cos()).map(|(sin, cos)| [cos, sin]).collect();
        let points = uv.iter().map(|[x, y]| [*x, *y, 0.0]).collect();
        let side = 2.0 * (PI / n as f64).sin();
        Polygon { uv, points, angles: vec![PI - TAU / n as f64; n], lengths: vec![side; n] }
    }

    #[test]
    fn even_polygons_are_cut_into_the_fewest_patches_with_good_corners() {
        assert_eq!(even(4).best().1, Cut::default());
        let (cost, cut) = even(6).best();
        assert!(cut.lines.len() == 1 && cut.stars.is_empty(), "{cut:?}");
        assert!(cost < BROKEN);
        assert_eq!(even(5).best().0, f64::INFINITY);
    }

    /// A triangle with the middles of its sides: only a vertex in its middle gives three patches.
    #[test]
    fn a_triangle_with_halved_sides_gets_a_vertex_in_the_middle() {
        let mut polygon = even(6);
        polygon.angles = vec![PI / 3.0, PI, PI / 3.0, PI, PI / 3.0, PI];
        let (cost, cut) = polygon.best();
        assert_eq!(cut, Cut { lines: Vec::new(), stars: vec![vec![1, 2, 3, 4, 5, 0]] });
        assert!(cost < BROKEN, "{cost}");
    }
}
