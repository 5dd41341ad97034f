//! Weights that follow the errors: ℓp, outliers, markers.

mod common;

use std::ops::ControlFlow;
use std::sync::Arc;

use adaptive::{Iteration, Outcome, run};
use common::Random;
use fit_ls::{
    Lambda, LeastSquares, Loss, MarkerRules, Markers, Options, Reweighted, Reweighting, Robust, Update, median_scale,
};
use ndarray::{Array1, Array2};
use thb_core::{CellSpace, HierarchicalSpace, Kind, KnotVector, Refinement, SplineMap};

fn fixed<const D: usize>(lambda: f64) -> Options<D> {
    Options { lambda: Lambda::Fixed(lambda), ..Options::default() }
}

fn uniform<const D: usize>(degree: usize, elements: usize) -> Arc<HierarchicalSpace<D>> {
    let knots = KnotVector::uniform(degree, elements).unwrap();
    Arc::new(HierarchicalSpace::new(Kind::Thb, std::array::from_fn(|_| knots.clone())).unwrap())
}

fn robust(rule: Robust) -> Reweighting {
    Reweighting { robust: Some(rule), ..Reweighting::default() }
}

/// Approximately normal, of deviation 1: twelve uniform numbers.
fn normal(random: &mut Random) -> f64 {
    (0..12).map(|_| random.next()).sum::<f64>() - 6.0
}

#[test]
fn iterated_weights_find_the_minimum_of_lp() {
    let (m, space) = (60, uniform::<1>(3, 5));
    let mut random = Random::new(3);
    let parameters = Array2::from_shape_fn((m, 1), |(i, _)| i as f64 / (m - 1) as f64);
    let points = parameters.mapv(|u| (6.0 * u).sin() + 0.3 * (random.next() - 0.5));
    for p in [1.2, 1.5, 1.8, 2.0] {
        let rules = robust(Robust::plain(Loss::Power(p)));
        let mut fit = Reweighted::<1>::new(parameters.view(), points.view(), None, fixed(0.0), &rules).unwrap();
        let map = fit.fit(&space, 2000).unwrap();
        let image = map.eval_batch(parameters.view()).unwrap();
        // The objective is convex: no step along a coefficient may lower it by more than the tolerance of the weights.
        let cost = |coefficients: Array2<f64>| {
            let image = SplineMap::new(space.clone(), coefficients).unwrap().eval_batch(parameters.view()).unwrap();
            (&image - &points).iter().map(|r| r.abs().powf(p)).sum::<f64>()
        };
        let reached = cost(map.coefficients().to_owned());
        for j in 0..space.n_functions() {
            for step in [-1e-2, -1e-3, 1e-3, 1e-2] {
                let mut moved = map.coefficients().to_owned();
                moved[[j, 0]] += step;
                let there = cost(moved);
                assert!(there > reached * (1.0 - 2e-4), "p = {p}, coefficient {j}, step {step}: {there} < {reached}");
            }
        }
        assert!((&image - &points).iter().all(|r| r.is_finite()));
    }
}

#[test]
fn l2_is_least_squares() {
    let space = uniform::<2>(2, 4);
    let mut random = Random::new(5);
    let (parameters, points) = (random.array(300, 2), random.array(300, 3));
    let plain = LeastSquares::new(parameters.view(), points.view(), None, fixed(1e-6)).unwrap().fit(&space).unwrap();
    let rules = robust(Robust::plain(Loss::Power(2.0)));
    let mut fit = Reweighted::<2>::new(parameters.view(), points.view(), None, fixed(1e-6), &rules).unwrap();
    let map = fit.fit(&space, 10).unwrap();
    assert!(common::largest_difference(&map.coefficients().to_owned(), &plain.coefficients().to_owned()) < 1e-10);
    assert_eq!(fit.report().unwrap().rounds, 1);
}

/// A hill with a crease as a height field, and points of it: clean ones, and the same with gross outliers.
struct Contaminated {
    parameters: Array2<f64>,
    clean: Array2<f64>,
    points: Array2<f64>,
    outliers: Vec<bool>,
}

impl Contaminated {
    fn new(m: usize, noise: f64, share: f64, one_sided: bool) -> Self {
        let mut random = Random::new(11);
        let parameters = random.array(m, 2);
        let height = |u: f64, v: f64| (-8.0 * ((u - 0.6).powi(2) + (v - 0.4).powi(2))).exp() + 0.5 * (u - 0.3).abs();
        let clean = Array2::from_shape_fn((m, 3), |(i, k)| {
            let (u, v) = (parameters[[i, 0]], parameters[[i, 1]]);
            [u, v, height(u, v) + noise * normal(&mut random)][k]
        });
        let outliers: Vec<bool> = (0..m).map(|_| random.next() < share).collect();
        let mut points = clean.clone();
        for (mut row, _) in points.outer_iter_mut().zip(&outliers).filter(|(_, outlier)| **outlier) {
            let size = 0.1 + 0.9 * random.next();
            let side = if one_sided || random.next() < 0.5 { 1.0 } else { -1.0 };
            row[2] += side * size;
        }
        Self { parameters, clean, points, outliers }
    }

    /// Fits adaptively and returns the error at clean points, and the fit.
    fn fit(&self, points: &Array2<f64>, rules: &Reweighting, tolerance: f64) -> (f64, usize, Reweighted<2>) {
        let mut method = Reweighted::<2>::new(self.parameters.view(), points.view(), None, fixed(1e-6), rules).unwrap();
        let options = adaptive::Options {
            tolerance,
            refinement: Refinement { extension: [2; 2], max_levels: 5, ..Refinement::default() },
            max_dofs: 2500,
            ..adaptive::Options::default()
        };
        let mut observer = |_: &Iteration| ControlFlow::Continue(());
        let Outcome { map, history, .. } = run(&mut method, uniform(3, 4), &options, &mut observer).unwrap();
        let image = map.eval_batch(self.parameters.view()).unwrap();
        let (mut sum, mut count) = (0.0, 0);
        for i in (0..points.nrows()).filter(|&i| !self.outliers[i]) {
            sum += (&image.row(i) - &self.clean.row(i)).mapv(|x| x * x).sum();
            count += 1;
        }
        ((sum / f64::from(count)).sqrt(), history.last().unwrap().dofs, method)
    }
}

#[test]
fn a_fifth_of_gross_outliers_hardly_matters() {
    for (noise, one_sided) in [(0.0, false), (0.0, true), (0.003, true)] {
        let data = Contaminated::new(4000, noise, 0.2, one_sided);
        let tolerance = 0.01;
        let (clean, dofs, _) = data.fit(&data.clean, &Reweighting::default(), tolerance);
        let (plain, ..) = data.fit(&data.points, &Reweighting::default(), tolerance);
        assert!(plain > 5.0 * clean, "least squares follows outliers: {plain:e} beside {clean:e}");
        for loss in [Loss::Huber, Loss::Tukey, Loss::GemanMcClure, Loss::Power(1.2)] {
            let (error, robust_dofs, method) =
                data.fit(&data.points, &robust(Robust::adaptive::<2>(loss, tolerance)), tolerance);
            println!(
                "{noise} {one_sided} {loss:?}: clean {clean:e} {dofs}, robust {error:e} {robust_dofs}, plain {plain:e}"
            );
            let gross = method.weights().gross();
            let missed = (0..4000).filter(|&i| data.outliers[i] && !gross[i]).count();
            let wrong = (0..4000).filter(|&i| !data.outliers[i] && gross[i]).count();
            println!(
                "   missed {missed} wrong {wrong} scale {:?} rounds {}",
                method.weights().scale(),
                method.report().unwrap().rounds
            );
            assert!(error < 1.5 * clean, "{loss:?}: {error:e} beside {clean:e}");
        }
    }
}
