//! The smoothing weight.

use std::sync::Arc;

use ndarray::{Array1, Array2};
use thb_core::{CellSpace, HierarchicalSpace, Kind, KnotVector, SplineMap, SymmetricPattern, ThinPlate};

use crate::cholesky::Cholesky;
use crate::least_squares::penalized;
use crate::{Error, LeastSquares, NormalEquations, Options, SortedPoints};

/// The smoothing weight λ in `BᵀWB + λG`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lambda {
    /// The given number; 0 switches smoothing off.
    Fixed(f64),
    /// Chosen from the data, among powers of ten times the total weight of the points. Fits of a fine uniform space to
    /// nine tenths of the points are compared by the share of the last tenth that they predict within the tolerance.
    /// Weights that predict about as many as the best one are equally good; of these the largest is taken that does not
    /// keep the fitted points from half the tolerance, or else the smallest. So noise is smoothed, and what is no noise
    /// is not flattened.
    Auto {
        /// Distance up to which a point counts as met; infinity for twice the median error of the best prediction.
        tolerance: f64,
    },
}

/// Every so many points, one is held out.
const HOLD_OUT: usize = 10;

/// Points per function of the space in which weights are compared. It should resolve what the final space resolves:
/// in a coarse one all small weights look the same.
const POINTS_PER_FUNCTION: usize = 2;

/// Largest number of elements per direction of that space; its equations are solved once per candidate.
const MAX_ELEMENTS: usize = 64;

/// Candidates are powers of ten times the total weight of the points, which makes them independent of their number.
const EXPONENTS: std::ops::RangeInclusive<i32> = -13..=-3;

/// Weights that predict this share of the points less than the best one are as good: about one standard deviation of the
/// share of a few hundred points.
const SLACK: f64 = 0.02;

/// Smoothing may use up this share of the tolerance; the rest is left to the coarseness of the adaptive space.
const TOLERANCE_SHARE: f64 = 0.5;

/// Share of the fitted points that smoothing may keep from that part of the tolerance.
const LOST_POINTS: f64 = 0.01;

/// Chooses λ for points sorted by the cells of `space`.
pub(crate) fn choose<const D: usize>(
    points: &SortedPoints<D>,
    space: &HierarchicalSpace<D>,
    options: &Options<D>,
    tolerance: f64,
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
    let unsmoothed = Options { lambda: Lambda::Fixed(0.0), ..options.clone() };
    let mut training = LeastSquares::of(subset(points, &kept)?, unsmoothed.clone())?;
    training.sort(&space)?;
    let pattern = SymmetricPattern::new(space.as_ref());
    let equations = NormalEquations::new(space.as_ref(), &pattern, training.points())?;
    let energy =
        ThinPlate::scaled(space.degree(), options.quadrature, options.lengths).gram(space.as_ref(), &pattern)?;
    let mut solver = Cholesky::new(&pattern).map_err(|_| Error::OutOfMemory { functions: space.n_functions() })?;
    let mut check = LeastSquares::of(subset(points, &held_out)?, unsmoothed)?;
    let mut trials = Vec::new();
    for exponent in EXPONENTS {
        let lambda = total * 10.0_f64.powi(exponent);
        // Weights too small for the equations to be solved are no candidates.
        let Ok(coefficients) = penalized(&mut solver, equations.clone(), &energy, lambda, &Vec::new()) else {
            continue;
        };
        let map = SplineMap::new(space.clone(), coefficients)?;
        let mut predicted = check.distances(&map)?.to_vec();
        predicted.sort_unstable_by(f64::total_cmp);
        let mut fitted = training.distances(&map)?.to_vec();
        fitted.sort_unstable_by(f64::total_cmp);
        trials.push((lambda, predicted, fitted));
    }
    let medians = trials.iter().map(|(_, predicted, _)| predicted[predicted.len() / 2]);
    let met = if tolerance.is_finite() { tolerance } else { 2.0 * medians.fold(f64::INFINITY, f64::min) };
    let share = |sorted: &[f64], limit: f64| sorted.partition_point(|&e| e <= limit) as f64 / sorted.len() as f64;
    let candidates: Vec<Candidate> = trials
        .iter()
        .map(|(lambda, predicted, fitted)| Candidate {
            lambda: *lambda,
            predicted: share(predicted, met),
            fitted: share(fitted, TOLERANCE_SHARE * met),
        })
        .collect();
    tracing::debug!(?candidates, "smoothing weights");
    Ok(select(&candidates).unwrap_or(smallest))
}

/// A weight, the share of the held-out points that it predicts within the tolerance, and that of the fitted points which
/// it leaves within half of it.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    lambda: f64,
    predicted: f64,
    fitted: f64,
}

/// The rule of [`Lambda::Auto`] for candidates in increasing order.
fn select(candidates: &[Candidate]) -> Option<f64> {
    let best = candidates.iter().map(|c| c.predicted).fold(0.0, f64::max);
    let good: Vec<_> = candidates.iter().filter(|c| c.predicted >= best - SLACK).collect();
    let most = good.iter().map(|c| c.fitted).fold(0.0, f64::max);
    good.iter().rev().find(|c| c.fitted >= most - LOST_POINTS).map(|c| c.lambda)
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

fn subset<const D: usize>(points: &SortedPoints<D>, chosen: &[usize]) -> Result<SortedPoints<D>, Error> {
    let parameters = Array2::from_shape_fn((chosen.len(), D), |(i, d)| points.parameters[d][chosen[i]]);
    let targets = Array2::from_shape_fn((chosen.len(), points.dim()), |(i, k)| points.points[k][chosen[i]]);
    let weights = points.weights.as_ref().map(|w| Array1::from_iter(chosen.iter().map(|&i| w[i])));
    SortedPoints::new(parameters.view(), targets.view(), weights.as_ref().map(|w| w.view()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn candidate(lambda: f64, predicted: f64, fitted: f64) -> Candidate {
        Candidate { lambda, predicted, fitted }
    }

    #[test]
    fn the_largest_harmless_weight_is_taken() {
        // Without noise: small weights are equal, larger ones flatten.
        let clean =
            [candidate(1.0, 0.9, 1.0), candidate(2.0, 0.9, 0.995), candidate(3.0, 0.89, 0.9), candidate(4.0, 0.3, 0.1)];
        assert_eq!(select(&clean), Some(2.0));
        // Noise beyond the tolerance: small weights follow the noise and predict less.
        let noisy =
            [candidate(1.0, 0.3, 0.9), candidate(2.0, 0.5, 0.4), candidate(3.0, 0.51, 0.35), candidate(4.0, 0.2, 0.1)];
        assert_eq!(select(&noisy), Some(2.0));
        assert_eq!(select(&[]), None);
    }
}
