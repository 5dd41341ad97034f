//! Weights in training, and how a run is kept and gone on with.

use std::collections::BTreeMap;
use std::str::FromStr;

use super::StepReport;
use super::optimizer::{Optimizer, Recipe};
use crate::archive::Archive;
use crate::error::NnError;

/// Steps over which weights are averaged; shorter at the start of a run.
const AVERAGE_HORIZON: f64 = 1000.0;

/// Weights, their running average, and the optimizer.
#[derive(Debug)]
pub(super) struct State {
    pub(super) theta: Vec<f32>,
    pub(super) average: Vec<f32>,
    optimizer: Optimizer,
}

impl State {
    /// The start of a run.
    pub(super) fn new(theta: Vec<f32>, recipe: Recipe) -> Self {
        Self { average: theta.clone(), optimizer: Optimizer::new(recipe, theta.len()), theta }
    }

    /// Steps done.
    pub(super) fn steps(&self) -> u64 {
        self.optimizer.steps
    }

    /// Weights with what single precision cuts off; only [`Recipe::Sgd`] keeps it.
    pub(super) fn double_weights(&self) -> Vec<f64> {
        let rest = &self.optimizer.second;
        self.theta.iter().zip(rest).map(|(&t, &r)| f64::from(t) + f64::from(r)).collect()
    }

    /// Share of the steps so far whose gradient was shortened.
    pub(super) fn clipped_share(&self) -> f64 {
        self.optimizer.clipped as f64 / self.optimizer.steps.max(1) as f64
    }

    /// Moves the weights against the gradient of a step with an error.
    ///
    /// # Errors
    /// [`NnError::Training`] if one of them is not finite.
    pub(super) fn advance<G>(&mut self, mse: f64, gradient: &[G], rate: f64) -> Result<StepReport, NnError>
    where
        G: Copy + Into<f64>,
    {
        let step = self.optimizer.steps;
        if !(mse.is_finite() && gradient.iter().all(|&g| g.into().is_finite())) {
            return Err(NnError::Training { step, reason: "loss or gradient is not finite; lower the rate".into() });
        }
        let norm = self.optimizer.step(&mut self.theta, gradient, rate);
        if self.optimizer.recipe.is_published() {
            self.average.copy_from_slice(&self.theta);
            return Ok(StepReport { step, mse, rate, gradient: norm });
        }
        let horizon = AVERAGE_HORIZON.min(1.0 + 0.1 * step as f64);
        let weight = (1.0 / horizon) as f32;
        self.average.iter_mut().zip(&self.theta).for_each(|(a, t)| *a += weight * (t - *a));
        Ok(StepReport { step, mse, rate, gradient: norm })
    }

    /// Notes on how the averaged weights came about, with further ones of the run.
    pub(super) fn notes<const N: usize>(&self, further: [(&str, String); N]) -> BTreeMap<String, String> {
        let all = further.into_iter().chain([("steps_done", self.optimizer.steps.to_string())]);
        all.map(|(name, value)| (name.to_owned(), value)).collect()
    }

    /// The bytes of a checkpoint: the archive of the averaged weights with further tensors.
    pub(super) fn checkpoint(&self, mut archive: Archive) -> Vec<u8> {
        for (name, values) in [
            ("train.weights", &self.theta),
            ("train.first_moment", &self.optimizer.first),
            ("train.second_moment", &self.optimizer.second),
        ] {
            archive.tensors.insert(name.into(), ([1, values.len()], values.clone()));
        }
        archive.metadata.insert("mean_norm".into(), self.optimizer.mean_norm.to_string());
        archive.metadata.insert("clipped".into(), self.optimizer.clipped.to_string());
        archive.to_bytes()
    }

    /// The state in a checkpoint, of which the averaged weights are known.
    ///
    /// # Errors
    /// [`NnError::OtherWeights`] if it is none.
    pub(super) fn resume(archive: &Archive, average: Vec<f32>, recipe: Recipe) -> Result<Self, NnError> {
        let tensor = |name: &str| {
            let found = archive.tensors.get(name).map(|(_, values)| values.clone());
            found.filter(|values| values.len() == average.len()).ok_or_else(|| missing(name))
        };
        let optimizer = Optimizer {
            recipe,
            first: tensor("train.first_moment")?,
            second: tensor("train.second_moment")?,
            steps: needed(archive, "steps_done")?,
            mean_norm: needed(archive, "mean_norm")?,
            clipped: needed(archive, "clipped")?,
        };
        Ok(Self { theta: tensor("train.weights")?, average, optimizer })
    }
}

/// A note of a checkpoint.
pub(super) fn note<T: FromStr>(archive: &Archive, name: &str) -> Option<T> {
    archive.metadata.get(name)?.parse().ok()
}

/// A note that every checkpoint has.
///
/// # Errors
/// [`NnError::OtherWeights`].
pub(super) fn needed<T: FromStr>(archive: &Archive, name: &str) -> Result<T, NnError> {
    note(archive, name).ok_or_else(|| missing(name))
}

fn missing(name: &str) -> NnError {
    NnError::OtherWeights {
        what: "no training state",
        found: name.to_owned(),
        required: "a checkpoint, not a weights file",
    }
}
