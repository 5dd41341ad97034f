//! Theorem 1 and its consequences (Imperatore 2024, §3.1.3–3.1.4).

use std::sync::Arc;

use fit_ls::{
    Error, Lambda, LeastSquares, Options, collocation_matrix, schoenberg_whitney, wls_as_interpolants, wls_limit,
};
use ndarray::{Array1, Array2, array};
use proptest::prelude::*;
use thb_core::{CellSpace, HierarchicalSpace, Kind, KnotVector, Refinement, SplineMap};

fn unsmoothed<const D: usize>() -> Options<D> {
    Options { lambda: Lambda::Fixed(0.0), ..Options::default() }
}

fn direct<const D: usize>(
    space: &Arc<HierarchicalSpace<D>>,
    sites: &Array2<f64>,
    values: &Array2<f64>,
    weights: &Array1<f64>,
) -> Result<SplineMap<D>, Error> {
    LeastSquares::new(sites.view(), values.view(), Some(weights.view()), unsmoothed())?.fit(space)
}

/// The data of Imperatore 2024, §3.1.5.
fn worked_example() -> (Array2<f64>, Array2<f64>) {
    let sites = array![[-4.5], [-3.5], [-2.2], [-1.2], [0.8], [2.2], [4.0]];
    (sites, array![[-2.0], [0.0], [-1.0], [2.8], [2.9], [0.5], [-2.0]])
}

fn spline_space() -> Arc<HierarchicalSpace<1>> {
    let knots = KnotVector::new(2, vec![-5.0, -5.0, -5.0, -5.0 / 3.0, 5.0 / 3.0, 5.0, 5.0, 5.0]).unwrap();
    Arc::new(HierarchicalSpace::new(Kind::Thb, [knots]).unwrap())
}

#[test]
fn the_worked_example_has_35_and_20_interpolants() {
    let (sites, values) = worked_example();
    let polynomials = KnotVector::uniform(2, 1).unwrap().on_interval(-5.0, 5.0).unwrap();
    let polynomials = Arc::new(HierarchicalSpace::new(Kind::Thb, [polynomials]).unwrap());
    for (space, tried, exist) in [(polynomials, 35, 35), (spline_space(), 21, 20)] {
        let sum = wls_as_interpolants(&space, sites.view(), values.view(), None).unwrap();
        assert_eq!((sum.n_subsets(), sum.interpolants().len()), (tried, exist));
    }
    // The missing one has no point where the last function lives.
    let sum = wls_as_interpolants(&spline_space(), sites.view(), values.view(), None).unwrap();
    assert!(sum.interpolants().iter().all(|k| k.points != [0, 1, 2, 3, 4]));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// (3.10) and (3.11) for random sites, values and weights.
    #[test]
    fn least_squares_is_the_combination(
        sites in prop::collection::vec(0.0..1.0f64, 9), values in prop::collection::vec(-1.0..1.0f64, 18),
        weights in prop::collection::vec(0.01..1.0f64, 9), u in 0.0..1.0f64,
    ) {
        let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [KnotVector::uniform(2, 3).unwrap()]).unwrap());
        let sites = Array2::from_shape_vec((9, 1), sites).unwrap();
        let values = Array2::from_shape_vec((9, 2), values).unwrap();
        let weights = Array1::from(weights);
        let Ok(sum) = wls_as_interpolants(&space, sites.view(), values.view(), Some(weights.view())) else {
            return Ok(());
        };
        // A badly conditioned system keeps fewer digits, in both ways.
        let best = sum.interpolants().iter().map(|k| k.determinant.abs()).fold(0.0, f64::max);
        prop_assume!(best > 1e-4);
        let (combined, solved) = (sum.map().unwrap(), direct(&space, &sites, &values, &weights).unwrap());
        let size = solved.coefficients().iter().fold(1.0_f64, |m, c| m.max(c.abs()));
        for order in 0..=2 {
            let (a, b) = (combined.derivative([u], [order]).unwrap(), solved.derivative([u], [order]).unwrap());
            for (k, [low, high]) in sum.derivative_bounds([u], [order]).unwrap().into_iter().enumerate() {
                prop_assert!((a[k] - b[k]).abs() < 1e-7 * size, "{} {}", a[k], b[k]);
                prop_assert!(low - 1e-9 * size <= a[k] && a[k] <= high + 1e-9 * size);
            }
        }
        prop_assert!((sum.interpolants().iter().map(|k| k.share).sum::<f64>() - 1.0).abs() < 1e-13);
    }

    /// The nesting condition says when the collocation matrix has full rank.
    #[test]
    fn the_nesting_condition_is_full_rank(
        degree in 1..4usize, places in prop::collection::vec(0..24u8, 3..9), twice in any::<bool>(),
    ) {
        let mut knots = vec![0.0; degree + 1];
        knots.extend(if twice { vec![0.25, 0.5, 0.5, 0.75] } else { vec![0.25, 0.5, 0.75] });
        knots.extend(vec![1.0; degree + 1]);
        let Ok(knots) = KnotVector::new(degree, knots) else { return Ok(()) };
        let sites: Vec<f64> = places.iter().map(|&k| f64::from(k) / 23.0).collect();
        let column = Array2::from_shape_vec((sites.len(), 1), sites.clone()).unwrap();
        let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone()]).unwrap());
        let ones = Array2::ones((sites.len(), 1));
        let full = wls_as_interpolants(&space, column.view(), ones.view(), None).is_ok();
        prop_assert_eq!(schoenberg_whitney(&knots, &sites), full);
    }
}

#[test]
fn growing_weights_approach_the_limit() {
    let (sites, values) = worked_example();
    let space = spline_space();
    let base = Array1::from_shape_fn(7, |i| 0.3 + 0.1 * i as f64);
    let marked = [2, 5];
    let limit = wls_limit(&space, sites.view(), values.view(), Some(base.view()), &marked).unwrap();
    assert!(limit.interpolants().iter().all(|k| marked.iter().all(|i| k.points.contains(i))));
    let limit = limit.map().unwrap();
    // It passes through the marked points, and finite weights approach it with their reciprocal.
    for i in marked {
        assert!((limit.eval([sites[[i, 0]]]).unwrap()[0] - values[[i, 0]]).abs() < 1e-13);
    }
    let away = |factor: f64| {
        let weights = Array1::from_shape_fn(7, |i| base[i] * if marked.contains(&i) { factor } else { 1.0 });
        let map = direct(&space, &sites, &values, &weights).unwrap();
        (&map.coefficients() - &limit.coefficients()).iter().fold(0.0_f64, |m, d| m.max(d.abs()))
    };
    let (near, nearer) = (away(1e4), away(1e6));
    assert!(nearer < 1e-4 && (near / nearer - 100.0).abs() < 1.0, "{near} {nearer}");
    // As many points as functions are interpolated.
    let all = wls_limit(&space, sites.view(), values.view(), None, &[0, 2, 3, 5, 6]).unwrap();
    assert_eq!((all.n_subsets(), all.interpolants().len()), (1, 1));
}

#[test]
fn hierarchical_spaces_are_spaces_too() {
    let knots = KnotVector::uniform(1, 2).unwrap();
    let coarse = HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap();
    let space = Arc::new(coarse.refine(&[0], &Refinement::default()).unwrap());
    let n = space.n_functions();
    // The vertices of the mesh.
    let coarse = (0..9).map(|k| [(k % 3) as f64 / 2.0, (k / 3) as f64 / 2.0]);
    let fine = [[0.25, 0.0], [0.0, 0.25], [0.25, 0.25], [0.5, 0.25], [0.25, 0.5]];
    let vertices: Vec<[f64; 2]> = coarse.chain(fine).collect();
    let m = vertices.len();
    let sites = Array2::from_shape_fn((m, 2), |(i, d)| vertices[i][d]);
    let values = Array2::from_shape_fn((m, 1), |(i, _)| (i as f64).sin());
    let matrix = collocation_matrix(&space, sites.view()).unwrap();
    assert_eq!(matrix.dim(), (m, n));
    assert!(matrix.sum_axis(ndarray::Axis(1)).iter().all(|s| (s - 1.0).abs() < 1e-14));
    let ones = Array1::ones(m);
    let sum = wls_as_interpolants(&space, sites.view(), values.view(), None);
    match (sum, direct(&space, &sites, &values, &ones)) {
        (Ok(sum), Ok(solved)) => {
            let difference = &sum.map().unwrap().coefficients() - &solved.coefficients();
            assert!(difference.iter().all(|d| d.abs() < 1e-8), "{difference}");
        }
        (sum, solved) => panic!("{:?} {:?}", sum.err(), solved.err()),
    }
}

#[test]
fn what_is_too_much_is_refused() {
    let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [KnotVector::uniform(3, 12).unwrap()]).unwrap());
    let sites = Array2::from_shape_fn((60, 1), |(i, _)| i as f64 / 59.0);
    let values = sites.clone();
    let many = wls_as_interpolants(&space, sites.view(), values.view(), None);
    assert!(matches!(many, Err(Error::TooManySubsets { points: 60, functions: 15, .. })));
    let few = Arc::new(HierarchicalSpace::new(Kind::Thb, [KnotVector::uniform(3, 1).unwrap()]).unwrap());
    let equal = Array2::from_elem((6, 1), 0.5);
    assert!(matches!(
        wls_as_interpolants(&few, equal.view(), equal.view(), None),
        Err(Error::NoInterpolant { points: 6, functions: 4 })
    ));
    let weights = array![1.0, 0.0, 1.0, 1.0, 1.0, 1.0];
    assert!(matches!(
        wls_as_interpolants(&few, equal.view(), equal.view(), Some(weights.view())),
        Err(Error::Weight { index: 1, .. })
    ));
}

#[test]
fn periodic_sites_may_start_anywhere() {
    let knots = KnotVector::uniform_periodic(3, 6).unwrap();
    let shifted: Vec<f64> = (0..6).map(|k| (k as f64 + 0.4) / 6.0).collect();
    assert!(schoenberg_whitney(&knots, &shifted));
    // A gap of five sixths leaves a function without a site.
    let gathered: Vec<f64> = (0..9).map(|k| 0.5 + 0.01 * k as f64).collect();
    assert!(!schoenberg_whitney(&knots, &gathered));
    assert!(!schoenberg_whitney(&knots, &shifted[..5]));
}
