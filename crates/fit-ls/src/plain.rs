//! Least squares in any space of cells, without smoothing.

use std::sync::Arc;

use ndarray::{ArrayView1, ArrayView2};
use thb_core::{ParameterBox, SplineMap, SymmetricMatrix, SymmetricPattern};

use crate::cholesky::Cholesky;
use crate::least_squares::penalized;
use crate::{Error, NormalEquations, SortedPoints};

/// The weighted least-squares fit (3.5) of points `(m, N)` at parameters `(m, D)` with weights `(m)`, if given, in any space:
/// tensor-product polynomials, B-splines, box splines. Hierarchical splines with smoothing, refined step by step, are for
/// [`crate::LeastSquares`].
///
/// ```
/// use std::sync::Arc;
/// use fit_ls::weighted_least_squares;
/// use ndarray::Array2;
/// use thb_core::TensorSpace;
///
/// // Biquadratic polynomials.
/// let space = Arc::new(TensorSpace::bernstein([2, 2])?);
/// let uv = Array2::from_shape_fn((25, 2), |(i, d)| [i % 5, i / 5][d] as f64 / 4.0);
/// let z = Array2::from_shape_fn((25, 1), |(i, _)| uv[[i, 0]].powi(2) - uv[[i, 1]]);
/// let fit = weighted_least_squares(&space, uv.view(), z.view(), None)?;
/// assert!((fit.eval([0.3, 0.9])?[0] - (0.09 - 0.9)).abs() < 1e-13);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// Those of [`SortedPoints::new`]; [`Error::Parameter`], [`Error::RankDeficient`], [`Error::OutOfMemory`].
pub fn weighted_least_squares<const D: usize, S: ParameterBox<D>>(
    space: &Arc<S>,
    parameters: ArrayView2<'_, f64>,
    points: ArrayView2<'_, f64>,
    weights: Option<ArrayView1<'_, f64>>,
) -> Result<SplineMap<D, S>, Error> {
    let mut sorted = SortedPoints::<D>::new(parameters, points, weights)?;
    sorted.sort(space.as_ref(), |_| None)?;
    let pattern = SymmetricPattern::new(space.as_ref());
    let equations = NormalEquations::new(space.as_ref(), &pattern, &sorted)?;
    let mut solver = Cholesky::new(&pattern).map_err(|_| Error::OutOfMemory { functions: space.n_functions() })?;
    let none = SymmetricMatrix::zeros(&pattern);
    let coefficients = penalized(&mut solver, equations, &none, 0.0, &Vec::new())?;
    Ok(SplineMap::new(space.clone(), coefficients)?)
}
