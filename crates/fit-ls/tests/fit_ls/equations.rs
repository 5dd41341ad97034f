//! Normal equations as a statistic that adds up, points without weight, and problems that have no solution.

use std::sync::Arc;

use crate::common::{Random, largest_difference, random_map, refined, scattered};
use fit_ls::{Error, Lambda, LeastSquares, NormalEquations, Options, SortedPoints};
use ndarray::{Array1, Array2, Axis};
use thb_core::{CellSpace, HierarchicalSpace, Kind, KnotVector, SymmetricPattern};

fn fixed(lambda: f64) -> Options<2> {
    Options { lambda: Lambda::Fixed(lambda), ..Options::default() }
}

fn equations(
    space: &HierarchicalSpace<2>,
    pattern: &SymmetricPattern,
    parameters: &Array2<f64>,
    points: &Array2<f64>,
) -> NormalEquations {
    let mut sorted = SortedPoints::new(parameters.view(), points.view(), None).unwrap();
    sorted.sort_refined(space, None).unwrap();
    NormalEquations::new(space, pattern, &sorted).unwrap()
}

#[test]
fn chunks_add_up_to_the_whole() {
    let space = refined::<2>(Kind::Thb, 3, 4);
    let pattern = SymmetricPattern::new(space.as_ref());
    let mut random = Random::new(1);
    let (parameters, points) = (random.array(4000, 2), random.array(4000, 3));
    let whole = equations(&space, &pattern, &parameters, &points);
    let mut sum = NormalEquations::zeros(&pattern, 3);
    for (first, end) in [(0, 1), (1, 700), (700, 3999), (3999, 4000)] {
        let rows: Vec<usize> = (first..end).collect();
        let (u, p) = (parameters.select(Axis(0), &rows), points.select(Axis(0), &rows));
        sum.merge(&equations(&space, &pattern, &u, &p)).unwrap();
    }
    let largest = whole.matrix.values().iter().copied().fold(0.0, f64::max);
    for (a, b) in whole.matrix.values().iter().zip(sum.matrix.values()) {
        assert!((a - b).abs() <= 1e-12 * largest);
    }
    assert!(largest_difference(&whole.right, &sum.right) <= 1e-12 * largest);
    // The functions sum to one, so all entries together count the points.
    let ones = whole.matrix.multiply(&vec![1.0; space.n_functions()]);
    assert!((ones.iter().sum::<f64>() - 4000.0).abs() < 1e-9);
}

#[test]
fn statistics_of_different_problems_do_not_merge() {
    let (a, b) = (refined::<2>(Kind::Thb, 2, 2), refined::<2>(Kind::Thb, 2, 3));
    let (a, b) = (SymmetricPattern::new(a.as_ref()), SymmetricPattern::new(b.as_ref()));
    let mut sum = NormalEquations::zeros(&a, 3);
    assert_eq!(sum.merge(&NormalEquations::zeros(&b, 3)), Err(Error::DifferentSpaces));
    assert_eq!(sum.merge(&NormalEquations::zeros(&a, 2)), Err(Error::DifferentSpaces));
    assert_eq!(sum.merge(&NormalEquations::zeros(&a, 3)), Ok(()));
}

#[test]
fn points_sorted_for_another_space_are_refused() {
    let space = refined::<2>(Kind::Thb, 2, 3);
    let pattern = SymmetricPattern::new(space.as_ref());
    let mut random = Random::new(2);
    let unsorted = SortedPoints::new(random.array(50, 2).view(), random.array(50, 1).view(), None).unwrap();
    let error = NormalEquations::new(space.as_ref(), &pattern, &unsorted).unwrap_err();
    let expected = space.n_cells();
    assert_eq!(error, Error::Shape { what: "cells the points are sorted for", given: 1, expected });
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let space = refined::<2>(Kind::Thb, 2, 4);
    let mut random = Random::new(9);
    // Enough points in one cell for several tasks.
    let parameters =
        Array2::from_shape_fn((60_000, 2), |(i, _)| if i % 2 == 0 { 0.6 + 0.1 * random.next() } else { random.next() });
    let points = random.array(60_000, 3);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let options = Options { lambda: Lambda::Auto { tolerance: 0.1 }, ..Options::default() };
            let mut method = LeastSquares::new(parameters.view(), points.view(), None, options).unwrap();
            let map = method.fit(&space).unwrap();
            let errors = method.distances(&map).unwrap().to_vec();
            (map.coefficients().to_owned(), errors, method.lambda())
        })
    };
    let one = run(1);
    for threads in [2, 3, 8] {
        assert!(run(threads) == one, "{threads} threads");
    }
}

#[test]
fn a_hole_in_the_data_names_the_functions() {
    let knots = KnotVector::uniform(2, 8).unwrap();
    let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap());
    let mut random = Random::new(4);
    let parameters = random.array(2000, 2);
    // Nothing in (½, 1]²: of the 10 × 10 functions those with both supports in [½, 1] have no data.
    let kept: Vec<usize> = (0..2000).filter(|&i| parameters[[i, 0]] < 0.5 || parameters[[i, 1]] < 0.5).collect();
    let parameters = parameters.select(Axis(0), &kept);
    let points = random.array(kept.len(), 3);
    let mut method = LeastSquares::new(parameters.view(), points.view(), None, fixed(0.0)).unwrap();
    let without: Vec<usize> = (0..100).filter(|k| k % 10 >= 6 && k / 10 >= 6).collect();
    let error = method.fit(&space).unwrap_err();
    let first = without[..5].to_vec();
    assert_eq!(error, Error::RankDeficient { without_data: without.len(), functions: 100, first, lambda: 0.0 });
    assert!(error.to_string().contains("16 of 100") && error.to_string().contains("[66, 67, 68, 69, 76]"), "{error}");
    // Held at values, they are no problem; with smoothing neither.
    let held = without.iter().map(|&j| (j, vec![0.0; 3])).collect();
    assert!(method.fit_with_fixed(&space, &held).is_ok());
    let mut method = LeastSquares::new(parameters.view(), points.view(), None, fixed(1e-6)).unwrap();
    assert!(method.fit(&space).is_ok());
}

#[test]
fn too_few_points_are_rank_deficient_though_each_function_has_one() {
    // All points on the diagonal of one element: each of the nine functions sees them.
    let knots = KnotVector::uniform(2, 1).unwrap();
    let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap());
    let parameters = Array2::from_shape_fn((40, 2), |(i, _)| (i as f64 + 0.5) / 40.0);
    let points = Array2::from_elem((40, 1), 1.0);
    let mut method = LeastSquares::new(parameters.view(), points.view(), None, fixed(0.0)).unwrap();
    match method.fit(&space) {
        Err(error @ Error::RankDeficient { without_data: 0, functions: 9, .. }) => {
            assert!(error.to_string().contains("each of 9 functions has points"), "{error}");
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn the_first_of_several_parameters_outside_is_named() {
    let knots = KnotVector::uniform(2, 4).unwrap();
    let space = std::sync::Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap());
    let mut parameters = Array2::from_elem((40_000, 2), 0.5);
    for row in [5, 9_000, 20_000, 39_999] {
        parameters[[row, 1]] = 1.5;
    }
    for _ in 0..20 {
        let found = LeastSquares::<2>::new(parameters.view(), Array2::zeros((40_000, 3)).view(), None, fixed(1e-6))
            .and_then(|mut method| method.fit(&space));
        assert!(matches!(found, Err(Error::Parameter { index: 5, .. })), "{:?}", found.err());
    }
}

#[test]
fn a_point_of_weight_zero_is_absent() {
    let space = refined::<2>(Kind::Thb, 2, 3);
    let mut random = Random::new(6);
    let parameters = scattered(&space, 20, &mut random);
    let mut points = random.array(parameters.nrows(), 3);
    let absent = |i: usize| i.is_multiple_of(5);
    let weights = Array1::from_shape_fn(points.nrows(), |i| if absent(i) { 0.0 } else { 1.0 });
    let kept: Vec<usize> = (0..points.nrows()).filter(|&i| !absent(i)).collect();
    let (u, p) = (parameters.select(Axis(0), &kept), points.select(Axis(0), &kept));
    (0..points.nrows()).filter(|&i| absent(i)).for_each(|i| points.row_mut(i).fill(1e6));
    let with = LeastSquares::new(parameters.view(), points.view(), Some(weights.view()), fixed(1e-5))
        .unwrap()
        .fit(&space)
        .unwrap();
    let without = LeastSquares::new(u.view(), p.view(), None, fixed(1e-5)).unwrap().fit(&space).unwrap();
    let error = largest_difference(&with.coefficients().to_owned(), &without.coefficients().to_owned());
    assert!(error < 1e-11, "{error:e}");
    // Weights twice as large ask for a smoothing weight twice as large.
    let doubled = weights.mapv(|w| 2.0 * w);
    let scaled = LeastSquares::new(parameters.view(), points.view(), Some(doubled.view()), fixed(2e-5))
        .unwrap()
        .fit(&space)
        .unwrap();
    assert!(largest_difference(&with.coefficients().to_owned(), &scaled.coefficients().to_owned()) < 1e-11);
}

#[test]
fn a_point_of_weight_two_is_two_points() {
    let space = refined::<2>(Kind::Thb, 2, 2);
    let mut random = Random::new(8);
    let parameters = scattered(&space, 12, &mut random);
    let points = random.array(parameters.nrows(), 2);
    let weights = Array1::from_shape_fn(points.nrows(), |i| if i % 3 == 0 { 2.0 } else { 1.0 });
    let repeated: Vec<usize> = (0..points.nrows()).chain((0..points.nrows()).step_by(3)).collect();
    let (u, p) = (parameters.select(Axis(0), &repeated), points.select(Axis(0), &repeated));
    let fit = |u: &Array2<f64>, p: &Array2<f64>, w: Option<&Array1<f64>>| {
        let mut method = LeastSquares::new(u.view(), p.view(), w.map(|w| w.view()), fixed(0.0)).unwrap();
        method.fit(&space).unwrap().coefficients().to_owned()
    };
    assert!(largest_difference(&fit(&parameters, &points, Some(&weights)), &fit(&u, &p, None)) < 1e-10);
}

#[test]
fn fixed_coefficients_are_kept_and_the_others_minimize() {
    let space = refined::<2>(Kind::Thb, 2, 3);
    let mut random = Random::new(12);
    let map = random_map(&space, 3, &mut random);
    let parameters = scattered(&space, 25, &mut random);
    let points = map.eval_batch(parameters.view()).unwrap();
    let mut method = LeastSquares::new(parameters.view(), points.view(), None, fixed(0.0)).unwrap();
    let row = |j: usize| map.coefficients().row(j).to_vec();
    // Held at the truth: the rest comes back.
    let held = vec![(0, row(0)), (5, row(5)), (space.n_functions() - 1, row(space.n_functions() - 1))];
    let found = method.fit_with_fixed(&space, &held).unwrap();
    for (j, values) in &held {
        assert_eq!(found.coefficients().row(*j).to_vec(), *values);
    }
    assert!(largest_difference(&found.coefficients().to_owned(), &map.coefficients().to_owned()) < 1e-9);
    // Held elsewhere: the gradient vanishes in all other coefficients.
    let held = vec![(7, vec![3.0, -1.0, 0.5]), (20, vec![0.0; 3])];
    let found = method.fit_with_fixed(&space, &held).unwrap();
    let pattern = SymmetricPattern::new(space.as_ref());
    let equations = equations(&space, &pattern, &parameters, &points);
    for k in 0..3 {
        let gradient = equations.matrix.multiply(&found.coefficients().column(k).to_vec());
        for j in 0..space.n_functions() {
            let free = held.iter().all(|(held, _)| *held != j);
            let value = (gradient[j] - equations.right[[j, k]]).abs();
            assert!(!free || value < 1e-10, "function {j}: {value:e}");
        }
    }
    for (j, values) in &held {
        assert_eq!(found.coefficients().row(*j).to_vec(), *values);
    }
    // Functions that do not exist, and rows of another length.
    let beyond = vec![(space.n_functions(), vec![0.0; 3])];
    assert!(matches!(method.fit_with_fixed(&space, &beyond), Err(Error::Shape { what: "fixed function", .. })));
    let narrow = vec![(0, vec![0.0; 2])];
    assert!(matches!(method.fit_with_fixed(&space, &narrow), Err(Error::Shape { given: 2, expected: 3, .. })));
}

#[test]
fn wrong_data_are_typed_errors() {
    let good = Array2::from_elem((5, 2), 0.5);
    let points = Array2::from_elem((5, 3), 1.0);
    let new = |u: &Array2<f64>, p: &Array2<f64>, w: Option<&Array1<f64>>, lambda: f64| {
        LeastSquares::new(u.view(), p.view(), w.map(|w| w.view()), fixed(lambda)).map(|_| ()).unwrap_err()
    };
    assert_eq!(new(&Array2::zeros((0, 2)), &Array2::zeros((0, 3)), None, 0.0), Error::NoPoints);
    assert!(matches!(new(&Array2::zeros((5, 3)), &points, None, 0.0), Error::Shape { given: 3, expected: 2, .. }));
    assert!(matches!(new(&Array2::zeros((4, 2)), &points, None, 0.0), Error::Shape { given: 4, expected: 5, .. }));
    let mut broken = points.clone();
    broken[[3, 2]] = f64::NAN;
    assert_eq!(new(&good, &broken, None, 0.0), Error::NotFinite { index: 3, component: 2 });
    let weights = Array1::from(vec![1.0, 1.0, -0.5, 1.0, 1.0]);
    assert_eq!(new(&good, &points, Some(&weights), 0.0), Error::Weight { index: 2, value: -0.5 });
    assert!(matches!(new(&good, &points, Some(&Array1::ones(4)), 0.0), Error::Shape { what: "weights", .. }));
    assert_eq!(new(&good, &points, None, -1.0), Error::Lambda { value: -1.0 });

    let knots = KnotVector::uniform(1, 2).unwrap();
    let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap());
    for bad in [1.5, -1e-9, f64::NAN] {
        let mut parameters = good.clone();
        parameters[[4, 1]] = bad;
        let mut method = LeastSquares::new(parameters.view(), points.view(), None, fixed(1.0)).unwrap();
        match method.fit(&space) {
            Err(Error::Parameter { index: 4, source: thb_core::Error::OutsideDomain { direction: 1, .. } }) => {}
            other => panic!("{bad}: {other:?}"),
        }
    }
}
