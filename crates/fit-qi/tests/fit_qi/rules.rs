//! The adaptive loop: marking, kept coefficients, costs, errors, threads.

use std::ops::ControlFlow;

use crate::common::{Numbers, grid, image, random, tensor};
use adaptive::{Iteration, Outcome, Solve, Stop, run};
use fit_qi::{Error, LocalLambda, Options, QuasiInterpolation};
use ndarray::{Array2, Axis, array};
use thb_core::{HierarchicalSpace, Kind, KnotVector, Refinement, SplineMap};

fn options() -> Options<2> {
    Options { lambda: LocalLambda::Constant(1e-8), ..Options::default() }
}

fn rules(tolerance: f64) -> adaptive::Options<2> {
    adaptive::Options {
        tolerance,
        within: 0.99,
        refinement: Refinement { extension: [0; 2], max_levels: 6, ..Refinement::default() },
        ..adaptive::Options::default()
    }
}

fn bump(u: [f64; 2]) -> f64 {
    (-400.0 * ((u[0] - 0.3).powi(2) + (u[1] - 0.7).powi(2))).exp()
}

fn go(method: &mut QuasiInterpolation<2>, rules: &adaptive::Options<2>) -> Outcome<2, Error> {
    run(method, tensor::<2>(2, 8), rules, &mut |_: &Iteration| ControlFlow::Continue(())).unwrap()
}

#[test]
fn only_new_functions_are_solved_for_and_no_point_is_summed_twice_on_a_level() {
    let parameters = grid::<2>(150);
    let points = image(&parameters, &[&|u: [f64; 2]| u[0], &|u| u[1], &bump]);
    let mut method = QuasiInterpolation::new(parameters.view(), points.view(), None, options()).unwrap();
    let outcome = go(&mut method, &rules(1e-3));
    assert_eq!(outcome.stop, Stop::ToleranceReached);
    let work = method.work();
    assert!(work.len() >= 4, "{}", work.len());
    assert_eq!(work[0].solved, work[0].functions);
    let summed: usize = work.iter().map(|w| w.summed).sum();
    assert!(summed <= outcome.map.space().n_levels() * parameters.nrows(), "{summed}");
    // The bump is small: new functions are fewer and fewer of all, and so are the points that they need.
    for (pair, iteration) in work.windows(2).zip(&outcome.history[1..]) {
        assert_eq!(pair[1].functions, iteration.dofs);
        assert!(pair[1].solved < pair[1].functions);
        assert!(pair[1].solved >= pair[1].functions - pair[0].functions);
    }
    let last = &work[work.len() - 1];
    assert!(2 * last.summed < parameters.nrows(), "{last:?}");
    assert_eq!(last.solved_per_level.iter().sum::<usize>(), last.solved);
    // All at once gives the same coefficients.
    let mut anew = QuasiInterpolation::new(parameters.view(), points.view(), None, options()).unwrap();
    let map = anew.fit(outcome.map.space()).unwrap();
    assert_eq!(map.coefficients(), outcome.map.coefficients());
}

#[test]
fn the_same_bits_with_any_number_of_threads() {
    let parameters = random::<2>(40_000, 8);
    let points = image(&parameters, &[&|u: [f64; 2]| u[0], &|u| u[1], &bump]);
    let fit = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut method = QuasiInterpolation::new(parameters.view(), points.view(), None, options()).unwrap();
            go(&mut method, &rules(1e-3)).map
        })
    };
    let one = fit(1);
    assert!(one.space().n_levels() > 3);
    for threads in [2, 3] {
        assert!(one.coefficients().iter().zip(fit(threads).coefficients()).all(|(a, b)| a.to_bits() == b.to_bits()));
    }
}

#[test]
fn functions_with_too_few_points_are_not_refined() {
    let parameters = random::<2>(500, 3);
    let mut noise = Numbers::new(2);
    let points = Array2::from_shape_simple_fn((500, 1), || noise.next());
    let wanted = Options { n_loc: Some(40), ..options() };
    let mut method = QuasiInterpolation::new(parameters.view(), points.view(), None, wanted).unwrap();
    let mut go_on = |_: &Iteration| ControlFlow::Continue(());
    let outcome = run(&mut method, tensor::<2>(2, 4), &rules(1e-9), &mut go_on).unwrap();
    assert_eq!(outcome.stop, Stop::Data);
    // A cell of level ℓ was made from a support of nine cells with 40 points at least; 500 points allow for two levels.
    assert!((2..=3).contains(&outcome.map.space().n_levels()), "{}", outcome.map.space().n_levels());
    // Points in one half of each support only are not enough where both halves must hold their share.
    let half = parameters.map_axis(Axis(1), |u| u[0] < 0.125);
    let rows: Vec<usize> = (0..500).filter(|&i| half[i]).collect();
    let (parameters, points) = (parameters.select(Axis(0), &rows), points.select(Axis(0), &rows));
    let marked = |splits| {
        let wanted = Options { n_min: Some(4), n_loc: Some(9), splits, ..options() };
        let mut method = QuasiInterpolation::new(parameters.view(), points.view(), None, wanted).unwrap();
        let map = method.fit(&tensor::<2>(2, 4)).unwrap();
        method.distances(&map).unwrap();
        method.mark(&map, 1e-9).unwrap().len()
    };
    assert!(marked([1, 1]) > 0);
    assert_eq!(marked([6, 1]), 0);
}

#[test]
fn marked_cells_are_those_of_functions_that_see_an_error() {
    let parameters = grid::<2>(80);
    // One point is off; all else lies in a plane.
    let mut points = image(&parameters, &[&|u: [f64; 2]| u[0] - u[1]]);
    let at = 80 * 40 + 40;
    points[[at, 0]] += 0.5;
    let mut method = QuasiInterpolation::new(parameters.view(), points.view(), None, options()).unwrap();
    let map = method.fit(&tensor::<2>(2, 16)).unwrap();
    method.distances(&map).unwrap();
    let marked = method.mark(&map, 0.1).unwrap();
    // Functions of the point's cell have supports within two cells of it: five by five cells.
    let centre = map.space().locate_cell([parameters[[at, 0]], parameters[[at, 1]]]).unwrap();
    let expected: Vec<usize> = (0..5).flat_map(|j| (0..5).map(move |i| centre - 34 + i + 16 * j)).collect();
    let mut sorted: Vec<usize> = marked.into_iter().map(|mark| mark.cell).collect();
    sorted.sort_unstable();
    assert_eq!(sorted, expected);
    assert_eq!(method.mark(&map, 1.0).unwrap(), []);
}

#[test]
fn voids_are_spanned_within_the_range_of_their_rims() {
    // Noisy hills with a hole, whose rim is dense on one side and sparse on the other.
    let mut numbers = Numbers::new(12);
    let rows: Vec<[f64; 2]> = (0..20_000)
        .map(|_| ([numbers.next(), numbers.next()], numbers.next()))
        .filter(|(u, chance)| (u[0] - 0.55).hypot(u[1] - 0.5) > 0.22 && (u[0] > 0.4 || *chance < 0.2))
        .map(|(u, _)| u)
        .collect();
    let parameters = Array2::from_shape_fn((rows.len(), 2), |(i, d)| rows[i][d]);
    // Ridges: every height over the hole is met on its rim too.
    let height = |u: [f64; 2]| 0.2 * (9.0 * u[0] + 5.0 * u[1]).sin();
    let points = Array2::from_shape_fn((rows.len(), 3), |(i, k)| match k {
        2 => height(rows[i]) + 0.01 * (numbers.next() - 0.5),
        _ => rows[i][k],
    });
    let wanted = Options { lambda: LocalLambda::Constant(1e-6), splits: [2, 2], ..Options::default() };
    let mut method = QuasiInterpolation::new(parameters.view(), points.view(), None, wanted).unwrap();
    let outcome =
        run(&mut method, tensor::<2>(3, 16), &rules(6e-3), &mut |_: &Iteration| ControlFlow::Continue(())).unwrap();
    assert!(outcome.map.space().n_levels() > 1);
    let rim: Vec<f64> = (0..rows.len())
        .filter(|&i| (rows[i][0] - 0.55).hypot(rows[i][1] - 0.5) < 0.25)
        .map(|i| points[[i, 2]])
        .collect();
    let (low, high) = rim.iter().fold((f64::MAX, f64::MIN), |(a, b), &z| (a.min(z), b.max(z)));
    let slack = 0.1 * (high - low);
    for i in 0..40 {
        for j in 0..40 {
            let u = [0.55 + 0.22 * (i as f64 / 19.5 - 1.0), 0.5 + 0.22 * (j as f64 / 19.5 - 1.0)];
            if (u[0] - 0.55_f64).hypot(u[1] - 0.5) < 0.22 {
                let z = outcome.map.eval(u).unwrap()[2];
                assert!((low - slack..=high + slack).contains(&z), "{u:?}: {z}, rim {low} to {high}");
                assert!(jacobian(&outcome.map, u) > 0.0, "a fold at {u:?}");
            }
        }
    }
}

/// Determinant of the first two coordinates' derivatives.
fn jacobian(map: &SplineMap<2>, u: [f64; 2]) -> f64 {
    let (a, b) = (map.derivative(u, [1, 0]).unwrap(), map.derivative(u, [0, 1]).unwrap());
    a[0] * b[1] - a[1] * b[0]
}

#[test]
fn bad_input_is_named() {
    let parameters = random::<2>(50, 1);
    let points = image(&parameters, &[&bump]);
    let new = |options: Options<2>| QuasiInterpolation::new(parameters.view(), points.view(), None, options);
    let option = |options, expected: &str| match new(options) {
        Err(Error::Option { name, .. }) => assert_eq!(name, expected),
        other => panic!("{expected}: {other:?}"),
    };
    option(Options { lambda: LocalLambda::PerPoint(-1.0), ..options() }, "the smoothing weight");
    option(Options { lambda: LocalLambda::Constant(f64::NAN), ..options() }, "the smoothing weight");
    option(Options { density: 1.5, ..options() }, "the density");
    option(Options { n_min: Some(2), ..options() }, "n_min");
    option(Options { n_min: Some(9), n_loc: Some(8), ..options() }, "n_loc");
    option(Options { splits: [0, 1], ..options() }, "the number of parts of a support");
    assert_eq!(
        new(Options { n_min: Some(51), ..options() }).err(),
        Some(Error::TooFewPoints { given: 50, needed: 51 })
    );
    assert_eq!(
        new(options()).unwrap().fit(&tensor::<2>(8, 1)).err(),
        Some(Error::TooFewPoints { given: 50, needed: 81 })
    );

    let knots = KnotVector::uniform(2, 4).unwrap();
    let hb = std::sync::Arc::new(HierarchicalSpace::new(Kind::Hb, [knots.clone(), knots]).unwrap());
    assert_eq!(new(options()).unwrap().fit(&hb).err(), Some(Error::NotTruncated));

    // Fewer points than polynomials of a cell, without smoothing.
    let mut method = QuasiInterpolation::new(
        parameters.view().select(Axis(0), &[0, 1, 2, 3, 4]).view(),
        points.view().select(Axis(0), &[0, 1, 2, 3, 4]).view(),
        None,
        Options { lambda: LocalLambda::Constant(0.0), n_min: Some(3), ..Options::default() },
    )
    .unwrap();
    match method.fit(&tensor::<2>(2, 2)) {
        Err(Error::NotDetermined { points: 5, lambda, .. }) => assert_eq!(lambda, 0.0),
        other => panic!("{other:?}"),
    }

    let outside = array![[0.5, 0.5], [0.5, 1.5], [0.1, 0.2], [0.3, 0.9]];
    let mut method = QuasiInterpolation::new(outside.view(), Array2::zeros((4, 1)).view(), None, options()).unwrap();
    match method.fit(&tensor::<2>(1, 2)) {
        Err(Error::Points(fit_ls::Error::Parameter { index: 1, .. })) => {}
        other => panic!("{other:?}"),
    }
    let bad = array![[f64::NAN, 0.5], [0.5, 0.5]];
    assert!(matches!(
        QuasiInterpolation::<2>::new(bad.view(), bad.view(), None, options()).err(),
        Some(Error::Points(fit_ls::Error::NotFinite { index: 0, component: 0 }))
    ));
}
