//! Hierarchical quartic box splines.

use std::sync::Arc;

use ndarray::Array2;
use thb_core::{BoxSplineSpace, CellSpace, Error, SplineMap};

fn refined() -> BoxSplineSpace {
    let coarse = BoxSplineSpace::new([5, 4], [-1.0, 0.0], [1.0, 1.0]).unwrap();
    let cell = coarse.locate_cell([0.1, 0.4]).unwrap();
    let once = coarse.refine(&[cell], 1).unwrap();
    let cell = once.locate_cell([0.1, 0.4]).unwrap();
    once.refine(&[cell], 2).unwrap()
}

/// Pseudo-random places of a box.
fn places(count: usize, space: &BoxSplineSpace) -> Vec<[f64; 2]> {
    let (lower, upper) = space.domain();
    let share = |k: usize, d: usize| ((k + 1) as f64 * [0.754_877_666_2, 0.569_840_291_0][d]).fract();
    (0..count).map(|k| [0, 1].map(|d| lower[d] + share(k, d) * (upper[d] - lower[d]))).collect()
}

#[test]
fn box_splines_of_one_level_sum_to_one_and_give_lines() {
    let space = Arc::new(BoxSplineSpace::new([5, 4], [-1.0, 0.0], [1.0, 1.0]).unwrap());
    // Vertices of the grid and around it, but for the two corners whose hexagons lie outside.
    assert_eq!(space.n_functions(), (5 + 3) * (4 + 3) - 2);
    let ones = SplineMap::new(space.clone(), Array2::ones((space.n_functions(), 1))).unwrap();
    for u in places(300, &space) {
        assert!((ones.eval(u).unwrap()[0] - 1.0).abs() < 1e-12);
        let cell = space.cell(space.locate_cell(u).unwrap());
        // Twelve hexagons cover a triangle.
        assert_eq!(cell.functions.len(), 12);
        assert!(cell.functions.is_sorted());
    }
}

#[test]
fn functions_are_twice_continuously_differentiable_and_not_negative() {
    let space = Arc::new(refined());
    let map = SplineMap::new(space.clone(), Array2::eye(space.n_functions())).unwrap();
    for number in 0..space.n_cells() {
        let cell = space.cell(number);
        let (a, b) = (cell.lower, cell.upper);
        let point = |s: f64, t: f64| [a[0] + s * (b[0] - a[0]), a[1] + t * (b[1] - a[1])];
        // Over the diagonal, and over the left and the lower side.
        let h = 1e-9;
        let pairs = [([0.5 + h, 0.5 - h], [0.5 - h, 0.5 + h]), ([h, 0.6], [-h, 0.6]), ([0.3, h], [0.3, -h])];
        for (p, q) in pairs {
            let (p, q) = (point(p[0], p[1]), point(q[0], q[1]));
            let (lower, upper) = space.domain();
            if (0..2).any(|d| q[d] < lower[d] || q[d] > upper[d]) {
                continue;
            }
            for order in [[0, 0], [1, 0], [0, 1], [2, 0], [1, 1], [0, 2]] {
                let (x, y) = (map.derivative(p, order).unwrap(), map.derivative(q, order).unwrap());
                // Third derivatives of the finest level are about its number of squares to the third.
                let slack = 1e-4;
                assert!(x.iter().zip(&y).all(|(x, y)| (x - y).abs() < slack), "{number} {p:?} {order:?}");
            }
        }
        assert!(map.eval(point(0.7, 0.2)).unwrap().iter().all(|v| *v > -1e-12));
    }
}

#[test]
fn levels_are_nested_and_functions_independent() {
    let space = Arc::new(refined());
    assert_eq!(space.n_levels(), 3);
    assert_eq!(space.functions_per_level().iter().sum::<usize>(), space.n_functions());
    assert!(space.functions_per_level().iter().all(|&n| n > 0), "{:?}", space.functions_per_level());
    // Gram matrix of many samples: elimination meets no zero pivot.
    let n = space.n_functions();
    let map = SplineMap::new(space.clone(), Array2::eye(n)).unwrap();
    let samples: Vec<[f64; 2]> = (0..space.n_cells())
        .flat_map(|number| {
            let cell = space.cell(number);
            let upper = number % 2 == 1;
            (0..5).flat_map(move |i| (0..=i).map(move |j| [(i as f64 + 0.5) / 5.5, j as f64 / 5.5])).map(
                move |[s, t]| {
                    let [s, t] = if upper { [t, s] } else { [s, t] };
                    [cell.lower[0] + s * cell.size()[0], cell.lower[1] + t * cell.size()[1]]
                },
            )
        })
        .collect();
    let sites = Array2::from_shape_fn((samples.len(), 2), |(i, d)| samples[i][d]);
    let values = map.eval_batch(sites.view()).unwrap();
    let mut gram = values.t().dot(&values);
    for k in 0..n {
        let pivot = gram[[k, k]];
        assert!(pivot > 1e-6, "function {k}: {pivot}");
        for i in k + 1..n {
            let factor = gram[[i, k]] / pivot;
            for j in k..n {
                gram[[i, j]] -= factor * gram[[k, j]];
            }
        }
    }
}

#[test]
fn what_lies_outside_is_refused() {
    let space = refined();
    assert!(matches!(space.locate_cell([1.1, 0.5]), Err(Error::OutsideDomain { direction: 0, .. })));
    assert!(space.locate_cell([f64::NAN, 0.5]).is_err());
    assert!(space.locate_cell([1.0, 1.0]).is_ok());
    assert!(matches!(space.refine(&[space.n_cells()], 0), Err(Error::Shape { .. })));
    assert!(BoxSplineSpace::new([0, 3], [0.0; 2], [1.0; 2]).is_err());
    assert!(BoxSplineSpace::new([3, 3], [0.0; 2], [1.0, 0.0]).is_err());
}
