//! Parameters by the networks that come with the program.

use ndarray::{Array2, ArrayView2};
use param_classic::{BoundaryParameters, ParamError};
use param_nn::{Bidgcn, Pargcn, PargcnOptions, Reading, grid_parameters};
use point_cloud::GridShape;

use crate::Error;

/// Points that the graph network is given at once: as many as its largest clouds in training had, about.
pub(super) const LARGEST: usize = 2000;

/// Points that are given weights by a network at once: its linear system takes seconds then.
pub(super) const LARGEST_WEIGHTED: usize = 10_000;

/// Parameters of a grid, `(n_u · n_v, 3)` with point `(i, j)` in row `i · n_v + j`, by PARCNN.
pub(super) fn of_grid(points: ArrayView2<'_, f64>, shape: GridShape) -> Result<Array2<f64>, Error> {
    let GridShape { n_u, n_v } = shape;
    let given = points.nrows();
    let wrong = || ParamError::GridMismatch { n_u, n_v, required: n_u.saturating_mul(n_v), given };
    let grid = points.to_shape((n_u, n_v, points.ncols())).map_err(|_| wrong())?;
    let parameters = grid_parameters(grid.view(), None)?;
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
