//! What the theory promises: reproduction, convergence, agreement with the global problem.

use crate::common::{grid, image, random, refined, tensor};
use fit_ls::{Lambda, LeastSquares};
use fit_qi::{Error, LocalLambda, Options, QuasiInterpolation};
use ndarray::Array2;
use proptest::prelude::*;
use thb_core::{HierarchicalSpace, Kind, KnotVector, SplineMap};

fn options<const D: usize>(lambda: LocalLambda) -> Options<D> {
    Options { lambda, ..Options::default() }
}

/// The polynomial with the given coefficients of `∏ (2u_d − 1)^{i_d}`, i ≤ p in each direction, scaled to at most 1.
fn polynomial<const D: usize>(degree: usize, coefficients: &[f64], u: [f64; D]) -> f64 {
    let order = degree + 1;
    let term = |(k, c): (usize, &f64)| {
        c * (0..D).map(|d| (2.0 * u[d] - 1.0).powi((k / order.pow(d as u32) % order) as i32)).product::<f64>()
    };
    coefficients.iter().enumerate().map(term).sum::<f64>() / coefficients.iter().map(|c| c.abs()).sum::<f64>()
}

fn largest_error<const D: usize>(map: &SplineMap<D>, f: impl Fn([f64; D]) -> f64) -> f64 {
    let sites = random::<D>(500, 77);
    let values = map.eval_batch(sites.view()).unwrap();
    (0..500).map(|i| (values[[i, 0]] - f(std::array::from_fn(|d| sites[[i, d]]))).abs()).fold(0.0, f64::max)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    #[test]
    fn polynomials_are_reproduced_without_smoothing(
        degree in 1_usize..=4,
        seed in 1_u64..1000,
        centre in 0.1..0.9_f64,
        coefficients in prop::collection::vec(-1.0..1.0_f64, 25),
    ) {
        let f = |u: [f64; 2]| polynomial(degree, &coefficients[..(degree + 1).pow(2)], u);
        let space = refined(&tensor::<2>(degree, 3), [centre, 1.0 - centre]);
        let parameters = random::<2>(20_000, seed);
        let points = image(&parameters, &[&f]);
        let mut method = QuasiInterpolation::new(parameters.view(), points.view(), None, options(LocalLambda::Constant(0.0))).unwrap();
        let map = method.fit(&space).unwrap();
        prop_assert!(space.n_levels() == 3);
        let error = largest_error(&map, f);
        prop_assert!(error < 1e-11, "{error:e}");
    }

    #[test]
    fn linear_functions_are_reproduced_with_smoothing(
        degree in 2_usize..=4,
        lambda in prop::sample::select(vec![
            LocalLambda::Constant(1e-6), LocalLambda::Constant(1.0), LocalLambda::PerPoint(1e-3), LocalLambda::PerArea(1e-2),
        ]),
        a in -1.0..1.0_f64,
        b in -1.0..1.0_f64,
        m in 40_usize..2000,
    ) {
        let f = |u: [f64; 2]| 1.0 + a * u[0] + b * u[1];
        let space = refined(&tensor::<2>(degree, 5), [0.3, 0.6]);
        let parameters = random::<2>(m, 5);
        let points = image(&parameters, &[&f]);
        let mut method = QuasiInterpolation::new(parameters.view(), points.view(), None, options(lambda)).unwrap();
        let map = method.fit(&space).unwrap();
        prop_assert!(method.work()[0].collinear.is_empty());
        let error = largest_error(&map, f);
        prop_assert!(error < 1e-9, "{error:e}");
    }
}

#[test]
fn polynomials_are_reproduced_in_one_and_three_dimensions() {
    let coefficients: Vec<f64> = (0..64).map(|i| ((i * 7 % 11) as f64 - 5.0) / 5.0).collect();
    let curve = |u: [f64; 1]| polynomial(3, &coefficients[..4], u);
    let parameters = random::<1>(1000, 3);
    let points = image(&parameters, &[&curve]);
    let mut method =
        QuasiInterpolation::new(parameters.view(), points.view(), None, options(LocalLambda::Constant(0.0))).unwrap();
    let map = method.fit(&refined(&tensor::<1>(3, 4), [0.4])).unwrap();
    assert!(largest_error(&map, curve) < 1e-11);

    let volume = |u: [f64; 3]| polynomial(2, &coefficients[..27], u);
    let parameters = grid::<3>(30);
    let points = image(&parameters, &[&volume]);
    let mut method =
        QuasiInterpolation::new(parameters.view(), points.view(), None, options(LocalLambda::Constant(0.0))).unwrap();
    let map = method.fit(&refined(&tensor::<3>(2, 2), [0.4, 0.5, 0.6])).unwrap();
    assert!(largest_error(&map, volume) < 1e-11, "{:e}", largest_error(&map, volume));
}

#[test]
fn errors_fall_with_order_degree_plus_one() {
    let f = |u: [f64; 2]| (3.0 * u[0] + 2.0 * u[1]).sin();
    let parameters = random::<2>(60_000, 9);
    let points = image(&parameters, &[&f]);
    for degree in 1..=4 {
        let error = |elements: usize| {
            let mut method =
                QuasiInterpolation::new(parameters.view(), points.view(), None, options(LocalLambda::Constant(0.0)))
                    .unwrap();
            largest_error(&method.fit(&tensor::<2>(degree, elements)).unwrap(), f)
        };
        let rate = (error(12) / error(24)).log2();
        assert!(rate > degree as f64 + 0.6, "degree {degree}: {rate}");
    }
}

#[test]
fn a_region_of_the_whole_domain_gives_the_global_fit() {
    // n_min is the number of points, so every support grows until it holds all of them.
    let parameters = random::<2>(600, 21);
    let points = image(&parameters, &[&|u: [f64; 2]| (9.0 * u[0] * u[1]).sin(), &|u| u[0] * u[0] - u[1]]);
    let weights = ndarray::Array1::from_iter((0..600).map(|i| 0.5 + (i % 7) as f64));
    for degree in 1..=4 {
        let space = tensor::<2>(degree, 4);
        let lambda = 1e-3;
        let wanted = Options { n_min: Some(600), ..options(LocalLambda::Constant(lambda)) };
        let mut local =
            QuasiInterpolation::new(parameters.view(), points.view(), Some(weights.view()), wanted).unwrap();
        let local = local.fit(&space).unwrap();
        let fitting = fit_ls::Options { lambda: Lambda::Fixed(lambda), ..fit_ls::Options::default() };
        let mut global = LeastSquares::new(parameters.view(), points.view(), Some(weights.view()), fitting).unwrap();
        let global = global.fit(&space).unwrap();
        let difference = (&local.coefficients() - &global.coefficients()).iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        assert!(difference < 1e-10, "degree {degree}: {difference:e}");
    }
}

#[test]
fn hierarchical_coefficients_are_those_of_each_level() {
    let f = |u: [f64; 2]| (8.0 * u[0]).sin() + (1.0 - u[1]).powi(5);
    let parameters = random::<2>(8000, 4);
    let points = image(&parameters, &[&f]);
    let start = tensor::<2>(2, 6);
    let space = refined(&start, [0.3, 0.3]);
    let method = || {
        QuasiInterpolation::new(parameters.view(), points.view(), None, options(LocalLambda::Constant(1e-7))).unwrap()
    };
    let hierarchical = method().fit(&space).unwrap();
    for level in 0..3 {
        let uniform = tensor::<2>(2, 6 << level);
        let of_level = method().fit(&uniform).unwrap();
        let first = space.first_of_level(level);
        for (k, &function) in space.active_functions(level).iter().enumerate() {
            let difference =
                hierarchical.coefficients()[[first + k, 0]] - of_level.coefficients()[[function as usize, 0]];
            assert!(difference.abs() < 1e-12, "level {level}, function {function}: {difference:e}");
        }
    }
}

#[test]
fn the_mean_stands_in_where_parameters_lie_on_a_line() {
    // Two rows of points, far apart: near the first one the local sites are collinear, and density is not asked for.
    let parameters =
        Array2::from_shape_fn(
            (200, 2),
            |(i, d)| if d == 0 { (i % 100) as f64 / 99.0 } else { 0.02 + 0.96 * (i / 100) as f64 },
        );
    let points = image(&parameters, &[&|u: [f64; 2]| 3.0 * u[0]]);
    let lambda = LocalLambda::Constant(1e-8);
    let wanted = Options { n_min: Some(4), density: 0.0, ..options(lambda) };
    let mut method = QuasiInterpolation::new(parameters.view(), points.view(), None, wanted).unwrap();
    let map = method.fit(&tensor::<2>(2, 16)).unwrap();
    let collinear = &method.work()[0].collinear;
    assert!(!collinear.is_empty());
    for &function in collinear {
        // The mean of points along a piece of the line of slope 3.
        assert!((0.0..=3.0).contains(&map.coefficients()[[function, 0]]));
    }
    // With more points than a row has, regions grow until they hold both rows.
    let wanted = Options { n_min: Some(101), ..options(lambda) };
    let mut method = QuasiInterpolation::new(parameters.view(), points.view(), None, wanted).unwrap();
    let map = method.fit(&tensor::<2>(2, 16)).unwrap();
    assert!(method.work()[0].collinear.is_empty() && method.work()[0].max_rings > 3);
    assert!(largest_error(&map, |u| 3.0 * u[0]) < 1e-6);
}

#[test]
fn functions_far_from_all_points_inherit_from_the_coarser_level() {
    // Points in the left half only; the mesh is refined everywhere.
    let mut parameters = random::<2>(3000, 6);
    parameters.column_mut(0).mapv_inplace(|u| 0.45 * u);
    let f = |u: [f64; 2]| 2.0 * u[0] - 3.0 * u[1];
    let points = image(&parameters, &[&f]);
    let start = tensor::<2>(2, 4);
    let all: Vec<usize> = (0..16).collect();
    let once = start.refine(&all, &thb_core::Refinement::default()).unwrap();
    let all: Vec<usize> = (0..64).collect();
    let space = std::sync::Arc::new(once.refine(&all, &thb_core::Refinement::default()).unwrap());
    let method = |lambda| {
        QuasiInterpolation::new(parameters.view(), points.view(), None, options(LocalLambda::Constant(lambda))).unwrap()
    };
    let mut smoothed = method(1e-9);
    let map = smoothed.fit(&space).unwrap();
    let work = &smoothed.work()[0];
    assert!(work.inherited > 20 && work.inherited < work.functions, "{work:?}");
    assert!(largest_error(&map, f) < 1e-6, "{:e}", largest_error(&map, f));
    // Without smoothing nothing says what the last function of level 0, far from all points, should be.
    assert!(matches!(method(0.0).fit(&space), Err(Error::NotDetermined { function: 5, level: 0, points: 3000, .. })));
}

#[test]
fn closed_directions_have_no_seam() {
    let f = |u: [f64; 2]| (std::f64::consts::TAU * u[0]).sin() + u[1] * (2.0 * std::f64::consts::TAU * u[0]).cos();
    let parameters = random::<2>(20_000, 15);
    let points = image(&parameters, &[&f]);
    for degree in 2..=3 {
        let knots = [KnotVector::uniform_periodic(degree, 12).unwrap(), KnotVector::uniform(degree, 6).unwrap()];
        let start = HierarchicalSpace::new(Kind::Thb, knots).unwrap();
        let space = refined(&start, [0.98, 0.5]);
        let mut method =
            QuasiInterpolation::new(parameters.view(), points.view(), None, options(LocalLambda::Constant(0.0)))
                .unwrap();
        let map = method.fit(&space).unwrap();
        let error = largest_error(&map, f);
        assert!(error < if degree == 2 { 3e-2 } else { 1e-2 }, "degree {degree}: {error:e}");
        // Shifting the points by a third of a turn shifts the surface: the seam is a place like any other.
        let turned = |by: f64| {
            let mut parameters = parameters.clone();
            parameters.column_mut(0).mapv_inplace(|u| (u + by).rem_euclid(1.0));
            let wanted = options(LocalLambda::Constant(1e-6));
            let mut method = QuasiInterpolation::new(parameters.view(), points.view(), None, wanted).unwrap();
            method.fit(&std::sync::Arc::new(start.clone())).unwrap()
        };
        let (still, moved) = (turned(0.0), turned(0.25));
        for i in 0..50 {
            let (u, v) = (f64::from(i) / 50.0, 0.4);
            let difference = still.eval([u, v]).unwrap()[0] - moved.eval([(u + 0.25).rem_euclid(1.0), v]).unwrap()[0];
            assert!(difference.abs() < 1e-9, "{u}: {difference:e}");
        }
    }
}
