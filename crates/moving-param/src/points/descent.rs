//! Descent methods for the squared distance of one point.

use thb_core::SmallCholesky;

use crate::points::patch::Jet;
use crate::points::vector::{Vector, difference, dot};

/// How the squared distance is minimized. The others are there to be compared with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Descent {
    /// Newton's method with the exact Hessian, damped where it does not descend.
    Newton,
    /// Steepest descent with halved steps, until a step in the parameters is shorter than `min_step`.
    Gradient {
        /// Smallest step, in parameters.
        min_step: f64,
    },
    /// The quasi-Newton method of a parameter's own few steps (BFGS): first derivatives only.
    QuasiNewton {
        /// Smallest step, in parameters.
        min_step: f64,
    },
}

/// The squared distance at a parameter, with the derivatives of its half.
pub(crate) struct Local<const D: usize> {
    pub(crate) squared: f64,
    pub(crate) gradient: [f64; D],
    hessian: [[f64; D]; D],
    /// The part of the Hessian without second derivatives: never indefinite.
    metric: [[f64; D]; D],
}

impl<const D: usize> Local<D> {
    #[inline(always)]
    pub(crate) fn new(jet: &Jet<D>, point: &Vector) -> Self {
        let residual = difference(&jet.value, point);
        let mut metric = [[0.0; D]; D];
        let mut hessian = [[0.0; D]; D];
        for a in 0..D {
            for b in a..D {
                metric[a][b] = dot(&jet.first[a], &jet.first[b]);
                hessian[a][b] = metric[a][b] + dot(&jet.second[a][b], &residual);
                (metric[b][a], hessian[b][a]) = (metric[a][b], hessian[a][b]);
            }
        }
        let gradient = std::array::from_fn(|a| dot(&jet.first[a], &residual));
        Self { squared: dot(&residual, &residual), gradient, hessian, metric }
    }

    /// With a spring on the parameter.
    #[inline(always)]
    pub(crate) fn anchored(mut self, squared: f64, pull: [f64; D], stiffness: [f64; D]) -> Self {
        self.squared += squared;
        for d in 0..D {
            self.gradient[d] += pull[d];
            self.hessian[d][d] += stiffness[d];
            self.metric[d][d] += stiffness[d];
        }
        self
    }
}

/// What a descent remembers from step to step.
pub(crate) enum DescentState<const D: usize> {
    Newton {
        damping: f64,
    },
    Gradient {
        length: f64,
        min_step: f64,
    },
    /// `moved` is the way since `before`, the gradient at the last step.
    QuasiNewton {
        inverse: [[f64; D]; D],
        moved: [f64; D],
        before: Option<[f64; D]>,
        length: f64,
        min_step: f64,
    },
}

/// A step of Newton's method below this share of the cell is the last one: what it leaves is of the order of its square.
const LAST_STEP: f64 = 1e-6;

/// First damping of a Newton step that did not descend, as a share of the metric; then it grows by `DAMPING_FACTOR`.
const FIRST_DAMPING: f64 = 0.1;

/// Growth of the damping.
const DAMPING_FACTOR: f64 = 10.0;

impl<const D: usize> DescentState<D> {
    pub(crate) fn new(descent: Descent) -> Self {
        match descent {
            Descent::Newton => Self::Newton { damping: 0.0 },
            Descent::Gradient { min_step } => Self::Gradient { length: 1.0, min_step },
            Descent::QuasiNewton { min_step } => {
                Self::QuasiNewton { inverse: [[0.0; D]; D], moved: [0.0; D], before: None, length: 1.0, min_step }
            }
        }
    }

    #[inline(always)]
    pub(crate) fn step(&mut self, local: &Local<D>, free: [bool; D], size: [f64; D]) -> Option<[f64; D]> {
        match self {
            Self::Newton { damping } => {
                let added = std::array::from_fn(|d| *damping * local.metric[d][d]);
                SmallCholesky::new(&local.hessian, &added, free)
                    .or_else(|| SmallCholesky::new(&local.metric, &added, free))
                    .map(|factor| factor.step(&local.gradient))
            }
            Self::Gradient { length, .. } => {
                // The first trial step minimizes along the gradient if the map were linear.
                let g: [f64; D] = std::array::from_fn(|d| if free[d] { local.gradient[d] } else { 0.0 });
                let (slope, bend) = quadratic(&g, &local.metric);
                (bend > 0.0).then(|| g.map(|x| -x * *length * slope / bend))
            }
            Self::QuasiNewton { inverse, moved, before, length, .. } => {
                match before {
                    Some(old_gradient) => update_inverse(
                        inverse,
                        std::mem::replace(moved, [0.0; D]),
                        std::array::from_fn(|d| local.gradient[d] - old_gradient[d]),
                    ),
                    None => (0..D).for_each(|d| inverse[d][d] = size[d] * size[d] / trace(&local.metric, size)),
                }
                *before = Some(local.gradient);
                let product = |a: usize| (0..D).map(|b| inverse[a][b] * local.gradient[b]).sum::<f64>();
                let step = std::array::from_fn(|a| if free[a] { -product(a) * *length } else { 0.0 });
                let descends = (0..D).map(|d| step[d] * local.gradient[d]).sum::<f64>() < 0.0;
                descends.then_some(step)
            }
        }
    }

    /// Whether no step after one along a way would pay, which is `moved` cells long.
    #[inline(always)]
    pub(crate) fn is_last(&self, way: &[f64; D], moved: f64) -> bool {
        match self {
            Self::Newton { .. } => moved < LAST_STEP,
            // What these leave may be far longer than their steps: that is why the smallest step matters so much.
            Self::Gradient { min_step, .. } | Self::QuasiNewton { min_step, .. } => {
                way.iter().map(|w| w * w).sum::<f64>() < min_step * min_step
            }
        }
    }

    /// Takes note of a step along a way that descended.
    #[inline(always)]
    pub(crate) fn accepted(&mut self, way: [f64; D]) {
        match self {
            Self::Newton { damping } => *damping /= DAMPING_FACTOR,
            Self::Gradient { length, .. } => *length = 1.0,
            Self::QuasiNewton { length, moved, .. } => (*length, *moved) = (1.0, way),
        }
    }

    /// Shortens the next step; false if it would be too short.
    pub(crate) fn rejected(&mut self, moved: f64) -> bool {
        match self {
            Self::Newton { damping } => {
                *damping = (*damping * DAMPING_FACTOR).max(FIRST_DAMPING);
                true
            }
            Self::Gradient { length, min_step } | Self::QuasiNewton { length, min_step, .. } => {
                *length *= 0.5;
                0.5 * moved >= *min_step
            }
        }
    }
}

fn trace<const D: usize>(metric: &[[f64; D]; D], size: [f64; D]) -> f64 {
    (0..D).map(|d| metric[d][d] * size[d] * size[d]).sum::<f64>().max(f64::MIN_POSITIVE)
}

/// `gᵀg` and `gᵀMg`.
fn quadratic<const D: usize>(g: &[f64; D], m: &[[f64; D]; D]) -> (f64, f64) {
    let product = |a: usize| (0..D).map(|b| m[a][b] * g[b]).sum::<f64>();
    ((0..D).map(|a| g[a] * g[a]).sum(), (0..D).map(|a| g[a] * product(a)).sum())
}

/// The BFGS update of an inverse Hessian for a step and the change of the gradient; none where the curvature is not
/// positive.
fn update_inverse<const D: usize>(inverse: &mut [[f64; D]; D], step: [f64; D], change: [f64; D]) {
    let curvature: f64 = (0..D).map(|d| step[d] * change[d]).sum();
    if curvature <= 0.0 || curvature.is_nan() {
        return;
    }
    let hy: [f64; D] = std::array::from_fn(|a| (0..D).map(|b| inverse[a][b] * change[b]).sum());
    let yhy: f64 = (0..D).map(|d| change[d] * hy[d]).sum();
    for a in 0..D {
        for b in 0..D {
            inverse[a][b] += (1.0 + yhy / curvature) * step[a] * step[b] / curvature
                - (hy[a] * step[b] + step[a] * hy[b]) / curvature;
        }
    }
}
