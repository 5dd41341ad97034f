//! Closest points against closed forms and against brute force.

use std::sync::Arc;

use ndarray::Array2;
use proptest::prelude::*;
use thb_core::{CellSpace, ClosestPoints, HierarchicalSpace, Kind, KnotVector, Refinement, SplineMap};

/// A space refined around a few parameters.
fn refined<const D: usize>(degree: usize, elements: usize, places: &[[f64; D]]) -> HierarchicalSpace<D> {
    let knots = KnotVector::uniform(degree, elements).unwrap();
    let mut space = HierarchicalSpace::new(Kind::Thb, std::array::from_fn(|_| knots.clone())).unwrap();
    for &place in places {
        let cell = space.locate_cell(place).unwrap();
        space = space.refine(&[cell], &Refinement { extension: [2; D], ..Refinement::default() }).unwrap();
    }
    space
}

/// The map of a space that takes the value of a polynomial: of degree 2 per direction, so that values at three points per
/// direction and cell determine it.
fn interpolating<const D: usize>(space: HierarchicalSpace<D>, value: impl Fn([f64; D]) -> Vec<f64>) -> SplineMap<D> {
    assert!(space.degree().iter().all(|&p| p == 2));
    // Quadratic B-spline coefficients are blossoms f(t₁, t₂) at the inner knots: with m their middle and h half their
    // distance, f(t₁, t₂) = 2 f(m) − (f(m − h) + f(m + h)) / 2.
    let coarse = (0..D).map(|d| space.knots(0, d).unwrap().clone()).collect::<Vec<_>>();
    let counts: [usize; D] = std::array::from_fn(|d| coarse[d].n_functions());
    let rows: Vec<Vec<f64>> = (0..counts.iter().product::<usize>())
        .map(|mut linear| {
            let inner: [[f64; 2]; D] = std::array::from_fn(|d| {
                let i = linear % counts[d];
                linear /= counts[d];
                [coarse[d].knots()[i + 1], coarse[d].knots()[i + 2]]
            });
            let mut sum = vec![];
            for choice in 0..3_usize.pow(D as u32) {
                let mut weight = 1.0;
                let u = std::array::from_fn(|d| {
                    let [a, b] = inner[d];
                    let pick = choice / 3_usize.pow(d as u32) % 3;
                    weight *= [-0.5, 2.0, -0.5][pick];
                    [a, 0.5 * (a + b), b][pick]
                });
                let point = value(u);
                sum.resize(point.len(), 0.0);
                sum.iter_mut().zip(&point).for_each(|(s, x)| *s += weight * x);
            }
            sum
        })
        .collect();
    let tensor = HierarchicalSpace::new(Kind::Thb, std::array::from_fn(|d| coarse[d].clone())).unwrap();
    let coefficients = Array2::from_shape_fn((rows.len(), rows[0].len()), |(i, k)| rows[i][k]);
    let map = SplineMap::new(Arc::new(tensor), coefficients).unwrap();
    let moved = thb_core::transfer(&map, &space).unwrap();
    SplineMap::new(Arc::new(space), moved).unwrap()
}

fn random_map<const D: usize>(space: HierarchicalSpace<D>, n: usize, seed: u64) -> SplineMap<D> {
    let mut state = seed | 1;
    let coefficients = Array2::from_shape_simple_fn((space.n_functions(), n), || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / f64::from(1_u32 << 31)
    });
    SplineMap::new(Arc::new(space), coefficients).unwrap()
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| (x - y) * (x - y)).sum::<f64>().sqrt()
}

/// Smallest distance over a regular grid of parameters.
fn brute_force<const D: usize>(map: &SplineMap<D>, query: &[f64], per_direction: usize) -> f64 {
    let sites = Array2::from_shape_fn((per_direction.pow(D as u32), D), |(i, d)| {
        (i / per_direction.pow(d as u32) % per_direction) as f64 / (per_direction - 1) as f64
    });
    let image = map.eval_batch(sites.view()).unwrap();
    image.outer_iter().map(|point| distance(&point.to_vec(), query)).fold(f64::INFINITY, f64::min)
}

/// What every answer must satisfy: the parameter lies in its cell, and has the distance.
fn check<const D: usize>(map: &SplineMap<D>, query: &[f64]) -> (f64, [f64; D]) {
    let found = ClosestPoints::new(map.bezier().clone()).unwrap().closest(query);
    let (lower, upper) = map.bezier().cell_box(found.cell);
    assert!((0..D).all(|d| (lower[d]..=upper[d]).contains(&found.u[d])), "{found:?} is not in its cell");
    let point = map.eval(found.u).unwrap();
    assert!((distance(&point, query) - found.distance).abs() <= 1e-12 * (1.0 + found.distance), "{found:?}");
    (found.distance, found.u)
}

#[test]
fn a_parabola_in_the_plane() {
    // (t, t²): from (0, c) with c > ½ the closest points are t = ±√(c − ½), at distance √(c − ¼).
    let map = interpolating(refined::<1>(2, 5, &[[0.31], [0.9]]), |[u]| {
        let t = 4.0 * u - 2.0;
        vec![t, t * t]
    });
    for c in [0.6_f64, 1.0, 2.5, 4.0] {
        let (found, [u]) = check(&map, &[0.0, c]);
        assert!((found - (c - 0.25).sqrt()).abs() < 1e-12, "c = {c}: {found}");
        assert!(((4.0 * u - 2.0).abs() - (c - 0.5).sqrt()).abs() < 1e-7);
    }
    // From below the vertex it is the vertex.
    for c in [0.45, 0.0, -1.0, -50.0_f64] {
        assert!((check(&map, &[0.0, c]).0 - c.abs()).abs() < 1e-12, "c = {c}");
    }
    // At the centre of curvature of the vertex the distance is stationary to third order, and still found.
    assert!((check(&map, &[0.0, 0.5]).0 - 0.5).abs() < 1e-12);
}

#[test]
fn queries_beyond_the_ends_of_a_curve() {
    // A straight line from (0, 0, 0) to (1, 2, 2), of length 3.
    let map = interpolating(refined::<1>(2, 3, &[[0.5]]), |[u]| vec![u, 2.0 * u, 2.0 * u]);
    let (found, u) = check(&map, &[-1.0, -2.0, -2.0]);
    assert!((found - 3.0).abs() < 1e-12 && u == [0.0]);
    let (found, u) = check(&map, &[2.0, 4.0, 4.0]);
    assert!((found - 3.0).abs() < 1e-12 && u == [1.0]);
    // Offset across the line.
    let (found, u) = check(&map, &[0.5, 1.0 + 0.7, 1.0 - 0.7]);
    assert!((found - 0.7 * 2.0_f64.sqrt()).abs() < 1e-12 && (u[0] - 0.5).abs() < 1e-12);
    // On the line, at a knot.
    let (found, _) = check(&map, &[1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0]);
    assert!(found < 1e-15);
}

#[test]
fn a_paraboloid_and_its_offsets() {
    // z = x² + y² has curvature at most 2: up to the offset ½ the foot point is where the offset started.
    let value = |[u, v]: [f64; 2]| {
        let (x, y) = (2.0 * u - 1.0, 2.0 * v - 1.0);
        vec![x, y, x * x + y * y]
    };
    let map = interpolating(refined::<2>(2, 4, &[[0.3, 0.3], [0.28, 0.3], [0.8, 0.1]]), value);
    for (i, j) in (1..12).flat_map(|i| (1..12).map(move |j| (i, j))) {
        let u = [f64::from(i) / 12.0, f64::from(j) / 12.0];
        let foot = value(u);
        let length = (1.0 + 4.0 * foot[2]).sqrt();
        let normal = [-2.0 * foot[0] / length, -2.0 * foot[1] / length, 1.0 / length];
        for offset in [-3.0_f64, -0.5, -1e-6, 0.0, 1e-9, 0.1, 0.45] {
            let query: Vec<f64> = (0..3).map(|k| foot[k] + offset * normal[k]).collect();
            let (found, at) = check(&map, &query);
            assert!((found - offset.abs()).abs() < 1e-12, "offset {offset} at {u:?}: {found}");
            assert!(distance(&at, &u) < 1e-6, "offset {offset} at {u:?}: foot point {at:?}");
        }
    }
}

#[test]
fn queries_beyond_the_sides_and_corners_of_a_surface() {
    let map = interpolating(refined::<2>(2, 3, &[[0.1, 0.1]]), |[u, v]| vec![u, v, 0.0]);
    for (query, u) in [
        ([-0.3, 0.4, 0.0], [0.0, 0.4]),
        ([1.3, 0.4, 0.4], [1.0, 0.4]),
        ([0.7, -2.0, 0.0], [0.7, 0.0]),
        ([-0.3, -0.4, 1.2], [0.0, 0.0]),
        ([1.3, 1.4, 0.0], [1.0, 1.0]),
        ([0.25, 0.5, -7.0], [0.25, 0.5]),
    ] {
        let (found, at) = check(&map, &query);
        assert!((found - distance(&[u[0], u[1], 0.0], &query)).abs() < 1e-12, "{query:?}: {found}");
        assert!(distance(&at, &u) < 1e-9, "{query:?}: {at:?}");
    }
}

#[test]
fn a_surface_with_a_collapsed_side() {
    // A cone: the side v = 1 is its tip (0, 0, 1), where the surface has no normal.
    let map = interpolating(refined::<2>(2, 3, &[[0.5, 0.9], [0.5, 0.99]]), |[u, v]| {
        let s = 2.0 * u - 1.0;
        vec![s * (1.0 - v), (1.0 - s * s) * (1.0 - v), v]
    });
    for height in [1.0, 1.5, 40.0] {
        let (found, [_, v]) = check(&map, &[0.0, 0.0, height]);
        assert!((found - (height - 1.0)).abs() < 1e-9, "height {height}: {found}");
        assert!((v - 1.0).abs() < 1e-9);
    }
    for query in [[0.1, -0.3, 1.1], [0.0, 0.4, 0.8], [-0.5, 0.1, 0.2], [0.3, 0.0, 0.99]] {
        let (found, _) = check(&map, &query);
        let coarse = brute_force(&map, &query, 201);
        assert!(found <= coarse + 1e-12 && coarse - found < 1e-3, "{query:?}: {found}, brute force {coarse}");
    }
    // A surface that is a point all over.
    let point = interpolating(refined::<2>(2, 2, &[[0.3, 0.3]]), |_| vec![1.0, 2.0, 3.0]);
    assert!((check(&point, &[1.0, 2.0, 5.0]).0 - 2.0).abs() < 1e-12);
    assert_eq!(check(&point, &[1.0, 2.0, 3.0]).0, 0.0);
}

#[test]
fn a_start_near_the_foot_point_gives_the_same_point() {
    let map = random_map(refined::<2>(3, 4, &[[0.6, 0.2]]), 3, 5);
    let search = ClosestPoints::new(map.bezier().clone()).unwrap();
    for k in 0..60 {
        let u = [f64::from(k * 13 % 60) / 59.0, f64::from(k * 29 % 60) / 59.0];
        let mut query = map.eval(u).unwrap();
        query[k as usize % 3] += 0.05;
        let cell = map.space().locate_cell(u).unwrap();
        let (near, far) = (search.closest_from(&query, cell, u), search.closest(&query));
        assert!((near.distance - far.distance).abs() < 1e-9, "{near:?} and {far:?}");
    }
}

#[test]
fn images_of_more_than_three_dimensions_are_an_error() {
    let map = random_map(refined::<1>(2, 2, &[]), 4, 1);
    let error = ClosestPoints::new(map.bezier().clone()).unwrap_err();
    assert_eq!(error, thb_core::Error::Shape { what: "dimension of the image", given: 4, expected: 3 });
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn curves_against_brute_force(degree in 1_usize..=5, elements in 1_usize..=6, n in 1_usize..=3, place in 0.0..=1.0_f64,
                                  seed in any::<u64>(), query in prop::array::uniform3(-0.5..1.5_f64)) {
        let map = random_map(refined::<1>(degree, elements, &[[place]]), n, seed);
        let (found, _) = check(&map, &query[..n]);
        let coarse = brute_force(&map, &query[..n], 4001);
        prop_assert!(found <= coarse + 1e-12, "{found}, brute force {coarse}");
        // Lipschitz bound: coefficients in [0, 1] and a cell of at least 1/12 give slopes of at most 12 · 2 · degree · √n.
        prop_assert!(coarse - found <= 24.0 * degree as f64 * 2.0 / 4000.0);
    }

    #[test]
    fn surfaces_against_brute_force(degree in 1_usize..=4, elements in 1_usize..=3, place in prop::array::uniform2(0.0..=1.0_f64),
                                    seed in any::<u64>(), query in prop::array::uniform3(-0.5..1.5_f64)) {
        let map = random_map(refined::<2>(degree, elements, &[place]), 3, seed);
        let (found, _) = check(&map, &query);
        let coarse = brute_force(&map, &query, 121);
        prop_assert!(found <= coarse + 1e-12, "{found}, brute force {coarse}");
    }
}
