//! The smoothing weight.

use std::sync::Arc;

use ndarray::Array2;
use thb_core::{CellSpace, HierarchicalSpace, Kind, KnotVector, SymmetricPattern, ThinPlate};

use crate::cholesky::Cholesky;
use crate::least_squares::penalized;
use crate::{Error, LeastSquares, NormalEquations, Options, SortedPoints};

/// The smoothing weight λ in `BᵀWB + λG`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lambda {
    /// The given number; 0 switches smoothing off.
    Fixed(f64),
    /// Chosen from the data: fits with several weights to nine tenths of the points are compared on the last tenth, and
    /// the largest weight is taken whose error there is within two percent of the smallest.
    Auto,
}

/// Every so many points, one is held out.
const HOLD_OUT: usize = 10;

/// Points per function of the space in which weights are compared; fewer would let the energy decide, many more would
/// hide noise in the bias of a coarse space.
const POINTS_PER_FUNCTION: usize = 8;

/// Largest number of elements per direction of that space; its equations are solved some ten times.
const MAX_ELEMENTS: usize = 48;

/// Candidates are powers of ten times the total weight of the points, which makes them independent of their number.
const EXPONENTS: std::ops::RangeInclusive<i32> = -13..=-3;

/// Weights whose error exceeds the smallest by less than this factor are as good.
const SLACK: f64 = 1.02;

/// Chooses λ for points sorted by the cells of `space`.
pub(crate) fn choose<const D: usize>(
    points: &SortedPoints<D>,
    space: &HierarchicalSpace<D>,
    options: &Options<D>,
) -> Result<f64, Error> {
    let total = points.total_weight();
    // Held-out points are spread over the domain, since the points are sorted by cell.
    let is_held_out = |at: usize| at % HOLD_OUT == HOLD_OUT / 2;
    let kept: Vec<usize> = (0..points.len()).filter(|&at| !is_held_out(at)).collect();
    let held_out: Vec<usize> = (0..points.len()).filter(|&at| is_held_out(at)).collect();
    let smallest = total * 10.0_f64.powi(*EXPONENTS.start());
    if held_out.is_empty() {
        return Ok(smallest);
    }
    let space = Arc::new(comparison_space(space, kept.len())?);
    let mut training = subset(points, &kept)?;
    training.sort_refined(&space, None)?;
    let pattern = SymmetricPattern::new(space.as_ref());
    let equations = NormalEquations::new(space.as_ref(), &pattern, &training)?;
    let energy =
        ThinPlate::scaled(space.degree(), options.quadrature, options.lengths).gram(space.as_ref(), &pattern)?;
    let mut solver = Cholesky::new(&pattern).map_err(|_| Error::OutOfMemory { functions: space.n_functions() })?;
    let (parameters, targets) = arrays(points, &held_out);
    let check = Options { lambda: Lambda::Fixed(0.0), ..options.clone() };
    let mut check = LeastSquares::<D>::new(parameters.view(), targets.view(), None, check)?;
    let mut candidates = Vec::new();
    for exponent in EXPONENTS {
        let lambda = total * 10.0_f64.powi(exponent);
        // Weights too small for the equations to be solved are no candidates.
        let Ok(coefficients) = penalized(&mut solver, equations.clone(), &energy, lambda, &Vec::new()) else {
            continue;
        };
        let map = thb_core::SplineMap::new(space.clone(), coefficients)?;
        let squares: f64 = check.distances(&map)?.iter().map(|e| e * e).sum();
        tracing::debug!(lambda, rmse = (squares / held_out.len() as f64).sqrt(), "held-out error");
        candidates.push((lambda, squares));
    }
    let best = candidates.iter().map(|c| c.1).fold(f64::INFINITY, f64::min);
    let chosen = candidates.iter().rev().find(|c| c.1 <= SLACK * SLACK * best);
    Ok(chosen.map_or(smallest, |c| c.0))
}

/// A tensor-product space on the domain of `space`, with a number of functions that suits the number of points.
fn comparison_space<const D: usize>(
    space: &HierarchicalSpace<D>,
    points: usize,
) -> Result<HierarchicalSpace<D>, Error> {
    let per_direction = (points as f64 / POINTS_PER_FUNCTION as f64).powf(1.0 / D as f64) as usize;
    let (lower, upper) = space.domain();
    let mut knots = Vec::with_capacity(D);
    for d in 0..D {
        let degree = space.degree()[d];
        let elements = per_direction.saturating_sub(degree).clamp(1, MAX_ELEMENTS);
        knots.push(KnotVector::uniform(degree, elements)?.on_interval(lower[d], upper[d])?);
    }
    Ok(HierarchicalSpace::new(Kind::Thb, std::array::from_fn(|d| knots[d].clone()))?)
}

fn arrays<const D: usize>(points: &SortedPoints<D>, chosen: &[usize]) -> (Array2<f64>, Array2<f64>) {
    (
        Array2::from_shape_fn((chosen.len(), D), |(i, d)| points.parameters[d][chosen[i]]),
        Array2::from_shape_fn((chosen.len(), points.dim()), |(i, k)| points.points[k][chosen[i]]),
    )
}

fn subset<const D: usize>(points: &SortedPoints<D>, chosen: &[usize]) -> Result<SortedPoints<D>, Error> {
    let (parameters, targets) = arrays(points, chosen);
    let weights = points.weights.as_ref().map(|w| ndarray::Array1::from_iter(chosen.iter().map(|&i| w[i])));
    SortedPoints::new(parameters.view(), targets.view(), weights.as_ref().map(|w| w.view()))
}
