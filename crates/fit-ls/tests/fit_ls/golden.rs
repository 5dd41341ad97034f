//! The adaptive loop on a fixed cloud, iteration by iteration.

use std::ops::ControlFlow;
use std::sync::Arc;

use adaptive::{Iteration, Options, Stop, run};
use fit_ls::{Lambda, LeastSquares};
use ndarray::Array2;
use thb_core::{HierarchicalSpace, Kind, KnotVector, Quadrature};

/// Functions, largest error and mean squared error of each iteration. G+Smo 26.9 (its `gsFitting` in the loop of its
/// `gsHFitting`) gives the same functions, and the same errors to these ten digits: `tests/peers/peaks_gismo.py`.
const EXPECTED: [(usize, f64, f64); 5] = [
    (100, 3.719504444e-1, 7.095848749e-4),
    (324, 1.512171967e-1, 5.864578283e-5),
    (934, 6.301378367e-2, 4.794884282e-6),
    (1789, 1.325186388e-3, 3.647299199e-9),
    (2212, 1.051830877e-3, 8.927681372e-10),
];

/// Relative deviation that other orders of summation may cause; the last systems have nearly as many functions as points.
const ROUND_OFF: f64 = 1e-6;

#[test]
fn peaks_are_fitted_as_by_the_reference_implementation() {
    let mut state = 1_u64;
    let parameters = Array2::from_shape_simple_fn((3000, 2), || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    });
    let points = Array2::from_shape_fn((3000, 3), |(i, k)| {
        let (x, y) = (2.0 * parameters[[i, 0]] - 1.0, 2.0 * parameters[[i, 1]] - 1.0);
        let cusp = |shift: f64| (-(10.0 * x + shift).hypot(10.0 * y + shift)).exp();
        [x, y, 2.0 / 3.0 * (cusp(-3.0) + cusp(3.0) + cusp(0.0))][k]
    });
    let knots = KnotVector::uniform(2, 8).unwrap();
    let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap());
    let fitting =
        fit_ls::Options { lambda: Lambda::Fixed(1e-7), quadrature: Quadrature::GaussP, ..fit_ls::Options::default() };
    let mut method = LeastSquares::new(parameters.view(), points.view(), None, fitting).unwrap();
    let options = Options { tolerance: 1e-4, within: 1.0, max_iterations: EXPECTED.len(), ..Options::default() };
    let mut go_on = |_: &Iteration| ControlFlow::Continue(());
    let outcome = run(&mut method, space, &options, &mut go_on).unwrap();
    assert_eq!(outcome.stop, Stop::Iterations);
    let dofs: Vec<usize> = outcome.history.iter().map(|i| i.dofs).collect();
    assert_eq!(dofs, EXPECTED.map(|(dofs, ..)| dofs));
    for (found, (_, max, mse)) in outcome.history.iter().zip(EXPECTED) {
        for (name, found, expected) in [("max", found.deviation.max, max), ("mse", found.deviation.mse, mse)] {
            assert!((found / expected - 1.0).abs() < ROUND_OFF, "{name} {found:e} instead of {expected:e}");
        }
    }
}
