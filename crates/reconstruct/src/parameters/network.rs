//! Parameters by the networks that come with the program.

use ndarray::{Array2, ArrayView2};
use param_classic::{BoundaryParameters, ParamError};
use param_nn::{Bidgcn, Pargcn, PargcnOptions, Reading, SplineSpace, grid_parameters};
use point_cloud::GridShape;

use crate::Error;
use crate::options::ToldSpline;

/// Functions along a line of a grid that the network can be told of.
const MOST_FUNCTIONS: usize = 24;

/// Points that the graph network is given at once: as many as its largest clouds in training had, about.
pub(super) const LARGEST: usize = 2000;

/// Points that are given weights by a network at once: its linear system takes seconds then.
pub(super) const LARGEST_WEIGHTED: usize = 10_000;

/// Parameters of a grid, `(n_u · n_v, 3)` with point `(i, j)` in row `i · n_v + j`, by PARCNN, which is told of the splines that
/// are fitted as far as it can be: it knows of [`MOST_FUNCTIONS`] along a line.
pub(super) fn of_grid(
    points: ArrayView2<'_, f64>,
    shape: GridShape,
    told: Option<ToldSpline>,
) -> Result<Array2<f64>, Error> {
    let GridShape { n_u, n_v } = shape;
    let given = points.nrows();
    let wrong = || ParamError::GridMismatch { n_u, n_v, required: n_u.saturating_mul(n_v), given };
    let grid = points.to_shape((n_u, n_v, points.ncols())).map_err(|_| wrong())?;
    let space = told.map(|ToldSpline { degree, elements }| {
        let elements = elements.unwrap_or(SplineSpace::suggested(n_u.min(n_v)).elements);
        SplineSpace { degree, elements: elements.clamp(1, MOST_FUNCTIONS.saturating_sub(degree).max(1)) }
    });
    let parameters = grid_parameters(grid.view(), space)?;
    Ok(parameters.into_shape_with_order((given, 2)).map_err(|_| wrong())?)
}

/// Parameters of a cloud with known boundary by BIDGCN, the mean over the positions of the square.
pub(super) fn of_cloud(points: ArrayView2<'_, f64>, fixed: &BoundaryParameters) -> Result<Array2<f64>, Error> {
    Ok(Bidgcn::embedded()?.read_as(Reading::BEST).predict(points, &fixed.points, fixed.parameters.view())?)
}

/// Parameters of a cloud with known boundary by PARGCN.
pub(super) fn by_learned_weights(
    points: ArrayView2<'_, f64>,
    fixed: &BoundaryParameters,
) -> Result<Array2<f64>, Error> {
    Ok(Pargcn::embedded()?.predict(points, &fixed.points, fixed.parameters.view(), &PargcnOptions::default())?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grids_are_laid_out_for_the_splines_that_are_fitted() {
        let shape = GridShape { n_u: 12, n_v: 12 };
        let points = Array2::from_shape_fn((144, 3), |(row, k)| {
            let (u, v) = ((row / 12) as f64 / 11.0, (row % 12) as f64 / 11.0);
            [u * u, v, (5.0 * u).sin() * v][k]
        });
        let by = |told| of_grid(points.view(), shape, told).unwrap();
        let told = |degree, elements| by(Some(ToldSpline { degree, elements }));
        let supposed = SplineSpace::suggested(12);
        assert_eq!(by(None), told(supposed.degree, None));
        assert_eq!(by(None), told(supposed.degree, Some(supposed.elements)));
        assert_ne!(told(2, Some(1)), told(3, Some(1)));
        assert_ne!(told(2, Some(1)), told(2, Some(3)));
        // More than it can be told of counts as the most.
        assert_eq!(told(2, Some(22)), told(2, Some(400)));
    }
}
