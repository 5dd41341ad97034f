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
    /// Whether they are the scan, and not spanned over its points.
    pub(crate) is_mesh: bool,
    /// Whether the parameters are the user's: then the errors of points are those at their parameters.
    pub(crate) is_given: bool,
    pub(crate) tolerance: f64,
    /// Diagonal of the bounding box of the points.
    pub(crate) diagonal: f64,
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
