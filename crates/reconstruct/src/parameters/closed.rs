//! Parameters of grids whose lines close, and of points with parameters that wrap.

use ndarray::{Array2, ArrayView2, Axis};
use param_classic::{GridReport, Rule, parameterize_grid};
use point_cloud::GridShape;

use crate::Error;

/// Last and first line of a grid are the same if their points are, on average, nearer than this share of the mean step
/// between them and their neighbours: then the last one is left out. Rounding in files of few digits stays far below.
const SAME_LINE: f64 = 1e-3;

/// A grid with parameters, less the lines that repeat their first ones.
pub(super) struct ClosedGrid {
    /// Which of the grid's points are left, in their order.
    pub(super) kept: Vec<usize>,
    /// Their parameters, `(kept, 2)`, in closed directions in [0, 1).
    pub(super) parameters: Array2<f64>,
    pub(super) report: GridReport,
    /// Directions whose last line repeated the first and was left out.
    pub(super) repeated: [bool; 2],
}

/// Parameters by a rule along the lines of a grid, `(n_u · n_v, N)` with point `(i, j)` in row `i · n_v + j`. Along closed
/// directions lines are taken to return to their first point: a last point that is the first one is left out, another
/// is joined to it by one more step.
pub(super) fn parameterize(
    points: ArrayView2<'_, f64>,
    shape: GridShape,
    rule: Rule,
    closed: [bool; 2],
) -> Result<ClosedGrid, Error> {
    let full = [shape.n_u, shape.n_v];
    if full[0].saturating_mul(full[1]) != points.nrows() {
        // The error of the open grid says what is wrong.
        parameterize_grid(points, shape, rule)?;
    }
    let row = |at: [usize; 2]| at[0] * full[1] + at[1];
    let repeated: [bool; 2] = std::array::from_fn(|d| closed[d] && full[d] > 2 && is_repeated(points, full, d));
    let left: [usize; 2] = std::array::from_fn(|d| full[d] - usize::from(repeated[d]));
    // The first line once more behind the last one, so that the step across the seam counts.
    let around: [usize; 2] = std::array::from_fn(|d| left[d] + usize::from(closed[d]));
    let places = |counts: [usize; 2]| (0..counts[0]).flat_map(move |i| (0..counts[1]).map(move |j| [i, j]));
    let of_around: Vec<usize> = places(around).map(|at| row([at[0] % left[0], at[1] % left[1]])).collect();
    let turn = points.select(Axis(0), &of_around);
    let (parameters, report) = parameterize_grid(turn.view(), GridShape { n_u: around[0], n_v: around[1] }, rule)?;
    let of_left: Vec<usize> = places(left).map(|at| at[0] * around[1] + at[1]).collect();
    let kept = places(left).map(row).collect();
    Ok(ClosedGrid { kept, parameters: parameters.select(Axis(0), &of_left), report, repeated })
}

/// Whether the last line across a direction is the first one again.
fn is_repeated(points: ArrayView2<'_, f64>, full: [usize; 2], d: usize) -> bool {
    let along = full[1 - d];
    let row = |line: usize, k: usize| if d == 0 { line * full[1] + k } else { k * full[1] + line };
    let distance = |a: usize, b: usize| -> f64 {
        let step = |k: usize| {
            let (p, q) = (points.row(row(a, k)), points.row(row(b, k)));
            p.iter().zip(q).map(|(x, y)| (x - y).powi(2)).sum::<f64>().sqrt()
        };
        (0..along).map(step).sum()
    };
    let last = full[d] - 1;
    distance(last, 0) <= SAME_LINE * 0.5 * (distance(0, 1) + distance(last - 1, last))
}

/// Moves parameters of closed directions into [0, 1).
pub(super) fn wrap(parameters: &mut Array2<f64>, closed: [bool; 2]) {
    for (mut column, _) in parameters.columns_mut().into_iter().zip(closed).filter(|(_, closed)| *closed) {
        // A tiny negative number wraps to 1.
        column.mapv_inplace(|u| if (0.0..1.0).contains(&u) { u } else { u.rem_euclid(1.0) % 1.0 });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// A ring of unequal steps, `repeat` further points at its end; three rings along v.
    fn rings(angles: &[f64], repeat: bool) -> (Array2<f64>, GridShape) {
        let n = angles.len() + usize::from(repeat);
        let points = Array2::from_shape_fn((3 * n, 3), |(row, k)| {
            let (i, j) = (row / 3, row % 3);
            let angle = TAU * angles[i % angles.len()];
            [angle.cos(), angle.sin(), j as f64][k]
        });
        (points, GridShape { n_u: n, n_v: 3 })
    }

    #[test]
    fn a_ring_gets_the_same_parameters_with_and_without_its_first_point_again() {
        let angles = [0.0, 0.1, 0.25, 0.5, 0.9];
        let (open, shape) = rings(&angles, false);
        let without = parameterize(open.view(), shape, Rule::ChordLength, [true, false]).unwrap();
        let (again, shape) = rings(&angles, true);
        let with = parameterize(again.view(), shape, Rule::ChordLength, [true, false]).unwrap();
        assert_eq!((without.repeated, with.repeated), ([false; 2], [true, false]));
        assert_eq!((without.kept.len(), with.kept.len()), (15, 15));
        assert_eq!(without.parameters, with.parameters);
        let chord = |a: f64| 2.0 * (0.5 * TAU * a).sin();
        let steps = [0.1, 0.15, 0.25, 0.4, 0.1].map(chord);
        let length: f64 = steps.iter().sum();
        let mut sum = 0.0;
        for (i, step) in steps.iter().enumerate() {
            assert!((with.parameters[[3 * i, 0]] - sum / length).abs() < 1e-14);
            sum += step;
        }
        assert_eq!(with.parameters[[2, 1]], 1.0);
    }

    #[test]
    fn both_directions_close() {
        let n = [6, 5];
        let torus = Array2::from_shape_fn((n[0] * n[1], 3), |(row, k)| {
            let [a, b] = [(row / n[1]) as f64 / n[0] as f64, (row % n[1]) as f64 / n[1] as f64].map(|t| TAU * t);
            [(3.0 + b.cos()) * a.cos(), (3.0 + b.cos()) * a.sin(), b.sin()][k]
        });
        let shape = GridShape { n_u: n[0], n_v: n[1] };
        let found = parameterize(torus.view(), shape, Rule::ChordLength, [true; 2]).unwrap();
        for (row, uv) in found.parameters.outer_iter().enumerate() {
            let expected = [(row / n[1]) as f64 / n[0] as f64, (row % n[1]) as f64 / n[1] as f64];
            assert!((0..2).all(|d| (uv[d] - expected[d]).abs() < 1e-14), "{uv}");
        }
        assert!(parameterize(torus.view(), GridShape { n_u: 7, n_v: 5 }, Rule::ChordLength, [true; 2]).is_err());
    }

    #[test]
    fn parameters_wrap() {
        let mut parameters = ndarray::array![[-0.25, -0.25], [1.0, 1.0], [2.5, 0.5], [-1e-30, 0.0]];
        wrap(&mut parameters, [true, false]);
        assert_eq!(parameters, ndarray::array![[0.75, -0.25], [0.0, 1.0], [0.5, 0.5], [0.0, 0.0]]);
    }
}
