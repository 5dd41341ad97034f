//! Distances of the points.

use rayon::prelude::*;
use thb_core::ParameterBox;

use crate::Error;
use crate::equations::Linearization;
use crate::state::{State, StepStart};
use crate::term::Term;

/// `½ Σ ω_i |s(u_i) − p_i|²`. Nothing is held constant.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Data;

/// Points of one parallel task.
const CHUNK: usize = 1024;

/// `½ Σ ω d²`, in the order of the points.
pub(crate) fn half_squares(distances: &[f64], weights: &[f64]) -> f64 {
    0.5 * distances.iter().zip(weights).map(|(d, w)| w * d * d).sum::<f64>()
}

impl<const D: usize, S: ParameterBox<D>> Term<D, S> for Data {
    fn name(&self) -> &'static str {
        "distances"
    }

    fn energy(&self, at: &State<'_, D, S>) -> Result<f64, Error> {
        Ok(half_squares(at.distances, at.weights))
    }

    fn linearize(&self, at: &StepStart<'_, D, S>, _: &[u32], into: &mut Linearization<'_, D>) -> Result<(), Error> {
        let of_points = into.points.par_iter_mut().zip(at.frames).with_min_len(CHUNK);
        of_points.for_each(|(block, frame)| (block.residual, block.tangents) = (frame.residual, frame.tangents));
        Ok(())
    }
}
