//! Surfaces with given boundary curves.

use std::sync::Arc;

use crate::common::{Random, largest_difference, random_map, refined, scattered};
use fit_ls::{Error, Lambda, LeastSquares, Options, Side, boundary_coefficients, boundary_functions};
use ndarray::Array2;
use thb_core::{CellSpace, HierarchicalSpace, Kind, KnotVector, Refinement, SplineMap};

const SIDES: [Side; 4] = [Side::Left, Side::Right, Side::Bottom, Side::Top];

/// The parameter of a surface at a parameter of a side's curve.
fn on(side: Side, s: f64) -> [f64; 2] {
    match side {
        Side::Left => [0.0, s],
        Side::Right => [1.0, s],
        Side::Bottom => [s, 0.0],
        Side::Top => [s, 1.0],
    }
}

/// A boundary curve of a surface, in a curve space that holds it: uniform and as fine as the finest level.
fn boundary(map: &SplineMap<2>, side: Side) -> SplineMap<1> {
    let space = map.space();
    let knots = KnotVector::uniform(space.degree()[0], space.mesh().grid(space.n_levels() - 1)[0]).unwrap();
    let curves = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots]).unwrap());
    let m = 8 * curves.n_functions();
    let along = Array2::from_shape_fn((m, 1), |(i, _)| (i as f64 + 0.5) / m as f64);
    let sites = Array2::from_shape_fn((m, 2), |(i, d)| on(side, along[[i, 0]])[d]);
    let points = map.eval_batch(sites.view()).unwrap();
    let options = Options { lambda: Lambda::Fixed(0.0), ..Options::default() };
    LeastSquares::new(along.view(), points.view(), None, options).unwrap().fit(&curves).unwrap()
}

fn deviation_along(map: &SplineMap<2>, curve: &SplineMap<1>, side: Side) -> f64 {
    let along = Array2::from_shape_fn((501, 1), |(i, _)| i as f64 / 500.0);
    let sites = Array2::from_shape_fn((501, 2), |(i, d)| on(side, along[[i, 0]])[d]);
    let (a, b) = (map.eval_batch(sites.view()).unwrap(), curve.eval_batch(along.view()).unwrap());
    largest_difference(&a, &b)
}

/// A space that is refined at two sides and a corner.
fn space(kind: Kind, degree: usize) -> Arc<HierarchicalSpace<2>> {
    let mut space = refined::<2>(kind, degree, 4).as_ref().clone();
    for place in [[0.0, 0.6], [0.0, 0.62], [1.0, 1.0], [0.4, 0.0]] {
        let cell = space.locate_cell(place).unwrap();
        space = space.refine(&[cell], &Refinement { extension: [2; 2], ..Refinement::default() }).unwrap();
    }
    Arc::new(space)
}

#[test]
fn boundary_functions_are_those_that_do_not_vanish_on_the_side() {
    for kind in [Kind::Thb, Kind::Hb] {
        let space = space(kind, 2);
        for side in SIDES {
            let expected: Vec<usize> = (0..space.n_functions())
                .filter(|&j| {
                    let mut coefficients = Array2::zeros((space.n_functions(), 1));
                    coefficients[[j, 0]] = 1.0;
                    let function = SplineMap::new(space.clone(), coefficients).unwrap();
                    (0..=640).any(|i| function.eval(on(side, f64::from(i) / 640.0)).unwrap()[0] > 1e-9)
                })
                .collect();
            assert_eq!(boundary_functions(&space, side), expected, "{kind:?} {side:?}");
        }
    }
}

#[test]
fn the_boundary_of_a_surface_gives_its_own_coefficients() {
    for (kind, degree) in [(Kind::Thb, 2), (Kind::Thb, 3), (Kind::Hb, 2)] {
        let space = space(kind, degree);
        let map = random_map(&space, 3, &mut Random::new(3));
        for side in SIDES {
            let fixed = boundary_coefficients(&space, side, &boundary(&map, side)).unwrap();
            assert_eq!(fixed.iter().map(|(j, _)| *j).collect::<Vec<_>>(), boundary_functions(&space, side));
            for (j, row) in fixed {
                for (k, value) in row.iter().enumerate() {
                    let error = (value - map.coefficients()[[j, k]]).abs();
                    assert!(error < 1e-9, "{kind:?} {side:?}, function {j}: {error:e}");
                }
            }
        }
    }
}

#[test]
fn noisy_points_are_fitted_inside_while_the_boundary_is_exact() {
    let space = space(Kind::Thb, 3);
    let mut random = Random::new(17);
    let map = random_map(&space, 3, &mut random);
    let parameters = scattered(&space, 30, &mut random);
    let noise = random.array(parameters.nrows(), 3) * 0.2;
    let points = map.eval_batch(parameters.view()).unwrap() + noise - 0.1;
    // Corners belong to two sides, with the same value up to round-off: the first one is kept.
    let mut fixed: Vec<(usize, Vec<f64>)> = Vec::new();
    for side in SIDES {
        for (j, row) in boundary_coefficients(&space, side, &boundary(&map, side)).unwrap() {
            if fixed.iter().all(|(known, _)| *known != j) {
                fixed.push((j, row));
            }
        }
    }
    fixed.sort_by_key(|(j, _)| *j);
    let options = Options { lambda: Lambda::Fixed(0.0), ..Options::default() };
    let mut method = LeastSquares::new(parameters.view(), points.view(), None, options).unwrap();
    let found = method.fit_with_fixed(&space, &fixed).unwrap();
    let free = method.fit(&space).unwrap();
    for side in SIDES {
        let curve = boundary(&map, side);
        assert!(deviation_along(&found, &curve, side) < 1e-10, "{side:?}");
        assert!(deviation_along(&free, &curve, side) > 1e-3, "the noise should move the free boundary {side:?}");
    }
    // Inside, the noise is averaged.
    let inside = Array2::from_shape_fn((400, 2), |(i, d)| 0.3 + 0.4 * (i / 20_usize.pow(d as u32) % 20) as f64 / 19.0);
    let (a, b) = (found.eval_batch(inside.view()).unwrap(), map.eval_batch(inside.view()).unwrap());
    assert!(largest_difference(&a, &b) < 0.1);
}

#[test]
fn curves_that_no_surface_has_as_boundary_are_an_error() {
    let space = space(Kind::Thb, 2);
    let knots = KnotVector::uniform(3, 1).unwrap();
    let cubic = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots]).unwrap());
    // s³ is no quadratic spline.
    let curve =
        SplineMap::new(cubic.clone(), Array2::from_shape_fn((4, 3), |(i, _)| if i == 3 { 1.0 } else { 0.0 })).unwrap();
    for side in SIDES {
        match boundary_coefficients(&space, side, &curve) {
            Err(Error::BoundaryCurve { deviation }) => assert!((1e-6..0.1).contains(&deviation), "{deviation}"),
            other => panic!("{other:?}"),
        }
    }
    // s itself is one.
    let line = SplineMap::new(cubic, Array2::from_shape_fn((4, 3), |(i, _)| i as f64 / 3.0)).unwrap();
    let fixed = boundary_coefficients(&space, Side::Bottom, &line).unwrap();
    assert!(!fixed.is_empty());
    // A curve on another interval.
    let knots = KnotVector::uniform(2, 2).unwrap().on_interval(0.0, 0.5).unwrap();
    let short = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots]).unwrap());
    let short = SplineMap::new(short.clone(), Array2::zeros((short.n_functions(), 3))).unwrap();
    assert!(matches!(boundary_coefficients(&space, Side::Left, &short), Err(Error::Space(_))));
}
