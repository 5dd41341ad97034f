//! Springs on the parameters.

use fit_ls::SortedPoints;
use rayon::prelude::*;
use thb_core::ParameterBox;

use crate::equations::{Linearization, Spring};
use crate::points::frame::Frame;
use crate::points::vector::dot;
use crate::state::{State, StepStart};
use crate::term::Term;
use crate::terms::neighbour_weights::NeighbourWeights;
use crate::{Error, JointOptions};

/// `½ Σ ω_i [(u_i − u_i⁰)ᵀ diag(k⁰) (u_i − u_i⁰) + (u_i − u_i⁰ − m_i)ᵀ diag(k_i) (u_i − u_i⁰ − m_i)]` but for a constant: a weak spring
/// from each parameter to where it started, `u_i⁰`, and a stronger one to where it would be had it moved as its neighbours have.
///
/// `k⁰_d = κ |S_d|²`, the mean over the points at the start, and `k_i,d = σ |S_d(u_i)|²` for the tangents `S_d`: a move along the surface by
/// some length costs as much as a distance of that length times the root of κ or σ. `m_i = Σ_j a_ij (u_j − u_j⁰)` is what the
/// neighbours have moved, fitted by an affine function ([`NeighbourWeights`]).
///
/// Held constant during a step: `m_i` and `k_i`, so that each parameter is still eliminated by itself. The two springs are put together in
/// one, `½ ω (u − a)ᵀ diag(k⁰ + k) (u − a)`, which is what the search for foot points looks at.
///
/// Distances alone leave parameters free to slide along the surface where that costs nothing. They then open voids in
/// the parameter domain over which the surface swings away from the points, and slide past each other, which tears the map of the
/// points: the surface folds along the tear, at no distance from any of them.
#[derive(Clone, Debug)]
pub(crate) struct Springs<const D: usize> {
    /// `u⁰`, by the index of the point.
    start: Vec<[f64; D]>,
    /// `k⁰`.
    to_start: [f64; D],
    /// σ.
    cohesion: f64,
    neighbours: NeighbourWeights,
    /// By the index of the point.
    springs: Vec<Spring<D>>,
}

/// Points of one parallel task.
const CHUNK: usize = 1024;

impl<const D: usize> Springs<D> {
    /// Springs from `start`, by the index of the point, with σ = [`JointOptions::cohesion`] along the sides of triangles, and
    /// κ = [`JointOptions::stiffness`]; `frames` are of the points in their order.
    pub(crate) fn new(
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
        let neighbours = NeighbourWeights::new(&[], points);
        let mut all = Self { start, to_start, cohesion: options.cohesion, neighbours, springs };
        all.join(triangles, points);
        all
    }

    /// Joins neighbours along the sides of triangles anew, where weights have become zero or positive.
    pub(crate) fn join(&mut self, triangles: &[[u32; 3]], points: &SortedPoints<D>) {
        let Self { start, to_start, springs, .. } = self;
        for (spring, &at) in springs.iter_mut().zip(&*start) {
            *spring = Spring { at, stiffness: *to_start };
        }
        self.neighbours = NeighbourWeights::new(if self.cohesion > 0.0 { triangles } else { &[] }, points);
    }
}

impl<const D: usize, S: ParameterBox<D>> Term<D, S> for Springs<D> {
    fn name(&self) -> &'static str {
        "springs"
    }

    fn freeze(&mut self, at: &StepStart<'_, D, S>) -> Result<(), Error> {
        let Self { start, to_start, cohesion, neighbours, springs } = self;
        if neighbours.is_empty() {
            return Ok(());
        }
        let (space, places, parameters) = (at.state.map.space(), at.state.places, at.state.parameters);
        let moved = |index: usize| space.way(start[index], parameters[places[index]]);
        springs.par_iter_mut().enumerate().with_min_len(CHUNK).for_each(|(index, spring)| {
            let around = neighbours.of(index);
            if around.is_empty() {
                return;
            }
            let mut mean = [0.0; D];
            for &(neighbour, weight) in around {
                let way = moved(neighbour as usize);
                (0..D).for_each(|d| mean[d] += weight * way[d]);
            }
            let tangents = &at.frames[places[index]].tangents;
            let to_neighbours: [f64; D] = std::array::from_fn(|d| *cohesion * dot(&tangents[d], &tangents[d]));
            spring.stiffness = std::array::from_fn(|d| to_start[d] + to_neighbours[d]);
            // Degenerate tangents pull nowhere.
            let share = |d: usize| if to_neighbours[d] > 0.0 { to_neighbours[d] / spring.stiffness[d] } else { 0.0 };
            spring.at = space.to_domain(std::array::from_fn(|d| start[index][d] + share(d) * mean[d]));
        });
        Ok(())
    }

    fn energy(&self, at: &State<'_, D, S>) -> Result<f64, Error> {
        let (space, order) = (at.map.space().as_ref(), at.points.order());
        let energy =
            |place: usize| at.weights[place] * self.springs[order[place] as usize].squared(space, at.parameters[place]);
        Ok(0.5 * (0..order.len()).map(energy).sum::<f64>())
    }

    fn linearize(&self, at: &StepStart<'_, D, S>, _: &[u32], into: &mut Linearization<'_, D>) -> Result<(), Error> {
        let State { map, points, parameters, .. } = at.state;
        let of_points = into.points.par_iter_mut().zip(points.order()).zip(parameters).with_min_len(CHUNK);
        of_points.for_each(|((block, &index), &u)| {
            block.add_spring(&self.springs[index as usize], map.space().as_ref(), u);
        });
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::state::Snapshot;
    use ndarray::Array2;
    use thb_core::{HierarchicalSpace, Kind, KnotVector, SplineMap};

    /// A point amid four others, all of which have moved by the same way, is pulled after them, the others hardly anywhere.
    #[test]
    fn parameters_are_drawn_to_where_their_neighbours_went() {
        let knots = KnotVector::uniform(2, 4).unwrap();
        let sites = knots.greville();
        let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap());
        // Tangents of lengths 1 and 2.
        let coefficients = Array2::from_shape_fn((36, 3), |(j, k)| [sites[j % 6], 2.0 * sites[j / 6], 0.0][k]);
        let map = SplineMap::new(space.clone(), coefficients).unwrap();
        let start = [[0.5, 0.5], [0.4, 0.5], [0.5, 0.4], [0.6, 0.5], [0.5, 0.6]];
        let way = [0.1, -0.05];
        let places = Array2::from_shape_fn((5, 3), |(i, k)| if k < 2 { start[i][k] } else { 0.0 });
        let parameters = Array2::from_shape_fn((5, 2), |(i, k)| start[i][k] + if i > 0 { way[k] } else { 0.0 });
        let mut points = SortedPoints::new(parameters.view(), places.view(), None).unwrap();
        points.sort_refined(&space, None).unwrap();
        let triangles = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]];
        let options = JointOptions { stiffness: 0.0, cohesion: 0.1, ..JointOptions::default() };
        let snapshot = Snapshot::new(&map, &points, |_| 1.0).unwrap();
        let mut springs = Springs::new(&points, &snapshot.frames, start.to_vec(), &triangles, &options);
        springs.freeze(&snapshot.start(&map, &points)).unwrap();
        let pull = springs.springs[0].pull(space.as_ref(), start[0]);
        for d in 0..2 {
            let expected = -[0.1, 0.4][d] * way[d];
            assert!((pull[d] - expected).abs() < 1e-12, "{pull:?}");
        }
    }
}
