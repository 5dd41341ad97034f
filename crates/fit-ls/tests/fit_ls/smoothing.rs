//! Rules for the smoothing weight, judged by the error to a known truth.

use std::sync::Arc;

use crate::common::{Random, largest_difference};
use fit_ls::{Error, Lambda, LeastSquares, Options};
use ndarray::{Array1, Array2};
use thb_core::{HierarchicalSpace, Kind, KnotVector};

/// Approximately normal, of deviation 1.
fn normal(random: &mut Random) -> f64 {
    (0..12).map(|_| random.next()).sum::<f64>() - 6.0
}

/// Noisy heights of a hill and a wave over the unit square, with the true ones.
struct Data {
    parameters: Array2<f64>,
    points: Array2<f64>,
    truth: Array1<f64>,
}

impl Data {
    fn new(m: usize, noise: f64, seed: u64) -> Self {
        let mut random = Random::new(seed);
        let parameters = random.array(m, 2);
        let truth = Array1::from_shape_fn(m, |i| {
            let (u, v) = (parameters[[i, 0]], parameters[[i, 1]]);
            (-20.0 * ((u - 0.6).powi(2) + (v - 0.4).powi(2))).exp() + 0.1 * (9.0 * u + 4.0 * v).sin()
        });
        let points = Array2::from_shape_fn((m, 1), |(i, _)| truth[i] + noise * normal(&mut random));
        Self { parameters, points, truth }
    }

    /// Root mean squared error to the truth, and the weight used.
    fn error(&self, space: &Arc<HierarchicalSpace<2>>, lambda: Lambda) -> (f64, f64) {
        let options = Options { lambda, ..Options::default() };
        let mut fit = LeastSquares::new(self.parameters.view(), self.points.view(), None, options).unwrap();
        let image = fit.fit(space).unwrap().eval_batch(self.parameters.view()).unwrap();
        let squares = image.column(0).iter().zip(&self.truth).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        ((squares / self.truth.len() as f64).sqrt(), fit.lambda().unwrap())
    }
}

fn uniform(degree: usize, elements: usize) -> Arc<HierarchicalSpace<2>> {
    let knots = KnotVector::uniform(degree, elements).unwrap();
    Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap())
}

/// The best error on a grid of weights, four a power of ten.
fn best(data: &Data, space: &Arc<HierarchicalSpace<2>>) -> (f64, f64) {
    let grid = (-48..=8).map(|k| 10.0_f64.powf(f64::from(k) / 4.0));
    let errors = grid.map(|lambda| data.error(space, Lambda::Fixed(lambda)));
    errors.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap()
}

#[test]
fn cross_validation_is_near_the_best_weight_for_any_noise() {
    // Of the range of heights, about 1.2.
    for (noise, elements, m) in
        [(0.001, 20, 3000), (0.01, 20, 3000), (0.05, 20, 3000), (0.01, 30, 3000), (0.05, 8, 1000)]
    {
        let data = Data::new(m, 1.2 * noise, 21);
        let space = uniform(3, elements);
        let (least, at) = best(&data, &space);
        let (found, lambda) = data.error(&space, Lambda::CrossValidation);
        assert!(found <= 1.1 * least, "noise {noise}: {found:e} with {lambda:e}, best {least:e} with {at:e}");
    }
}

#[test]
fn discrepancy_leaves_the_noise_in_the_residuals() {
    let space = uniform(3, 16);
    for noise in [0.003, 0.03] {
        let data = Data::new(3000, noise, 5);
        let (found, lambda) = data.error(&space, Lambda::Discrepancy { noise });
        let options = Options { lambda: Lambda::Fixed(lambda), ..Options::default() };
        let mut fit = LeastSquares::new(data.parameters.view(), data.points.view(), None, options).unwrap();
        let map = fit.fit(&space).unwrap();
        let distances = fit.distances(&map).unwrap();
        let rmse = (distances.iter().map(|d| d * d).sum::<f64>() / 3000.0).sqrt();
        assert!(rmse <= noise && rmse > 0.97 * noise, "{rmse:e} beside {noise:e}");
        let (least, _) = best(&data, &space);
        assert!(found < 2.0 * least, "{found:e} beside {least:e}");
    }
}

#[test]
fn a_noise_that_no_fit_leaves_gives_the_least_smoothing() {
    let data = Data::new(500, 0.05, 7);
    let coarse = uniform(2, 2);
    let (_, lambda) = data.error(&coarse, Lambda::Discrepancy { noise: 1e-6 });
    let (_, more) = data.error(&coarse, Lambda::Discrepancy { noise: 0.2 });
    assert!(lambda < 1e-4 * more, "{lambda:e}, {more:e}");
}

#[test]
fn wrong_levels_are_refused() {
    let data = Data::new(50, 0.0, 1);
    for noise in [0.0, -1.0, f64::NAN] {
        let options = Options::<2> { lambda: Lambda::Discrepancy { noise }, ..Options::default() };
        let made = LeastSquares::new(data.parameters.view(), data.points.view(), None, options);
        assert!(matches!(made, Err(Error::Noise { .. })));
    }
}

#[test]
fn points_without_weight_have_no_say() {
    // The same points once with half of them spoiled and without weight, once without that half.
    let data = Data::new(1200, 0.02, 9);
    let space = uniform(3, 10);
    let spoiled = |i: usize| i % 2 == 1;
    let weights = Array1::from_shape_fn(1200, |i| if spoiled(i) { 0.0 } else { 1.0 });
    let mut points = data.points.clone();
    (0..1200).filter(|&i| spoiled(i)).for_each(|i| points[[i, 0]] = 100.0);
    let kept: Vec<usize> = (0..1200).filter(|&i| !spoiled(i)).collect();
    let axis = ndarray::Axis(0);
    let (u, p) = (data.parameters.select(axis, &kept), data.points.select(axis, &kept));
    for lambda in [Lambda::CrossValidation, Lambda::Discrepancy { noise: 0.02 }] {
        let options = Options { lambda, ..Options::default() };
        let mut all =
            LeastSquares::new(data.parameters.view(), points.view(), Some(weights.view()), options.clone()).unwrap();
        let mut half = LeastSquares::new(u.view(), p.view(), None, options).unwrap();
        let (a, b) = (all.fit(&space).unwrap(), half.fit(&space).unwrap());
        let ratio = all.lambda().unwrap() / half.lambda().unwrap();
        // Probes differ, since points have other indices.
        assert!((ratio.log10()).abs() < 0.25, "{lambda:?}: {ratio}");
        assert!(largest_difference(&a.coefficients().to_owned(), &b.coefficients().to_owned()) < 0.02);
    }
}
