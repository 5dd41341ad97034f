//! Periodic directions: the theorems about splines that close on themselves, over degrees, levels and random refinements.

use std::f64::consts::TAU;
use std::sync::Arc;

use ndarray::Array2;
use proptest::prelude::*;
use thb_core::{
    CellSpace, Error, HierarchicalSpace, Kind, KnotVector, ParameterBox, Quadrature, Refinement, SplineMap,
    SymmetricPattern, TensorSpace, ThinPlate, transfer,
};

use crate::common::random_map;

fn knots(degree: usize, elements: usize, periodic: bool) -> KnotVector {
    let of = if periodic { KnotVector::uniform_periodic } else { KnotVector::uniform };
    of(degree, elements).unwrap()
}

/// A space refined at random places, of which every second lies at a seam.
fn refined<const D: usize>(kind: Kind, knots: [KnotVector; D], choices: &[u16]) -> HierarchicalSpace<D> {
    let mut space = HierarchicalSpace::new(kind, knots).unwrap();
    for (round, &choice) in choices.iter().enumerate() {
        let cell = match round % 2 {
            0 => usize::from(choice) % space.n_cells(),
            _ => space.locate_cell([if choice % 2 == 0 { 0.0 } else { 1.0 }; D]).unwrap(),
        };
        let extension = [[2, 0, 3, 4][round % 4]; D];
        space = space.refine(&[cell], &Refinement { extension, max_levels: 5, ..Refinement::default() }).unwrap();
    }
    space.check_invariants().unwrap();
    space
}

fn sites() -> Vec<f64> {
    let mut sites: Vec<f64> = (0..=12).map(|i| f64::from(i) / 12.0).collect();
    sites.extend([0.013, 0.3, 0.501, 0.77, 0.999]);
    sites
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn functions_are_a_partition_of_unity(degree in 1_usize..=5, more in 0_usize..3, both in any::<bool>(),
                                          choices in prop::collection::vec(any::<u16>(), 0..5)) {
        let n = degree + 1 + more;
        let space = refined::<2>(Kind::Thb, [knots(degree, n, true), knots(degree, n, both)], &choices);
        prop_assert_eq!(space.periodic(), [true, both]);
        let ones = SplineMap::new(Arc::new(space.clone()), Array2::ones((space.n_functions(), 1))).unwrap();
        for u in sites() {
            for v in sites() {
                let sum = ones.eval([u, v]).unwrap()[0];
                prop_assert!((sum - 1.0).abs() < 1e-13, "sum {sum} at ({u}, {v})");
            }
        }
    }

    #[test]
    fn maps_are_smooth_across_the_seam(hb in any::<bool>(), degree in 1_usize..=5, more in 0_usize..3,
                                       both in any::<bool>(), seed in any::<u64>(),
                                       choices in prop::collection::vec(any::<u16>(), 0..5)) {
        let (kind, n) = (if hb { Kind::Hb } else { Kind::Thb }, degree + 1 + more);
        let map = random_map(refined(kind, [knots(degree, n, true), knots(degree, n, both)], &choices), seed);
        let finest = (n << (map.space().n_levels() - 1)) as f64;
        for t in sites() {
            for order in 0..degree {
                // A derivative of order k grows as the k-th power of the number of elements.
                let tolerance = 1e-12 * finest.powi(order as i32);
                let close = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < tolerance);
                let at = |u: f64| map.derivative([u, t], [order, 0]).unwrap();
                prop_assert!(close(&at(0.0), &at(1.0)), "order {order} at v = {t}: {:?} {:?}", at(0.0), at(1.0));
                if both {
                    let at = |v: f64| map.derivative([t, v], [0, order]).unwrap();
                    prop_assert!(close(&at(0.0), &at(1.0)), "order {order} at u = {t}");
                }
            }
        }
    }

    #[test]
    fn the_dimension_is_that_of_the_smooth_piecewise_polynomials(degree in 1_usize..=4, more in 0_usize..4,
                                                    choices in prop::collection::vec(any::<u16>(), 0..4)) {
        // On a circle a simple knot costs all coefficients of its span but for one. Refined regions must be as wide as a
        // function of the next level.
        let mut thb = refined::<1>(Kind::Thb, [knots(degree, degree + 1 + more, true)], &[]);
        for choice in choices {
            let cell = usize::from(choice) % thb.n_cells();
            let refinement = Refinement { extension: [degree], max_levels: 4, ..Refinement::default() };
            thb = thb.refine(&[cell], &refinement).unwrap();
        }
        prop_assert_eq!(thb.n_functions(), thb.n_cells());
        // Linearly independent: the mass matrix of the functions is positive definite.
        prop_assert!(smallest_pivot(&thb) > 1e-9);
    }

    #[test]
    fn transfer_is_exact(hb in any::<bool>(), degree in 1_usize..=4, more in 0_usize..3, both in any::<bool>(),
                         first in prop::collection::vec(any::<u16>(), 0..3),
                         then in prop::collection::vec(any::<u16>(), 1..3), seed in any::<u64>()) {
        let (kind, n) = (if hb { Kind::Hb } else { Kind::Thb }, degree + 1 + more);
        let map = random_map(refined::<2>(kind, [knots(degree, n, true), knots(degree, n, both)], &first), seed);
        let mut finer = map.space().as_ref().clone();
        for choice in then {
            let cell = usize::from(choice) % finer.n_cells();
            finer = finer.refine(&[cell], &Refinement { extension: [2, 1], max_levels: 6, ..Refinement::default() }).unwrap();
        }
        // Opened knots hold the same maps, cut at the seams.
        for target in [finer.clone(), map.space().opened().unwrap(), finer.opened().unwrap()] {
            target.check_invariants().unwrap();
            let moved = SplineMap::new(Arc::new(target.clone()), transfer(&map, &target).unwrap()).unwrap();
            for u in sites() {
                for v in sites() {
                    let (a, b) = (map.eval([u, v]).unwrap(), moved.eval([u, v]).unwrap());
                    prop_assert!((a[0] - b[0]).abs() < 1e-12 && (a[1] - b[1]).abs() < 1e-12);
                }
            }
        }
        let flat = map.tensor_product().unwrap();
        for u in sites() {
            let (a, b) = (map.eval([u, 0.4]).unwrap(), flat.eval([u, 0.4]).unwrap());
            prop_assert!((a[0] - b[0]).abs() < 1e-11);
        }
    }

    #[test]
    fn refinement_does_not_see_the_seam(degree in 1_usize..=3, shift in 0_usize..12, class in 2_usize..=3,
                                        choices in prop::collection::vec(0_usize..12, 1..4)) {
        // Marks turned by some elements give the mesh turned by as many.
        let n = 12;
        let refine = |turn: usize| {
            let mut space = HierarchicalSpace::new(Kind::Thb, [knots(degree, n, true), knots(degree, 4, false)]).unwrap();
            for (round, choice) in choices.iter().enumerate() {
                let u = ((choice + turn) % n) as f64 / n as f64 + 1e-3;
                let cell = space.locate_cell([u, 0.3]).unwrap();
                let refinement = Refinement { extension: [round, 1], admissible: Some(class), max_levels: 5 };
                space = space.refine(&[cell], &refinement).unwrap();
            }
            space.check_invariants().unwrap();
            space
        };
        let (plain, turned) = (refine(0), refine(shift));
        prop_assert_eq!(plain.functions_per_level(), turned.functions_per_level());
        for node in plain.mesh().nodes() {
            let (level, mut index) = (plain.mesh().level(node), plain.mesh().cell_index(node));
            index[0] = (index[0] + ((shift as u32) << level)) % ((n as u32) << level);
            let image = turned.mesh().find(level, index);
            prop_assert!(image.is_some_and(|image| turned.mesh().is_leaf(image) == plain.mesh().is_leaf(node)));
        }
    }

    #[test]
    fn turned_coefficients_give_the_turned_map(degree in 1_usize..=5, more in 0_usize..4, turn in 0_usize..8, seed in any::<u64>()) {
        let n = degree + 1 + more;
        let map = random_map(refined::<1>(Kind::Thb, [knots(degree, n, true)], &[]), seed);
        let turned = Array2::from_shape_fn((n, 2), |(i, k)| map.coefficients()[[(i + turn) % n, k]]);
        let turned = SplineMap::new(map.space().clone(), turned).unwrap();
        for u in sites() {
            let before = (u + turn as f64 / n as f64).rem_euclid(1.0);
            let (a, b) = (map.eval([before]).unwrap(), turned.eval([u]).unwrap());
            prop_assert!((a[0] - b[0]).abs() < 1e-12 && (a[1] - b[1]).abs() < 1e-12);
        }
    }

    #[test]
    fn the_energy_does_not_see_the_seam(degree in 2_usize..=4, turn in 1_usize..8, seed in any::<u64>()) {
        let n = 8;
        let map = random_map(refined::<1>(Kind::Thb, [knots(degree, n, true)], &[]), seed);
        let gram = ThinPlate::new([degree], Quadrature::Exact).gram(map.space().as_ref(), &SymmetricPattern::new(map.space().as_ref())).unwrap();
        let energy = |turn: usize| {
            let c: Vec<f64> = (0..n).map(|i| map.coefficients()[[(i + turn) % n, 0]]).collect();
            gram.multiply(&c).iter().zip(&c).map(|(a, b)| a * b).sum::<f64>()
        };
        prop_assert!((energy(0) - energy(turn)).abs() < 1e-11 * energy(0));
    }
}

/// Smallest norm that Gram–Schmidt leaves of a function, largest remaining first.
fn smallest_pivot(space: &HierarchicalSpace<1>) -> f64 {
    let mut vectors: Vec<Vec<f64>> = (0..space.n_functions())
        .map(|f| {
            let mut c = Array2::zeros((space.n_functions(), 1));
            c[[f, 0]] = 1.0;
            let map = SplineMap::new(Arc::new(space.clone()), c).unwrap();
            (0..400).map(|i| map.eval([f64::from(i) / 400.0]).unwrap()[0]).collect()
        })
        .collect();
    let squared = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>();
    let mut smallest = f64::INFINITY;
    while let Some(best) = (0..vectors.len()).max_by(|&a, &b| squared(&vectors[a]).total_cmp(&squared(&vectors[b]))) {
        let q = vectors.swap_remove(best);
        smallest = smallest.min(squared(&q).sqrt());
        for v in &mut vectors {
            let share = v.iter().zip(&q).map(|(a, b)| a * b).sum::<f64>() / squared(&q);
            v.iter_mut().zip(&q).for_each(|(a, b)| *a -= share * b);
        }
    }
    smallest
}

#[test]
fn knots_of_any_spacing_close_and_refine() {
    for degree in 1..=4 {
        let uneven = KnotVector::periodic(degree, vec![-1.0, -0.7, 0.1, 0.2, 1.1, 1.9, 2.3]).unwrap();
        let n = uneven.n_functions();
        assert_eq!((n, uneven.n_spans()), (6, 6));
        let c = Array2::from_shape_fn((n, 2), |(i, k)| ((i * 3 + k * 5) % 7) as f64);
        let at = |knots: &KnotVector, c: &Array2<f64>, u: f64| {
            let (first, values) = knots.basis(u).unwrap();
            let n = knots.n_functions();
            values.iter().enumerate().map(|(i, b)| b * c[[(first + i) % n, 1]]).sum::<f64>()
        };
        let (finer, moved) = uneven.insert(&[-0.9, 0.15, 2.2], c.view()).unwrap();
        assert!(finer.is_periodic());
        for i in 0..=40 {
            let u = -1.0 + 3.3 * f64::from(i) / 40.0;
            assert!((at(&uneven, &c, u) - at(&finer, &moved, u)).abs() < 1e-12, "degree {degree} at {u}");
        }
        assert!((at(&uneven, &c, -1.0) - at(&uneven, &c, 2.3)).abs() < 1e-12);
        let supports = (0..n).map(|f| uneven.support(f).len()).collect::<Vec<_>>();
        assert_eq!(supports, vec![degree + 1; n]);
    }
}

#[test]
fn a_circle_is_met_to_the_order_of_the_degree() {
    // Interpolating the sampled circle at the Greville abscissae of ever finer knots: the errors of the functions
    // e^{2πiu}, which are eigenvectors of every periodic scheme, fall as h^{p+1}.
    let error = |degree: usize, n: usize| {
        let knots = knots(degree, n, true);
        // The coefficients of an eigenvector are its samples times a number.
        let symbol = |u: f64| {
            let (first, values) = knots.basis(u).unwrap();
            values.iter().enumerate().fold([0.0, 0.0], |sum, (i, b)| {
                let angle = TAU * ((first + i) as f64 / n as f64 - u);
                [sum[0] + b * angle.cos(), sum[1] + b * angle.sin()]
            })
        };
        // Its value relative to the circle's at sites across a span: constant for an exact circle.
        let of: Vec<[f64; 2]> = (0..16).map(|i| symbol(f64::from(i) / (16.0 * n as f64))).collect();
        let spread = |k: usize| {
            of.iter().map(|s| s[k]).fold(f64::NEG_INFINITY, f64::max)
                - of.iter().map(|s| s[k]).fold(f64::INFINITY, f64::min)
        };
        spread(0).hypot(spread(1))
    };
    for degree in 1..=4 {
        let rate = (error(degree, 16) / error(degree, 32)).log2();
        assert!((rate - (degree + 1) as f64).abs() < 0.3, "degree {degree}: rate {rate}");
    }
}

#[test]
fn parameters_are_wrapped_or_clamped_into_the_domain() {
    let space = HierarchicalSpace::new(Kind::Thb, [knots(2, 4, true), knots(2, 4, false)]).unwrap();
    for (u, wrapped, clamped) in
        [(0.25, 0.25, 0.25), (1.0, 0.0, 1.0), (-0.25, 0.75, 0.0), (3.5, 0.5, 1.0), (-1e-30, 0.0, 0.0)]
    {
        assert_eq!(space.to_domain([u, u]), [wrapped, clamped]);
    }
    assert!(space.to_domain([f64::NAN; 2]).iter().all(|u| u.is_nan()));
    assert_eq!(space.way([0.75, 0.75], [0.0, 0.0]), [0.25, -0.75]);
    assert_eq!(space.way([0.125, 0.125], [0.875, 0.875]), [-0.25, 0.75]);
}

#[test]
fn too_few_elements_and_repeated_knots_are_typed_errors() {
    assert_eq!(
        KnotVector::uniform_periodic(3, 3),
        Err(Error::TooFewPeriodicElements { given: 3, degree: 3, needed: 4 })
    );
    assert!(matches!(KnotVector::uniform_periodic(3, 0), Err(Error::TooFewPeriodicElements { given: 0, .. })));
    assert!(matches!(KnotVector::periodic(1, vec![0.0, 0.5, 0.5, 1.0]), Err(Error::RepeatedKnot { index: 2, .. })));
    assert!(matches!(KnotVector::periodic(1, vec![0.0, 0.5, 0.4, 1.0]), Err(Error::KnotOrder { index: 2, .. })));
    assert!(matches!(KnotVector::periodic(1, vec![0.0, f64::NAN, 1.0]), Err(Error::KnotOrder { index: 1, .. })));
    // Round-off leaves nothing of the first span a period on, or of its halves.
    let vanishing = KnotVector::periodic(1, vec![0.0, 1e-17, 0.5, 1.0]);
    assert!(matches!(vanishing, Err(Error::KnotSpan { .. })), "{vanishing:?}");
    let narrow = KnotVector::periodic(1, vec![0.0, f64::EPSILON, 0.5, 1.0]).unwrap();
    let space = HierarchicalSpace::new(Kind::Thb, [narrow]).unwrap();
    let halved = space.refine(&[0], &Refinement::default());
    assert!(matches!(halved, Err(Error::SpanTooNarrow { direction: 0, level: 1 })), "{halved:?}");
    let closed = [knots(2, 4, false), knots(2, 4, true)];
    assert!(matches!(TensorSpace::new(closed.clone()), Err(Error::PeriodicKnots { direction: 1 })));
    let (closed, open) = (
        HierarchicalSpace::new(Kind::Thb, closed).unwrap(),
        refined::<2>(Kind::Thb, [knots(2, 4, false), knots(2, 4, false)], &[]),
    );
    assert!(matches!(transfer(&random_map(open, 1), &closed), Err(Error::NotNested { .. })));
}
