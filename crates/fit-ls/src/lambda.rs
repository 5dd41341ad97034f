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
    /// Chosen from the data, among powers of ten times the total weight of the points. Fits of fine uniform spaces to
    /// nine tenths of the points are compared by how well they predict the last tenth. Weights that predict about as
    /// well as the best one are equally good; of these the largest is taken that does not keep the fitted points from
    /// half the tolerance. So noise is smoothed, voids are spanned calmly, and what is no noise is not flattened.
    Auto {
        /// Distance up to which a point counts as met; infinity for twice the median error of the best prediction.
        tolerance: f64,
    },
    /// The minimum of generalized cross-validation, sought anew in each space: for points with noise of unknown size that is
    /// independent from point to point. Wahba's score `m Σ ω|r|² / (m − tr H)²` estimates the error of prediction; the trace
    /// of the influence matrix H is estimated by random probes with a fixed seed.
    CrossValidation,
    /// The largest weight with which the root mean squared distance of the points is at most a known noise, sought anew in
    /// each space (Morozov's discrepancy principle).
    Discrepancy {
        /// Root mean squared distance of the points from the true map.
        noise: f64,
    },
}

impl Lambda {
    /// Checks the numbers.
    ///
    /// # Errors
    /// [`Error::Lambda`], [`Error::Noise`].
    pub fn check(self) -> Result<(), Error> {
        match self {
            Self::Fixed(value) if !(value.is_finite() && value >= 0.0) => Err(Error::Lambda { value }),
            Self::Discrepancy { noise: value } if !(value.is_finite() && value > 0.0) => Err(Error::Noise { value }),
            _ => Ok(()),
        }
    }
}

/// Every so many points, one is held out.
const HOLD_OUT: usize = 10;

/// Binary digits per direction of the curve along which points are counted for that.
const CURVE_BITS: u32 = 12;

/// Shift of the curve in its steps, against lines of grids at round fractions of the domain.
const CURVE_SHIFT: f64 = std::f64::consts::FRAC_1_PI;

/// Points per function of the spaces in which weights are compared. They should resolve what the final space resolves:
/// in a coarse one all small weights look the same.
const POINTS_PER_FUNCTION: usize = 2;

/// Points in a window. Equations of a window, with half as many unknowns, are solved once per candidate; larger clouds
/// are judged by `WINDOWS` windows per direction instead of the whole.
const WINDOW_POINTS: usize = 2500;

/// Windows per direction.
const WINDOWS: usize = 3;

/// Fewer points than this in a window say nothing.
const FEWEST_POINTS: usize = 20;

/// Candidates are powers of ten times the total weight of the points, which makes them independent of their number.
const EXPONENTS: std::ops::RangeInclusive<i32> = -13..=-3;

/// Share of a window's edge that the reach of a weight may have: the length over which a smoothing spline averages,
/// `(λ / density)^(1/4)`. A window that a weight flattens as a whole cannot tell it from one that suits the data.
const REACH: f64 = 0.25;

/// Weights whose root mean squared prediction error exceeds the smallest by less than this factor are as good. Points
/// next to voids dominate that error; a closer comparison would smooth all of the surface for their sake.
const SLACK: f64 = 1.25;

/// Smoothing may use up this share of the tolerance; the rest is left to the coarseness of the adaptive space.
const TOLERANCE_SHARE: f64 = 0.5;

/// Share of the fitted points that smoothing may keep from that part of the tolerance.
const LOST_POINTS: f64 = 0.02;

/// The smoothing weight that [`Lambda::Auto`] chooses for points sorted by the cells of `space`; `options.lambda` does not
/// matter.
///
/// # Errors
/// Those of [`LeastSquares::fit`].
pub fn automatic_lambda<const D: usize>(
    points: &SortedPoints<D>,
    space: &HierarchicalSpace<D>,
    options: &Options<D>,
    tolerance: f64,
) -> Result<f64, Error> {
    let windows = windows(space.domain(), points.len());
    let largest =
        windows.first().map_or(f64::INFINITY, |window| largest_judged(window, space.domain(), points, options));
    let mut lambdas: Vec<f64> = EXPONENTS.map(|exponent| points.total_weight() * 10.0_f64.powi(exponent)).collect();
    let judged = lambdas.partition_point(|&lambda| lambda <= largest).max(1);
    lambdas.truncate(judged);
    let mut trials: Vec<Trial> = lambdas.iter().map(|&lambda| Trial { lambda, ..Trial::default() }).collect();
    for window in windows {
        // What has no weight is neither fitted nor predicted.
        let counts = |at: usize| points.weights().is_none_or(|w| w[at] > 0.0);
        let inside: Vec<usize> =
            (0..points.len()).filter(|&at| counts(at) && contains(&window, points.parameter(at))).collect();
        if inside.len() >= FEWEST_POINTS {
            compare(points, &inside, space.degree(), &window, options, &mut trials)?;
        }
    }
    // Weights too small for the equations to be solved are no candidates.
    trials.retain(|trial| !trial.failed && !trial.predicted.is_empty());
    for trial in &mut trials {
        trial.predicted.sort_unstable_by(f64::total_cmp);
        trial.fitted.sort_unstable_by(f64::total_cmp);
    }
    let medians = trials.iter().map(|trial| trial.predicted[trial.predicted.len() / 2]);
    let met = if tolerance.is_finite() { tolerance } else { 2.0 * medians.fold(f64::INFINITY, f64::min) };
    let share = |sorted: &[f64], limit: f64| sorted.partition_point(|&e| e <= limit) as f64 / sorted.len() as f64;
    let candidates: Vec<Candidate> = trials
        .iter()
        .map(|trial| Candidate {
            lambda: trial.lambda,
            error: (trial.predicted.iter().map(|e| e * e).sum::<f64>() / trial.predicted.len() as f64).sqrt(),
            fitted: share(&trial.fitted, TOLERANCE_SHARE * met),
        })
        .collect();
    tracing::debug!(?candidates, "smoothing weights");
    Ok(select(&candidates).unwrap_or(lambdas[0]))
}

/// A box of parameters, by its corners.
type Window<const D: usize> = ([f64; D], [f64; D]);

/// The whole domain, or for large clouds a few windows spread over it.
fn windows<const D: usize>((lower, upper): Window<D>, points: usize) -> Vec<Window<D>> {
    let count = WINDOWS.pow(D as u32);
    if points <= count * WINDOW_POINTS {
        return vec![(lower, upper)];
    }
    let edge = (WINDOW_POINTS as f64 / points as f64).powf(1.0 / D as f64);
    (0..count)
        .map(|linear| {
            let corner = |d: usize, side: f64| {
                let centre = ((linear / WINDOWS.pow(d as u32) % WINDOWS) as f64 + 0.5) / WINDOWS as f64;
                lower[d] + (upper[d] - lower[d]) * (centre + side * edge)
            };
            (std::array::from_fn(|d| corner(d, -0.5)), std::array::from_fn(|d| corner(d, 0.5)))
        })
        .collect()
}

fn contains<const D: usize>((lower, upper): &Window<D>, u: [f64; D]) -> bool {
    (0..D).all(|d| (lower[d]..=upper[d]).contains(&u[d]))
}

/// The largest weight that windows of this size can judge.
fn largest_judged<const D: usize>(
    window: &Window<D>,
    domain: Window<D>,
    points: &SortedPoints<D>,
    options: &Options<D>,
) -> f64 {
    let extents =
        |(lower, upper): &Window<D>| std::array::from_fn::<f64, D, _>(|d| (upper[d] - lower[d]) * options.lengths[d]);
    let density = points.total_weight() / extents(&domain).iter().product::<f64>();
    let edge = extents(window).into_iter().fold(f64::INFINITY, f64::min);
    density * (REACH * edge).powi(4)
}

/// Errors with one weight, over all windows.
#[derive(Clone, Debug, Default)]
struct Trial {
    lambda: f64,
    /// Errors at held-out points.
    predicted: Vec<f64>,
    /// Errors at the points that were fitted.
    fitted: Vec<f64>,
    failed: bool,
}

/// Fits the points of a window with each weight and adds their errors to the trials.
fn compare<const D: usize>(
    points: &SortedPoints<D>,
    inside: &[usize],
    degree: [usize; D],
    window: &Window<D>,
    options: &Options<D>,
    trials: &mut [Trial],
) -> Result<(), Error> {
    let inside = along_z_curve(points, inside, window);
    let (held_out, kept): (Vec<_>, Vec<_>) = inside.iter().enumerate().partition(|(k, _)| k % HOLD_OUT == HOLD_OUT / 2);
    let of = |chosen: Vec<(usize, &usize)>| chosen.into_iter().map(|(_, &at)| at).collect::<Vec<_>>();
    let (held_out, kept) = (of(held_out), of(kept));
    let space = Arc::new(comparison_space(degree, window, kept.len())?);
    let unsmoothed = Options { lambda: Lambda::Fixed(0.0), ..options.clone() };
    let mut training = LeastSquares::of(subset(points, &kept)?, unsmoothed.clone())?;
    let mut check = LeastSquares::of(subset(points, &held_out)?, unsmoothed)?;
    training.sort(&space)?;
    let pattern = SymmetricPattern::new(space.as_ref());
    let equations = NormalEquations::new(space.as_ref(), &pattern, training.points())?;
    let energy = ThinPlate::scaled(degree, options.quadrature, options.lengths).gram(space.as_ref(), &pattern)?;
    let mut solver = Cholesky::new(&pattern).map_err(|_| Error::OutOfMemory { functions: space.n_functions() })?;
    for trial in trials {
        match penalized(&mut solver, equations.clone(), &energy, trial.lambda, &Vec::new()) {
            Ok(coefficients) => {
                let map = SplineMap::new(space.clone(), coefficients)?;
                trial.predicted.extend_from_slice(check.distances(&map)?);
                trial.fitted.extend_from_slice(training.distances(&map)?);
            }
            Err(_) => trial.failed = true,
        }
    }
    Ok(())
}

/// A weight, its root mean squared error at held-out points, and the share of the fitted points that it leaves within
/// half the tolerance.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    lambda: f64,
    error: f64,
    fitted: f64,
}

/// The rule of [`Lambda::Auto`] for candidates in increasing order.
fn select(candidates: &[Candidate]) -> Option<f64> {
    let best = candidates.iter().map(|c| c.error).fold(f64::INFINITY, f64::min);
    let good: Vec<_> = candidates.iter().filter(|c| c.error <= SLACK * best).collect();
    let most = good.iter().map(|c| c.fitted).fold(0.0, f64::max);
    good.iter().rev().find(|c| c.fitted >= most - LOST_POINTS).map(|c| c.lambda)
}

/// Some of the points, by their places, along a Z-curve through the window: so every tenth is spread over it, whatever the order of the
/// points.
fn along_z_curve<const D: usize>(points: &SortedPoints<D>, chosen: &[usize], (lower, upper): &Window<D>) -> Vec<usize> {
    let key = |at: usize| {
        let u = points.parameter(at);
        // Round-off decides nothing where parameters lie on the lines of a grid, but for lines that happen to be those of the curve.
        let steps: [u64; D] = std::array::from_fn(|d| {
            ((u[d] - lower[d]) / (upper[d] - lower[d]) * f64::from(1 << CURVE_BITS) + CURVE_SHIFT) as u64
        });
        (0..=CURVE_BITS).rev().flat_map(|bit| steps.map(|step| step >> bit & 1)).fold(0_u64, |key, bit| key << 1 | bit)
    };
    let mut order: Vec<(u64, usize)> = chosen.iter().map(|&at| (key(at), at)).collect();
    order.sort_unstable();
    order.into_iter().map(|(_, at)| at).collect()
}

/// A tensor-product space on a window, with a number of functions that suits the number of points.
fn comparison_space<const D: usize>(
    degree: [usize; D],
    (lower, upper): &Window<D>,
    points: usize,
) -> Result<HierarchicalSpace<D>, Error> {
    let per_direction = (points as f64 / POINTS_PER_FUNCTION as f64).powf(1.0 / D as f64) as usize;
    let mut knots = Vec::with_capacity(D);
    for d in 0..D {
        let elements = per_direction.saturating_sub(degree[d]).max(1);
        knots.push(KnotVector::uniform(degree[d], elements)?.on_interval(lower[d], upper[d])?);
    }
    Ok(HierarchicalSpace::new(Kind::Thb, std::array::from_fn(|d| knots[d].clone()))?)
}

/// A uniform space of about so many functions, with the degree and domain of another; open in all directions.
pub(crate) fn uniform_space<const D: usize>(
    like: &HierarchicalSpace<D>,
    functions: usize,
) -> Result<HierarchicalSpace<D>, Error> {
    comparison_space(like.degree(), &like.domain(), POINTS_PER_FUNCTION * functions)
}

/// Some of the points, by their places.
pub(crate) fn subset<const D: usize>(points: &SortedPoints<D>, chosen: &[usize]) -> Result<SortedPoints<D>, Error> {
    let parameters = Array2::from_shape_fn((chosen.len(), D), |(i, d)| points.parameters[d][chosen[i]]);
    let targets = Array2::from_shape_fn((chosen.len(), points.dim()), |(i, k)| points.points[k][chosen[i]]);
    let weights = points.weights.as_ref().map(|w| Array1::from_iter(chosen.iter().map(|&i| w[i])));
    SortedPoints::new(parameters.view(), targets.view(), weights.as_ref().map(|w| w.view()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn candidate(lambda: f64, error: f64, fitted: f64) -> Candidate {
        Candidate { lambda, error, fitted }
    }

    #[test]
    fn the_largest_harmless_weight_is_taken() {
        // Without noise: small weights are equal, larger ones flatten.
        let clean =
            [candidate(1.0, 0.1, 1.0), candidate(2.0, 0.1, 0.995), candidate(3.0, 0.11, 0.9), candidate(4.0, 1.0, 0.1)];
        assert_eq!(select(&clean), Some(2.0));
        // Noise beyond the tolerance: small weights follow the noise and predict worse.
        let noisy =
            [candidate(1.0, 0.3, 0.9), candidate(2.0, 0.12, 0.4), candidate(3.0, 0.1, 0.395), candidate(4.0, 0.2, 0.1)];
        assert_eq!(select(&noisy), Some(3.0));
        assert_eq!(select(&[]), None);
    }
}
