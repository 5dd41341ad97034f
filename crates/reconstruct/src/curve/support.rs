//! Points laid over sparse stretches of a sequence, so that a curve doesn't swing there.

use ndarray::{Array1, Array2};

use super::polygon::{Place, Polygon};
use super::sequence::{Closing, Sequence};

/// Coordinates in which distances of curve and polygon are measured. Parameter and values of a function are scaled to the same
/// extent, as they are drawn.
pub(super) struct Frame {
    is_function: bool,
    scale: f64,
}

impl Frame {
    pub(super) fn new(sequence: &Sequence, is_function: bool) -> Self {
        let (lower, upper) = sequence.domain;
        let values = sequence.points.columns().into_iter().map(|column| {
            let (low, high) = column.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &x| (a.min(x), b.max(x)));
            (high - low) * (high - low)
        });
        let extent = values.sum::<f64>().sqrt();
        Self { is_function, scale: if extent > 0.0 { extent / (upper - lower) } else { 1.0 } }
    }

    pub(super) fn place(&self, u: f64, point: impl IntoIterator<Item = f64>) -> Place {
        let mut place = [0.0; 4];
        let first = usize::from(self.is_function);
        if self.is_function {
            place[0] = self.scale * u;
        }
        for (to, from) in place[first..].iter_mut().zip(point) {
            *to = from;
        }
        place
    }

    /// The coordinates of the input.
    pub(super) fn natural(&self, place: Place) -> [f64; 3] {
        let [first, second, third, _] = place;
        if self.is_function { [first / self.scale, second, third] } else { [first, second, third] }
    }

    /// The values or coordinates that the curve has.
    pub(super) fn coordinates(&self, place: Place) -> impl Iterator<Item = f64> {
        place.into_iter().skip(usize::from(self.is_function))
    }
}

/// The polygon through the points of a sequence in its own order.
pub(super) fn polygon_of(sequence: &Sequence, frame: &Frame) -> Polygon {
    let places = sequence.points.outer_iter().zip(&sequence.parameters).map(|(p, &u)| frame.place(u, p.to_vec()));
    Polygon::new(places.collect(), sequence.closing == Closing::Periodic, &sequence.corners)
}

/// How many times as near as the tolerance the curve has to be to points laid over a stretch.
///
/// Calibrated: on slots and rounded rectangles at 0.1 %. At 1, curves leave straights by 1.1 to 1.2 tolerances between those
/// points; at 3, they need a tenth more control points.
const NEARER: f64 = 1.5;

/// By how much more is demanded of the points at a crossing, and how much denser points over a stretch are laid, each time that it
/// is found again.
///
/// Derived: halving a distance takes one more bisection of the spans there.
const MORE: f64 = 2.0;

/// What a fit is given beside its points, so that the curve doesn't swing out or cross itself: points `(k, N)` with parameters, laid
/// over edges of the polygon, and how near to each point the curve has to come.
#[derive(Clone, Debug)]
pub(super) struct Support {
    points: Array2<f64>,
    parameters: Array1<f64>,
    /// Edges that have such points, and by how much finer than at first.
    edges: Vec<(usize, f64)>,
    /// Of each point of the sequence, by how much nearer than the tolerance the curve has to be; after them of these points.
    demands: Vec<f64>,
}

impl Support {
    /// Nothing, for a sequence.
    pub(super) fn none(sequence: &Sequence) -> Self {
        let (m, dimension) = sequence.points.dim();
        let (points, parameters) = (Array2::zeros((0, dimension)), Array1::zeros(0));
        Self { points, parameters, edges: Vec::new(), demands: vec![1.0; m] }
    }

    /// Factors of the distances of all points.
    pub(super) fn demands(&self) -> &[f64] {
        &self.demands
    }

    /// The same with more demanded of some points of the sequence.
    pub(super) fn demanding(mut self, points: &[usize]) -> Self {
        for &at in points {
            self.demands[at] *= MORE;
        }
        self
    }

    /// Whether more is demanded of some points of the sequence.
    pub(super) fn is_demanding(&self) -> bool {
        self.demands.iter().rev().skip(self.len()).any(|&demand| demand > 1.0)
    }

    /// The same with points over the edges of a polygon that hold the given points, and denser ones where there were some; none if the
    /// given points hold no edge.
    pub(super) fn with(
        &self,
        sequence: &Sequence,
        frame: &Frame,
        polygon: &Polygon,
        swings: &[[usize; 2]],
    ) -> Option<Self> {
        let m = sequence.points.nrows();
        let holds = |from: usize, to: usize, [a, b]: [usize; 2]| {
            let length = (to + m - from) % m;
            let inside = |i: usize| (i + m - from) % m;
            a != b && (inside(a) < length || (1..=length).contains(&inside(b)))
        };
        let edges = polygon.edges();
        let mut held = self.edges.clone();
        for k in (0..edges.len()).filter(|&k| swings.iter().any(|&pair| holds(edges[k].from, edges[k].to, pair))) {
            match held.iter_mut().find(|(known, _)| *known == k) {
                Some((_, finer)) => *finer *= MORE,
                None => held.push((k, 1.0)),
            }
        }
        if held == self.edges {
            return None;
        }
        let (mut points, mut parameters) = (Array2::zeros((0, sequence.points.ncols())), Vec::new());
        let (lower, upper) = sequence.domain;
        for &(k, finer) in &held {
            let (from, mut to) = (sequence.parameters[edges[k].from], sequence.parameters[edges[k].to]);
            if edges[k].to <= edges[k].from {
                to += upper - lower;
            }
            if to <= from {
                continue;
            }
            for (share, place) in polygon.laid_over(k, finer) {
                let u = from + share * (to - from);
                parameters.push(if u > upper { u - (upper - lower) } else { u });
                let row: Vec<f64> = frame.coordinates(place).take(points.ncols()).collect();
                points.push_row(Array1::from(row).view()).ok()?;
            }
        }
        let mut demands = self.demands[..m].to_vec();
        demands.resize(m + parameters.len(), NEARER);
        Some(Self { points, parameters: parameters.into(), edges: held, demands })
    }

    /// Parameters and points of a sequence, and after them these.
    pub(super) fn beside(&self, sequence: &Sequence) -> (Array1<f64>, Array2<f64>) {
        let (m, dimension) = sequence.points.dim();
        let points = Array2::from_shape_fn((m + self.len(), dimension), |(i, k)| {
            if i < m { sequence.points[[i, k]] } else { self.points[[i - m, k]] }
        });
        (sequence.parameters.iter().chain(&self.parameters).copied().collect(), points)
    }

    /// Number of points.
    pub(super) fn len(&self) -> usize {
        self.parameters.len()
    }

    /// Number of edges with such points.
    pub(super) fn stretches(&self) -> usize {
        self.edges.len()
    }
}
