//! The theorems about HB- and THB-splines, over a grid of degrees, levels and random refinements.

use std::sync::Arc;

use ndarray::Array2;
use proptest::prelude::*;
use thb_core::{
    CellSpace, Error, Extraction, HierarchicalSpace, Kind, KnotVector, Quadrature, Refinement, SplineMap,
    SymmetricPattern, ThinPlate, transfer,
};

use crate::common::random_map;

/// A space refined at random places: `choices` picks one leaf cell a round.
fn refined<const D: usize>(kind: Kind, degree: usize, elements: usize, choices: &[u16]) -> HierarchicalSpace<D> {
    let knots = KnotVector::uniform(degree, elements).unwrap();
    let mut space = HierarchicalSpace::new(kind, std::array::from_fn(|_| knots.clone())).unwrap();
    for (round, &choice) in choices.iter().enumerate() {
        let cell = usize::from(choice) % space.n_cells();
        let extension = [[0, 2, 3, 4][round % 4]; D];
        space = space.refine(&[cell], &Refinement { extension, max_levels: 6, ..Refinement::default() }).unwrap();
    }
    space.check_invariants().unwrap();
    space
}

/// Parameters inside cells, on their edges and at the ends of the domain.
fn sites() -> Vec<f64> {
    let mut sites: Vec<f64> = (0..=16).map(|i| f64::from(i) / 16.0).collect();
    sites.extend([0.013, 0.3, 0.501, 0.77, 0.999]);
    sites
}

fn value_of(space: &HierarchicalSpace<2>, function: usize, u: [f64; 2]) -> f64 {
    let mut coefficients = Array2::zeros((space.n_functions(), 1));
    coefficients[[function, 0]] = 1.0;
    SplineMap::new(Arc::new(space.clone()), coefficients).unwrap().eval(u).unwrap()[0]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn thb_functions_are_non_negative_and_sum_to_one(degree in 1_usize..=5, elements in 1_usize..=4,
                                                    choices in prop::collection::vec(any::<u16>(), 0..5)) {
        let space = refined::<2>(Kind::Thb, degree, elements, &choices);
        let ones = SplineMap::new(Arc::new(space.clone()), Array2::ones((space.n_functions(), 1))).unwrap();
        for u in sites() {
            for v in sites() {
                let sum = ones.eval([u, v]).unwrap()[0];
                prop_assert!((sum - 1.0).abs() < 1e-13, "sum {sum} at ({u}, {v})");
            }
        }
        for function in (0..space.n_functions()).step_by(7) {
            for u in sites() {
                prop_assert!(value_of(&space, function, [u, 0.4]) >= 0.0);
            }
        }
    }

    #[test]
    fn functions_are_linearly_independent_and_span_the_same_space(degree in 1_usize..=4,
                                                    choices in prop::collection::vec(any::<u16>(), 0..4)) {
        // The mass matrix is positive definite if and only if the functions are linearly independent.
        let thb = refined::<1>(Kind::Thb, degree, 3, &choices);
        let hb = refined::<1>(Kind::Hb, degree, 3, &choices);
        prop_assert_eq!(thb.functions_per_level(), hb.functions_per_level());
        for space in [&thb, &hb] {
            prop_assert!(smallest_pivot(space) > 1e-9);
        }
        // Each THB-spline map is an HB-spline map: the mass matrix of both bases together has no larger rank.
        prop_assert!(joint_rank(&thb, &hb) == thb.n_functions());
    }

    #[test]
    fn polynomials_up_to_the_degree_are_reproduced(degree in 1_usize..=5, elements in 1_usize..=3,
                                                   choices in prop::collection::vec(any::<u16>(), 0..5)) {
        // Level 0 B-splines reproduce them with coefficients given by blossoms; transfer must keep them.
        let coarse = refined::<2>(Kind::Thb, degree, elements, &[]);
        let knots = coarse.knots(0, 0).unwrap().clone();
        let n = knots.n_functions();
        // u^p has the coefficients ∏ t_{j+1..j+p}, v has the Greville abscissae.
        let power: Vec<f64> = (0..n).map(|j| knots.knots()[j + 1..=j + degree].iter().product()).collect();
        let greville = knots.greville();
        let coefficients = Array2::from_shape_fn((n * n, 2), |(k, c)| if c == 0 { power[k % n] } else { greville[k / n] });
        let map = SplineMap::new(Arc::new(coarse), coefficients).unwrap();
        let finer = refined::<2>(Kind::Thb, degree, elements, &choices);
        let moved = transfer(&map, &finer).unwrap();
        let moved = SplineMap::new(Arc::new(finer), moved).unwrap();
        for u in sites() {
            for v in sites() {
                let point = moved.eval([u, v]).unwrap();
                prop_assert!((point[0] - u.powi(degree as i32)).abs() < 1e-11);
                prop_assert!((point[1] - v).abs() < 1e-11);
            }
        }
    }

    #[test]
    fn transfer_is_exact(hb in any::<bool>(), degree in 1_usize..=5, elements in 1_usize..=3,
                         first in prop::collection::vec(any::<u16>(), 0..3),
                         then in prop::collection::vec(any::<u16>(), 1..3), seed in any::<u64>()) {
        let kind = if hb { Kind::Hb } else { Kind::Thb };
        let map = random_map(refined::<2>(kind, degree, elements, &first), seed);
        let mut finer = map.space().as_ref().clone();
        for choice in then {
            let cell = usize::from(choice) % finer.n_cells();
            finer = finer.refine(&[cell], &Refinement { extension: [2, 1], max_levels: 6, ..Refinement::default() }).unwrap();
        }
        let moved = SplineMap::new(Arc::new(finer.clone()), transfer(&map, &finer).unwrap()).unwrap();
        for u in sites() {
            for v in sites() {
                let (a, b) = (map.eval([u, v]).unwrap(), moved.eval([u, v]).unwrap());
                prop_assert!((a[0] - b[0]).abs() < 1e-12 && (a[1] - b[1]).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn coefficients_of_b_splines_are_preserved(degree in 1_usize..=4, choices in prop::collection::vec(any::<u16>(), 1..4),
                                               seed in any::<u64>()) {
        // On a cell of level ℓ, a THB function of level ℓ carries the tensor-product coefficient of its mother B-spline.
        let map = random_map(refined::<2>(Kind::Thb, degree, 3, &choices), seed);
        let flat = map.tensor_product().unwrap();
        for u in sites() {
            for v in sites() {
                let (a, b) = (map.eval([u, v]).unwrap(), flat.eval([u, v]).unwrap());
                prop_assert!((a[0] - b[0]).abs() < 1e-11, "{} {}", a[0], b[0]);
            }
        }
        let mut local = Vec::new();
        let flat_rows: Vec<f64> = map.coefficients().iter().copied().collect();
        for number in 0..map.space().n_cells() {
            let cell = map.space().cell(number);
            cell.local_coefficients(&flat_rows, 2, &mut local);
            if let Extraction::Matrix(matrix) = cell.extraction {
                for (i, row) in matrix.chunks_exact(cell.n_local()).enumerate() {
                    if let Some(j) = row.iter().position(|&w| w == 1.0).filter(|_| row.iter().sum::<f64>() == 1.0) {
                        let own = map.coefficients()[[cell.functions[i] as usize, 0]];
                        let column_is_own = matrix.iter().skip(j).step_by(cell.n_local()).filter(|&&w| w != 0.0).count() == 1;
                        if column_is_own {
                            prop_assert!((local[2 * j] - own).abs() < 1e-13);
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn derivatives_agree_with_differences(degree in 2_usize..=5, choices in prop::collection::vec(any::<u16>(), 0..4),
                                          seed in any::<u64>()) {
        let map = random_map(refined::<2>(Kind::Thb, degree, 2, &choices), seed);
        let h = 1e-6;
        for u in [0.2031, 0.517, 0.8803] {
            for v in [0.1103, 0.6207] {
                let at = |du: f64, dv: f64, order| map.derivative([u + du, v + dv], order).unwrap()[0];
                let scale = map.derivative([u, v], [1, 1]).unwrap()[0].abs().max(10.0);
                let close = |exact: f64, difference: f64, size: f64| (exact - difference).abs() < 1e-5 * size;
                prop_assert!(close(at(0.0, 0.0, [1, 0]), (at(h, 0.0, [0, 0]) - at(-h, 0.0, [0, 0])) / (2.0 * h), scale));
                prop_assert!(close(at(0.0, 0.0, [0, 1]), (at(0.0, h, [0, 0]) - at(0.0, -h, [0, 0])) / (2.0 * h), scale));
                let second = at(0.0, 0.0, [1, 1]);
                prop_assert!(close(second, (at(h, 0.0, [0, 1]) - at(-h, 0.0, [0, 1])) / (2.0 * h), 100.0 * scale));
            }
        }
    }

    #[test]
    fn a_jet_holds_all_derivatives(degree in 1_usize..=5, choices in prop::collection::vec(any::<u16>(), 0..4), seed in any::<u64>(),
                                   u in 0.0..1.0, v in 0.0..1.0) {
        let map = random_map(refined::<2>(Kind::Thb, degree, 2, &choices), seed);
        let cell = map.space().locate_cell([u, v]).unwrap();
        let jet = map.bezier().jet(cell, [u, v]);
        let of = |order: [usize; 2]| map.derivative([u, v], order).unwrap();
        let [[uu, uv], [vu, vv]] = jet.second;
        for (found, order) in [(jet.value, [0, 0]), (jet.first[0], [1, 0]), (jet.first[1], [0, 1]), (uu, [2, 0]), (uv, [1, 1]),
                               (vu, [1, 1]), (vv, [0, 2])] {
            let expected = of(order);
            for (k, found) in found.iter().enumerate() {
                let expected = expected.get(k).copied().unwrap_or(0.0);
                prop_assert!((found - expected).abs() <= 1e-11 * (1.0 + expected.abs()), "{order:?}: {found} {expected}");
            }
        }
    }

    #[test]
    fn admissible_meshes_keep_few_levels_on_a_cell(hb in any::<bool>(), class in 2_usize..=3, degree in 1_usize..=3,
                                                   choices in prop::collection::vec(any::<u16>(), 1..8)) {
        let kind = if hb { Kind::Hb } else { Kind::Thb };
        let mut space = refined::<2>(kind, degree, 4, &[]);
        for choice in choices {
            // Always refine within the finest level, where admissibility is in danger.
            let finest: Vec<_> = (0..space.n_cells())
                .filter(|&c| space.mesh().level(space.node(c)) + 1 == space.n_levels()).collect();
            let cell = finest[usize::from(choice) % finest.len()];
            let refinement = Refinement { admissible: Some(class), max_levels: 6, ..Refinement::default() };
            space = space.refine(&[cell], &refinement).unwrap();
        }
        space.check_invariants().unwrap();
        let starts: Vec<usize> = (0..=space.n_levels()).map(|l| space.first_of_level(l)).collect();
        let level_of = |f: u32| starts.partition_point(|&s| s <= f as usize) - 1;
        for number in 0..space.n_cells() {
            let functions = space.cell(number).functions;
            let (coarsest, finest) = (level_of(functions[0]), level_of(functions[functions.len() - 1]));
            prop_assert!(finest - coarsest < class, "levels {coarsest} to {finest} meet on cell {number}");
        }
    }

    #[test]
    fn the_energy_is_that_of_the_polynomial(degree in 2_usize..=5, choices in prop::collection::vec(any::<u16>(), 0..4)) {
        // s = u² v has s_uu = 2v, s_uv = 2u, s_vv = 0: J = ∫ 4v² + 2·4u² = 4/3 + 8/3 = 4.
        let coarse = refined::<2>(Kind::Thb, degree, 2, &[]);
        let knots = coarse.knots(0, 0).unwrap().clone();
        let n = knots.n_functions();
        let square: Vec<f64> = (0..n).map(|j| symmetric_mean(&knots.knots()[j + 1..=j + degree])).collect();
        let greville = knots.greville();
        let map = Array2::from_shape_fn((n * n, 1), |(k, _)| square[k % n] * greville[k / n]);
        let map = SplineMap::new(Arc::new(coarse), map).unwrap();
        let finer = refined::<2>(Kind::Thb, degree, 2, &choices);
        let c: Vec<f64> = transfer(&map, &finer).unwrap().iter().copied().collect();
        let gram = ThinPlate::new([degree; 2], Quadrature::Exact).gram(&finer, &SymmetricPattern::new(&finer)).unwrap();
        let energy: f64 = gram.multiply(&c).iter().zip(&c).map(|(a, b)| a * b).sum();
        prop_assert!((energy - 4.0).abs() < 1e-9, "{energy}");
    }
}

/// Mean of the products of pairs: the blossom of u².
fn symmetric_mean(knots: &[f64]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for i in 0..knots.len() {
        for j in 0..i {
            sum += knots[i] * knots[j];
            count += 1.0;
        }
    }
    sum / count
}

/// Values of all functions at enough sites to determine them.
fn sampled(space: &HierarchicalSpace<1>) -> Vec<Vec<f64>> {
    (0..space.n_functions())
        .map(|f| {
            let mut c = Array2::zeros((space.n_functions(), 1));
            c[[f, 0]] = 1.0;
            let map = SplineMap::new(Arc::new(space.clone()), c).unwrap();
            (0..600).map(|i| map.eval([f64::from(i) / 599.0]).unwrap()[0]).collect()
        })
        .collect()
}

/// Rank by Gram–Schmidt with the largest remaining vector first; returns rank and the smallest accepted norm.
fn rank(mut vectors: Vec<Vec<f64>>) -> (usize, f64) {
    let norm = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let (mut rank, mut smallest) = (0, f64::INFINITY);
    while let Some(best) = (0..vectors.len()).max_by(|&a, &b| norm(&vectors[a]).total_cmp(&norm(&vectors[b]))) {
        let q = vectors.swap_remove(best);
        let length = norm(&q);
        if length < 1e-8 {
            break;
        }
        (rank, smallest) = (rank + 1, smallest.min(length));
        for v in &mut vectors {
            let share = v.iter().zip(&q).map(|(a, b)| a * b).sum::<f64>() / (length * length);
            v.iter_mut().zip(&q).for_each(|(a, b)| *a -= share * b);
        }
    }
    (rank, smallest)
}

fn smallest_pivot(space: &HierarchicalSpace<1>) -> f64 {
    let (rank, smallest) = rank(sampled(space));
    if rank == space.n_functions() { smallest } else { 0.0 }
}

fn joint_rank(a: &HierarchicalSpace<1>, b: &HierarchicalSpace<1>) -> usize {
    rank(sampled(a).into_iter().chain(sampled(b)).collect()).0
}

#[test]
fn derivatives_of_univariate_b_splines_agree_with_the_cell_polynomials() {
    for degree in 1..=8 {
        let mut inner = vec![0.0; degree + 1];
        inner.extend([0.1, 0.35, 0.35, 0.6]);
        inner.extend(vec![1.0; degree + 1]);
        let knots = KnotVector::new(degree, inner);
        if degree == 1 {
            // A double knot is allowed at degree 1 (it makes the functions discontinuous), three times is not.
            assert!(knots.is_ok());
        }
        let knots = knots.unwrap();
        let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone()]).unwrap());
        for order in 0..=2 {
            for u in [0.0, 0.05, 0.2, 0.35, 0.5, 0.8, 1.0] {
                let (first, rows) = knots.basis_derivatives(u, order).unwrap();
                for (i, &expected) in rows[order].iter().enumerate() {
                    let mut c = Array2::zeros((knots.n_functions(), 1));
                    c[[first + i, 0]] = 1.0;
                    let value = SplineMap::new(space.clone(), c).unwrap().derivative([u], [order]).unwrap()[0];
                    assert!((value - expected).abs() < 1e-11 * expected.abs().max(1.0), "{degree} {order} {u}");
                }
            }
        }
    }
}

#[test]
fn knot_insertion_keeps_the_curve() {
    let knots = KnotVector::uniform(3, 4).unwrap();
    let c = Array2::from_shape_fn((7, 2), |(i, k)| ((i * 3 + k * 5) % 7) as f64);
    let (finer, moved) = knots.insert(&[0.1, 0.5, 0.5, 0.9], c.view()).unwrap();
    let at = |knots: &KnotVector, c: &Array2<f64>, u: f64| {
        let (first, values) = knots.basis(u).unwrap();
        values.iter().enumerate().map(|(i, b)| b * c[[first + i, 1]]).sum::<f64>()
    };
    for u in sites() {
        assert!((at(&knots, &c, u) - at(&finer, &moved, u)).abs() < 1e-13);
    }
}

#[test]
fn bad_knots_and_parameters_are_typed_errors() {
    assert!(matches!(KnotVector::uniform(9, 1), Err(Error::Degree { given: 9, limit: 8 })));
    assert!(matches!(KnotVector::uniform(2, 0), Err(Error::Elements { given: 0, .. })));
    assert!(matches!(KnotVector::new(1, vec![0.0, 0.0, 1.0, 0.5, 1.0]), Err(Error::KnotOrder { index: 3, .. })));
    assert!(matches!(KnotVector::new(1, vec![0.0, 0.5, 1.0, 1.0]), Err(Error::Multiplicity { given: 1, .. })));
    assert!(matches!(KnotVector::new(1, vec![0.0; 4]), Err(Error::Multiplicity { .. })));
    assert!(matches!(
        KnotVector::new(2, vec![0.0, f64::NAN, 1.0, 1.0, 1.0, 1.0]),
        Err(Error::KnotOrder { index: 1, .. })
    ));
    let space = refined::<2>(Kind::Thb, 2, 2, &[1]);
    for u in [-1e-9, 1.0 + 1e-9, f64::NAN] {
        assert!(matches!(space.locate_cell([0.5, u]), Err(Error::OutsideDomain { direction: 1, .. })));
    }
    let even = KnotVector::uniform(1, 1).unwrap();
    let many = (0..=70_000).map(f64::from);
    let many = [0.0].into_iter().chain(many).chain([70_000.0]).collect();
    assert!(matches!(KnotVector::new(1, many), Err(Error::Elements { given: 70_000, .. })));
    for (inner, upper) in [(f64::MIN_POSITIVE, 1.0), (1e-19, 1.0), (1.0, 1e20), (1e-151, 2e-151)] {
        let short = KnotVector::new(1, vec![0.0, 0.0, inner, upper, upper]);
        assert!(matches!(short, Err(Error::KnotSpan { .. })), "{inner:e} of {upper:e}: {short:?}");
    }
    assert!(KnotVector::new(1, vec![0.0, 0.0, 1e-18, 1.0, 1.0]).is_ok());
    for end in [1e101, f64::MAX] {
        let large = KnotVector::new(1, vec![-end, -end, end, end]);
        assert!(matches!(large, Err(Error::KnotRange { .. })), "{end:e}: {large:?}");
    }
    // No number lies between the inner knots.
    let narrow = KnotVector::new(1, vec![0.0, 0.0, 0.3, 0.3_f64.next_up(), 1.0, 1.0]).unwrap();
    let space = HierarchicalSpace::new(Kind::Thb, [even, narrow]).unwrap();
    let refined = space.refine(&[0], &Refinement::default());
    assert!(matches!(refined, Err(Error::SpanTooNarrow { direction: 1, level: 1 })), "{refined:?}");
}

#[test]
fn three_directions_work_too() {
    let space = refined::<3>(Kind::Thb, 2, 2, &[3, 40]);
    let ones = SplineMap::new(Arc::new(space.clone()), Array2::ones((space.n_functions(), 1))).unwrap();
    assert!((ones.eval([0.2, 0.9, 0.4]).unwrap()[0] - 1.0).abs() < 1e-13);
}
