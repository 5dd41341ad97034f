//! A weak spring from each parameter to where it started.

use std::sync::Arc;

use thb_core::{CellSpace, HierarchicalSpace};

use crate::frame::Frame;
use crate::patch::dot;

/// Adds `½ Σ ω_i (u_i − a_i)ᵀ diag(k) (u_i − a_i)` to the objective of the joint method, `a_i` the parameters at the start.
///
/// Distances alone leave parameters free to slide along the surface where that costs nothing; they then open voids in
/// the parameter domain over which the surface swings away from the points.
#[derive(Clone, Debug)]
pub(crate) struct Anchor<const D: usize> {
    /// A space over the domain, for ways across a seam.
    space: Arc<HierarchicalSpace<D>>,
    /// `a`, by the index of the point.
    at: Vec<[f64; D]>,
    stiffness: [f64; D],
}

impl<const D: usize> Anchor<D> {
    /// Springs `share` times as stiff as distances: a move along the surface by some length costs as much as a distance of
    /// that length times `√share`. Lengths are those of the mean tangents in `frames`.
    pub(crate) fn new(space: Arc<HierarchicalSpace<D>>, frames: &[Frame<D>], start: Vec<[f64; D]>, share: f64) -> Self {
        let count = frames.len().max(1) as f64;
        let mean = |d: usize| frames.iter().map(|f| dot(&f.tangents[d], &f.tangents[d])).sum::<f64>() / count;
        Self { space, at: start, stiffness: std::array::from_fn(|d| share * mean(d)) }
    }

    pub(crate) fn stiffness(&self) -> [f64; D] {
        self.stiffness
    }

    /// `diag(k) (u − a)`, the gradient for the point of an index.
    pub(crate) fn pull(&self, index: usize, u: [f64; D]) -> [f64; D] {
        let way = self.space.way(self.at[index], u);
        std::array::from_fn(|d| self.stiffness[d] * way[d])
    }

    /// `(u − a)ᵀ diag(k) (u − a)`.
    pub(crate) fn squared(&self, index: usize, u: [f64; D]) -> f64 {
        let way = self.space.way(self.at[index], u);
        (0..D).map(|d| self.stiffness[d] * way[d] * way[d]).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use thb_core::{Kind, KnotVector};

    #[test]
    fn the_pull_is_the_gradient_of_half_the_energy() {
        let knots = KnotVector::uniform(2, 4).unwrap();
        let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap());
        let anchor = Anchor { space, at: vec![[0.2, 0.7]], stiffness: [3.0, 0.5] };
        let (u, h) = ([0.6, 0.1], 1e-6);
        let pull = anchor.pull(0, u);
        for d in 0..2 {
            let energy = |shift: f64| {
                let mut u = u;
                u[d] += shift;
                0.5 * anchor.squared(0, u)
            };
            let slope = (energy(h) - energy(-h)) / (2.0 * h);
            assert!((pull[d] - slope).abs() < 1e-6 * slope.abs(), "{pull:?} against {slope}");
        }
        assert_eq!(anchor.pull(0, [0.2, 0.7]), [0.0; 2]);
    }
}
