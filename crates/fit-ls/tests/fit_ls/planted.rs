//! Planted truths: points of known maps, whose coefficients must come back.

use std::sync::Arc;

use crate::common::{Random, largest_difference, random_map, refined, scattered, solve_dense};
use fit_ls::{Lambda, LeastSquares, NormalEquations, Options, SortedPoints};
use ndarray::{Array1, Array2};
use proptest::prelude::*;
use thb_core::{
    CellSpace, HierarchicalSpace, Kind, KnotVector, Quadrature, Refinement, SplineMap, SymmetricMatrix,
    SymmetricPattern, TensorSpace, ThinPlate,
};

/// Round-off that solving normal equations may leave in coefficients in [0, 1): some thirty times what is observed. The
/// condition number grows by about ten per degree; HB-splines of several levels overlap, which costs a further factor.
fn round_off(kind: Kind, degree: usize) -> f64 {
    let overlap = if kind == Kind::Hb { 10.0 } else { 1.0 };
    1e-12 * overlap * 10.0_f64.powi(degree as i32 - 2)
}

fn unsmoothed<const D: usize>() -> Options<D> {
    Options { lambda: Lambda::Fixed(0.0), ..Options::default() }
}

/// Samples a random map at scattered parameters and fits.
fn comes_back<const D: usize>(kind: Kind, degree: usize, n: usize, weighted: bool) {
    let space = refined::<D>(kind, degree, 4);
    let mut random = Random::new(7 + degree as u64);
    let map = random_map(&space, n, &mut random);
    let parameters = scattered(&space, 4 * (degree + 1).pow(D as u32), &mut random);
    let points = map.eval_batch(parameters.view()).unwrap();
    let weights = weighted.then(|| Array1::from_shape_simple_fn(points.nrows(), || 0.01 + 10.0 * random.next()));
    let weights = weights.as_ref().map(|w| w.view());
    let mut method = LeastSquares::new(parameters.view(), points.view(), weights, unsmoothed()).unwrap();
    let fitted = method.fit(&space).unwrap();
    let error = largest_difference(&fitted.coefficients().to_owned(), &map.coefficients().to_owned());
    let bound = round_off(kind, degree);
    assert!(error < bound, "{kind:?}, D = {D}, degree {degree}, N = {n}, weighted {weighted}: {error:e} ≥ {bound:e}");
    let distances = method.distances(&fitted).unwrap();
    assert!(distances.iter().all(|&d| d < 1e-12));
}

#[test]
fn surfaces_come_back() {
    for degree in 1..=4 {
        comes_back::<2>(Kind::Thb, degree, 3, false);
    }
    comes_back::<2>(Kind::Thb, 2, 1, false);
    comes_back::<2>(Kind::Thb, 3, 2, true);
    comes_back::<2>(Kind::Hb, 2, 3, false);
    comes_back::<2>(Kind::Hb, 3, 1, true);
}

#[test]
fn curves_come_back() {
    for degree in 1..=6 {
        comes_back::<1>(Kind::Thb, degree, 2, false);
    }
    comes_back::<1>(Kind::Thb, 3, 1, true);
    comes_back::<1>(Kind::Thb, 3, 3, false);
    comes_back::<1>(Kind::Hb, 3, 3, true);
}

#[test]
fn spaces_in_between_do_not_matter() {
    // The points are re-sorted from space to space; the last fit must not depend on the way there.
    let last = refined::<2>(Kind::Thb, 2, 4);
    let mut random = Random::new(3);
    let mut rows: Vec<[f64; 2]> = scattered(&last, 40, &mut random).outer_iter().map(|u| [u[0], u[1]]).collect();
    rows.sort_by_key(|u| u.map(|x| (x * 1e9) as u64 % 1009));
    let parameters = Array2::from(rows);
    let points = random.array(parameters.nrows(), 3);
    let fit_after = |before: &[&Arc<HierarchicalSpace<2>>]| {
        let mut method = LeastSquares::new(parameters.view(), points.view(), None, unsmoothed()).unwrap();
        before.iter().for_each(|space| {
            method.fit(space).unwrap();
        });
        method.fit(&last).unwrap().coefficients().to_owned()
    };
    let straight = fit_after(&[]);
    let cells = last.mesh().grid(0)[0];
    let knots = KnotVector::uniform(2, cells).unwrap();
    let first = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap());
    let corner = first.locate_cell([0.2, 0.3]).unwrap();
    let refinement = Refinement { extension: [2; 2], ..Refinement::default() };
    let second = Arc::new(first.refine(&[corner], &refinement).unwrap());
    // To the last bit on the way of refinement, to round-off after a space of other cells.
    assert!(fit_after(&[&first, &second]) == straight);
    assert!(fit_after(&[&second]) == straight);
    assert!(largest_difference(&fit_after(&[&refined::<2>(Kind::Thb, 2, 3)]), &straight) < 1e-10);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 16, ..ProptestConfig::default() })]

    #[test]
    fn linear_maps_are_reproduced_for_any_smoothing(exponent in -9_i32..=6, degree in 1_usize..=4, hb in any::<bool>(),
                                                    exact in any::<bool>(), slope in prop::array::uniform3(-5.0..5.0_f64)) {
        // The energy of a linear map is zero, so smoothing cannot move it. HB-splines span the same maps.
        let space = refined::<2>(if hb { Kind::Hb } else { Kind::Thb }, degree, 3);
        let mut random = Random::new(11);
        let parameters = scattered(&space, 8, &mut random);
        let value = |i: usize| slope[0] + slope[1] * parameters[[i, 0]] + slope[2] * parameters[[i, 1]];
        let points = Array2::from_shape_fn((parameters.nrows(), 1), |(i, _)| value(i));
        let quadrature = if exact { Quadrature::Exact } else { Quadrature::GaussP };
        let options = Options { lambda: Lambda::Fixed(10.0_f64.powi(exponent)), quadrature, ..Options::default() };
        let mut method = LeastSquares::new(parameters.view(), points.view(), None, options).unwrap();
        let map = method.fit(&space).unwrap();
        // A large weight drowns the data: what is left of their digits.
        let bound = 1e-10 * 10.0_f64.powi(exponent.max(0));
        let worst = method.distances(&map).unwrap().iter().copied().fold(0.0, f64::max);
        prop_assert!(worst < bound, "{worst:e} ≥ {bound:e}");
    }
}

/// Values of all functions at parameters, `(m, n_functions)`, one function after the other.
fn collocation(space: &Arc<HierarchicalSpace<2>>, parameters: &Array2<f64>) -> Array2<f64> {
    let mut matrix = Array2::zeros((parameters.nrows(), space.n_functions()));
    for j in 0..space.n_functions() {
        let mut coefficients = Array2::zeros((space.n_functions(), 1));
        coefficients[[j, 0]] = 1.0;
        let function = SplineMap::new(space.clone(), coefficients).unwrap();
        matrix.column_mut(j).assign(&function.eval_batch(parameters.view()).unwrap().column(0));
    }
    matrix
}

fn dense(matrix: &SymmetricMatrix) -> Array2<f64> {
    let n = matrix.pattern().n();
    let columns: Vec<Vec<f64>> = (0..n)
        .map(|j| {
            let mut unit = vec![0.0; n];
            unit[j] = 1.0;
            matrix.multiply(&unit)
        })
        .collect();
    Array2::from_shape_fn((n, n), |(i, j)| columns[j][i])
}

#[test]
fn fits_agree_with_a_dense_reference() {
    for kind in [Kind::Thb, Kind::Hb] {
        for (degree, lambda) in [(2, 0.0), (2, 1e-4), (3, 1e-6)] {
            let space = refined::<2>(kind, degree, 2);
            let mut random = Random::new(23);
            let parameters = scattered(&space, 20, &mut random);
            let points = random.array(parameters.nrows(), 2);
            let weights = Array1::from_shape_simple_fn(points.nrows(), || 0.5 + random.next());

            let basis = collocation(&space, &parameters);
            let weighted = Array2::from_shape_fn(basis.dim(), |(i, j)| weights[i] * basis[[i, j]]);
            let pattern = SymmetricPattern::new(space.as_ref());
            let energy = ThinPlate::new(space.degree(), Quadrature::Exact).gram(space.as_ref(), &pattern).unwrap();
            let matrix = weighted.t().dot(&basis) + dense(&energy) * lambda;
            let expected = solve_dense(matrix, weighted.t().dot(&points));

            let options = Options { lambda: Lambda::Fixed(lambda), ..Options::default() };
            let mut method =
                LeastSquares::new(parameters.view(), points.view(), Some(weights.view()), options).unwrap();
            let found = method.fit(&space).unwrap();
            let error = largest_difference(&found.coefficients().to_owned(), &expected);
            let largest = expected.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
            assert!(error < 1e-11 * largest, "{kind:?}, degree {degree}, λ = {lambda:e}: {error:e} of {largest}");
        }
    }
}

#[test]
fn normal_equations_are_those_of_the_collocation_matrix() {
    let space = refined::<2>(Kind::Thb, 3, 2);
    let mut random = Random::new(5);
    let parameters = scattered(&space, 9, &mut random);
    let points = random.array(parameters.nrows(), 3);
    let mut sorted = SortedPoints::new(parameters.view(), points.view(), None).unwrap();
    sorted.sort_refined(&space, None).unwrap();
    let pattern = SymmetricPattern::new(space.as_ref());
    let equations = NormalEquations::new(space.as_ref(), &pattern, &sorted).unwrap();
    let basis = collocation(&space, &parameters);
    let scale = parameters.nrows() as f64;
    assert!(largest_difference(&dense(&equations.matrix), &basis.t().dot(&basis)) < 1e-14 * scale);
    assert!(largest_difference(&equations.right, &basis.t().dot(&points)) < 1e-14 * scale);
}

#[test]
fn tensor_and_bernstein_spaces_are_fitted_through_their_normal_equations() {
    let knots = [KnotVector::uniform(3, 5).unwrap(), KnotVector::uniform(2, 4).unwrap()];
    for space in [TensorSpace::new(knots).unwrap(), TensorSpace::bernstein([4, 3]).unwrap()] {
        let mut random = Random::new(31);
        let expected = random.array(space.n_functions(), 3);
        let parameters = random.array(1500, 2);
        let space = Arc::new(space);
        let map = SplineMap::new(space.clone(), expected.clone()).unwrap();
        let points = map.eval_batch(parameters.view()).unwrap();
        let mut sorted = SortedPoints::new(parameters.view(), points.view(), None).unwrap();
        sorted.sort(space.as_ref(), |_| None).unwrap();
        let pattern = SymmetricPattern::new(space.as_ref());
        let equations = NormalEquations::new(space.as_ref(), &pattern, &sorted).unwrap();
        let mut solver = fit_ls::Cholesky::new(&pattern).unwrap();
        solver.factorize(&equations.matrix).unwrap();
        let found = solver.solve(&equations.right).unwrap();
        let error = largest_difference(&found, &expected);
        assert!(error < 1e-11, "{} functions: {error:e}", space.n_functions());
    }
}
