//! The polygon through the points of a sequence, and how far a smooth curve may leave its edges.
//!
//! Between two neighbouring points nothing is known but how the polygon turns at them. A circular arc whose tangents make the
//! angle α with an edge of length h leaves it by `h/2 tan(α/2)`. Along a smooth curve through evenly spaced points the tangent
//! halves the turning θ of the polygon, so that the arc is `h/2 tan(θ/4)`; where spacing and curvature change from edge to edge
//! it is up to four times that, and `√(h h') tan(θ/2)`, at most `h tan(θ/2)`, is allowed beside a neighbour of length h'.
//!
//! Where an edge is much longer than its neighbour (a straight without points between dense arcs), the tangent is known from the
//! dense side, and a curve that turns on the scale of the dense points gets back to the edge within a few of their distances: the
//! bulge is then measured by the neighbour's length, unless both tangents agree on one arc over the edge.

/// Coordinates of a point: up to three, and the parameter of a graph before them.
pub(super) type Place = [f64; 4];

/// How many times as long as its neighbour an edge is from which on the tangent at their common vertex is that of the
/// neighbour's side, and the edge a sparse stretch.
///
/// Calibrated: on rounded rectangles, slots and circles with 4 to 40 points an arc. At 2, random spacing makes sparse
/// stretches of one edge in three; at 6, straights beside arcs of three points pass as even spacing, with bulges of a tenth
/// of the straight.
const SPARSE: f64 = 3.0;

/// Length of the neighbours, in their own lengths, along which a curve may turn towards a sparse stretch.
///
/// Calibrated: on rectangles whose arcs have 3 to 20 points. At 1, splines that turn within their last spans are refused;
/// at 10, the swing of an arc of three points, a fifth of its radius, passes.
const REACH: f64 = 3.0;

/// Share of the turning that counts as uncertainty of a tangent that was extrapolated.
///
/// Derived: the end tangent of a parabola through three points of a circle, at steps of the angle θ that differ by a factor
/// of up to two, is off by at most θ/4.
const UNCERTAIN: f64 = 0.25;

/// Largest angle between edge and tangent of an arc over a sparse stretch, in radians: 75°.
///
/// Limit: `tan(α/2)` stays below 0.77; beyond, the chord says little about the arc.
const MAX_ARC_ANGLE: f64 = 1.309;

/// How many times as large as the other the larger angle of an arc may be.
///
/// Calibrated: gaps of 20° to 140° in ellipses of ratio up to 3 have at most 2.4; a hook at one end only has 10 and more.
const MAX_ARC_RATIO: f64 = 3.0;

/// Distance of neighbouring vertices in standard deviations of the noise: directions of edges are then known to 20°.
///
/// Derived: `√2 σ / (4 σ)` radians.
const NOISE_PER_EDGE: f64 = 4.0;

/// Standard deviations of the noise by which a curve may leave the polygon of noisy points in addition.
///
/// Calibrated: on outlines of pixels and sections of 400 noisy points, both fitted to less than their noise. At 3, curves that
/// run to and fro by the distance of the points pass.
const NOISE_ALLOWED: f64 = 1.0;

/// Growth of the distances between points that are laid over a sparse stretch, away from its ends.
///
/// Derived: dyadic knots halve spans, so neighbouring spans of an adaptive curve differ by a factor of two at most where every
/// span has a point.
const GROWTH: f64 = 1.6;

/// Largest distance of points laid over a stretch, as a share of it.
///
/// Limit: at least so many points stand in a stretch that no knots remain without one near.
const MAX_STEP: f64 = 0.0625;

/// Smallest step of points over a stretch, as a share of it.
///
/// Limit: bounds their number by about seventy.
const MIN_STEP: f64 = 1e-5;

/// An edge between two vertices, which are places of points in the order of the curve.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edge {
    /// Where it starts.
    pub(super) from: usize,
    /// Where it ends; below `from` for the edge that closes a polygon.
    pub(super) to: usize,
    /// How far a smooth curve may leave it.
    pub(super) allowed: f64,
}

/// The polygon through points, whose vertices are far enough apart that its edges have a direction.
#[derive(Clone, Debug)]
pub(super) struct Polygon {
    points: Vec<Place>,
    closed: bool,
    vertices: Vec<usize>,
    /// Of each vertex, whether the curve may turn there as it likes.
    is_corner: Vec<bool>,
    noise: f64,
}

impl Polygon {
    /// Of points in the order of the curve; `corners` are places of points where it may turn as it likes.
    pub(super) fn new(points: Vec<Place>, closed: bool, corners: &[usize]) -> Self {
        let noise = noise(&points);
        let mut extent = 0.0_f64;
        for point in &points {
            extent = extent.max(distance(*point, points[0]));
        }
        // Equal points have no edge between them.
        let shortest = (NOISE_PER_EDGE * noise).max(1e-9 * extent);
        let last = points.len() - 1;
        let mut vertices: Vec<usize> = vec![0];
        let mut kept_corner = true;
        for at in 1..=last {
            let is_corner = corners.contains(&at) || at == last && !closed;
            let previous = vertices[vertices.len() - 1];
            let far = distance(points[at], points[previous]) > shortest;
            if !far && is_corner && !kept_corner {
                vertices.pop();
            }
            if far || is_corner && (!kept_corner || distance(points[at], points[previous]) > 0.0) {
                vertices.push(at);
                kept_corner = is_corner;
            }
        }
        if closed {
            while vertices.len() > 1 && distance(points[vertices[vertices.len() - 1]], points[0]) <= shortest {
                vertices.pop();
            }
        }
        let is_corner = vertices.iter().map(|at| corners.contains(at)).collect();
        Self { points, closed, vertices, is_corner, noise }
    }

    /// All edges; none of fewer than two vertices.
    pub(super) fn edges(&self) -> Vec<Edge> {
        (0..self.n_edges()).map(|k| self.edge(k)).collect()
    }

    /// Distance of a place to the polygon along an edge and its two neighbours, by all points there.
    pub(super) fn distance_near(&self, k: usize, place: Place) -> f64 {
        let n = self.vertices.len();
        let first = if k > 0 { k - 1 } else { 0 };
        let start = if self.closed { (k + n - 1) % n } else { first };
        let steps = if self.closed { 3.min(n) } else { (k + 2).min(n - 1) - first };
        let m = self.points.len();
        let mut nearest = f64::INFINITY;
        for step in 0..steps {
            let (from, to) = (self.vertices[(start + step) % n], self.vertices[(start + step + 1) % n]);
            let count = if to > from { to - from } else { to + m - from };
            for i in from..from + count {
                nearest = nearest.min(distance_to_segment(place, self.points[i % m], self.points[(i + 1) % m]));
            }
        }
        nearest
    }

    /// Shares of an edge, between 0 and 1, and places there: on an arc where the tangents at its ends agree on one, on the edge
    /// itself otherwise. They stand as densely as the points at each end, and ever farther apart away from the ends; `finer` divides their distances.
    pub(super) fn laid_over(&self, k: usize, finer: f64) -> Vec<(f64, Place)> {
        let (a, b, length) = self.ends(k);
        let starts = [self.neighbour_length(k, false), self.neighbour_length(k, true)]
            .map(|near| (near.unwrap_or(length) / length).clamp(MIN_STEP, MAX_STEP));
        let (along, _) = self.direction(k);
        // As long as those of the cubic that meets the middle of an arc with these tangents.
        let [from, to] = self.tangents(k).map(|t| scaled(t, 2.0 * length / (1.0 + dot(t, along).max(0.0))));
        steps_between(starts, finer)
            .into_iter()
            .map(|t| {
                // Hermite's cubic, minus the chord.
                let (left, right) = (t * (1.0 - t) * (1.0 - t), -t * t * (1.0 - t));
                let chord = sub(b, a);
                let place = std::array::from_fn(|i| {
                    a[i] + t * chord[i] + left * (from[i] - chord[i]) + right * (to[i] - chord[i])
                });
                (t, place)
            })
            .collect()
    }

    fn n_edges(&self) -> usize {
        match self.vertices.len() {
            0 | 1 => 0,
            n if self.closed && n > 2 => n,
            n => n - 1,
        }
    }

    fn edge(&self, k: usize) -> Edge {
        let (_, _, length) = self.ends(k);
        let mut allowed = 0.0_f64;
        for at_end in [false, true] {
            if let Some(side) = self.side(k, at_end) {
                let bulge = if side.sparse {
                    0.5 * REACH * side.neighbour * half_tangent(side.away + UNCERTAIN * side.turn)
                } else {
                    (length * side.neighbour).sqrt().min(length) * half_tangent(side.turn)
                };
                allowed = allowed.max(bulge);
            }
        }
        if let Some(angle) = self.arc(k) {
            allowed = allowed.max(0.5 * length * half_tangent(angle));
        }
        let n = self.vertices.len();
        Edge { from: self.vertices[k], to: self.vertices[(k + 1) % n], allowed: allowed + NOISE_ALLOWED * self.noise }
    }

    fn place(&self, vertex: usize) -> Place {
        self.points[self.vertices[vertex % self.vertices.len()]]
    }

    fn ends(&self, k: usize) -> (Place, Place, f64) {
        let (a, b) = (self.place(k), self.place(k + 1));
        (a, b, distance(a, b))
    }

    /// The edge beyond one end of an edge; none where the polygon ends or has a corner.
    fn neighbour(&self, k: usize, at_end: bool) -> Option<usize> {
        let n = self.n_edges();
        let vertex = if at_end { (k + 1) % self.vertices.len() } else { k };
        if self.is_corner[vertex] {
            return None;
        }
        match (at_end, self.closed && n > 2) {
            (true, true) => Some((k + 1) % n),
            (false, true) => Some((k + n - 1) % n),
            (true, false) => (k + 1 < n).then_some(k + 1),
            (false, false) => k.checked_sub(1),
        }
    }

    fn neighbour_length(&self, k: usize, at_end: bool) -> Option<f64> {
        self.neighbour(k, at_end).map(|other| self.ends(other).2)
    }

    /// How the polygon goes on beyond one end of an edge.
    fn side(&self, k: usize, at_end: bool) -> Option<Side> {
        let other = self.neighbour(k, at_end)?;
        let (chord, length) = self.direction(k);
        let (near, neighbour) = self.direction(other);
        let sparse = length > SPARSE * neighbour;
        let tangent = if sparse {
            // The end tangent of the parabola through the last three vertices of the dense side.
            match self.neighbour(other, at_end) {
                Some(further) => {
                    let (far, beyond) = self.direction(further);
                    if neighbour > SPARSE * beyond || beyond > SPARSE * neighbour {
                        near
                    } else {
                        let share = neighbour / (neighbour + beyond);
                        unit(std::array::from_fn(|i| near[i] + share * (near[i] - far[i])))
                    }
                }
                None => near,
            }
        } else {
            unit(std::array::from_fn(|i| length * near[i] + neighbour * chord[i]))
        };
        Some(Side { neighbour, sparse, turn: angle(near, chord), tangent, away: angle(tangent, chord) })
    }

    /// The larger of the angles that the tangents at both ends make with an edge, if they are those of an arc.
    fn arc(&self, k: usize) -> Option<f64> {
        let (a, b) = (self.side(k, false)?, self.side(k, true)?);
        let (chord, _) = self.direction(k);
        let (at_start, at_end) = (across(a.tangent, chord), across(b.tangent, chord));
        let (larger, smaller) = (a.away.max(b.away), a.away.min(b.away));
        let certain = [&a, &b].iter().all(|side| side.away > UNCERTAIN * side.turn);
        let agree = certain && dot(at_start, at_end) < 0.0;
        (agree && larger <= MAX_ARC_ANGLE && larger <= MAX_ARC_RATIO * smaller).then_some(larger)
    }

    /// Unit tangents at both ends of an edge for what is laid over it.
    fn tangents(&self, k: usize) -> [Place; 2] {
        let (chord, _) = self.direction(k);
        if self.arc(k).is_some() {
            return [false, true].map(|at_end| self.side(k, at_end).map_or(chord, |side| side.tangent));
        }
        // A hook at the end of a sparse stretch is not spread over all of it.
        [false, true].map(|at_end| match self.side(k, at_end) {
            Some(side) if !side.sparse => side.tangent,
            _ => chord,
        })
    }

    fn direction(&self, k: usize) -> (Place, f64) {
        let (a, b, length) = self.ends(k);
        (unit(sub(b, a)), length)
    }
}

/// The polygon beyond one end of an edge.
struct Side {
    /// Length of the neighbouring edge.
    neighbour: f64,
    /// Whether the edge is a sparse stretch as seen from there.
    sparse: bool,
    /// The angle between both edges.
    turn: f64,
    /// The unit tangent at the common vertex, in the direction of the curve.
    tangent: Place,
    /// Its angle with the edge.
    away: f64,
}

/// Shares from 0 to 1, without both, whose distances start as given at each end and grow.
fn steps_between(starts: [f64; 2], finer: f64) -> Vec<f64> {
    let (mut shares, mut from_end) = (Vec::new(), Vec::new());
    let (mut left, mut right) = (0.0, 1.0);
    let [mut forward, mut backward] = starts.map(|start| start / finer);
    let longest = MAX_STEP / finer;
    while right - left > forward + backward {
        if forward <= backward {
            left += forward;
            shares.push(left);
            forward = (GROWTH * forward).min(longest);
        } else {
            right -= backward;
            from_end.push(right);
            backward = (GROWTH * backward).min(longest);
        }
    }
    shares.push(0.5 * (left + right));
    shares.extend(from_end.into_iter().rev());
    shares
}

/// Standard deviation of the points: from the fourth divided differences of five points in a row, at parameters by their
/// distances, which vanish for cubics. The median doesn't see corners and sparse stretches.
pub(super) fn noise(points: &[Place]) -> f64 {
    let mut deviations: Vec<f64> = points
        .windows(5)
        .filter_map(|w| {
            let steps: [f64; 4] = std::array::from_fn(|i| distance(w[i], w[i + 1]));
            let (shortest, longest) = steps.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), &s| (a.min(s), b.max(s)));
            if shortest <= 0.0 || longest > NOISE_MAX_RATIO * shortest {
                return None;
            }
            let t: [f64; 5] = std::array::from_fn(|i| steps[..i].iter().sum());
            let weights: [f64; 5] =
                std::array::from_fn(|i| (0..5).filter(|&j| j != i).map(|j| longest / (t[i] - t[j])).product());
            let off: Place = std::array::from_fn(|k| (0..5).map(|i| weights[i] * w[i][k]).sum());
            Some(norm(off) / weights.iter().map(|w| w * w).sum::<f64>().sqrt())
        })
        .collect();
    if deviations.len() < MIN_NOISE_SAMPLES {
        return 0.0;
    }
    let middle = deviations.len() / 2;
    let median = *deviations.select_nth_unstable_by(middle, f64::total_cmp).1;
    median * SIGMA_PER_MEDIAN
}

/// Longest of the steps between points from which noise is estimated, over the shortest.
///
/// Limit: excludes sparse stretches, where differences are not small.
const NOISE_MAX_RATIO: f64 = 10.0;

/// Fewest places from which noise is estimated.
///
/// Limit: the median of fewer says nothing.
const MIN_NOISE_SAMPLES: usize = 9;

/// Standard deviation of a normal variable over the median of its size.
///
/// Derived: 1/0.6745.
const SIGMA_PER_MEDIAN: f64 = 1.4826;

fn half_tangent(angle: f64) -> f64 {
    (0.5 * angle.min(std::f64::consts::FRAC_PI_2)).tan()
}

fn distance_to_segment(place: Place, a: Place, b: Place) -> f64 {
    let (edge, to) = (sub(b, a), sub(place, a));
    let squared = dot(edge, edge);
    let t = if squared > 0.0 { (dot(to, edge) / squared).clamp(0.0, 1.0) } else { 0.0 };
    distance(place, std::array::from_fn(|i| a[i] + t * edge[i]))
}

pub(super) fn sub(a: Place, b: Place) -> Place {
    std::array::from_fn(|i| a[i] - b[i])
}

pub(super) fn dot(a: Place, b: Place) -> f64 {
    a.iter().zip(&b).map(|(a, b)| a * b).sum()
}

pub(super) fn norm(a: Place) -> f64 {
    dot(a, a).sqrt()
}

pub(super) fn distance(a: Place, b: Place) -> f64 {
    norm(sub(a, b))
}

pub(super) fn angle(a: Place, b: Place) -> f64 {
    // Stable for small angles, unlike the arc cosine.
    2.0 * distance(a, b).atan2(distance(a, scaled(b, -1.0)))
}

pub(super) fn unit(a: Place) -> Place {
    let length = norm(a);
    if length > 0.0 { scaled(a, 1.0 / length) } else { a }
}

fn scaled(a: Place, factor: f64) -> Place {
    a.map(|x| factor * x)
}

/// The part of a vector across a unit vector.
fn across(a: Place, direction: Place) -> Place {
    let along = dot(a, direction);
    std::array::from_fn(|i| a[i] - along * direction[i])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arc(radius: f64, from: f64, to: f64, count: usize) -> Vec<Place> {
        (0..count)
            .map(|i| {
                let t = from + (to - from) * i as f64 / (count - 1) as f64;
                [radius * t.cos(), radius * t.sin(), 0.0, 0.0]
            })
            .collect()
    }

    #[test]
    fn an_even_circle_may_bulge_by_about_four_times_its_sagitta() {
        for count in [8_usize, 12, 40] {
            let polygon = Polygon::new(arc(1.0, 0.0, std::f64::consts::TAU, count + 1)[..count].to_vec(), true, &[]);
            let step = std::f64::consts::TAU / count as f64;
            let sagitta = 1.0 - (0.5 * step).cos();
            for edge in polygon.edges() {
                assert!((3.0..6.0).contains(&(edge.allowed / sagitta)), "{count}: {} of {sagitta}", edge.allowed);
            }
        }
    }

    #[test]
    fn a_gap_in_a_circle_may_be_an_arc_and_a_straight_between_arcs_may_not() {
        // A quarter of the circle without points, at any density of the rest.
        for count in [20, 60, 200] {
            let points = arc(1.0, 0.0, 1.5 * std::f64::consts::PI, count);
            let polygon = Polygon::new(points, true, &[]);
            let gap = polygon.n_edges() - 1;
            let edge = polygon.edge(gap);
            assert!(edge.allowed > 1.0 - 0.5_f64.sqrt(), "{}", edge.allowed);
            // What is laid over the gap is near the circle.
            assert!(polygon.laid_over(gap, 1.0).iter().all(|(_, p)| (p[0].hypot(p[1]) - 1.0).abs() < 0.03));
            // Two half circles and straights of 50 radii.
            let mut slot = arc(1.0, -0.5 * std::f64::consts::PI, 0.5 * std::f64::consts::PI, count);
            let far = arc(1.0, 0.5 * std::f64::consts::PI, 1.5 * std::f64::consts::PI, count);
            slot.extend(far.into_iter().map(|p| [p[0] - 50.0, p[1], 0.0, 0.0]));
            let polygon = Polygon::new(slot, true, &[]);
            for k in [count - 1, 2 * count - 1] {
                let edge = polygon.edge(k);
                assert!(edge.allowed < 0.05, "{count}: {}", edge.allowed);
                assert!(polygon.laid_over(k, 1.0).iter().all(|(_, p)| p[1].abs() < 1.05));
            }
        }
    }

    #[test]
    fn steps_grow_from_both_ends() {
        for starts in [[0.001, 0.0625], [0.0625, 0.001], [1e-5, 1e-5], [0.0625, 0.0625]] {
            let mut all = vec![0.0];
            all.extend(steps_between(starts, 1.0));
            all.push(1.0);
            let steps: Vec<f64> = all.windows(2).map(|w| w[1] - w[0]).collect();
            assert!(steps.iter().all(|&s| s > 0.0 && s <= 0.0626), "{steps:?}");
            assert!(steps.windows(2).all(|w| w[0] < 2.7 * w[1] && w[1] < 2.7 * w[0]), "{steps:?}");
            assert!(steps.len() < 80);
        }
    }
}
