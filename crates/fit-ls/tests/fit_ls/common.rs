//! Random spaces, maps and points for the tests.
#![allow(dead_code, reason = "each test uses a part of it")]

use std::sync::Arc;

use ndarray::Array2;
use thb_core::{CellSpace, HierarchicalSpace, Kind, KnotVector, Refinement, SplineMap};

/// A linear congruential generator of numbers in [0, 1).
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed)
    }

    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(crate) fn array(&mut self, rows: usize, columns: usize) -> Array2<f64> {
        Array2::from_shape_simple_fn((rows, columns), || self.next())
    }
}

/// A space of three or more levels, refined around a point that wanders.
pub(crate) fn refined<const D: usize>(kind: Kind, degree: usize, elements: usize) -> Arc<HierarchicalSpace<D>> {
    let knots = KnotVector::uniform(degree, elements).unwrap();
    let mut space = HierarchicalSpace::new(kind, std::array::from_fn(|_| knots.clone())).unwrap();
    for place in [[0.2, 0.3], [0.22, 0.31], [0.8, 0.9], [0.25, 0.35]] {
        let cell = space.locate_cell(std::array::from_fn(|d| place[d])).unwrap();
        space = space.refine(&[cell], &Refinement { extension: [2; D], ..Refinement::default() }).unwrap();
    }
    assert!(space.n_levels() >= 3);
    Arc::new(space)
}

/// A map with random coefficients in [0, 1).
pub(crate) fn random_map<const D: usize>(
    space: &Arc<HierarchicalSpace<D>>,
    n: usize,
    random: &mut Random,
) -> SplineMap<D> {
    SplineMap::new(space.clone(), random.array(space.n_functions(), n)).unwrap()
}

/// Random parameters, `per_cell` in each cell: scattered, and enough everywhere.
pub(crate) fn scattered<const D: usize>(
    space: &HierarchicalSpace<D>,
    per_cell: usize,
    random: &mut Random,
) -> Array2<f64> {
    let mut rows = Vec::new();
    for number in 0..space.n_cells() {
        let cell = space.cell(number);
        for _ in 0..per_cell {
            rows.extend((0..D).map(|d| cell.lower[d] + (cell.upper[d] - cell.lower[d]) * random.next()));
        }
    }
    Array2::from_shape_vec((rows.len() / D, D), rows).unwrap()
}

pub(crate) fn largest_difference(a: &Array2<f64>, b: &Array2<f64>) -> f64 {
    assert_eq!(a.dim(), b.dim());
    a.iter().zip(b).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
}

/// Solves a dense symmetric positive definite or general system by Gaussian elimination with partial pivoting; the
/// columns of `right` are replaced by the solutions.
pub(crate) fn solve_dense(mut matrix: Array2<f64>, mut right: Array2<f64>) -> Array2<f64> {
    let n = matrix.nrows();
    for k in 0..n {
        let pivot = (k..n).max_by(|&a, &b| matrix[[a, k]].abs().total_cmp(&matrix[[b, k]].abs())).unwrap();
        for j in 0..n {
            matrix.swap([k, j], [pivot, j]);
        }
        for j in 0..right.ncols() {
            right.swap([k, j], [pivot, j]);
        }
        for i in k + 1..n {
            let factor = matrix[[i, k]] / matrix[[k, k]];
            for j in k..n {
                matrix[[i, j]] -= factor * matrix[[k, j]];
            }
            for j in 0..right.ncols() {
                right[[i, j]] -= factor * right[[k, j]];
            }
        }
    }
    for i in (0..n).rev() {
        for c in 0..right.ncols() {
            let known: f64 = (i + 1..n).map(|j| matrix[[i, j]] * right[[j, c]]).sum();
            right[[i, c]] = (right[[i, c]] - known) / matrix[[i, i]];
        }
    }
    right
}
