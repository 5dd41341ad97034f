//! Holes cut out of a face: their rims in the parameter plane and in space.

use std::sync::Arc;

use ndarray::{Array2, Axis};
use thb_core::{HierarchicalSpace, Kind, KnotVector, SplineMap};

use super::partition::GridBox;
use super::shell::{Corner, Edge, in_space};
use crate::model::ModelErrorKind;

/// Degree of the rims, in the parameter plane and in space.
const DEGREE: usize = 3;

/// Distance between the curve of an edge and the surface, as a share of the diagonal of the control points' box. A rim is known
/// far less well, and cubic pieces reach this with a few per span.
const RIM_SHARE: f64 = 1e-7;

/// Halvings of a span of the rim. The surface is smooth on cells, so a span needs no more than its share of them.
const HALVINGS: usize = 12;

/// The rim of a hole: a closed uniform cubic B-spline in the parameter plane of a surface.
pub(super) struct Rim {
    curve: SplineMap<1>,
    /// Smallest box in cells of the finest level that holds the rim.
    pub(super) bounds: GridBox,
}

impl Rim {
    /// The rim with the given control points, shape `(n, 2)`, of hole `number`; `breaks` are the cell boundaries of the finest
    /// level.
    pub(super) fn new(number: usize, control: &Array2<f64>, breaks: [&[f64]; 2]) -> Result<Self, ModelErrorKind> {
        if control.ncols() != 2 {
            return Err(ModelErrorKind::Count {
                what: "coordinates of the rim of a hole",
                found: control.ncols(),
                expected: "2".to_owned(),
            });
        }
        let knots = KnotVector::uniform_periodic(DEGREE, control.nrows())?;
        let space = HierarchicalSpace::new(Kind::Thb, [knots])?;
        let mut bounds = GridBox { lower: [0; 2], upper: [0; 2] };
        for d in 0..2 {
            // The curve lies in the hull of its control points.
            let column = control.column(d);
            let lower = column.fold(f64::INFINITY, |a, &b| a.min(b));
            let upper = column.fold(f64::NEG_INFINITY, |a, &b| a.max(b));
            let ends = [breaks[d][0], breaks[d][breaks[d].len() - 1]];
            if !(ends[0] < lower && upper < ends[1]) {
                return Err(ModelErrorKind::HoleOutside { hole: number, direction: d, lower, upper, domain: ends });
            }
            bounds.lower[d] = breaks[d].partition_point(|b| *b <= lower) as u32 - 1;
            bounds.upper[d] = breaks[d].partition_point(|b| *b < upper) as u32;
        }
        Ok(Self { curve: SplineMap::new(Arc::new(space), control.to_owned())?, bounds })
    }

    /// Its place in the parameter plane.
    fn parameter(&self, t: f64) -> Result<[f64; 2], ModelErrorKind> {
        let uv = self.curve.eval([t])?;
        Ok([uv[0], uv[1]])
    }

    /// The edge from a vertex to itself along the rim on the surface: cubic pieces that share tangents, bisected until they keep
    /// to the surface by `share` of its size.
    pub(super) fn edge(&self, map: &SplineMap<2>, vertex: usize, size: f64) -> Result<Edge, ModelErrorKind> {
        let spans = self.curve.coefficients().nrows();
        let mut open: Vec<(Place, Place, usize)> = Vec::with_capacity(spans);
        for span in (0..spans).rev() {
            let at = |k: usize| self.place(map, k as f64 / spans as f64);
            open.push((at(span)?, at(span + 1)?, HALVINGS));
        }
        let mut pieces: Vec<(Place, Place)> = Vec::new();
        while let Some((from, to, halvings)) = open.pop() {
            let middle = self.place(map, 0.5 * (from.t + to.t))?;
            let mut off = distance(&hermite(&from, &to, 0.5), &middle.point);
            for share in [0.25, 0.75] {
                let exact =
                    in_space(ndarray::ArrayView1::from(&map.eval(self.parameter(from.t + share * (to.t - from.t))?)?));
                off = off.max(distance(&hermite(&from, &to, share), &exact));
            }
            if off > RIM_SHARE * size && halvings > 0 {
                open.push((middle, to, halvings - 1));
                open.push((from, middle, halvings - 1));
            } else {
                pieces.push((from, to));
            }
        }
        // Knots between pieces are double: tangents are shared, and Bézier points at them follow from their neighbours.
        let mut knots = vec![0.0; DEGREE + 1];
        let mut points = vec![pieces[0].0.point];
        for (from, to) in &pieces {
            let third = (to.t - from.t) / 3.0;
            points.push(std::array::from_fn(|k| from.point[k] + third * from.tangent[k]));
            points.push(std::array::from_fn(|k| to.point[k] - third * to.tangent[k]));
            knots.extend([to.t; 2]);
        }
        // It closes at the very point it starts from.
        points.push(pieces[0].0.point);
        knots.extend([1.0; 2]);
        Ok(Edge { vertices: [vertex; 2], degree: DEGREE, knots, points })
    }

    fn place(&self, map: &SplineMap<2>, t: f64) -> Result<Place, ModelErrorKind> {
        let uv = self.parameter(t)?;
        let way = self.curve.derivative([t], [1])?;
        let [along_u, along_v] = [map.derivative(uv, [1, 0])?, map.derivative(uv, [0, 1])?];
        let tangent: Vec<f64> = along_u.iter().zip(along_v).map(|(a, b)| way[0] * a + way[1] * b).collect();
        let point = map.eval(uv)?;
        let vector = |x: &[f64]| in_space(ndarray::ArrayView1::from(x));
        Ok(Place { t, point: vector(&point), tangent: vector(&tangent) })
    }

    /// Where it starts and ends in space.
    pub(super) fn start(&self, map: &SplineMap<2>) -> Result<[f64; 3], ModelErrorKind> {
        Ok(self.place(map, 0.0)?.point)
    }

    /// Whether it lies in a box of cells.
    pub(super) fn is_in(&self, lower: Corner, upper: Corner) -> bool {
        (0..2).all(|d| lower[d] <= self.bounds.lower[d] && self.bounds.upper[d] <= upper[d])
    }
}

/// A point of a rim on the surface with its derivative.
#[derive(Clone, Copy)]
struct Place {
    t: f64,
    point: [f64; 3],
    tangent: [f64; 3],
}

/// The cubic with the ends and derivatives of two places, at a share of the way between.
fn hermite(from: &Place, to: &Place, s: f64) -> [f64; 3] {
    let (step, r) = (to.t - from.t, 1.0 - s);
    let [start, out, end, back] =
        [r * r * (1.0 + 2.0 * s), r * r * s * step, s * s * (3.0 - 2.0 * s), -s * s * r * step];
    std::array::from_fn(|k| start * from.point[k] + out * from.tangent[k] + end * to.point[k] + back * to.tangent[k])
}

fn distance(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
}

/// The rims of holes given by control points, turned so that they run clockwise: the surface lies on their left.
pub(super) fn rims(holes: &[Array2<f64>], breaks: [&[f64]; 2]) -> Result<Vec<Rim>, ModelErrorKind> {
    let clockwise = |control: &Array2<f64>| {
        let n = control.nrows();
        let wedge = |i: usize| {
            let j = (i + 1) % n;
            control[[i, 0]] * control[[j, 1]] - control[[i, 1]] * control[[j, 0]]
        };
        (0..n).map(wedge).sum::<f64>() <= 0.0
    };
    let turned = |control: &Array2<f64>| -> Array2<f64> {
        let backwards: Vec<usize> = (0..control.nrows()).rev().collect();
        if control.ncols() != 2 || clockwise(control) { control.clone() } else { control.select(Axis(0), &backwards) }
    };
    holes.iter().enumerate().map(|(number, control)| Rim::new(number, &turned(control), breaks)).collect()
}
