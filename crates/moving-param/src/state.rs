//! Where a fit is: a map, and a parameter for each point.

use fit_ls::SortedPoints;
use rayon::prelude::*;
use thb_core::{HierarchicalSpace, ParameterBox, SplineMap};

use crate::Error;
use crate::points::frame::{Frame, frames_into};

/// A map and the parameters of all points: what the energy of a term is a function of.
///
/// Arrays have an entry for each point, in the order of `points`. That order is the one at the start of the step: points are
/// sorted by cells anew only when a step is taken.
#[derive(Debug)]
pub struct State<'a, const D: usize, S = HierarchicalSpace<D>> {
    /// The map `s`.
    pub map: &'a SplineMap<D, S>,
    /// The points `p_i`, with the parameters that they had at the start of the step.
    pub points: &'a SortedPoints<D>,
    /// The place of each point among the sorted ones, by its original index.
    pub places: &'a [usize],
    /// The parameters `u_i`.
    pub parameters: &'a [[f64; D]],
    /// The distances `|s(u_i) − p_i|`.
    pub distances: &'a [f64],
    /// The weights `ω_i`, which may differ from those of `points`: some points get more for a few steps.
    pub weights: &'a [f64],
}

impl<const D: usize, S> Clone for State<'_, D, S> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<const D: usize, S> Copy for State<'_, D, S> {}

impl<const D: usize, S: ParameterBox<D>> State<'_, D, S> {
    /// Whether a point counts, by its place: those of weight 0 hold nothing.
    pub fn counts(&self, at: usize) -> bool {
        self.points.weights().is_none_or(|weights| weights[at] > 0.0)
    }
}

/// The state from which a step is taken, with the map around each point.
#[derive(Debug)]
pub struct StepStart<'a, const D: usize, S = HierarchicalSpace<D>> {
    /// The state. Its parameters are those of its points.
    pub state: State<'a, D, S>,
    /// Residuals and tangents of the map at the parameters, in the order of the points.
    pub frames: &'a [Frame<D>],
}

impl<const D: usize, S> Clone for StepStart<'_, D, S> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<const D: usize, S> Copy for StepStart<'_, D, S> {}

/// Points of one parallel task.
const CHUNK: usize = 4096;

/// The arrays of a state from which a step is taken.
#[derive(Clone, Debug, Default)]
pub(crate) struct Snapshot<const D: usize> {
    pub(crate) places: Vec<usize>,
    pub(crate) parameters: Vec<[f64; D]>,
    pub(crate) distances: Vec<f64>,
    pub(crate) weights: Vec<f64>,
    pub(crate) frames: Vec<Frame<D>>,
}

impl<const D: usize> Snapshot<D> {
    /// Those of a map at the parameters of points that are sorted by its cells; weights by the index of the point.
    pub(crate) fn new<S: ParameterBox<D>>(
        map: &SplineMap<D, S>,
        points: &SortedPoints<D>,
        weight: impl Fn(usize) -> f64,
    ) -> Result<Self, Error> {
        let mut new = Self::default();
        new.take(map, points, weight)?;
        Ok(new)
    }

    /// The same, in the arrays of another state.
    pub(crate) fn take<S: ParameterBox<D>>(
        &mut self,
        map: &SplineMap<D, S>,
        points: &SortedPoints<D>,
        weight: impl Fn(usize) -> f64,
    ) -> Result<(), Error> {
        let Self { places, parameters, distances, weights, frames } = self;
        frames_into(map, points, frames)?;
        places.resize(points.len(), 0);
        points.order().iter().enumerate().for_each(|(at, &index)| places[index as usize] = at);
        parameters.clear();
        parameters.extend((0..points.len()).map(|at| points.parameter(at)));
        frames.par_iter().with_min_len(CHUNK).map(Frame::distance).collect_into_vec(distances);
        weights.clear();
        weights.extend(points.order().iter().map(|&index| weight(index as usize)));
        Ok(())
    }

    /// The state that they belong to.
    pub(crate) fn start<'a, S>(&'a self, map: &'a SplineMap<D, S>, points: &'a SortedPoints<D>) -> StepStart<'a, D, S> {
        let Self { places, parameters, distances, weights, frames } = self;
        StepStart { state: State { map, points, places, parameters, distances, weights }, frames }
    }
}
