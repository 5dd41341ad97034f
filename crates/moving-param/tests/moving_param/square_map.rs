//! Parameters moved by one smooth map of the square.

use std::sync::Arc;

use adaptive::Solve;
use fit_ls::Lambda;
use moving_param::{Distance, Method, MovingFit, Options, SquareMapOptions};
use ndarray::Array2;
use thb_core::{ClosestPoints, HierarchicalSpace, Kind, KnotVector, SplineMap};

/// Numbers in [0, 1) that depend on the seed only.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

fn space(degree: usize, elements: usize) -> Arc<HierarchicalSpace<2>> {
    let knots = KnotVector::uniform(degree, elements).unwrap();
    Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap())
}

/// A biquadratic sheet with bumps.
fn sheet(elements: usize) -> SplineMap<2> {
    let space = space(2, elements);
    let sites = space.knots(0, 0).unwrap().greville();
    let n = sites.len();
    let mut random = Random(3);
    let coefficients = Array2::from_shape_fn((n * n, 3), |(j, k)| match k {
        0 => sites[j % n],
        1 => sites[j / n],
        _ => 0.4 * random.next(),
    });
    SplineMap::new(space, coefficients).unwrap()
}

fn lattice(side: usize) -> Array2<f64> {
    Array2::from_shape_fn((side * side, 2), |(i, d)| [i % side, i / side][d] as f64 / (side - 1) as f64)
}

/// A smooth map of the square that keeps its sides.
fn warped(parameters: &Array2<f64>, by: f64) -> Array2<f64> {
    let space = space(3, 3);
    let sites = space.knots(0, 0).unwrap().greville();
    let n = sites.len();
    let mut random = Random(9);
    let control_points = Array2::from_shape_fn((n * n, 2), |(j, d)| {
        let along = [j % n, j / n][d];
        sites[along] + if (1..n - 1).contains(&along) { by * (random.next() - 0.5) } else { 0.0 }
    });
    let map = SplineMap::new(space, control_points).unwrap();
    // Round-off leaves the square.
    map.eval_batch(parameters.view()).unwrap().mapv(|u| u.clamp(0.0, 1.0))
}

fn fit(method: Method, parameters: &Array2<f64>, points: &Array2<f64>, lambda: f64, tolerance: f64) -> MovingFit<2> {
    let fitting = fit_ls::Options { lambda: Lambda::Fixed(lambda), ..fit_ls::Options::default() };
    let options = Options { method, tolerance, guard: false, ..Options::default() };
    MovingFit::new(parameters.view(), points.view(), None, fitting, options).unwrap()
}

#[test]
fn a_planted_map_is_found_to_round_off() {
    let sheet = sheet(4);
    let start = lattice(30);
    // What 6 × 6 control points can do exactly.
    let points = sheet.eval_batch(warped(&start, 0.12).view()).unwrap();
    let square = SquareMapOptions { per_side: 6, max_steps: 15, decrease: 0.0, barrier: 0.0 };
    let mut fit = fit(Method::SquareMap(square), &start, &points, 0.0, 1e-12);
    fit.solve(sheet.space(), None).unwrap();
    let report = fit.reports()[0];
    assert!(report.rmse[0] > 1e-3 && report.rmse[1] < 1e-10, "{report:?}");
    // Sides are kept.
    for (before, after) in start.outer_iter().zip(fit.parameters().outer_iter()) {
        for d in 0..2 {
            assert!((before[d] != 0.0 && before[d] != 1.0) || before[d] == after[d], "{before} {after}");
        }
    }
}

#[test]
fn exact_parameters_stay() {
    let sheet = sheet(4);
    let start = lattice(30);
    let points = sheet.eval_batch(start.view()).unwrap();
    let mut fit = fit(Method::SquareMap(SquareMapOptions::default()), &start, &points, 0.0, 0.0);
    fit.solve(sheet.space(), None).unwrap();
    let report = fit.reports()[0];
    assert!(report.rmse[1] < 1e-13 && report.max_move < 1e-9, "{report:?}");
}

#[test]
fn the_map_does_not_follow_noise() {
    let sheet = sheet(3);
    let start = lattice(24);
    let clean = sheet.eval_batch(warped(&start, 0.1).view()).unwrap();
    let mut random = Random(17);
    let noise = 0.02;
    // The sum of three uniform numbers is near enough to a normal one.
    let noisy = clean.mapv(|x| x + noise * 2.0 * (random.next() + random.next() + random.next() - 1.5));
    // Far more functions than the sheet has.
    let space = space(2, 12);
    let error = |method: Method| {
        let mut fit = fit(method, &start, &noisy, 1e-9, 1e-3);
        let map = fit.solve(&space, None).unwrap().map;
        let closest = ClosestPoints::new(map.bezier().clone()).unwrap();
        let squares = clean.outer_iter().map(|p| closest.closest(&p.to_vec()).distance.powi(2)).sum::<f64>();
        (squares / clean.nrows() as f64).sqrt()
    };
    let smooth = error(Method::SquareMap(SquareMapOptions { per_side: 6, ..SquareMapOptions::default() }));
    let point_by_point = error(Method::Alternating { distance: Distance::Point, corrections: 10 });
    assert!(smooth < 0.9 * point_by_point, "{smooth} {point_by_point}");
}

#[test]
fn curves_are_moved_by_a_map_of_the_interval() {
    let knots = KnotVector::uniform(2, 1).unwrap();
    let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots]).unwrap());
    let start = Array2::from_shape_fn((60, 1), |(i, _)| i as f64 / 59.0);
    let points = Array2::from_shape_fn((60, 2), |(i, k)| {
        let u = start[[i, 0]];
        // A parabola, run through unevenly.
        let x = u + 0.3 * u * u * (1.0 - u);
        [x, x * x][k]
    });
    let square = SquareMapOptions { per_side: 4, max_steps: 15, decrease: 0.0, barrier: 0.0 };
    let fitting = fit_ls::Options { lambda: Lambda::Fixed(0.0), ..fit_ls::Options::default() };
    let options = Options { method: Method::SquareMap(square), guard: false, ..Options::default() };
    let mut fit = MovingFit::new(start.view(), points.view(), None, fitting, options).unwrap();
    fit.solve(&space, None).unwrap();
    let report = fit.reports()[0];
    assert!(report.rmse[1] < 1e-12, "{report:?}");
}

#[test]
fn too_few_or_too_many_control_points_are_refused() {
    for per_side in [2, 33] {
        let square = SquareMapOptions { per_side, ..SquareMapOptions::default() };
        let options = Options { method: Method::SquareMap(square), ..Options::default() };
        let start = lattice(4);
        let points = sheet(3).eval_batch(start.view()).unwrap();
        let fitting = fit_ls::Options { lambda: Lambda::Fixed(1e-6), ..fit_ls::Options::default() };
        let error = MovingFit::<2>::new(start.view(), points.view(), None, fitting, options).unwrap_err();
        assert!(error.to_string().contains("control points per side"), "{error}");
    }
}
