//! Fits with fixed and with moving parameters, and their errors.

use std::sync::Arc;

use adaptive::Solve as _;
use anyhow::{Context, Result};
use deviation::directed_hausdorff;
use fit_ls::{Lambda, LeastSquares, Options};
use moving_param::{JointOptions, Method, MovingFit};
use ndarray::{Array2, ArrayView2};
use thb_core::{HierarchicalSpace, Kind, KnotVector, SplineMap};

/// Joint Levenberg–Marquardt steps of the column that the papers lack.
const JOINT_STEPS: usize = 2;

/// Smoothing weight where the points do not determine all control points.
const RESCUE: f64 = 1e-12;

/// A fit and its errors.
pub(in crate::tables) struct Fitted<const D: usize> {
    pub(super) map: SplineMap<D>,
    pub(super) parameters: Array2<f64>,
    pub(super) distances: Vec<f64>,
}

impl<const D: usize> Fitted<D> {
    /// Mean of the squared distances.
    pub(in crate::tables) fn mse(&self) -> f64 {
        self.distances.iter().map(|d| d * d).sum::<f64>() / self.distances.len() as f64
    }

    /// Largest distance at the parameters.
    pub(super) fn max(&self) -> f64 {
        self.distances.iter().fold(0.0, |a, &b| a.max(b))
    }

    /// Largest distance of a point to the map.
    pub(super) fn hausdorff(&self, points: ArrayView2<'_, f64>) -> Result<f64> {
        Ok(directed_hausdorff(&self.map, self.parameters.view(), points)?)
    }
}

pub(in crate::tables) fn polynomials<const D: usize>(degree: usize) -> Result<Arc<HierarchicalSpace<D>>> {
    elements(degree, 1)
}

pub(in crate::tables) fn elements<const D: usize>(degree: usize, elements: usize) -> Result<Arc<HierarchicalSpace<D>>> {
    let knots = KnotVector::uniform(degree, elements)?;
    Ok(Arc::new(HierarchicalSpace::new(Kind::Thb, std::array::from_fn(|_| knots.clone()))?))
}

/// Least squares at fixed parameters.
pub(in crate::tables) fn fit<const D: usize>(
    parameters: &Array2<f64>,
    points: ArrayView2<'_, f64>,
    space: &Arc<HierarchicalSpace<D>>,
) -> Result<Fitted<D>> {
    let attempt = |lambda| -> Result<Fitted<D>> {
        let options = Options { lambda: Lambda::Fixed(lambda), ..Options::default() };
        let mut fit = LeastSquares::new(parameters.view(), points, None, options)?;
        let map = fit.fit(space)?;
        let mut distances = vec![0.0; points.nrows()];
        let sorted = fit.distances(&map)?.to_vec();
        for (at, &index) in fit.points().order().iter().enumerate() {
            distances[index as usize] = sorted[at];
        }
        Ok(Fitted { map, parameters: parameters.clone(), distances })
    };
    attempt(0.0).or_else(|_| attempt(RESCUE))
}

/// Joint Levenberg–Marquardt steps for control points and parameters; the fit at fixed parameters where they are refused.
pub(in crate::tables) fn jointly_moved<const D: usize>(
    parameters: &Array2<f64>,
    points: ArrayView2<'_, f64>,
    space: &Arc<HierarchicalSpace<D>>,
) -> Result<Fitted<D>> {
    let joint =
        JointOptions { max_steps: JOINT_STEPS, decrease: 0.0, polish: 0, emphasis: 0, ..JointOptions::WITHOUT_SPRINGS };
    let options =
        moving_param::Options { method: Method::Joint(joint), guard: false, ..moving_param::Options::default() };
    let attempt = |lambda| -> Result<Fitted<D>> {
        let fitting = Options { lambda: Lambda::Fixed(lambda), ..Options::default() };
        let mut method = MovingFit::new(parameters.view(), points, None, fitting, options.clone())?;
        method.solve(space, None)?;
        fit(&method.parameters(), points, space)
    };
    let moved = attempt(0.0).or_else(|_| attempt(RESCUE));
    let fixed = fit(parameters, points, space)?;
    Ok(match moved {
        Ok(moved) if moved.mse() < fixed.mse() => moved,
        _ => fixed,
    })
}

/// A B-spline curve of least squares whose knots are inserted one by one in the middle of the interval that holds the
/// largest distance (Imperatore 2024, §4.1.6 (c)).
pub(super) fn adaptive_curve(
    parameters: &Array2<f64>,
    points: ArrayView2<'_, f64>,
    degree: usize,
    interior: usize,
) -> Result<f64> {
    let mut breaks = vec![0.0, 1.0];
    let mut fitted = fit(parameters, points, &with_breaks(degree, &breaks)?)?;
    while breaks.len() < interior + 2 {
        let span = |u: f64| breaks[1..breaks.len() - 1].iter().filter(|&&b| b <= u).count();
        let mut worst = vec![0.0f64; breaks.len() - 1];
        for (u, d) in parameters.column(0).iter().zip(&fitted.distances) {
            let s = span(*u);
            worst[s] = worst[s].max(*d);
        }
        let largest = (0..worst.len()).max_by(|&a, &b| worst[a].total_cmp(&worst[b])).context("no interval")?;
        breaks.insert(largest + 1, 0.5 * (breaks[largest] + breaks[largest + 1]));
        fitted = fit(parameters, points, &with_breaks(degree, &breaks)?)?;
    }
    Ok(fitted.mse())
}

fn with_breaks(degree: usize, breaks: &[f64]) -> Result<Arc<HierarchicalSpace<1>>> {
    let mut knots = vec![breaks[0]; degree];
    knots.extend_from_slice(breaks);
    knots.extend(vec![breaks[breaks.len() - 1]; degree]);
    Ok(Arc::new(HierarchicalSpace::new(Kind::Thb, [KnotVector::new(degree, knots)?])?))
}
