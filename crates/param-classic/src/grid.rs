//! Parameters of a gridded cloud.

use ndarray::{Array1, Array2, ArrayView2, Axis, Slice};
use point_cloud::{GridShape, check_finite};

use crate::ParamError;
use crate::sequence::{Rule, sequence_parameters};

/// What the average over the grid lines left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GridReport {
    /// Lines along u whose points are all equal (a pole), left out of the average.
    pub skipped_u: usize,
    /// Lines along v whose points are all equal, left out of the average.
    pub skipped_v: usize,
}

/// Parameters of the points of a grid, shape `(n_u · n_v, N)` with point `(i, j)` in row `i · n_v + j`: shape
/// `(n_u · n_v, 2)`, a tensor-product lattice `(u_i, v_j)` in the unit square.
///
/// `u_i` is the mean of the parameters of point `i` on the `n_v` grid lines along u, and likewise `v_j` (Imperatore 2024,
/// §4.1.1; Piegl & Tiller, The NURBS Book, §9.2.5). A line whose points are all equal, such as a pole, has no
/// chord-length parameters and is left out. The lattice is strictly increasing unless two neighbours are equal on
/// every line.
///
/// # Errors
/// [`ParamError::GridMismatch`], [`ParamError::GridTooThin`], coordinates not finite, [`ParamError::NoLength`] if all
/// lines of one direction are left out.
pub fn parameterize_grid(
    points: ArrayView2<'_, f64>,
    shape: GridShape,
    rule: Rule,
) -> Result<(Array2<f64>, GridReport), ParamError> {
    let GridShape { n_u, n_v } = shape;
    for (direction, given) in [('u', n_u), ('v', n_v)] {
        if given < 2 {
            return Err(ParamError::GridTooThin { direction, given });
        }
    }
    let required = n_u.saturating_mul(n_v);
    if required != points.nrows() {
        return Err(ParamError::GridMismatch { n_u, n_v, required, given: points.nrows() });
    }
    check_finite(points)?;
    let lines_u = (0..n_v).map(|j| points.slice_axis(Axis(0), Slice::new(j as isize, None, n_v as isize)));
    let lines_v = (0..n_u).map(|i| points.slice_axis(Axis(0), Slice::from(i * n_v..(i + 1) * n_v)));
    let (u, skipped_u) =
        mean_parameters(lines_u, n_u, rule).ok_or_else(|| no_length("the lines along u", rule, required))?;
    let (v, skipped_v) =
        mean_parameters(lines_v, n_v, rule).ok_or_else(|| no_length("the lines along v", rule, required))?;
    let mut parameters = Array2::zeros((required, 2));
    for (row, mut uv) in parameters.axis_iter_mut(Axis(0)).enumerate() {
        uv[0] = u[row / n_v];
        uv[1] = v[row % n_v];
    }
    Ok((parameters, GridReport { skipped_u, skipped_v }))
}

fn no_length(what: &'static str, rule: Rule, points: usize) -> ParamError {
    ParamError::NoLength { what, rule: rule.name(), points }
}

/// The mean over the lines with length, and the number of those without; `None` if none has length.
fn mean_parameters<'a>(
    lines: impl Iterator<Item = ArrayView2<'a, f64>>,
    n: usize,
    rule: Rule,
) -> Option<(Array1<f64>, usize)> {
    let mut sum = Array1::<f64>::zeros(n);
    let (mut used, mut skipped) = (0usize, 0);
    for line in lines {
        match sequence_parameters(line, rule) {
            Some(t) => {
                sum += &t;
                used += 1;
            }
            None => skipped += 1,
        }
    }
    // The last entry is a sum of ones, so the mean ends in exactly 1.
    (used > 0).then(|| (sum / used as f64, skipped))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grid_with_separate_directions_gets_its_abscissae_back() {
        // x depends on i only, y on j only: each line has the same parameters.
        let (u, v) = ([0.0, 0.2, 0.5, 1.0], [0.0, 0.7, 1.0]);
        let shape = GridShape { n_u: 4, n_v: 3 };
        let points = Array2::from_shape_fn((12, 3), |(r, k)| [4.0 * u[r / 3], -2.0 * v[r % 3], 7.0][k]);
        let (uv, report) = parameterize_grid(points.view(), shape, Rule::ChordLength).unwrap();
        assert_eq!(report, GridReport::default());
        for r in 0..12 {
            assert!((uv[[r, 0]] - u[r / 3]).abs() < 1e-15 && (uv[[r, 1]] - v[r % 3]).abs() < 1e-15);
        }
    }

    #[test]
    fn a_pole_is_left_out_and_lines_are_averaged() {
        // Line j = 0 along u is a pole; the other two have parameters (0, 1/4, 1) and (0, 3/4, 1).
        let x = [[0.0, 0.0, 0.0], [0.0, 1.0, 3.0], [0.0, 4.0, 4.0]];
        let shape = GridShape { n_u: 3, n_v: 3 };
        let points = Array2::from_shape_fn((9, 2), |(r, k)| [x[r / 3][r % 3], (r % 3) as f64][k]);
        let (uv, report) = parameterize_grid(points.view(), shape, Rule::ChordLength).unwrap();
        assert_eq!(report, GridReport { skipped_u: 1, skipped_v: 0 });
        assert_eq!([uv[[0, 0]], uv[[3, 0]], uv[[6, 0]]], [0.0, 0.5, 1.0]);
    }

    #[test]
    fn shapes_that_do_not_fit_are_errors() {
        let points = Array2::<f64>::zeros((6, 3));
        let grid = |n_u, n_v, rule| parameterize_grid(points.view(), GridShape { n_u, n_v }, rule).map(|_| ());
        assert_eq!(grid(2, 4, Rule::Uniform), Err(ParamError::GridMismatch { n_u: 2, n_v: 4, required: 8, given: 6 }));
        assert_eq!(grid(6, 1, Rule::Uniform), Err(ParamError::GridTooThin { direction: 'v', given: 1 }));
        assert_eq!(
            grid(2, 3, Rule::ChordLength),
            Err(ParamError::NoLength { what: "the lines along u", rule: "chord-length", points: 6 })
        );
        assert_eq!(grid(2, 3, Rule::Uniform), Ok(()));
    }
}
