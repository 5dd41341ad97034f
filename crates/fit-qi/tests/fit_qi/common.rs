//! Shared by the tests: points, spaces, functions.
#![allow(dead_code, reason = "no test file uses all of it")]

use std::sync::Arc;

use ndarray::Array2;
use thb_core::{CellSpace, HierarchicalSpace, Kind, KnotVector, Refinement};

/// A sequence of numbers between 0 and 1, the same every time.
pub(crate) struct Numbers(u64);

impl Numbers {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Random parameters `(m, D)`.
pub(crate) fn random<const D: usize>(m: usize, seed: u64) -> Array2<f64> {
    let mut numbers = Numbers::new(seed);
    Array2::from_shape_simple_fn((m, D), || numbers.next())
}

/// Parameters `(n^D, D)` in the middle of the cells of a grid.
pub(crate) fn grid<const D: usize>(n: usize) -> Array2<f64> {
    Array2::from_shape_fn((n.pow(D as u32), D), |(i, d)| ((i / n.pow(d as u32) % n) as f64 + 0.5) / n as f64)
}

/// Points `(m, N)` of functions at parameters.
pub(crate) fn image<const D: usize>(parameters: &Array2<f64>, functions: &[&dyn Fn([f64; D]) -> f64]) -> Array2<f64> {
    Array2::from_shape_fn((parameters.nrows(), functions.len()), |(i, k)| {
        functions[k](std::array::from_fn(|d| parameters[[i, d]]))
    })
}

/// The unrefined space.
pub(crate) fn tensor<const D: usize>(degree: usize, elements: usize) -> Arc<HierarchicalSpace<D>> {
    let knots = KnotVector::uniform(degree, elements).unwrap();
    Arc::new(HierarchicalSpace::new(Kind::Thb, std::array::from_fn(|_| knots.clone())).unwrap())
}

/// The space refined twice around a point.
pub(crate) fn refined<const D: usize>(start: &HierarchicalSpace<D>, around: [f64; D]) -> Arc<HierarchicalSpace<D>> {
    let mut space = start.clone();
    for _ in 0..2 {
        let cell = space.locate_cell(around).unwrap();
        let refinement = Refinement { extension: [2 * start.degree()[0]; D], ..Refinement::default() };
        space = space.refine(&[cell], &refinement).unwrap();
    }
    Arc::new(space)
}
