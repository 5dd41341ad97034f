//! The smoothing weight by generalized cross-validation, and by the discrepancy with a known noise.
//!
//! Both look at fits of the same points in the same space for many weights λ. The points are reduced once; each weight costs
//! one factorization `BᵀWB + λG` of a known pattern, and one solution for the points and a few probes together.

use std::sync::Arc;

use ndarray::{Array2, ArrayView1, Axis};
use thb_core::{HierarchicalSpace, SplineMap, SymmetricMatrix};

use crate::cholesky::Cholesky;
use crate::{Error, NormalEquations, SortedPoints};

/// Probes of the trace (Hutchinson's estimator) such that points times probes are about this many: the trace of the influence
/// matrix is then known to a per cent or so of the number of points.
const PROBED: usize = 16_000;

/// Fewest and most probes.
const PROBES: (usize, usize) = (4, 24);

/// Seed of the probes; its number means nothing. The same signs serve all weights, so that scores can be compared.
const SEED: u64 = 0x0005_EED0_F4C5;

/// Weights that are looked at, in powers of ten of the ratio of the traces of `BᵀWB` and `G`. Below, smoothing does not reach
/// the finest functions; above, only polynomials that have no energy are left.
const EXPONENTS: (f64, f64) = (-6.0, 9.0);

/// Steps over all weights, in powers of ten, with nothing known: scores may have several minima.
const SCAN: f64 = 2.5;

/// Steps around the weight of a coarser space, one after the other. A parabola through the last three places the minimum:
/// scores rise more steeply on the side of too much smoothing, which misleads one through distant weights.
const STEPS: [f64; 2] = [1.0, 0.4];

/// Precision of the discrepancy, in powers of ten.
const PRECISION: f64 = 0.1;

/// Squared residuals below this share of the squared points cannot be told from moments, which cancel.
const CANCELLATION: f64 = 1e-8;

/// The weight that minimizes Craven and Wahba's score `m Σ ω|r|² / (m − tr H)²`, where H maps points to their fit.
pub(crate) fn by_cross_validation<const D: usize>(path: &mut Path<'_, D>, guess: Option<f64>) -> Result<f64, Error> {
    let m = path.counted as f64;
    let score = |exponent: f64, path: &mut Path<'_, D>| -> Result<f64, Error> {
        let Some(trial) = path.at(exponent)? else { return Ok(f64::INFINITY) };
        let free = m - trial.trace;
        // A space that can interpolate leaves nothing to judge by.
        Ok(if free > 0.5 { trial.squares / (free * free) } else { f64::INFINITY })
    };
    let mut known: Vec<(f64, f64)> = Vec::new();
    let mut best = match guess {
        Some(lambda) => path.exponent(lambda),
        None => {
            let count = ((EXPONENTS.1 - EXPONENTS.0) / SCAN) as usize;
            for k in 0..=count {
                let at = EXPONENTS.0 + SCAN * k as f64;
                known.push((at, score(at, path)?));
            }
            lowest(&known)
        }
    };
    for step in STEPS {
        loop {
            for side in [-step, 0.0, step] {
                let at = (best + side).clamp(EXPONENTS.0, EXPONENTS.1);
                if known.iter().all(|&(other, _)| (other - at).abs() > 0.1 * step) {
                    known.push((at, score(at, path)?));
                }
            }
            let lower = lowest(&known);
            if lower == best {
                break;
            }
            best = lower;
        }
    }
    known.sort_by(|a, b| a.0.total_cmp(&b.0));
    tracing::debug!(scores = ?known, "cross-validation");
    Ok(path.lambda(vertex(&known, best)))
}

/// The largest weight with which the root mean squared distance `(Σ ω|r|² / Σ ω)^½` is at most `noise` (Morozov's discrepancy
/// principle); the smallest one looked at, if that is more for all.
pub(crate) fn by_discrepancy<const D: usize>(path: &mut Path<'_, D>, noise: f64) -> Result<f64, Error> {
    let allowed = noise * noise * path.total_weight;
    let (mut low, mut high) = EXPONENTS;
    let meets = |exponent, path: &mut Path<'_, D>| -> Result<bool, Error> {
        // A weight too small for the equations to be solved is no reason to take a larger one than the noise allows.
        Ok(path.at(exponent)?.is_none_or(|trial| trial.squares <= allowed))
    };
    if meets(high, path)? {
        return Ok(path.lambda(high));
    }
    while high - low > PRECISION {
        let middle = 0.5 * (low + high);
        if meets(middle, path)? { low = middle } else { high = middle }
    }
    Ok(path.lambda(low))
}

fn lowest(known: &[(f64, f64)]) -> f64 {
    let lowest = known.iter().min_by(|a, b| a.1.total_cmp(&b.1).then(b.0.total_cmp(&a.0)));
    lowest.map_or(EXPONENTS.0, |k| k.0)
}

/// The vertex of the parabola through the logarithms of the lowest score and its two neighbours; `known` increases.
fn vertex(known: &[(f64, f64)], best: f64) -> f64 {
    let at = known.iter().position(|k| k.0 == best);
    let triple = at.and_then(|k| known.get(k.checked_sub(1)?..k + 2));
    let Some(&[(x0, y0), (x1, y1), (x2, y2)]) = triple else { return best };
    let [y0, y1, y2] = [y0, y1, y2].map(f64::ln);
    let (left, right) = ((y1 - y0) / (x1 - x0), (y2 - y1) / (x2 - x1));
    let curvature = (right - left) / (x2 - x0);
    if !(curvature.is_finite() && curvature > 0.0) {
        return best;
    }
    (0.5 * (x0 + x1) - 0.5 * left / curvature).clamp(x0, x2)
}

/// A fit with one weight.
struct Trial {
    /// `Σ ω |r|²`.
    squares: f64,
    /// Estimate of the trace of the influence matrix.
    trace: f64,
}

/// Fits of points in a space along all smoothing weights.
pub(crate) struct Path<'a, const D: usize> {
    space: &'a Arc<HierarchicalSpace<D>>,
    points: &'a SortedPoints<D>,
    energy: &'a SymmetricMatrix,
    solver: &'a mut Cholesky,
    /// `BᵀWB`, and the right-hand sides of the coordinates, then of the probes.
    equations: NormalEquations,
    penalized: SymmetricMatrix,
    /// `Σ ω |p|²`.
    squares: f64,
    total_weight: f64,
    /// Points with a weight.
    counted: usize,
    /// The weight of exponent 0.
    unit: f64,
}

impl<'a, const D: usize> Path<'a, D> {
    /// Reduces points that are sorted by the cells of the space. `solver` is for the pattern of the energy.
    pub(crate) fn new(
        space: &'a Arc<HierarchicalSpace<D>>,
        points: &'a SortedPoints<D>,
        energy: &'a SymmetricMatrix,
        solver: &'a mut Cholesky,
        probes: bool,
    ) -> Result<Self, Error> {
        let n = points.dim();
        let count = if probes { (PROBED / points.len()).clamp(PROBES.0, PROBES.1) } else { 0 };
        let probed = points.with_columns((0..count).map(|k| probe(points, k)));
        let equations = NormalEquations::new(space.as_ref(), energy.pattern(), &probed)?;
        let weight = |at: usize| points.weights().map_or(1.0, |w| w[at]);
        let squared = |at: usize| (0..n).map(|k| points.coordinates(k)[at].powi(2)).sum::<f64>();
        let (data, smoothness) = (equations.matrix.trace(), energy.trace());
        Ok(Self {
            squares: (0..points.len()).map(|at| weight(at) * squared(at)).sum(),
            total_weight: points.total_weight(),
            counted: (0..points.len()).filter(|&at| weight(at) > 0.0).count(),
            // Linear functions have no energy: then no weight does anything.
            unit: if smoothness > 0.0 { data / smoothness } else { 0.0 },
            penalized: SymmetricMatrix::zeros(energy.pattern()),
            space,
            points,
            energy,
            solver,
            equations,
        })
    }

    /// The equations of the points alone.
    pub(crate) fn into_equations(self) -> NormalEquations {
        let NormalEquations { matrix, right } = self.equations;
        let (own, _) = right.view().split_at(Axis(1), self.points.dim());
        NormalEquations { matrix, right: own.to_owned() }
    }

    fn lambda(&self, exponent: f64) -> f64 {
        self.unit * 10.0_f64.powf(exponent)
    }

    fn exponent(&self, lambda: f64) -> f64 {
        let exponent = (lambda / self.unit).log10();
        if exponent.is_finite() { exponent.clamp(EXPONENTS.0, EXPONENTS.1) } else { EXPONENTS.0 }
    }

    /// The fit with the weight of an exponent; `None` where the equations cannot be solved.
    fn at(&mut self, exponent: f64) -> Result<Option<Trial>, Error> {
        let lambda = self.lambda(exponent);
        let parts = self.equations.matrix.values().iter().zip(self.energy.values());
        self.penalized.values_mut().iter_mut().zip(parts).for_each(|(sum, (a, g))| *sum = a + lambda * g);
        let right = &self.equations.right;
        let solved = self.solver.factorize(&self.penalized).and_then(|()| self.solver.solve(right));
        let Ok(solution) = solved else { return Ok(None) };
        let (n, columns) = (self.points.dim(), right.ncols());
        let dot = |a: ArrayView1<'_, f64>, b: ArrayView1<'_, f64>| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        let probes: f64 = (n..columns).map(|k| dot(right.column(k), solution.column(k))).sum();
        let explained: f64 = (0..n)
            .map(|k| {
                let c = solution.column(k);
                let image = self.equations.matrix.multiply(&c.to_vec());
                2.0 * dot(c, right.column(k)) - dot(c, ArrayView1::from(&image))
            })
            .sum();
        let mut squares = self.squares - explained;
        if squares < CANCELLATION * self.squares {
            squares = self.residual_squares(&solution)?;
        }
        Ok(Some(Trial { squares, trace: probes / (columns - n).max(1) as f64 }))
    }

    /// `Σ ω |r|²` by a pass over the points.
    fn residual_squares(&self, solution: &Array2<f64>) -> Result<f64, Error> {
        let coefficients = Array2::from_shape_fn((solution.nrows(), self.points.dim()), |(i, k)| solution[[i, k]]);
        let map = SplineMap::new(self.space.clone(), coefficients)?;
        let mut distances = Vec::new();
        self.points.distances(map.bezier(), &mut distances)?;
        let weight = |at: usize| self.points.weights().map_or(1.0, |w| w[at]);
        Ok(distances.iter().enumerate().map(|(at, d)| weight(at) * d * d).sum())
    }
}

/// A column of random signs that depend on the points' indices alone, divided by the root of the weights, since the
/// equations multiply with these.
fn probe<const D: usize>(points: &SortedPoints<D>, number: usize) -> Vec<f64> {
    let sign = |index: u32| {
        // The finalizer of SplitMix64.
        let mut z = SEED ^ ((number as u64) << 32 | u64::from(index)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        if (z ^ (z >> 31)) & 1 == 0 { 1.0 } else { -1.0 }
    };
    let weight = |at: usize| points.weights().map_or(1.0, |w| w[at]);
    let scaled = |(at, &index): (usize, &u32)| if weight(at) > 0.0 { sign(index) / weight(at).sqrt() } else { 0.0 };
    points.order().iter().enumerate().map(scaled).collect()
}
