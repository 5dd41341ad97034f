//! Least squares in spaces other than hierarchical B-splines.

use std::sync::Arc;

use fit_ls::{Error, weighted_least_squares, wls_as_interpolants};
use ndarray::{Array1, Array2};
use thb_core::{BoxSplineSpace, CellSpace, SplineMap, TensorSpace};

fn places(count: usize) -> Array2<f64> {
    Array2::from_shape_fn((count, 2), |(i, d)| ((i + 1) as f64 * [0.754_877_666_2, 0.569_840_291_0][d]).fract())
}

#[test]
fn box_splines_come_back() {
    let coarse = BoxSplineSpace::new([4, 4], [0.0; 2], [1.0; 2]).unwrap();
    let space = Arc::new(coarse.refine(&[coarse.locate_cell([0.3, 0.6]).unwrap()], 1).unwrap());
    let coefficients = Array2::from_shape_fn((space.n_functions(), 2), |(i, k)| (i as f64 * 1.3 + k as f64).sin());
    let planted = SplineMap::new(space.clone(), coefficients).unwrap();
    let uv = places(3000);
    let points = planted.eval_batch(uv.view()).unwrap();
    let weights = Array1::from_shape_fn(3000, |i| 0.5 + (i as f64 * 0.618).fract());
    let fit = weighted_least_squares(&space, uv.view(), points.view(), Some(weights.view())).unwrap();
    let difference = &fit.eval_batch(uv.view()).unwrap() - &points;
    // Functions at the rim of the domain have a sliver of support there.
    assert!(difference.iter().all(|d| d.abs() < 1e-8));
}

#[test]
fn theorem_1_holds_for_tensor_product_polynomials() {
    let space = Arc::new(TensorSpace::bernstein([1, 2]).unwrap());
    let uv = places(9);
    let points = Array2::from_shape_fn((9, 1), |(i, _)| (2.0 * i as f64).cos());
    let weights = Array1::from_shape_fn(9, |i| 0.2 + 0.1 * i as f64);
    let sum = wls_as_interpolants(&space, uv.view(), points.view(), Some(weights.view())).unwrap();
    assert_eq!(sum.n_subsets(), 84);
    let solved = weighted_least_squares(&space, uv.view(), points.view(), Some(weights.view())).unwrap();
    let difference = &sum.map().unwrap().coefficients() - &solved.coefficients();
    assert!(difference.iter().all(|d| d.abs() < 1e-9), "{difference}");
}

#[test]
fn too_few_points_are_refused() {
    let space = Arc::new(BoxSplineSpace::new([4, 4], [0.0; 2], [1.0; 2]).unwrap());
    let uv = places(10);
    let few = weighted_least_squares(&space, uv.view(), uv.view(), None);
    assert!(matches!(few, Err(Error::RankDeficient { functions: 47, .. })), "{:?}", few.err());
}
