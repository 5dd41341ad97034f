//! Weights that follow the errors: ℓp, outliers, markers.

use std::ops::ControlFlow;
use std::sync::Arc;

use crate::common::{Random, largest_difference};
use adaptive::{Iteration, Outcome, run};
use fit_ls::{
    Detection, Error, Lambda, LeastSquares, Loss, MarkerRules, Markers, Options, PointWeights, Reweighted, Reweighting,
    Robust, Update, detect_markers,
};
use ndarray::{Array1, Array2, Axis};
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
    assert!(largest_difference(&map.coefficients().to_owned(), &plain.coefficients().to_owned()) < 1e-10);
    assert_eq!(fit.report().unwrap().rounds, 1);
}

/// A loss for adaptive fits that may set up to 30 % of the points aside.
fn many_outliers(loss: Loss, tolerance: f64) -> Robust {
    Robust { max_set_aside: 0.3, ..Robust::adaptive::<2>(loss, tolerance) }
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
                data.fit(&data.points, &robust(many_outliers(loss, tolerance)), tolerance);
            let gross = method.weights().gross();
            let missed = (0..4000).filter(|&i| data.outliers[i] && !gross[i]).count();
            let wrong = (0..4000).filter(|&i| !data.outliers[i] && gross[i]).count();
            assert!(missed <= 10 && wrong <= 10, "{loss:?}: {missed} missed, {wrong} clean points set aside");
            assert!(robust_dofs < 2 * dofs, "{loss:?}: outliers drive refinement, {robust_dofs} beside {dofs}");
            assert!(error < 1.5 * clean, "{loss:?}: {error:e} beside {clean:e}");
        }
    }
}

#[test]
fn a_weight_of_two_is_a_point_given_twice_and_one_of_zero_is_none() {
    let space = uniform::<2>(2, 5);
    let mut random = Random::new(8);
    let (parameters, points) = (random.array(400, 2), random.array(400, 2));
    let weights = Array1::from_shape_fn(400, |i| (i % 3) as f64);
    let repeated: Vec<usize> = (0..400).flat_map(|i| std::iter::repeat_n(i, i % 3)).collect();
    let (u, p) = (parameters.select(Axis(0), &repeated), points.select(Axis(0), &repeated));
    let nothing = Reweighting::default();
    let confidence = Some(weights.view());
    let mut weighted = Reweighted::new(parameters.view(), points.view(), confidence, fixed(1e-6), &nothing).unwrap();
    let a = weighted.fit(&space, 1).unwrap();
    let b = LeastSquares::new(u.view(), p.view(), None, fixed(1e-6)).unwrap().fit(&space).unwrap();
    assert!(largest_difference(&a.coefficients().to_owned(), &b.coefficients().to_owned()) < 1e-9);
    let counted = weighted.weights().counted();
    assert!((0..400).all(|i| counted[i] == (i % 3 > 0)));
}

/// Points of a narrow peak on [0, 1], denser there, and three of them as markers.
fn peak() -> (Array2<f64>, Array2<f64>, Vec<usize>) {
    let parameters = Array2::from_shape_fn((88, 1), |(i, _)| 0.5 + 4.0 * (i as f64 / 87.0 - 0.5).powi(3));
    let points = parameters.mapv(|u| (-((u - 0.5) / 0.06).powi(2)).exp());
    (parameters, points, vec![33, 43, 54])
}

#[test]
fn markers_are_met_by_algorithm_1_and_least_squares_misses_them() {
    let (parameters, points, met) = peak();
    let space = uniform::<1>(3, 12);
    let error = |map: &SplineMap<1>, i: usize| (map.eval([parameters[[i, 0]]]).unwrap()[0] - points[[i, 0]]).abs();
    let plain = LeastSquares::new(parameters.view(), points.view(), None, fixed(1e-9)).unwrap().fit(&space).unwrap();
    let tolerance = 1e-3;
    assert!(met.iter().all(|&i| error(&plain, i) > 4.0 * tolerance));
    for update in [Update::ErrorDriven { unit: 1.0 }, Update::ErrorDriven { unit: tolerance }, Update::Constant(1.25)] {
        let rules = MarkerRules { update, ..MarkerRules::algorithm_1(tolerance, 1.0) };
        let markers = Markers { met: met.clone(), ignored: vec![] };
        let reweighting = Reweighting { markers: Some((markers, rules)), ..Reweighting::default() };
        let mut fit = Reweighted::<1>::new(parameters.view(), points.view(), None, fixed(1e-9), &reweighting).unwrap();
        let map = fit.fit(&space, 20_000).unwrap();
        let report = fit.report().unwrap();
        assert!(report.settled && report.met == [3, 3], "{update:?}: {report:?}");
        assert!(met.iter().all(|&i| error(&map, i) < tolerance));
        assert!(fit.errors().iter().enumerate().all(|(i, &e)| (e - error(&map, i)).abs() < 1e-12));
    }
}

#[test]
fn a_corrupted_patch_is_ignored_by_markers_of_type_2() {
    let data = Contaminated::new(4000, 0.0, 0.0, false);
    let mut points = data.clean.clone();
    let (u, tolerance) = (&data.parameters, 0.01);
    let patch: Vec<usize> = (0..4000).filter(|&i| (u[[i, 0]] - 0.55).hypot(u[[i, 1]] - 0.6) < 0.12).collect();
    let mut random = Random::new(2);
    for &i in &patch {
        (0..3).for_each(|k| points[[i, k]] += 0.4 * (random.next() - 0.5));
    }
    let (_, dofs, _) = data.fit(&data.clean, &Reweighting::default(), tolerance);
    let (plain, plain_dofs, _) = data.fit(&points, &Reweighting::default(), tolerance);
    let markers = Markers { met: vec![], ignored: patch.clone() };
    let reweighting =
        Reweighting { markers: Some((markers, MarkerRules::new(tolerance, tolerance))), ..Reweighting::default() };
    let (error, marked_dofs, method) = data.fit(&points, &reweighting, tolerance);
    // The error to the clean points counts the patch too, where the surface knows its surroundings only.
    assert!(error < 0.01 && plain > 0.015, "{error:e} beside {plain:e}");
    assert!(marked_dofs <= dofs + 40 && plain_dofs > 2 * dofs, "{marked_dofs}, {dofs}, {plain_dofs}");
    assert_eq!(method.report().unwrap().ignored, [patch.len(), patch.len()]);
    assert_eq!(method.weights().counted().iter().filter(|&&counts| counts).count(), 4000 - patch.len());
}

#[test]
fn results_do_not_depend_on_threads() {
    let data = Contaminated::new(1500, 0.002, 0.2, true);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let rules = robust(many_outliers(Loss::Tukey, 0.01));
            let options = Options { lambda: Lambda::CrossValidation, ..Options::default() };
            let mut fit =
                Reweighted::<2>::new(data.parameters.view(), data.points.view(), None, options, &rules).unwrap();
            fit.fit(&uniform(3, 8), 20).unwrap().coefficients().to_owned()
        })
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn outliers_have_no_say_in_an_automatic_smoothing_weight() {
    let data = Contaminated::new(3000, 0.005, 0.2, true);
    let space = uniform::<2>(3, 16);
    for lambda in [Lambda::Auto { tolerance: 0.02 }, Lambda::CrossValidation, Lambda::Discrepancy { noise: 0.006 }] {
        let options = Options { lambda, ..Options::default() };
        let of = |points: &Array2<f64>, rules: &Reweighting| {
            let mut fit =
                Reweighted::<2>::new(data.parameters.view(), points.view(), None, options.clone(), rules).unwrap();
            fit.fit(&space, 20).unwrap();
            fit.least_squares().lambda().unwrap()
        };
        let clean = of(&data.clean, &Reweighting::default());
        let rule = robust(many_outliers(Loss::Tukey, 0.02));
        let (found, plain) = (of(&data.points, &rule), of(&data.points, &Reweighting::default()));
        let off = |lambda: f64| (lambda / clean).log10().abs();
        // The automatic rule judges by powers of ten of the total weight, which the outliers have left.
        assert!(off(found) <= 1.1, "{lambda:?}: {found:e} beside {clean:e} of clean points, {plain:e} of all");
        let by_chance = matches!(lambda, Lambda::Auto { .. });
        assert!(
            by_chance || off(plain) > off(found),
            "{lambda:?}: {found:e} beside {clean:e} of clean points, {plain:e} of all"
        );
    }
}

#[test]
fn features_and_outliers_are_told_apart() {
    let data = Contaminated::new(4000, 0.0, 0.1, false);
    let detection = Detection { threshold: 0.004, standing_out: true, outliers: true, max_outliers: 0.2 };
    let (u, p) = (data.parameters.view(), data.points.view());
    let markers = detect_markers(u, p, None, &uniform::<2>(3, 15), fixed(1e-7), detection).unwrap();
    markers.check(4000).unwrap();
    let found = markers.ignored.iter().filter(|&&i| data.outliers[i]).count();
    let outliers = data.outliers.iter().filter(|&&o| o).count();
    let wrong = markers.ignored.len() - found;
    assert!(found as f64 > 0.98 * outliers as f64 && wrong < 20, "{found} of {outliers}, {wrong} of clean points");
    // The crease runs along u = 0.3.
    let near = markers.met.iter().filter(|&&i| (data.parameters[[i, 0]] - 0.3).abs() < 0.1).count();
    assert!(markers.met.len() > 50 && near as f64 > 0.9 * markers.met.len() as f64, "{near} of {}", markers.met.len());
}

#[test]
fn wrong_rules_are_refused() {
    let parameters = Array2::from_shape_fn((5, 1), |(i, _)| i as f64 / 4.0);
    let make = |reweighting: Reweighting, confidence: Option<&Array1<f64>>| {
        let confidence = confidence.map(|w| w.view());
        PointWeights::new::<1>(parameters.view(), confidence, &reweighting).map(|_| ()).unwrap_err()
    };
    assert_eq!(make(robust(Robust::plain(Loss::Power(1.0))), None), Error::Exponent { value: 1.0 });
    let scale = Robust { least_scale: -1.0, ..Robust::plain(Loss::Huber) };
    assert_eq!(make(robust(scale), None), Error::Scale { value: -1.0 });
    let share = Robust { max_set_aside: 1.5, ..Robust::plain(Loss::Huber) };
    assert_eq!(make(robust(share), None), Error::Share { value: 1.5 });
    let markers = |met: Vec<usize>| Reweighting {
        markers: Some((Markers { met, ignored: vec![2] }, MarkerRules::new(0.1, 0.1))),
        ..Reweighting::default()
    };
    assert_eq!(make(markers(vec![7]), None), Error::Marker { index: 7, points: 5 });
    assert_eq!(make(markers(vec![2]), None), Error::MarkedTwice { index: 2 });
    let negative = Array1::from(vec![1.0, 1.0, -0.5, 1.0, 1.0]);
    assert_eq!(make(Reweighting::default(), Some(&negative)), Error::Weight { index: 2, value: -0.5 });
    let short = Array1::from(vec![1.0]);
    assert!(matches!(make(Reweighting::default(), Some(&short)), Error::Shape { given: 1, expected: 5, .. }));
}

const LOSSES: [Loss; 5] = [Loss::Huber, Loss::Tukey, Loss::GemanMcClure, Loss::Power(1.2), Loss::Power(2.0)];

#[test]
fn no_more_points_are_set_aside_than_may_be() {
    let space = uniform::<2>(3, 8);
    for (share, most) in [(0.05, 0.1), (0.2, 0.1), (0.4, 0.1), (0.2, 0.0), (0.2, 0.3), (0.2, 1.0)] {
        let data = Contaminated::new(1500, 0.003, share, true);
        for loss in LOSSES {
            let rule = Robust { max_set_aside: most, ..Robust::adaptive::<2>(loss, 0.01) };
            let mut fit =
                Reweighted::<2>::new(data.parameters.view(), data.points.view(), None, fixed(1e-6), &robust(rule))
                    .unwrap();
            fit.fit(&space, 12).unwrap();
            let outliers = data.outliers.iter().filter(|off| **off).count();
            let without_weight = fit.weights().weights().iter().filter(|w| **w == 0.0).count();
            let report = fit.report().unwrap();
            assert!(report.gross.len() as f64 <= most * 1500.0, "{loss:?}, {most}: {}", report.gross.len());
            assert!(without_weight <= report.gross.len(), "{loss:?}, {most}: {without_weight} without weight");
            if loss.is_least_squares() {
                assert!(report.gross.is_empty() && !report.capped && report.scale.is_none());
            } else if share > 1.2 * most {
                assert!(report.capped, "{loss:?}: {share} of outliers where {most} may be set aside");
            } else if share < 0.8 * most {
                assert!(!report.capped && report.gross.len() as f64 > 0.9 * outliers as f64, "{loss:?}, {most}");
            }
        }
    }
}

#[test]
fn the_square_is_least_squares_whatever_the_points() {
    let space = uniform::<2>(3, 6);
    for m in [20, 200, 1500] {
        let data = Contaminated::new(m, 0.01, 0.3, true);
        let (u, p) = (data.parameters.view(), data.points.view());
        let plain = LeastSquares::new(u, p, None, fixed(1e-6)).unwrap().fit(&space).unwrap();
        let rules = robust(Robust::adaptive::<2>(Loss::Power(2.0), 1e-3));
        let mut fit = Reweighted::<2>::new(u, p, None, fixed(1e-6), &rules).unwrap();
        let map = fit.fit(&space, 10).unwrap();
        assert!(largest_difference(&map.coefficients().to_owned(), &plain.coefficients().to_owned()) < 1e-12);
        let report = fit.report().unwrap();
        assert_eq!((report.rounds, report.gross.len(), report.settled), (1, 0, true));
    }
}

#[test]
fn points_of_an_exact_spline_are_not_set_aside() {
    // One element: the surface is met exactly, and what is left are smoothing and round-off.
    let space = uniform::<2>(3, 1);
    for m in [18, 20, 30, 100, 400] {
        for offset in [0.0, 1e3] {
            let mut random = Random::new(m as u64);
            let parameters = random.array(m, 2);
            let points = Array2::from_shape_fn((m, 3), |(i, k)| {
                let (u, v) = (parameters[[i, 0]], parameters[[i, 1]]);
                offset + [u, v, u * v - 0.3 * u * u][k]
            });
            for loss in LOSSES {
                let rules = robust(Robust { max_set_aside: 1.0, ..Robust::adaptive::<2>(loss, 1e-3) });
                let mut fit =
                    Reweighted::<2>::new(parameters.view(), points.view(), None, fixed(1e-9), &rules).unwrap();
                fit.fit(&space, 10).unwrap();
                let aside = fit.report().unwrap().gross.len();
                assert_eq!(aside, 0, "{m} at {offset:e}, {loss:?}");
            }
        }
    }
}
