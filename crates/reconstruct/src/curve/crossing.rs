//! Where a plane curve crosses itself, and where a polygon does.

use rstar::primitives::{GeomWithData, Rectangle};
use rstar::{AABB, RTree};
use thb_core::SplineMap;

use crate::Error;

/// Largest number of chords of a span.
///
/// Limit: a span whose control points are far from the part for its length would ask for millions.
const MAX_CHORDS: f64 = 256.0;

/// Newton steps from the crossing of two chords to that of the curve.
///
/// Limit: convergence is quadratic from chords that are nearly the curve; four steps are usual.
const MAX_STEPS: usize = 20;

/// Distance, as a share of the extent, within which two places of a curve are the same.
///
/// Limit: some thousand times the round-off of coordinates.
const SAME: f64 = 1e-12;

/// Two parameters with the same place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Crossing {
    /// Its parameters, the smaller one first.
    pub(super) parameters: [f64; 2],
    /// In the plane.
    pub(super) place: [f64; 2],
}

/// A plane in space, by a point and two unit vectors, into which curve and polygon are projected.
#[derive(Clone, Debug)]
pub(super) struct Plane {
    origin: Vec<f64>,
    axes: [Vec<f64>; 2],
}

impl Plane {
    /// The plane of points of two or three coordinates, if none is farther from it than `limit`.
    pub(super) fn of(points: &[&[f64]], limit: f64) -> Option<Self> {
        let origin = points.first()?.to_vec();
        if origin.len() == 2 {
            return Some(Self { origin: vec![0.0; 2], axes: [vec![1.0, 0.0], vec![0.0, 1.0]] });
        }
        let from_origin = |p: &[f64]| -> Vec<f64> { p.iter().zip(&origin).map(|(a, b)| a - b).collect() };
        let farthest = |off: &dyn Fn(&[f64]) -> Vec<f64>| {
            let offsets = points.iter().map(|p| off(p));
            offsets.max_by(|a, b| dot(a, a).total_cmp(&dot(b, b))).filter(|a| dot(a, a) > 0.0)
        };
        let first = normalized(farthest(&from_origin)?);
        let beside = |p: &[f64]| minus_along(from_origin(p), &first);
        let second = normalized(farthest(&beside)?);
        let above = |p: &[f64]| minus_along(beside(p), &second);
        let height = farthest(&above).map_or(0.0, |h| dot(&h, &h).sqrt());
        (height <= limit).then_some(Self { origin, axes: [first, second] })
    }

    pub(super) fn project(&self, point: &[f64]) -> [f64; 2] {
        let offset: Vec<f64> = point.iter().zip(&self.origin).map(|(a, b)| a - b).collect();
        [dot(&offset, &self.axes[0]), dot(&offset, &self.axes[1])]
    }

    fn project_vector(&self, vector: &[f64]) -> [f64; 2] {
        [dot(vector, &self.axes[0]), dot(vector, &self.axes[1])]
    }
}

/// The crossings of a curve in a plane with itself. Loops smaller than about `chord`, the distance allowed between the curve
/// and its chords, are not seen.
pub(super) fn of_curve(map: &SplineMap<1>, plane: &Plane, chord: f64, extent: f64) -> Result<Vec<Crossing>, Error> {
    let knots = map.space().knots(0, 0)?;
    let breaks = knots.breaks();
    let period = knots.is_periodic().then(|| breaks[breaks.len() - 1] - breaks[0]);
    let bezier = map.bezier();
    let (n, degree) = (map.dim(), bezier.degree()[0] as f64);
    let mut chords: Vec<Segment> = Vec::new();
    for span in breaks.windows(2) {
        let cell = map.space().locate_cell([span[0]])?;
        let rows: Vec<&[f64]> = bezier.cell_coefficients(cell).chunks(n).collect();
        let bend = rows
            .windows(3)
            .map(|w| (0..n).map(|k| (w[0][k] - 2.0 * w[1][k] + w[2][k]).powi(2)).sum::<f64>().sqrt())
            .fold(0.0, f64::max);
        // A curve with |C″| ≤ p (p − 1) bend leaves the chord over a step h by |C″| h² / 8 at most.
        let count = (degree * (degree - 1.0) * bend / (8.0 * chord)).sqrt().ceil().clamp(1.0, MAX_CHORDS) as usize;
        let place = |k: usize| -> (f64, [f64; 2]) {
            let u = if k == count { span[1] } else { span[0] + (span[1] - span[0]) * k as f64 / count as f64 };
            let mut image = vec![0.0; n];
            bezier.derivative(cell, [u], [0], &mut image);
            (u, plane.project(&image))
        };
        for k in 0..count {
            let ((u, a), (v, b)) = (place(k), place(k + 1));
            chords.push(Segment { a, b, parameters: [u, v] });
        }
    }
    let is_loop = chords.len() > 2 && distance(chords[0].a, chords[chords.len() - 1].b) <= SAME.sqrt() * extent;
    let mut crossings = Vec::new();
    for (i, j) in near_pairs(&chords, 0.0) {
        if j - i <= 1 || is_loop && i == 0 && j + 1 == chords.len() {
            continue;
        }
        let Some(shares) = crossing_of(&chords[i], &chords[j]) else { continue };
        if let Some(found) = refine(map, plane, [&chords[i], &chords[j]], shares, period, extent)? {
            crossings.push(found);
        }
    }
    // A crossing on a break or between two chords is found from both its sides.
    let near = |a: f64, b: f64| (a - b).abs() <= SAME.sqrt() * (breaks[breaks.len() - 1] - breaks[0]);
    crossings
        .sort_by(|a, b| a.parameters[0].total_cmp(&b.parameters[0]).then(a.parameters[1].total_cmp(&b.parameters[1])));
    crossings.dedup_by(|a, b| near(a.parameters[0], b.parameters[0]) && near(a.parameters[1], b.parameters[1]));
    Ok(crossings)
}

/// Where a polygon touches or crosses itself, with the length of the longer edge there.
pub(super) fn of_polygon(points: &[[f64; 2]], closed: bool, extent: f64) -> Vec<([f64; 2], f64)> {
    let m = points.len();
    let edges: Vec<Segment> = (0..if closed { m } else { m - 1 })
        .map(|i| Segment { a: points[i], b: points[(i + 1) % m], parameters: [0.0; 2] })
        .filter(|edge| edge.a != edge.b)
        .collect();
    let touching = SAME.sqrt() * extent;
    let mut contacts = Vec::new();
    for (i, j) in near_pairs(&edges, touching) {
        let (a, b) = (&edges[i], &edges[j]);
        // Neighbours share a vertex, and so do the first and the last edge of a closed polygon.
        let longer = a.length().max(b.length());
        if j - i <= 1 || closed && i == 0 && j + 1 == edges.len() {
            continue;
        }
        let ends = [(a.a, b), (a.b, b), (b.a, a), (b.b, a)];
        let touch = ends.into_iter().find(|(end, edge)| edge.distance(*end) <= touching);
        if let Some((place, _)) = touch {
            contacts.push((place, longer));
        } else if let Some([s, _]) = crossing_of(a, b) {
            contacts.push((a.at(s), longer));
        }
    }
    contacts
}

#[derive(Clone, Copy, Debug)]
struct Segment {
    a: [f64; 2],
    b: [f64; 2],
    parameters: [f64; 2],
}

impl Segment {
    fn at(&self, share: f64) -> [f64; 2] {
        std::array::from_fn(|k| self.a[k] + share * (self.b[k] - self.a[k]))
    }

    fn length(&self) -> f64 {
        distance(self.a, self.b)
    }

    fn distance(&self, place: [f64; 2]) -> f64 {
        let edge = minus(self.b, self.a);
        let squared = edge[0] * edge[0] + edge[1] * edge[1];
        let to = minus(place, self.a);
        let t = if squared > 0.0 { ((to[0] * edge[0] + to[1] * edge[1]) / squared).clamp(0.0, 1.0) } else { 0.0 };
        distance(place, self.at(t))
    }
}

/// Pairs `i < j` of segments whose boxes, widened, meet; in increasing order.
fn near_pairs(segments: &[Segment], widened: f64) -> Vec<(usize, usize)> {
    let envelope = |s: &Segment| {
        let lower = std::array::from_fn(|k| s.a[k].min(s.b[k]) - widened);
        let upper = std::array::from_fn(|k| s.a[k].max(s.b[k]) + widened);
        AABB::from_corners(lower, upper)
    };
    let boxes = segments.iter().enumerate().map(|(i, s)| {
        let bounds = envelope(s);
        GeomWithData::new(Rectangle::from_corners(bounds.lower(), bounds.upper()), i)
    });
    let tree: RTree<GeomWithData<Rectangle<[f64; 2]>, usize>> = RTree::bulk_load(boxes.collect());
    let mut pairs = Vec::new();
    for (i, segment) in segments.iter().enumerate() {
        let others = tree.locate_in_envelope_intersecting(envelope(segment));
        pairs.extend(others.map(|other| other.data).filter(|&j| j > i).map(|j| (i, j)));
    }
    pairs.sort_unstable();
    pairs
}

/// The shares of two segments at which they cross; none if they are parallel.
fn crossing_of(first: &Segment, second: &Segment) -> Option<[f64; 2]> {
    let (d, e, w) = (minus(first.b, first.a), minus(second.b, second.a), minus(second.a, first.a));
    let determinant = cross(d, e);
    if determinant == 0.0 {
        return None;
    }
    let shares = [cross(w, e) / determinant, cross(w, d) / determinant];
    shares.iter().all(|s| (0.0..=1.0).contains(s)).then_some(shares)
}

/// Newton's method for `C(s) = C(t)` from the crossing of two chords. None if it leads elsewhere, as where two branches come
/// near each other without crossing.
fn refine(
    map: &SplineMap<1>,
    plane: &Plane,
    chords: [&Segment; 2],
    shares: [f64; 2],
    period: Option<f64>,
    extent: f64,
) -> Result<Option<Crossing>, Error> {
    let start: [f64; 2] = std::array::from_fn(|k| {
        let [u, v] = chords[k].parameters;
        u + shares[k] * (v - u)
    });
    let reach: [f64; 2] = chords.map(|c| 2.0 * (c.parameters[1] - c.parameters[0]));
    let mut at = start;
    for _ in 0..MAX_STEPS {
        let places = [plane.project(&map.eval([at[0]])?), plane.project(&map.eval([at[1]])?)];
        let off = minus(places[1], places[0]);
        if distance(places[0], places[1]) <= SAME * extent {
            let apart = at[1] - at[0];
            let apart = period.map_or(apart, |period| apart.min(period - apart));
            let own = apart > 0.25 * reach[0].min(reach[1]);
            return Ok(own.then_some(Crossing { parameters: at, place: places[0] }));
        }
        let d = plane.project_vector(&map.derivative([at[0]], [1])?);
        let e = plane.project_vector(&map.derivative([at[1]], [1])?);
        let determinant = cross(d, e);
        if determinant == 0.0 {
            return Ok(None);
        }
        // off + e Δt = d Δs
        let steps = [cross(off, e) / determinant, cross(off, d) / determinant];
        let (lower, upper) = map.space().domain();
        for k in 0..2 {
            at[k] = (at[k] + steps[k]).clamp(lower[0], upper[0]).clamp(start[k] - reach[k], start[k] + reach[k]);
        }
    }
    Ok(None)
}

fn minus(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn normalized(mut a: Vec<f64>) -> Vec<f64> {
    let norm = dot(&a, &a).sqrt();
    a.iter_mut().for_each(|x| *x /= norm);
    a
}

fn minus_along(mut a: Vec<f64>, direction: &[f64]) -> Vec<f64> {
    let along = dot(&a, direction);
    a.iter_mut().zip(direction).for_each(|(x, d)| *x -= along * d);
    a
}
