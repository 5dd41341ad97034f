//! Quasi-interpolation with moving parameters.

use std::ops::ControlFlow;
use std::sync::Arc;

use adaptive::{Iteration, Outcome, Solve, run};
use fit_qi::{LocalLambda, QuasiInterpolation};
use moving_param::{Boundary, Error, MovingQuasi, QuasiOptions};
use ndarray::Array2;
use thb_core::{HierarchicalSpace, Kind, KnotVector, Refinement, SplineMap};

const SIDE: usize = 61;

/// A ridged cylinder, parameterized unevenly along its curved side.
fn cloud() -> (Array2<f64>, Array2<f64>) {
    let m = SIDE * SIDE;
    let parameters = Array2::from_shape_fn((m, 2), |(i, d)| [i % SIDE, i / SIDE][d] as f64 / (SIDE - 1) as f64);
    let points = Array2::from_shape_fn((m, 3), |(i, k)| {
        let (u, v) = (parameters[[i, 0]], parameters[[i, 1]]);
        let x = u + 0.6 * (u * (1.0 - u)) * (9.0 * u).sin() * (0.5 + 0.5 * v);
        [x, v, x * x + 0.1 * (-60.0 * (x - 0.5) * (x - 0.5)).exp()][k]
    });
    (parameters, points)
}

fn space() -> Arc<HierarchicalSpace<2>> {
    let knots = KnotVector::uniform(2, 4).unwrap();
    Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap())
}

fn local() -> fit_qi::Options<2> {
    fit_qi::Options { lambda: LocalLambda::Constant(1e-9), ..fit_qi::Options::default() }
}

const TOLERANCE: f64 = 2e-3;

fn rules() -> adaptive::Options<2> {
    adaptive::Options {
        tolerance: TOLERANCE,
        within: 1.0,
        refinement: Refinement { extension: [0; 2], ..Refinement::default() },
        ..adaptive::Options::default()
    }
}

fn go(corrections: usize, boundary: Boundary) -> (MovingQuasi<2>, Outcome<2, Error>) {
    let (parameters, points) = cloud();
    let options = QuasiOptions { corrections, boundary, tolerance: TOLERANCE, ..QuasiOptions::default() };
    let mut method = MovingQuasi::new(parameters.view(), points.view(), None, local(), options).unwrap();
    let outcome = run(&mut method, space(), &rules(), &mut |_: &Iteration| ControlFlow::Continue(())).unwrap();
    (method, outcome)
}

#[test]
fn corrections_save_control_points_at_the_same_largest_error() {
    let dofs = |outcome: &Outcome<2, Error>| {
        let last = outcome.history[outcome.history.len() - 1];
        assert!(last.deviation.max <= TOLERANCE, "{last:?}");
        last.dofs
    };
    let fixed = dofs(&go(0, Boundary::Kept).1);
    for corrections in 1..=3 {
        let (method, outcome) = go(corrections, Boundary::Kept);
        assert!(20 * dofs(&outcome) < 17 * fixed, "{corrections}: {} against {fixed}", dofs(&outcome));
        // All coefficients are computed again after each correction.
        let work = method.quasi_interpolation().work();
        assert!(work[..=corrections].iter().all(|w| w.solved == w.functions));
        assert_eq!(method.reports()[0].corrections, corrections);
        // Errors are those at the present parameters.
        let image = outcome.map.eval_batch(method.parameters().view()).unwrap();
        let largest = (&image - &cloud().1).outer_iter().map(|row| row.dot(&row).sqrt()).fold(0.0, f64::max);
        assert!((largest - outcome.history[outcome.history.len() - 1].deviation.max).abs() < 1e-12);
    }
}

#[test]
fn without_corrections_it_is_plain_quasi_interpolation() {
    let (parameters, points) = cloud();
    let mut plain = QuasiInterpolation::new(parameters.view(), points.view(), None, local()).unwrap();
    let outcome = run(&mut plain, space(), &rules(), &mut |_: &Iteration| ControlFlow::Continue(())).unwrap();
    let (method, moving) = go(0, Boundary::Kept);
    assert_eq!(outcome.map.coefficients(), moving.map.coefficients());
    assert_eq!(method.parameters(), parameters);
}

#[test]
fn points_on_the_boundary_stay_on_their_side() {
    let (parameters, _) = cloud();
    let (method, _) = go(2, Boundary::Kept);
    let moved = method.parameters();
    assert!(method.reports()[0].mean_move > 1e-3);
    for (before, after) in parameters.outer_iter().zip(moved.outer_iter()) {
        for d in 0..2 {
            if before[d] == 0.0 || before[d] == 1.0 {
                assert_eq!(before[d], after[d]);
            }
            assert!((0.0..=1.0).contains(&after[d]));
        }
    }
    let free = go(2, Boundary::Free).0.parameters();
    let left =
        |u: &Array2<f64>| parameters.column(0).iter().zip(u.column(0)).filter(|(a, b)| **a == 0.0 && **b > 0.0).count();
    assert_eq!(left(&moved), 0);
    assert!(left(&free) > 0);
}

#[test]
fn bad_options_are_named() {
    let (parameters, points) = cloud();
    let new = |points: &Array2<f64>, tolerance| {
        let options = QuasiOptions { tolerance, ..QuasiOptions::default() };
        MovingQuasi::<2>::new(parameters.view(), points.view(), None, local(), options).err()
    };
    assert!(matches!(new(&points, -1.0), Some(Error::Option { name: "tolerance", .. })));
    let wide = Array2::zeros((points.nrows(), 4));
    assert!(matches!(new(&wide, 0.0), Some(Error::Dimension { given: 4, limit: 3 })));
    let short = Array2::zeros((3, 3));
    assert!(matches!(new(&short, 0.0), Some(Error::Quasi(fit_qi::Error::Points(fit_ls::Error::Shape { .. })))));
}

/// A sheet with noise as large as its waves, so that foot points follow what is not there.
fn noisy(seed: usize) -> (Array2<f64>, Array2<f64>) {
    let side = 25;
    let noise = |i: usize| ((i * 7919 + seed * 104_729) as f64 * 0.618_033_988_749_895).fract() - 0.5;
    let parameters =
        Array2::from_shape_fn((side * side, 2), |(i, d)| [i % side, i / side][d] as f64 / (side - 1) as f64);
    let points = Array2::from_shape_fn((side * side, 3), |(i, k)| {
        let (u, v) = (parameters[[i, 0]], parameters[[i, 1]]);
        [u, v, 0.1 * (9.0 * u + 4.0 * v).sin()][k] + 0.2 * noise(3 * i * i + k)
    });
    (parameters, points)
}

#[test]
fn moving_does_not_end_much_farther_away_than_not_moving_in_the_same_space() {
    let cases = (0..8).flat_map(|seed| [(seed, 5, 1), (seed, 5, 3), (seed, 8, 1), (seed, 8, 3)]);
    for (seed, elements, corrections) in cases {
        let (parameters, points) = noisy(seed);
        let largest = |map: &SplineMap<2>, at: &Array2<f64>| -> f64 {
            let off = map.eval_batch(at.view()).unwrap() - &points;
            off.rows().into_iter().map(|r| r.dot(&r).sqrt()).fold(0.0, f64::max)
        };
        let knots = KnotVector::uniform(2, elements).unwrap();
        let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap());
        let mut plain = QuasiInterpolation::new(parameters.view(), points.view(), None, local()).unwrap();
        let fixed = plain.fit(&space).unwrap();
        let options = QuasiOptions { corrections, tolerance: 1e-4, ..QuasiOptions::default() };
        let mut method = MovingQuasi::new(parameters.view(), points.view(), None, local(), options).unwrap();
        let moved = Solve::solve(&mut method, &space, None).unwrap().map;
        let (before, after) = (largest(&fixed, &parameters), largest(&moved, &method.parameters()));
        assert!(after <= 1.5 * before * (1.0 + 1e-12), "{elements} elements: {before:e}, moved {after:e}");
        assert_eq!(method.work().len(), 1);
        assert!(method.work()[0].len() > corrections);
    }
}
