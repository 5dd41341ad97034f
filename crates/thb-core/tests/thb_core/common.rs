//! What several tests need.

use std::sync::Arc;

use ndarray::Array2;
use thb_core::{CellSpace, HierarchicalSpace, SplineMap};

/// A map to the plane with random coefficients.
pub(crate) fn random_map<const D: usize>(space: HierarchicalSpace<D>, seed: u64) -> SplineMap<D> {
    let mut state = seed | 1;
    let coefficients = Array2::from_shape_simple_fn((space.n_functions(), 2), || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / f64::from(1_u32 << 31) - 0.5
    });
    SplineMap::new(Arc::new(space), coefficients).unwrap()
}
