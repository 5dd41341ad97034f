//! Distances between points and surface that do not depend on parameters.

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use ndarray::ArrayView2;
use rayon::prelude::*;
use thb_core::{ClosestPoints, SplineMap};

use crate::Error;

/// Hausdorff distances between points and a spline map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hausdorff {
    /// Largest distance of a point to the map (DHD).
    pub points_to_map: f64,
    /// Largest distance of a sample of the map to its nearest point.
    pub map_to_points: f64,
}

impl Hausdorff {
    /// The two-sided distance (HSD).
    pub fn two_sided(&self) -> f64 {
        self.points_to_map.max(self.map_to_points)
    }
}

/// Points searched in parallel before the largest distance so far is looked at.
const BATCH: usize = 1 << 10;

/// Largest distance of the points `(m, N)`, N ≤ 3, to the map (DHD): each point's distance to the map's closest point,
/// searched from its parameter `(m, D)`.
///
/// A point's distance at its parameter bounds its distance to the map from above, so points are searched in the order of
/// that bound, and only until it falls below the largest distance found.
///
/// # Errors
/// [`Error::Count`], [`Error::Dimension`], [`Error::Parameter`], [`Error::NoPoints`].
pub fn directed_hausdorff<const D: usize>(
    map: &SplineMap<D>,
    parameters: ArrayView2<'_, f64>,
    points: ArrayView2<'_, f64>,
) -> Result<f64, Error> {
    check_widths(map, points)?;
    if parameters.dim() != (points.nrows(), D) {
        return Err(Error::Count { what: "rows of parameters", given: parameters.nrows(), expected: points.nrows() });
    }
    let bezier = map.bezier();
    let search = ClosestPoints::new(bezier.clone())?;
    let mut bounds = (0..points.nrows())
        .into_par_iter()
        .map(|index| -> Result<_, Error> {
            let u = std::array::from_fn(|d| parameters[[index, d]]);
            let cell = map.space().locate_cell(u).map_err(|source| Error::Parameter { index, source })?;
            let mut image = [0.0; 3];
            bezier.derivative(cell, u, [0; D], &mut image[..map.dim()]);
            let squared: f64 = points.row(index).iter().zip(&image).map(|(a, b)| (a - b) * (a - b)).sum();
            Ok((squared.sqrt(), index, cell))
        })
        // Of several errors the first, whichever thread is faster.
        .collect::<Vec<_>>()
        .into_iter()
        .collect::<Result<Vec<_>, Error>>()?;
    bounds.par_sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let mut largest = 0.0_f64;
    for batch in bounds.chunks(BATCH).take_while(|batch| batch[0].0 > 0.0) {
        if batch[0].0 <= largest {
            break;
        }
        let distance = |&(_, index, cell): &(f64, usize, usize)| {
            let u = std::array::from_fn(|d| parameters[[index, d]]);
            search.closest_from(&points.row(index).to_vec(), cell, u).distance
        };
        largest = largest.max(batch.par_iter().map(distance).reduce(|| 0.0, f64::max));
    }
    Ok(largest)
}

/// Both directed Hausdorff distances: points `(m, N)` to the map without parameters to start from, and the map, sampled
/// at `samples` parameters per direction and cell, to the points.
///
/// # Errors
/// [`Error::Count`], [`Error::Dimension`], [`Error::NoPoints`].
pub fn hausdorff<const D: usize>(
    map: &SplineMap<D>,
    points: ArrayView2<'_, f64>,
    samples: usize,
) -> Result<Hausdorff, Error> {
    check_widths(map, points)?;
    let search = ClosestPoints::new(map.bezier().clone())?;
    let points_to_map = (0..points.nrows())
        .into_par_iter()
        .map(|i| search.closest(&points.row(i).to_vec()).distance)
        .reduce(|| 0.0, f64::max);
    Ok(Hausdorff { points_to_map, map_to_points: map_to_points(map, points, samples)? })
}

/// Largest distance of samples of the map, `samples` parameters per direction and cell, to their nearest points. Where
/// the map leaves the points, across a void or in a swing between them, this is what tells.
///
/// # Errors
/// [`Error::Count`], [`Error::Dimension`], [`Error::NoPoints`].
pub fn map_to_points<const D: usize>(
    map: &SplineMap<D>,
    points: ArrayView2<'_, f64>,
    samples: usize,
) -> Result<f64, Error> {
    check_widths(map, points)?;
    let tree: ImmutableKdTree<f64, 3> =
        ImmutableKdTree::new_from_slice(&padded(points)).map_err(|_| Error::NoPoints)?;
    let bezier = map.bezier();
    let per_cell = samples.max(2);
    let largest = (0..bezier.n_cells())
        .into_par_iter()
        .map(|cell| {
            let (lower, upper) = bezier.cell_box(cell);
            let mut image = [0.0; 3];
            let mut largest = 0.0_f64;
            for linear in 0..per_cell.pow(D as u32) {
                let u = std::array::from_fn(|d| {
                    let i = linear / per_cell.pow(d as u32) % per_cell;
                    lower[d] + (upper[d] - lower[d]) * i as f64 / (per_cell - 1) as f64
                });
                bezier.derivative(cell, u, [0; D], &mut image[..map.dim()]);
                largest = largest.max(tree.query(&image).nearest_one::<SquaredEuclidean<f64>>().execute().distance);
            }
            largest
        })
        .reduce(|| 0.0, f64::max);
    Ok(largest.sqrt())
}

/// Rows of up to three coordinates, with zeros for those that are missing.
pub(crate) fn padded(rows: ArrayView2<'_, f64>) -> Vec<[f64; 3]> {
    rows.outer_iter().map(|row| std::array::from_fn(|k| row.get(k).copied().unwrap_or(0.0))).collect()
}

pub(crate) fn check_widths<const D: usize>(map: &SplineMap<D>, points: ArrayView2<'_, f64>) -> Result<(), Error> {
    if points.nrows() == 0 {
        return Err(Error::NoPoints);
    }
    if points.ncols() != map.dim() {
        return Err(Error::Count { what: "coordinates of the points", given: points.ncols(), expected: map.dim() });
    }
    if map.dim() > 3 {
        return Err(Error::Dimension { given: map.dim() });
    }
    Ok(())
}

#[cfg(test)]
mod tests;
