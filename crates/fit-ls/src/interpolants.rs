//! Weighted least squares as a convex combination of interpolants (Imperatore 2024, §3.1.3–3.1.4): Theorem 1 as code, for
//! small spaces and few points.
//!
//! ```
//! use std::sync::Arc;
//! use fit_ls::wls_as_interpolants;
//! use ndarray::array;
//! use thb_core::TensorSpace;
//!
//! // A line through three points is a mean of the three lines through two of them.
//! let lines = Arc::new(TensorSpace::<1>::bernstein([1])?);
//! let (sites, values) = (array![[0.0], [0.5], [1.0]], array![[0.0], [1.0], [0.0]]);
//! let sum = wls_as_interpolants(&lines, sites.view(), values.view(), None)?;
//! assert_eq!(sum.interpolants().len(), 3);
//! // The least-squares line is the constant 1/3.
//! assert!((sum.map()?.eval([0.2])?[0] - 1.0 / 3.0).abs() < 1e-15);
//! // It lies between the lowest and the highest of the three lines.
//! let [low, high] = sum.derivative_bounds([0.2], [0])?[0];
//! assert!(low <= 1.0 / 3.0 && 1.0 / 3.0 <= high);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use std::sync::Arc;

use ndarray::{Array2, ArrayView1, ArrayView2, Axis};
use thb_core::{KnotVector, ParameterBox, SplineMap};

use crate::Error;

/// Most subsets of points that are gone through: some seconds, for ten functions.
const MOST_SUBSETS: usize = 1 << 20;

/// A determinant below this share of the largest that rows of these lengths could have is round-off (Hadamard's inequality).
const ROUND_OFF: f64 = 1e-13;

/// The function of the space through as many points as it has dimensions.
#[derive(Clone, Debug)]
pub struct Interpolant {
    /// The points K, increasing.
    pub points: Vec<usize>,
    /// |B_K|, the determinant of their collocation matrix (3.8).
    pub determinant: f64,
    /// λ_K = ω_K |B_K|² as a share of the sum of all.
    pub share: f64,
    /// Coefficients, `(n, N)`.
    pub coefficients: Array2<f64>,
}

/// A weighted least-squares fit as a convex combination of interpolants (3.10).
#[derive(Clone, Debug)]
pub struct Interpolants<const D: usize, S> {
    space: Arc<S>,
    subsets: usize,
    interpolants: Vec<Interpolant>,
}

impl<const D: usize, S: ParameterBox<D>> Interpolants<D, S> {
    /// The interpolants that exist, in lexicographic order of their points.
    pub fn interpolants(&self) -> &[Interpolant] {
        &self.interpolants
    }

    /// Number of subsets that were tried, K_{n+1} in the thesis.
    pub fn n_subsets(&self) -> usize {
        self.subsets
    }

    /// The combination: the weighted least-squares fit.
    ///
    /// # Errors
    /// [`Error::Space`].
    pub fn map(&self) -> Result<SplineMap<D, S>, Error> {
        let mut sum = Array2::zeros(self.interpolants[0].coefficients.dim());
        self.interpolants.iter().for_each(|k| sum.scaled_add(k.share, &k.coefficients));
        Ok(SplineMap::new(self.space.clone(), sum)?)
    }

    /// For each component the least and the largest value that a derivative of the interpolants has at `u`: bounds of the
    /// derivative of the fit, which is their mean (3.11).
    ///
    /// # Errors
    /// [`Error::Space`].
    pub fn derivative_bounds(&self, u: [f64; D], order: [usize; D]) -> Result<Vec<[f64; 2]>, Error> {
        let mut bounds = vec![[f64::INFINITY, f64::NEG_INFINITY]; self.interpolants[0].coefficients.ncols()];
        for interpolant in &self.interpolants {
            let map = SplineMap::new(self.space.clone(), interpolant.coefficients.clone())?;
            for (bound, value) in bounds.iter_mut().zip(map.derivative(u, order)?) {
                *bound = [bound[0].min(value), bound[1].max(value)];
            }
        }
        Ok(bounds)
    }
}

/// The weighted least-squares fit of points `(m, N)` at parameters `(m, D)` with positive weights `(m)`, taken apart into
/// the interpolants of all subsets of n points, n the dimension of the space (Imperatore 2024, Theorem 1).
///
/// # Errors
/// [`Error::Shape`], [`Error::Weight`], [`Error::Space`]; [`Error::TooManySubsets`]; [`Error::NoInterpolant`] where no subset
/// has an interpolant, that is, where the points do not determine the fit.
pub fn wls_as_interpolants<const D: usize, S: ParameterBox<D>>(
    space: &Arc<S>,
    parameters: ArrayView2<'_, f64>,
    points: ArrayView2<'_, f64>,
    weights: Option<ArrayView1<'_, f64>>,
) -> Result<Interpolants<D, S>, Error> {
    wls_limit(space, parameters, points, weights, &[])
}

/// As [`wls_as_interpolants`], of the limit of the fit as the weights of some points grow beyond all bounds (Remark 13): the
/// mean of the interpolants of those points and others, with the weights of the others. Of as many such points as the
/// space has dimensions it is their interpolant.
///
/// # Errors
/// As [`wls_as_interpolants`]; [`Error::NoInterpolant`] also where the points of infinite weight cannot all be interpolated.
pub fn wls_limit<const D: usize, S: ParameterBox<D>>(
    space: &Arc<S>,
    parameters: ArrayView2<'_, f64>,
    points: ArrayView2<'_, f64>,
    weights: Option<ArrayView1<'_, f64>>,
    infinite: &[usize],
) -> Result<Interpolants<D, S>, Error> {
    let (m, n) = (parameters.nrows(), space.n_functions());
    let lengths = [("points", points.nrows()), ("weights", weights.map_or(m, |w| w.len()))];
    if let Some(&(what, given)) = lengths.iter().find(|(_, given)| *given != m) {
        return Err(Error::Shape { what, given, expected: m });
    }
    let log_weight = |index: usize| match weights.map_or(1.0, |w| w[index]) {
        weight if weight > 0.0 && weight.is_finite() => Ok(weight.ln()),
        value => Err(Error::Weight { index, value }),
    };
    let logs = (0..m).map(log_weight).collect::<Result<Vec<_>, _>>()?;
    let mut kept = infinite.to_vec();
    kept.sort_unstable();
    kept.dedup();
    if let Some(&given) = kept.iter().find(|&&index| index >= m) {
        return Err(Error::Shape { what: "point of infinite weight", given, expected: m });
    }
    let others: Vec<usize> = (0..m).filter(|index| kept.binary_search(index).is_err()).collect();
    let chosen = n.checked_sub(kept.len()).ok_or(Error::NoInterpolant { points: kept.len(), functions: n })?;
    let subsets = binomial(others.len(), chosen);
    if subsets > MOST_SUBSETS {
        return Err(Error::TooManySubsets { points: m, functions: n, limit: MOST_SUBSETS });
    }
    let collocation = collocation_matrix(space, parameters)?;
    let mut interpolants = Vec::new();
    let mut log_shares = Vec::new();
    for_each_subset(others.len(), chosen, |subset| {
        let mut members: Vec<usize> = subset.iter().map(|&k| others[k]).chain(kept.iter().copied()).collect();
        members.sort_unstable();
        let (matrix, right) = (collocation.select(Axis(0), &members), points.select(Axis(0), &members));
        if let Some((determinant, coefficients)) = interpolate(matrix, right) {
            // In logarithms: products of weights and determinants leave the range of numbers.
            let weight: f64 = subset.iter().map(|&k| logs[others[k]]).sum();
            log_shares.push(weight + 2.0 * determinant.abs().ln());
            interpolants.push(Interpolant { points: members, determinant, share: 0.0, coefficients });
        }
    });
    let largest = log_shares.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let total: f64 = log_shares.iter().map(|l| (l - largest).exp()).sum();
    if interpolants.is_empty() {
        return Err(Error::NoInterpolant { points: m, functions: n });
    }
    for (interpolant, log) in interpolants.iter_mut().zip(log_shares) {
        interpolant.share = (log - largest).exp() / total;
    }
    Ok(Interpolants { space: space.clone(), subsets, interpolants })
}

/// Values of all functions of a small space at parameters `(m, D)`: `(m, n)`, the matrix (3.4).
///
/// # Errors
/// [`Error::Space`] for parameters outside the domain.
pub fn collocation_matrix<const D: usize, S: ParameterBox<D>>(
    space: &Arc<S>,
    parameters: ArrayView2<'_, f64>,
) -> Result<Array2<f64>, Error> {
    // The map whose coefficients are the unit vectors has the functions as its components.
    Ok(SplineMap::new(space.clone(), Array2::eye(space.n_functions()))?.eval_batch(parameters)?)
}

/// Whether sites determine a spline of the knots: some of them lie, one for each B-spline and in their order, where that
/// does not vanish (Schoenberg and Whitney 1953). Sites need not be sorted; equal ones count once.
///
/// For open knots this is necessary and sufficient for least squares without smoothing to have one solution; for periodic
/// ones it is necessary.
pub fn schoenberg_whitney(knots: &KnotVector, sites: &[f64]) -> bool {
    let (lower, upper) = knots.domain();
    let mut sorted: Vec<f64> = sites.iter().copied().filter(|u| (lower..=upper).contains(u)).collect();
    sorted.sort_by(f64::total_cmp);
    sorted.dedup();
    let (m, n, p, t) = (sorted.len(), knots.n_functions(), knots.degree(), knots.knots());
    if m < n {
        return false;
    }
    if !knots.is_periodic() {
        let is_positive = |i: usize, u: f64| {
            let (left, right) = (t[i], t[i + p + 1]);
            // Where all its knots but the last one coincide a B-spline starts with a jump, and so at the end of the domain.
            let from = u > left || u == left && t[i + p] == left;
            from && (u < right || u == right && right == upper && t[i + 1] == right)
        };
        return takes(n, 0, |i, k| k < m && is_positive(i, sorted[k]), |i, k| k < m && sorted[k] < t[i + p + 1]);
    }
    // Sites go round: site k is site k − m a period on. The functions' knots start before the domain.
    let period = upper - lower;
    sorted.retain(|&u| u < upper);
    let m = sorted.len();
    let site = |k: usize| sorted[k % m] + period * (k / m) as f64 - period;
    let starts = (0..2 * m).filter(|&k| site(k) > t[0] && site(k) < t[p + 1]);
    m >= n
        && starts.into_iter().any(|start| {
            let within = |k: usize| k < start + m;
            let is_positive = |i: usize, k: usize| within(k) && site(k) > t[i] && site(k) < t[i + p + 1];
            takes(n, start, is_positive, |i, k| within(k) && site(k) < t[i + p + 1])
        })
}

/// Whether each of `n` functions can take a site of its own, both in order: each takes the first that suits it.
fn takes(
    n: usize,
    start: usize,
    suits: impl Fn(usize, usize) -> bool,
    may_suit_later: impl Fn(usize, usize) -> bool,
) -> bool {
    let mut next = start;
    for function in 0..n {
        while !suits(function, next) {
            if !may_suit_later(function, next) {
                return false;
            }
            next += 1;
        }
        next += 1;
    }
    true
}

/// The number of subsets, or more than the limit.
fn binomial(n: usize, k: usize) -> usize {
    if k > n {
        return 0;
    }
    (0..k.min(n - k)).fold(1_usize, |product, i| product.saturating_mul(n - i) / (i + 1))
}

/// Calls `each` for all subsets of `0..n` with `k` members, in lexicographic order.
fn for_each_subset(n: usize, k: usize, mut each: impl FnMut(&[usize])) {
    if k > n {
        return;
    }
    let mut subset: Vec<usize> = (0..k).collect();
    loop {
        each(&subset);
        let Some(place) = (0..k).rev().find(|&i| subset[i] < n - k + i) else { return };
        subset[place] += 1;
        (place + 1..k).for_each(|i| subset[i] = subset[i - 1] + 1);
    }
}

/// Determinant and solution of a square system, by elimination with row pivots; none if it is singular up to round-off.
fn interpolate(mut matrix: Array2<f64>, mut right: Array2<f64>) -> Option<(f64, Array2<f64>)> {
    let n = matrix.nrows();
    let largest: f64 = matrix.outer_iter().map(|row| row.dot(&row).sqrt()).product();
    let mut determinant = 1.0;
    for column in 0..n {
        let pivot = (column..n)
            .max_by(|&a, &b| matrix[[a, column]].abs().total_cmp(&matrix[[b, column]].abs()).then(b.cmp(&a)))?;
        if pivot != column {
            (0..n).for_each(|k| matrix.swap([pivot, k], [column, k]));
            (0..right.ncols()).for_each(|k| right.swap([pivot, k], [column, k]));
            determinant = -determinant;
        }
        let value = matrix[[column, column]];
        determinant *= value;
        if value == 0.0 {
            return None;
        }
        for row in column + 1..n {
            let factor = matrix[[row, column]] / value;
            (column..n).for_each(|k| matrix[[row, k]] -= factor * matrix[[column, k]]);
            (0..right.ncols()).for_each(|k| right[[row, k]] -= factor * right[[column, k]]);
        }
    }
    if determinant.abs() <= ROUND_OFF * largest {
        return None;
    }
    for row in (0..n).rev() {
        for k in 0..right.ncols() {
            let known: f64 = (row + 1..n).map(|j| matrix[[row, j]] * right[[j, k]]).sum();
            right[[row, k]] = (right[[row, k]] - known) / matrix[[row, row]];
        }
    }
    Some((determinant, right))
}
