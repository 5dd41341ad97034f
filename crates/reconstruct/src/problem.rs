//! Points with parameters, ready to be fitted.

use ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis};
use thb_core::SplineMap;

use crate::Error;

/// Points that are ready to be fitted.
pub(crate) struct Problem<'a> {
    pub(crate) points: ArrayView2<'a, f64>,
    pub(crate) parameters: ArrayView2<'a, f64>,
    /// The confidence in each point, if it is given.
    pub(crate) weights: Option<ArrayView1<'a, f64>>,
    /// Row of each point in the file.
    pub(crate) rows: &'a [u32],
    /// Triangles over the points that may not turn over in the parameter plane.
    pub(crate) triangles: &'a [[u32; 3]],
    /// Triangles of a mesh besides these, which count but were not laid out.
    pub(crate) left_out: &'a [[u32; 3]],
    /// Whether they are the scan, and not spanned over its points.
    pub(crate) is_mesh: bool,
    /// Whether the parameters are the user's: then the errors of points are those at their parameters.
    pub(crate) is_given: bool,
    pub(crate) tolerance: f64,
    /// Diagonal of the bounding box of the points.
    pub(crate) diagonal: f64,
}

/// How far a parameter may be from a linear function of a coordinate, as a share of its range, for the points to be heights.
///
/// Limit: coordinates of six digits leave less than this.
const LINEAR: f64 = 1e-5;

impl Problem<'_> {
    /// All triangles of a mesh, those laid out first.
    pub(crate) fn all_triangles(&self) -> Vec<[u32; 3]> {
        [self.triangles, self.left_out].concat()
    }

    /// Whether the points are heights over two coordinates: each parameter is a linear function of one of them.
    pub(crate) fn is_graph(&self) -> bool {
        let along = |d: usize| (0..3).find(|&k| is_linear(self.parameters.column(d), self.points.column(k)));
        along(0).zip(along(1)).is_some_and(|(first, second)| first != second)
    }
}

/// Whether some numbers are a linear function, that is not constant, of others.
fn is_linear(u: ArrayView1<'_, f64>, x: ArrayView1<'_, f64>) -> bool {
    let count = u.len().max(1) as f64;
    let (mean_u, mean_x) = (u.sum() / count, x.sum() / count);
    let (mut product, mut square, mut largest) = (0.0, 0.0, 0.0_f64);
    for (u, x) in u.iter().zip(x) {
        product += (u - mean_u) * (x - mean_x);
        square += (x - mean_x).powi(2);
        largest = largest.max((u - mean_u).abs());
    }
    let slope = product / square;
    largest > 0.0 && u.iter().zip(x).all(|(u, x)| ((u - mean_u) - slope * (x - mean_x)).abs() <= 2.0 * LINEAR * largest)
}

/// Points in space as plain arrays.
pub(crate) fn rows_of(points: ArrayView2<'_, f64>) -> Vec<[f64; 3]> {
    points.outer_iter().map(|row| std::array::from_fn(|k| row[k])).collect()
}

/// The triangles of which all corners are among some points, by their places there.
pub(crate) fn triangles_among(triangles: &[[u32; 3]], kept: &[usize], points: usize) -> Vec<[u32; 3]> {
    let mut place = vec![None; points];
    kept.iter().enumerate().for_each(|(at, &i)| place[i] = Some(at as u32));
    let among = |t: &[u32; 3]| Some([place[t[0] as usize]?, place[t[1] as usize]?, place[t[2] as usize]?]);
    triangles.iter().filter_map(among).collect()
}

/// Distances of points to the surface at their parameters.
pub(crate) fn errors_at(
    map: &SplineMap<2>,
    parameters: &Array2<f64>,
    points: ArrayView2<'_, f64>,
) -> Result<Array1<f64>, Error> {
    let image = map.eval_batch(parameters.view())?;
    Ok((&image - &points).mapv(|x| x * x).sum_axis(Axis(1)).mapv(f64::sqrt))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heights_have_parameters_that_are_linear_in_two_coordinates() {
        let grid = |shape: fn([f64; 2]) -> [f64; 3]| {
            let parameters =
                Array2::from_shape_fn((99, 2), |(i, d)| [(i % 11) as f64 / 10.0, (i / 11) as f64 / 8.0][d]);
            let points = Array2::from_shape_fn((99, 3), |(i, k)| shape([parameters[[i, 0]], parameters[[i, 1]]])[k]);
            let problem = Problem {
                points: points.view(),
                parameters: parameters.view(),
                weights: None,
                rows: &[],
                triangles: &[],
                left_out: &[],
                is_mesh: false,
                is_given: false,
                tolerance: 1.0,
                diagonal: 1.0,
            };
            problem.is_graph()
        };
        assert!(grid(|[u, v]| [4e6 + 30.0 * u, -30.0 * v, (5.0 * u * v).sin()]));
        assert!(grid(|[u, v]| [(5.0 * u * v).sin(), 2.0 * v, u]));
        assert!(grid(|[u, v]| [u, v, 0.0]));
        // Not evenly, not along both, nothing.
        assert!(!grid(|[u, v]| [u + 1e-3 * u * u, v, u * v]));
        assert!(!grid(|[u, v]| [u, (3.0 * v).cos(), u * v]));
        assert!(!grid(|_| [1.0, 2.0, 3.0]));
    }
}
