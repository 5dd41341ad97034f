//! Springs on the parameters.

use std::sync::Arc;

use fit_ls::SortedPoints;
use rayon::prelude::*;
use thb_core::{CellSpace, HierarchicalSpace};

use crate::JointOptions;
use crate::frame::Frame;
use crate::points::patch::dot;
use crate::terms::neighbour_weights::Rings;

/// Adds `½ Σ ω_i (u_i − a_i)ᵀ diag(k_i) (u_i − a_i)` to the objective of a step of the joint method: a weak spring from each parameter
/// to where it started, and a stronger one to where it would be had it moved as its neighbours have, put together in one.
///
/// Distances alone leave parameters free to slide along the surface where that costs nothing. They then open voids in
/// the parameter domain over which the surface swings away from the points, and slide past each other, which tears the map of the
/// points: the surface folds along the tear, at no distance from any of them. What the neighbours have moved is taken from
/// before the step, so that each parameter is still eliminated by itself.
#[derive(Clone, Debug)]
pub(crate) struct Anchor<const D: usize> {
    /// A space over the domain, for ways across a seam.
    space: Arc<HierarchicalSpace<D>>,
    /// The parameters at the start, by the index of the point.
    start: Vec<[f64; D]>,
    /// Stiffness of the springs to the start.
    to_start: [f64; D],
    /// Stiffness of those to the neighbours, as a share of that of distances.
    cohesion: f64,
    rings: Rings,
    springs: Vec<Spring<D>>,
}

/// A spring of one parameter: `a` and `k`.
#[derive(Clone, Copy, Debug)]
struct Spring<const D: usize> {
    at: [f64; D],
    stiffness: [f64; D],
}

/// Points of one parallel task.
const CHUNK: usize = 1024;

impl<const D: usize> Anchor<D> {
    /// Springs from `start`, by the index of the point, and along the sides of triangles. Stiffness is a share of that of distances: a
    /// move along the surface by some length costs as much as a distance of that length times the root of the share. Lengths
    /// are those of the mean tangents in `frames` for the springs to the start, of the tangents at each point for the others.
    pub(crate) fn new(
        space: Arc<HierarchicalSpace<D>>,
        points: &SortedPoints<D>,
        frames: &[Frame<D>],
        start: Vec<[f64; D]>,
        triangles: &[[u32; 3]],
        options: &JointOptions,
    ) -> Self {
        let counts = |at: usize| points.weights().is_none_or(|weights| weights[at] > 0.0);
        let counted: Vec<&Frame<D>> = frames.iter().enumerate().filter(|&(at, _)| counts(at)).map(|(_, f)| f).collect();
        let count = counted.len().max(1) as f64;
        let mean = |d: usize| counted.iter().map(|f| dot(&f.tangents[d], &f.tangents[d])).sum::<f64>() / count;
        let to_start = std::array::from_fn(|d| options.stiffness * mean(d));
        let springs = start.iter().map(|&at| Spring { at, stiffness: to_start }).collect();
        let rings = Rings::new(&[], points);
        let mut anchor = Self { space, start, to_start, cohesion: options.cohesion, rings, springs };
        anchor.join(triangles, points);
        anchor
    }

    /// Joins neighbours along the sides of triangles anew, where weights have become zero or positive.
    pub(crate) fn join(&mut self, triangles: &[[u32; 3]], points: &SortedPoints<D>) {
        let Self { start, to_start, springs, .. } = self;
        for (spring, &at) in springs.iter_mut().zip(&*start) {
            *spring = Spring { at, stiffness: *to_start };
        }
        self.rings = Rings::new(if self.cohesion > 0.0 { triangles } else { &[] }, points);
    }

    /// Hangs the springs to the neighbours where these are now; `frames` are of the points in their order.
    pub(crate) fn follow(&mut self, points: &SortedPoints<D>, frames: &[Frame<D>]) {
        let Self { space, start, to_start, cohesion, rings, springs } = self;
        if rings.is_empty() {
            return;
        }
        let places = points.places();
        let moved = |index: usize| space.way(start[index], points.parameter(places[index]));
        springs.par_iter_mut().enumerate().with_min_len(CHUNK).for_each(|(index, spring)| {
            let ring = rings.of(index);
            if ring.is_empty() {
                return;
            }
            let mut mean = [0.0; D];
            for &(neighbour, weight) in ring {
                let way = moved(neighbour as usize);
                (0..D).for_each(|d| mean[d] += weight * way[d]);
            }
            let tangents = &frames[places[index]].tangents;
            let to_ring: [f64; D] = std::array::from_fn(|d| *cohesion * dot(&tangents[d], &tangents[d]));
            spring.stiffness = std::array::from_fn(|d| to_start[d] + to_ring[d]);
            // Degenerate tangents pull nowhere.
            let share = |d: usize| if to_ring[d] > 0.0 { to_ring[d] / spring.stiffness[d] } else { 0.0 };
            spring.at = space.to_domain(std::array::from_fn(|d| start[index][d] + share(d) * mean[d]));
        });
    }

    pub(crate) fn stiffness(&self, index: usize) -> [f64; D] {
        self.springs[index].stiffness
    }

    /// `diag(k) (u − a)`, the gradient for the point of an index.
    pub(crate) fn pull(&self, index: usize, u: [f64; D]) -> [f64; D] {
        let Spring { at, stiffness } = self.springs[index];
        let way = self.space.way(at, u);
        std::array::from_fn(|d| stiffness[d] * way[d])
    }

    /// `(u − a)ᵀ diag(k) (u − a)`.
    pub(crate) fn squared(&self, index: usize, u: [f64; D]) -> f64 {
        let Spring { at, stiffness } = self.springs[index];
        let way = self.space.way(at, u);
        (0..D).map(|d| stiffness[d] * way[d] * way[d]).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array2, array};
    use thb_core::{Kind, KnotVector};

    fn space() -> Arc<HierarchicalSpace<2>> {
        let knots = KnotVector::uniform(2, 4).unwrap();
        Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap())
    }

    #[test]
    fn the_pull_is_the_gradient_of_half_the_energy() {
        let points = SortedPoints::new(array![[0.2, 0.7]].view(), Array2::zeros((1, 3)).view(), None).unwrap();
        let mut anchor = Anchor::new(space(), &points, &[], vec![[0.2, 0.7]], &[], &JointOptions::default());
        anchor.springs[0].stiffness = [3.0, 0.5];
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

    /// A point amid four others, all of which have moved by the same way, is pulled after them, the others hardly anywhere.
    #[test]
    fn parameters_are_drawn_to_where_their_neighbours_went() {
        let start = [[0.5, 0.5], [0.4, 0.5], [0.5, 0.4], [0.6, 0.5], [0.5, 0.6]];
        let way = [0.1, -0.05];
        let places = Array2::from_shape_fn((5, 3), |(i, k)| if k < 2 { start[i][k] } else { 0.0 });
        let parameters = Array2::from_shape_fn((5, 2), |(i, k)| start[i][k] + if i > 0 { way[k] } else { 0.0 });
        let points = SortedPoints::new(parameters.view(), places.view(), None).unwrap();
        let frame = Frame {
            residual: [0.0; 4],
            tangents: [[1.0, 0.0, 0.0, 0.0], [0.0, 2.0, 0.0, 0.0]],
            stiffness: [0.0; 2],
            pull: [0.0; 2],
        };
        let triangles = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]];
        let options = JointOptions { stiffness: 0.0, cohesion: 0.1, ..JointOptions::default() };
        let mut anchor = Anchor::new(space(), &points, &[frame; 5], start.to_vec(), &triangles, &options);
        anchor.follow(&points, &[frame; 5]);
        let pull = anchor.pull(0, start[0]);
        for d in 0..2 {
            let expected = -[0.1, 0.4][d] * way[d];
            assert!((pull[d] - expected).abs() < 1e-12, "{pull:?}");
        }
    }
}
