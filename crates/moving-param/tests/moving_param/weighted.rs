//! Weights that follow the errors while parameters move.

use std::ops::ControlFlow;
use std::sync::Arc;

use adaptive::{Iteration, Outcome, Solve, run};
use fit_ls::{Lambda, LeastSquares, Loss, MarkerRules, Markers, Reweighted, Reweighting, Robust, Weighted};
use moving_param::{Blend, Distance, JointOptions, Method, MovingFit, Options, Schedule};
use ndarray::{Array2, Axis};
use thb_core::{ClosestPoints, HierarchicalSpace, Kind, KnotVector, Refinement, SplineMap};

const TOLERANCE: f64 = 2e-3;

/// Points per direction.
const PER: usize = 32;

struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

fn space(elements: usize) -> Arc<HierarchicalSpace<2>> {
    let knots = KnotVector::uniform(3, elements).unwrap();
    Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap())
}

/// A planted spline over 4 × 4 elements, points of it at hidden parameters, some of them far off, and the parameters that a fit
/// begins with.
struct Planted {
    truth: SplineMap<2>,
    points: Array2<f64>,
    outliers: Vec<bool>,
    start: Array2<f64>,
}

impl Planted {
    fn new(seed: u64, share: f64) -> Self {
        let mut random = Random(seed * 7919 + 3);
        let space = space(4);
        let along = KnotVector::uniform(3, 4).unwrap().greville();
        let coefficients = Array2::from_shape_fn((49, 3), |(j, k)| {
            [along[j % 7], along[j / 7], 0.35 * random.next()][k] + if k < 2 { 0.01 * random.next() } else { 0.0 }
        });
        let truth = SplineMap::new(space, coefficients).unwrap();
        let hidden = lattice();
        let mut points = truth.eval_batch(hidden.view()).unwrap();
        // What a user would have: parameters off by a smooth distortion, on each side along it.
        let start = Array2::from_shape_fn((PER * PER, 2), |(i, d)| {
            let (u, v) = (hidden[[i, d]], hidden[[i, 1 - d]]);
            u + 0.1 * (std::f64::consts::PI * u).sin() * (3.0 * v + seed as f64).sin()
        });
        let outliers: Vec<bool> = (0..PER * PER).map(|_| random.next() < share).collect();
        for (mut row, _) in points.outer_iter_mut().zip(&outliers).filter(|(_, off)| **off) {
            row[2] += 0.08 + 0.3 * random.next();
        }
        Self { truth, points, outliers, start }
    }

    fn count(&self, set_aside: &[bool], off: bool) -> usize {
        (0..set_aside.len()).filter(|&i| self.outliers[i] == off && set_aside[i]).count()
    }

    fn moving(&self, method: Method) -> MovingFit<2> {
        let options = Options { method, tolerance: TOLERANCE, ..Options::default() };
        MovingFit::new(self.start.view(), self.points.view(), None, fitting(), options).unwrap()
    }

    /// Root mean squared distance of the true surface's points to what a method leaves in the space of the truth, refined once if
    /// asked for, and what came of the weights.
    fn fit<S: Weighted<2>>(&self, solver: S, rules: &Reweighting, levels: usize) -> (f64, Reweighted<2, S>) {
        let mut method = Reweighted::of(solver, None, rules).unwrap();
        let limits = adaptive::Options {
            tolerance: TOLERANCE,
            refinement: Refinement { extension: [1; 2], max_levels: levels, ..Refinement::default() },
            max_dofs: 300,
            ..adaptive::Options::default()
        };
        let mut observer = |_: &Iteration| ControlFlow::Continue(());
        let outcome = run(&mut method, space(4), &limits, &mut observer);
        let Outcome { map, .. } = outcome.unwrap_or_else(|error| panic!("{error}"));
        let search = ClosestPoints::new(map.bezier().clone()).unwrap();
        let exact = self.truth.eval_batch(lattice().view()).unwrap();
        let squares = exact.outer_iter().map(|p| search.closest(&p.to_vec()).distance.powi(2)).sum::<f64>();
        ((squares / exact.nrows() as f64).sqrt(), method)
    }
}

fn lattice() -> Array2<f64> {
    Array2::from_shape_fn((PER * PER, 2), |(i, d)| [i % PER, i / PER][d] as f64 / (PER - 1) as f64)
}

fn fitting() -> fit_ls::Options<2> {
    fit_ls::Options { lambda: Lambda::Fixed(1e-9), ..fit_ls::Options::default() }
}

fn tukey() -> Reweighting {
    let rule = Robust { max_set_aside: 0.2, ..Robust::adaptive::<2>(Loss::Tukey, TOLERANCE) };
    Reweighting { robust: Some(rule), markers: None }
}

fn joint() -> Method {
    Method::Joint(JointOptions::default())
}

fn triangles() -> Vec<[u32; 3]> {
    let per = PER as u32;
    let corners = (0..per - 1).flat_map(|i| (0..per - 1).map(move |j| i * per + j));
    corners.flat_map(|at| [[at, at + 1, at + per + 1], [at, at + per + 1, at + per]]).collect()
}

#[test]
fn hidden_parameters_are_found_in_spite_of_outliers() {
    let mut shares = Vec::new();
    for seed in 0..4 {
        let planted = Planted::new(seed, 0.08);
        let fixed = LeastSquares::new(planted.start.view(), planted.points.view(), None, fitting()).unwrap();
        let (fixed, _) = planted.fit(fixed, &tukey(), 1);
        let (plain, _) = planted.fit(planted.moving(joint()), &Reweighting::default(), 1);
        // With triangles over all points, outliers too, and without.
        for with_triangles in [false, true] {
            let mut moving = planted.moving(joint());
            if with_triangles {
                moving = moving.with_triangles(&triangles()).unwrap();
            }
            let (robust, method) = planted.fit(moving, &tukey(), 1);
            let (aside, wrong) = (method.weights().gross(), planted.count(method.weights().gross(), false));
            let outliers = planted.outliers.iter().filter(|off| **off).count();
            let found = planted.count(aside, true);
            assert!(found as f64 >= 0.95 * outliers as f64, "seed {seed}: {found} of {outliers} outliers set aside");
            assert!(wrong <= PER * PER / 50, "seed {seed}: {wrong} sound points set aside");
            assert!(robust < 0.8 * fixed, "seed {seed}: {robust:e} beside {fixed:e} at fixed parameters");
            shares.push(robust / fixed);
            assert!(robust < 0.25 * plain, "seed {seed}: {robust:e} beside {plain:e} by least squares");
        }
    }
    let mean = shares.iter().sum::<f64>() / shares.len() as f64;
    assert!(mean < 0.6, "errors are {mean} of those at fixed parameters: {shares:?}");
}

#[test]
fn every_method_with_moving_parameters_takes_weights_that_follow_the_errors() {
    let alternating = |distance| Method::Alternating { distance, corrections: 3 };
    let methods = [
        alternating(Distance::Point),
        alternating(Distance::Tangent { damping: 1e-3 }),
        alternating(Distance::Hybrid(Blend::ErrorDriven)),
        alternating(Distance::Hybrid(Blend::Constant(0.1))),
        joint(),
        Method::JointLbfgs(Schedule::B),
    ];
    for method in methods {
        for seed in [1, 2] {
            let planted = Planted::new(seed, 0.08);
            let (plain, _) = planted.fit(planted.moving(method.clone()), &Reweighting::default(), 2);
            let (robust, weighted) = planted.fit(planted.moving(method.clone()), &tukey(), 2);
            let aside = weighted.weights().gross();
            let outliers = planted.outliers.iter().filter(|off| **off).count();
            let found = planted.count(aside, true);
            assert!(found as f64 >= 0.95 * outliers as f64, "{method:?}, seed {seed}: {found} of {outliers}");
            assert!(
                robust < (0.3 * plain).max(1.2 * TOLERANCE).min(0.6 * plain),
                "{method:?}, seed {seed}: {robust:e} beside {plain:e} by least squares"
            );
            // Example 5.2.2 (e) of Imperatore 2024: the outliers are marked instead.
            let ignored = (0..planted.outliers.len()).filter(|&i| planted.outliers[i]).collect();
            let markers = Markers { met: Vec::new(), ignored };
            let rules = Reweighting { robust: None, markers: Some((markers, MarkerRules::new(TOLERANCE, TOLERANCE))) };
            let (marked, _) = planted.fit(planted.moving(method.clone()), &rules, 2);
            assert!(
                marked < (0.3 * plain).max(1.2 * TOLERANCE).min(0.6 * plain),
                "{method:?}, seed {seed}: {marked:e} of marked beside {plain:e}"
            );
        }
    }
}

#[test]
fn points_of_weight_zero_are_not_there() {
    let planted = Planted::new(3, 0.08);
    let sound: Vec<usize> = (0..planted.outliers.len()).filter(|&i| !planted.outliers[i]).collect();
    let weights: Vec<f64> = planted.outliers.iter().map(|off| if *off { 0.0 } else { 1.0 }).collect();
    let (start, points) = (planted.start.select(Axis(0), &sound), planted.points.select(Axis(0), &sound));
    for method in [joint(), Method::Alternating { distance: Distance::Hybrid(Blend::ErrorDriven), corrections: 2 }] {
        let options = Options { method: method.clone(), tolerance: TOLERANCE, ..Options::default() };
        let mut few = MovingFit::new(start.view(), points.view(), None, fitting(), options).unwrap();
        let mut all = planted.moving(method.clone());
        let space = space(4);
        all.least_squares_mut().sort_for(&space).unwrap();
        all.set_point_weights(&weights).unwrap();
        let (a, b) = (few.solve(&space, None).unwrap().map, all.solve(&space, None).unwrap().map);
        let off = (&a.coefficients() - &b.coefficients()).iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        assert!(off < 1e-6, "{method:?}: {off:e}");
        assert_eq!(few.reports()[0].outside, all.reports()[0].outside);
    }
}
