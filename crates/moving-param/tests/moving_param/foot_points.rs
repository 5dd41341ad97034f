//! Foot points against planted parameters, against the global search, and under constraints.

use std::sync::Arc;

use moving_param::{Boundary, Descent, FootPointOptions, Start, project};
use ndarray::Array2;
use thb_core::{CellSpace, ClosestPoints, HierarchicalSpace, Kind, KnotVector, Refinement, SplineMap};

/// Numbers in [0, 1) that depend on the seed only.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// A gently curved graph-like map: the identity in the first directions, noise of the given height on top.
fn map<const D: usize>(degree: usize, n: usize, height: f64, seed: u64) -> SplineMap<D> {
    let knots = KnotVector::uniform(degree, 4).unwrap();
    let mut space = HierarchicalSpace::new(Kind::Thb, std::array::from_fn(|_| knots.clone())).unwrap();
    let middle = space.locate_cell([0.4; D]).unwrap();
    space = space.refine(&[middle], &Refinement { extension: [2; D], ..Refinement::default() }).unwrap();
    let coarse = HierarchicalSpace::new(Kind::Thb, std::array::from_fn(|_| knots.clone())).unwrap();
    let mut random = Random(seed);
    let count = knots.n_functions();
    let greville: Vec<f64> =
        (0..count).map(|i| knots.knots()[i + 1..=i + degree].iter().sum::<f64>() / degree as f64).collect();
    let coefficients = Array2::from_shape_fn((coarse.n_functions(), n), |(i, k)| {
        let along = if k < D { greville[i / count.pow(k as u32) % count] } else { 0.0 };
        along + if k < D { 0.05 * height } else { height } * (random.next() - 0.5)
    });
    let coarse = SplineMap::new(Arc::new(coarse), coefficients).unwrap();
    let mut fine = thb_core::transfer(&coarse, &space).unwrap();
    // Functions of the second level move on their own, so that cells of different levels really differ.
    for mut row in fine.outer_iter_mut().skip(space.first_of_level(1)) {
        row.iter_mut().for_each(|x| *x += 0.01 * height * (random.next() - 0.5));
    }
    SplineMap::new(Arc::new(space), fine).unwrap()
}

fn parameters<const D: usize>(count: usize, seed: u64) -> Array2<f64> {
    let mut random = Random(seed);
    Array2::from_shape_simple_fn((count, D), || random.next())
}

#[test]
fn planted_foot_points_are_found_from_perturbed_parameters() {
    planted::<1>(3, 2);
    planted::<1>(2, 3);
    planted::<2>(2, 3);
    planted::<2>(3, 3);
    planted::<2>(1, 3);
}

fn planted<const D: usize>(degree: usize, n: usize) {
    let map = map::<D>(degree, n, 0.3, 7);
    let exact = parameters::<D>(400, 3);
    let points = map.eval_batch(exact.view()).unwrap();
    let mut random = Random(5);
    // 5 % of a cell.
    let moved = exact.mapv(|u| (u + 0.0125 * (2.0 * random.next() - 1.0)).clamp(0.0, 1.0));
    let options = FootPointOptions::default();
    let (found, distances, report) = project::<D>(&map, moved.view(), points.view(), Boundary::Free, &options).unwrap();
    for i in 0..exact.nrows() {
        assert!(distances[i] < 1e-11, "degree {degree}: point {i} is {:e} away", distances[i]);
        for d in 0..D {
            assert!((found[[i, d]] - exact[[i, d]]).abs() < 1e-9, "degree {degree}: point {i}");
        }
    }
    assert!(report.accepted > 0.99 && report.mean_steps < 6.0, "{report:?}");
}

#[test]
fn points_off_the_surface_reach_the_global_distance() {
    let map = map::<2>(3, 3, 0.4, 11);
    let exact = parameters::<2>(3000, 13);
    let mut random = Random(17);
    let mut points = map.eval_batch(exact.view()).unwrap();
    points.iter_mut().for_each(|x| *x += 0.05 * (random.next() - 0.5));
    let closest = ClosestPoints::new(map.bezier().clone()).unwrap();
    let global: Vec<f64> = points.outer_iter().map(|p| closest.closest(&p.to_vec()).distance).collect();
    let near = |distances: &[f64]| distances.iter().zip(&global).filter(|(d, g)| *d - *g < 1e-9).count();
    for (start, share) in
        [(Start::Present, 0.999), (Start::Both(3), 1.0), (Start::Sampled(3), 0.999), (Start::Global, 1.0)]
    {
        let options = FootPointOptions { start, ..FootPointOptions::default() };
        let (_, distances, _) = project::<2>(&map, exact.view(), points.view(), Boundary::Free, &options).unwrap();
        let found = near(&distances);
        assert!(found as f64 >= share * 3000.0, "{start:?}: {found} of 3000");
    }
    // The methods of first order stop where steps no longer pay; that they are worse is why they are not the default.
    for descent in [Descent::Gradient { min_step: 1e-12 }, Descent::QuasiNewton { min_step: 1e-12 }] {
        let options = FootPointOptions { descent, max_steps: 1000, ..FootPointOptions::default() };
        let (_, distances, _) = project::<2>(&map, exact.view(), points.view(), Boundary::Free, &options).unwrap();
        let found = near(&distances);
        assert!(found as f64 >= 0.97 * 3000.0, "{descent:?}: {found} of 3000");
    }
}

#[test]
fn distances_never_grow_and_sides_are_kept() {
    let map = map::<2>(2, 3, 2.0, 19);
    let mut start = parameters::<2>(2000, 23);
    // A quarter of the points each: left side, top side, corner, interior.
    for (i, mut u) in start.outer_iter_mut().enumerate() {
        match i % 4 {
            0 => u[0] = 0.0,
            1 => u[1] = 1.0,
            2 => (u[0], u[1]) = (1.0, 0.0),
            _ => {}
        }
    }
    let mut random = Random(29);
    let points = map.eval_batch(start.view()).unwrap().mapv(|x| x + 0.3 * (random.next() - 0.5));
    let before = map.eval_batch(start.view()).unwrap();
    let options = FootPointOptions::default();
    let (found, distances, report) = project::<2>(&map, start.view(), points.view(), Boundary::Kept, &options).unwrap();
    let after = map.eval_batch(found.view()).unwrap();
    for i in 0..start.nrows() {
        let norm = |image: &Array2<f64>| -> f64 {
            (0..3).map(|k| (image[[i, k]] - points[[i, k]]).powi(2)).sum::<f64>().sqrt()
        };
        assert!(distances[i] <= norm(&before) + 1e-14, "point {i}");
        assert!((distances[i] - norm(&after)).abs() < 1e-13, "point {i}");
        match i % 4 {
            0 => assert_eq!(found[[i, 0]], 0.0),
            1 => assert_eq!(found[[i, 1]], 1.0),
            2 => assert_eq!(found.row(i), start.row(i)),
            _ => {}
        }
    }
    assert!(report.accepted > 0.7 && report.accepted <= 0.75, "{report:?}");
}

/// The smallest distance of a point to a map: all of `side` × `side` samples of the domain, then a search without derivatives
/// over shrinking neighbourhoods from each sample that no neighbour undercuts and that could lead to a nearer point.
fn brute_force(map: &SplineMap<2>, samples: &[[f64; 3]], side: usize, spacing: f64, point: &[f64]) -> f64 {
    let distance = |x: &[f64]| (0..3).map(|k| (x[k] - point[k]).powi(2)).sum::<f64>().sqrt();
    let all: Vec<f64> = samples.iter().map(|x| distance(x)).collect();
    let least = all.iter().copied().fold(f64::INFINITY, f64::min);
    let mut best = least;
    for at in (0..all.len()).filter(|&at| all[at] <= least + spacing) {
        let around = |k: usize| k.saturating_sub(1)..(k + 2).min(side);
        let (i, j) = (at % side, at / side);
        if around(j).any(|b| around(i).any(|a| all[a + side * b] < all[at])) {
            continue;
        }
        let mut u = [i, j].map(|k| k as f64 / (side - 1) as f64);
        let (mut nearest, mut step) = (all[at], 0.5 / side as f64);
        while step > 1e-12 {
            let mut moved = false;
            for direction in (0..9).filter(|k| *k != 4) {
                let trial = [0, 1].map(|d| {
                    let way = [direction % 3, direction / 3][d] as f64 - 1.0;
                    (u[d] + step * way).clamp(0.0, 1.0)
                });
                let value = distance(&map.eval(trial).unwrap());
                if value < nearest {
                    (u, nearest, moved) = (trial, value, true);
                }
            }
            step = if moved { step } else { 0.5 * step };
        }
        best = best.min(nearest);
    }
    best
}

#[test]
fn brute_force_finds_nothing_nearer() {
    const QUERIES: usize = 300;
    const SIDE: usize = 101;
    let map = map::<2>(3, 3, 0.4, 31);
    let lattice = Array2::from_shape_fn((SIDE * SIDE, 2), |(i, d)| [i % SIDE, i / SIDE][d] as f64 / (SIDE - 1) as f64);
    let samples: Vec<[f64; 3]> =
        map.eval_batch(lattice.view()).unwrap().outer_iter().map(|x| [x[0], x[1], x[2]]).collect();
    let apart = |a: usize, b: usize| (0..3).map(|k| (samples[a][k] - samples[b][k]).powi(2)).sum::<f64>().sqrt();
    let spacing = (0..SIDE * SIDE - SIDE - 1).filter(|at| at % SIDE + 1 < SIDE).map(|at| apart(at, at + SIDE + 1));
    let spacing = spacing.fold(0.0, f64::max);
    let exact = parameters::<2>(QUERIES, 37);
    let mut random = Random(41);
    let points = map.eval_batch(exact.view()).unwrap().mapv(|x| x + 0.06 * (random.next() - 0.5));
    let warm = exact.mapv(|u| (u + 0.05 * (random.next() - 0.5)).clamp(0.0, 1.0));
    let truth: Vec<f64> =
        points.outer_iter().map(|p| brute_force(&map, &samples, SIDE, spacing, &p.to_vec())).collect();
    // A diagonal is about 1.5 long.
    for (start, least) in [(Start::Global, QUERIES), (Start::Both(4), QUERIES), (Start::Present, QUERIES - 1)] {
        let options = FootPointOptions { start, ..FootPointOptions::default() };
        let (_, distances, _) = project::<2>(&map, warm.view(), points.view(), Boundary::Free, &options).unwrap();
        let as_near = distances.iter().zip(&truth).filter(|(d, t)| **d <= *t + 1e-9).count();
        assert!(as_near >= least, "{start:?}: {as_near} of {QUERIES}");
    }
}
