//! Rims of holes as closed curves in the parameter plane, to be cut out of faces.

use std::f64::consts::TAU;
use std::sync::Arc;

use fit_ls::{Lambda, LeastSquares};
use ndarray::{Array2, ArrayView2, Axis};
use point_cloud::{BoundaryParams, CloudError, TriangleMesh, find_boundary, largest_disk};
use rstar::primitives::{GeomWithData, Line};
use rstar::{AABB, RTree};
use thb_core::{HierarchicalSpace, Kind, KnotVector, SplineMap};

use crate::{Error, Parameterized};

/// Degree of the curves, that of [`geom_io::StepOptions::holes`].
const DEGREE: usize = 3;

/// Fewest spans of a curve; twice as many are tried as long as points of the rim are farther from it than the tolerance.
const FEWEST_SPANS: usize = 8;

/// Points of the rim for each span at least: with fewer the curve follows the zigzag of the triangles there.
const POINTS_PER_SPAN: usize = 2;

/// Smoothing weight for each point. It decides where a span has no point, and no more.
const SMOOTHING: f64 = 1e-12;

/// Straight pieces for each span, among which crossings are sought.
const PIECES: usize = 8;

/// Holes of a surface, as curves in its parameter plane.
pub(crate) struct Trims {
    /// Control points of each, `(n, 2)`, as in [`geom_io::StepOptions::holes`].
    pub(crate) holes: Vec<Array2<f64>>,
    /// What could not be cut out, and why.
    pub(crate) warnings: Vec<String>,
}

/// The curves of the holes of a fit, with the parameters its points have in the end. Points of rims are met within the tolerance
/// where there are enough of them.
pub(crate) fn trims(
    laid_out: &Parameterized,
    map: &SplineMap<2>,
    parameters: ArrayView2<'_, f64>,
    tolerance: f64,
) -> Result<Trims, Error> {
    let mut trims = Trims { holes: Vec::new(), warnings: Vec::new() };
    let found;
    let rims = match laid_out.rims.is_empty() {
        false => &laid_out.rims,
        true => match find_rims(laid_out) {
            Ok(rims) => {
                found = rims;
                &found
            }
            Err(reason) => {
                trims.warnings.push(format!("no holes were cut out, since none could be looked for: {reason}"));
                return Ok(trims);
            }
        },
    };
    let mut outlines: Vec<Vec<[f64; 2]>> = Vec::new();
    for rim in rims {
        let rows: Vec<usize> = rim.iter().map(|&i| i as usize).collect();
        let (points, own) = (laid_out.points.select(Axis(0), &rows), parameters.select(Axis(0), &rows));
        match curve(points.view(), own, map, &outlines, tolerance)? {
            Ok((control, outline)) => {
                trims.holes.push(control);
                outlines.push(outline);
            }
            Err(reason) => trims.warnings.push(format!("a hole of {} points was not cut out: {reason}", rows.len())),
        }
    }
    Ok(trims)
}

/// The rims of holes of points whose parameters were given.
fn find_rims(laid_out: &Parameterized) -> Result<Vec<Vec<u32>>, CloudError> {
    let Parameterized { points, triangles, report, .. } = laid_out;
    if report.boundary_points > 0 {
        // They were laid out by their shape, and had none.
        return Ok(Vec::new());
    }
    if triangles.is_empty() {
        return Ok(find_boundary(points.view(), &BoundaryParams::default())?.holes);
    }
    let part = largest_disk(&TriangleMesh { vertices: points.clone(), triangles: triangles.clone() })?;
    let rim = |rim: &point_cloud::BoundaryLoop| rim.vertices.iter().map(|&v| part.kept[v as usize] as u32).collect();
    Ok(part.disk.holes().iter().map(rim).collect())
}

type Outline = Vec<[f64; 2]>;

/// The curve of a rim and straight pieces along it, or why there is none.
fn curve(
    points: ArrayView2<'_, f64>,
    mut parameters: Array2<f64>,
    map: &SplineMap<2>,
    others: &[Outline],
    tolerance: f64,
) -> Result<Result<(Array2<f64>, Outline), &'static str>, Error> {
    let n = points.nrows();
    let ((lower, upper), periodic) = (map.space().domain(), map.space().periodic());
    for d in (0..2).filter(|&d| periodic[d]) {
        let period = upper[d] - lower[d];
        for i in 1..n {
            let way = parameters[[i, d]] - parameters[[i - 1, d]];
            parameters[[i, d]] -= period * (way / period).round();
        }
        if 2.0 * (parameters[[0, d]] - parameters[[n - 1, d]]).abs() > period {
            return Ok(Err("it goes all the way round the surface"));
        }
    }
    let inside = |uv: [f64; 2]| (0..2).all(|d| lower[d] < uv[d] && uv[d] < upper[d]);
    if !parameters.outer_iter().all(|uv| inside([uv[0], uv[1]])) {
        return Ok(Err("it reaches the boundary or the seam of the surface"));
    }
    let places = chord_places(points);
    let on_surface = map.eval_batch(parameters.view())?;
    let (mut best, mut spans, mut failed) = (None, FEWEST_SPANS, "its rim crosses itself");
    loop {
        let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [KnotVector::uniform_periodic(DEGREE, spans)?])?);
        let smoothing = fit_ls::Options { lambda: Lambda::Fixed(SMOOTHING * n as f64), ..fit_ls::Options::default() };
        let curve = LeastSquares::new(places.view(), parameters.view(), None, smoothing)?.fit(&space)?;
        let control = curve.coefficients().to_owned();
        let pieces = PIECES * spans;
        let at = Array2::from_shape_fn((pieces, 1), |(k, _)| k as f64 / pieces as f64);
        let outline: Outline = curve.eval_batch(at.view())?.outer_iter().map(|uv| [uv[0], uv[1]]).collect();
        // The control points have to lie inside, see [`geom_io::StepOptions::holes`].
        if !control.outer_iter().all(|uv| inside([uv[0], uv[1]])) {
            failed = "it comes too near to the boundary or the seam of the surface";
        } else if winds_oddly(&outline) || crosses(&outline, &outline) {
            failed = "its rim crosses itself";
        } else if others.iter().any(|other| crosses(&outline, other)) {
            failed = "it meets another hole";
        } else {
            let met = map.eval_batch(curve.eval_batch(places.view())?.view())?;
            let off = (&met - &on_surface).mapv(|x| x * x).sum_axis(Axis(1)).fold(0.0, |a: f64, &b| a.max(b)).sqrt();
            best = Some((control, outline));
            if off <= tolerance {
                break;
            }
        }
        spans *= 2;
        if POINTS_PER_SPAN * spans > n {
            break;
        }
    }
    Ok(best.ok_or(failed))
}

/// Chord length round a closed sequence of points, as shares of the whole, `(n, 1)`.
fn chord_places(points: ArrayView2<'_, f64>) -> Array2<f64> {
    let n = points.nrows();
    let step = |i: usize| {
        let (a, b) = (points.row(i), points.row((i + 1) % n));
        a.iter().zip(b).map(|(x, y)| (x - y).powi(2)).sum::<f64>().sqrt()
    };
    let total: f64 = (0..n).map(step).sum();
    let mut sum = 0.0;
    let mut places = Array2::zeros((n, 1));
    for i in 0..n {
        places[[i, 0]] = if total > 0.0 { (sum / total).min(1.0) } else { i as f64 / n as f64 };
        sum += step(i);
    }
    places
}

/// Whether the tangents of a closed polygon turn by something else than one whole turn.
fn winds_oddly(outline: &[[f64; 2]]) -> bool {
    let n = outline.len();
    let edge = |k: usize| {
        let (a, b) = (outline[k % n], outline[(k + 1) % n]);
        [b[0] - a[0], b[1] - a[1]]
    };
    let turn = |k: usize| {
        let (a, b) = (edge(k), edge(k + 1));
        (a[0] * b[1] - a[1] * b[0]).atan2(a[0] * b[0] + a[1] * b[1])
    };
    ((0..n).map(turn).sum::<f64>().abs() - TAU).abs() > 1.0
}

/// Whether two closed polygons cross, or one itself where they are the same.
fn crosses(first: &[[f64; 2]], second: &[[f64; 2]]) -> bool {
    let same = std::ptr::eq(first, second);
    let piece = |outline: &[[f64; 2]], k: usize| [outline[k], outline[(k + 1) % outline.len()]];
    let [[a_low, a_high], [b_low, b_high]] = [first, second].map(bounds);
    if (0..2).any(|d| a_high[d] < b_low[d] || b_high[d] < a_low[d]) {
        return false;
    }
    let side = |p: [f64; 2], [a, b]: [[f64; 2]; 2]| (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
    let apart = |p: [[f64; 2]; 2], q: [[f64; 2]; 2]| side(p[0], q) * side(p[1], q) > 0.0;
    let n = first.len();
    let are_neighbours = |i: usize, j: usize| i == j || (i + 1) % n == j || (j + 1) % n == i;
    let pieces = (0..second.len()).map(|j| {
        let [a, b] = piece(second, j);
        GeomWithData::new(Line::new(a, b), j)
    });
    let tree = RTree::bulk_load(pieces.collect());
    (0..n).any(|i| {
        let p = piece(first, i);
        // Pieces of one straight line lie on no side of each other, so their boxes have to meet too.
        let mut near = tree.locate_in_envelope_intersecting(AABB::from_corners(p[0], p[1]));
        near.any(|other| {
            let q = piece(second, other.data);
            !(apart(p, q) || apart(q, p) || same && are_neighbours(i, other.data))
        })
    })
}

fn bounds(outline: &[[f64; 2]]) -> [[f64; 2]; 2] {
    let fold = |start: f64, pick: fn(f64, f64) -> f64| [0, 1].map(|d| outline.iter().map(|p| p[d]).fold(start, pick));
    [fold(f64::INFINITY, f64::min), fold(f64::NEG_INFINITY, f64::max)]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn circle(centre: [f64; 2], radius: f64, turns: f64) -> Outline {
        (0..64)
            .map(|k| {
                let angle = TAU * turns * k as f64 / 64.0;
                [centre[0] + radius * angle.cos(), centre[1] + radius * angle.sin()]
            })
            .collect()
    }

    #[test]
    fn crossings_are_seen_and_apart_is_apart() {
        let ring = circle([0.0, 0.0], 1.0, 1.0);
        assert!(!crosses(&ring, &ring) && !winds_oddly(&ring));
        assert!(crosses(&ring, &circle([1.5, 0.0], 1.0, 1.0)));
        assert!(!crosses(&ring, &circle([2.5, 0.0], 1.0, 1.0)) && !crosses(&ring, &circle([0.0, 0.0], 0.5, 1.0)));
        let box_sides: Outline = (0..64)
            .map(|k| f64::from(k) / 16.0)
            .map(|t| [t.min(1.0) - (t - 2.0).clamp(0.0, 1.0), (t - 1.0).clamp(0.0, 1.0) - (t - 3.0).max(0.0)])
            .collect();
        assert!(!crosses(&box_sides, &box_sides) && !winds_oddly(&box_sides));
        let eight: Outline =
            (0..64).map(|k| TAU * (f64::from(k) + 0.5) / 64.0).map(|t| [t.sin(), (2.0 * t).sin()]).collect();
        assert!(crosses(&eight, &eight) && winds_oddly(&eight) && winds_oddly(&circle([0.0, 0.0], 1.0, 2.0)));
    }

    #[test]
    fn the_curve_of_a_round_rim_is_round() {
        let knots = KnotVector::uniform(2, 3).unwrap();
        let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap());
        let flat = Array2::from_shape_fn((500, 2), |(i, d)| {
            (i as f64 * [0.754_877_666_246_693, 0.569_840_290_998_053][d]).fract()
        });
        let lift = |uv: &Array2<f64>| Array2::from_shape_fn((uv.nrows(), 3), |(i, k)| [uv[[i, 0]], uv[[i, 1]], 0.0][k]);
        let map = LeastSquares::new(flat.view(), lift(&flat).view(), None, fit_ls::Options::default())
            .unwrap()
            .fit(&space)
            .unwrap();
        let rim = |centre: [f64; 2]| {
            let ring = circle(centre, 0.2, 1.0);
            Array2::from_shape_fn((64, 2), |(i, d)| ring[i][d])
        };
        let make = |uv: Array2<f64>, others: &[Outline]| curve(lift(&uv).view(), uv, &map, others, 1e-4).unwrap();
        let (control, outline) = make(rim([0.4, 0.6]), &[]).unwrap();
        assert!((FEWEST_SPANS..=32).contains(&control.nrows()));
        assert!(outline.iter().all(|p| ((p[0] - 0.4).hypot(p[1] - 0.6) - 0.2).abs() < 2e-4));
        assert_eq!(make(rim([0.45, 0.6]), &[outline]).unwrap_err(), "it meets another hole");
        assert_eq!(make(rim([0.1, 0.5]), &[]).unwrap_err(), "it reaches the boundary or the seam of the surface");
    }
}
