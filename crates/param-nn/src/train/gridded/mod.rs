//! Training of PARCNN on fresh batches.

mod data;
mod validation;

use std::sync::Arc;

pub use self::validation::{GridScore, GridValidation};
use super::optimizer::Recipe;
use super::state::{State, needed, note};
use super::{StepReport, cosine_rate};
use crate::archive::Archive;
use crate::error::NnError;
use crate::parcnn::layout::{Architecture, Form, Layout};
use crate::parcnn::model::Parcnn;
use crate::parcnn::network::Keep;
use crate::parcnn::pass::{Pass, Task};
use crate::synthetic::stream;

/// Passes of the feedback form in a step; each is trained for itself, from the states that the one before left.
const PASSES: usize = 3;

/// The loss of an item is this power of its mean squared error: between the logarithm, which looks at easy items, and the
/// error itself, which looks at the worst ones only.
pub(super) const POWER: f64 = 0.6;

/// Keeps the loss differentiable at exact fits; far below the errors that are of interest.
pub(super) const FLOOR: f64 = 1e-9;

/// Share of the run over which the distance from the true parameters fades out of the loss. It leads out of local minima
/// of the error; the weight makes both parts of the loss alike at classical parameters.
const SUPERVISED_SHARE: f64 = 0.3;
const SUPERVISED_WEIGHT: f64 = 1.0;

/// The lowest rate, as a share of its peak; at a hundredth errors still fell by 3 to 5 % over the last fifth of a run.
const LAST_RATE: f64 = 1e-3;

/// What to train.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridTrainOptions {
    /// The network.
    pub architecture: Architecture,
    /// Steps of the whole run.
    pub steps: u64,
    /// Sequences or grids a step.
    pub batch: usize,
    /// Whether all sequences have the fewest points that tell a curve of their degree, 2d + 1, as for Table 4.1.
    pub shortest: bool,
    /// How weights move; [`Recipe::RmsProp`] is for the published form alone, on published items.
    pub recipe: Recipe,
    /// Largest learning rate.
    pub rate: f64,
    /// Seed of weights and batches.
    pub seed: u64,
}

/// A training run.
#[derive(Debug)]
pub struct GridTrainer {
    options: GridTrainOptions,
    layout: Arc<Layout>,
    state: State,
}

/// The loss of a state and its derivatives by the parameters, for an item of a batch.
fn loss(mse: f64, by_uv: Vec<[f64; 2]>, state: &[[f64; 2]], truth: Option<&[[f64; 2]]>, weight: f64) -> Vec<[f64; 2]> {
    let factor = POWER * (mse + FLOOR).powf(POWER - 1.0);
    let mut given: Vec<[f64; 2]> = by_uv.into_iter().map(|g| g.map(|x| factor * x)).collect();
    if let Some(truth) = truth.filter(|_| weight > 0.0) {
        let scale = 2.0 * weight / truth.len() as f64;
        for ((g, uv), t) in given.iter_mut().zip(state).zip(truth) {
            (0..2).for_each(|k| g[k] += scale * (uv[k] - t[k]));
        }
    }
    given
}

impl GridTrainer {
    /// A run from its start.
    pub fn new(options: GridTrainOptions) -> Self {
        let layout = Arc::new(Layout::new(options.architecture));
        let weights = match options.recipe.is_published() {
            true => layout.default_weights(options.seed),
            false => layout.initial_weights(options.seed),
        };
        let state = State::new(weights, options.recipe);
        Self { options, layout, state }
    }

    /// Steps done.
    pub fn step_count(&self) -> u64 {
        self.state.steps()
    }

    /// Options of the run.
    pub fn options(&self) -> &GridTrainOptions {
        &self.options
    }

    /// Makes the run shorter or longer: the rate goes on along the curve of the new length.
    pub fn set_steps(&mut self, steps: u64) {
        self.options.steps = steps;
    }

    /// Share of the steps so far whose gradient was shortened.
    pub fn clipped_share(&self) -> f64 {
        self.state.clipped_share()
    }

    /// One step on a fresh batch.
    ///
    /// # Errors
    /// [`NnError::Training`].
    pub fn step(&mut self) -> Result<StepReport, NnError> {
        match self.options.architecture.form {
            Form::Published { degree, .. } if self.options.recipe.is_published() => self.published_step(degree),
            _ => self.our_step(),
        }
    }

    /// The mean over a batch of mean squared errors, at a constant rate.
    fn published_step(&mut self, degree: usize) -> Result<StepReport, NnError> {
        let GridTrainOptions { architecture, batch, seed, shortest, rate, .. } = self.options;
        let mut random = stream(seed, self.state.steps());
        let tasks = data::draw_published(architecture, degree, (batch, shortest), &mut random)?;
        let pass = Pass::<f32>::new(&self.layout, &self.state.theta, &tasks, &[], Keep::Everything);
        let by_uv: Vec<Vec<[f64; 2]>> = pass.states.iter().map(|s| s.fit.gradient()).collect();
        let mse = pass.states.iter().map(|s| s.fit.mse).sum::<f64>() / batch as f64;
        let mut gradient = pass.backward(&self.layout, &self.state.theta, &tasks, &by_uv);
        gradient.iter_mut().for_each(|g| *g /= batch as f32);
        self.state.advance(mse, &gradient, rate)
    }

    fn our_step(&mut self) -> Result<StepReport, NnError> {
        let step = self.state.steps();
        let progress = step as f64 / self.options.steps.max(1) as f64;
        let supervised = SUPERVISED_WEIGHT * (1.0 - progress / SUPERVISED_SHARE).max(0.0);
        let GridTrainOptions { architecture, batch, seed, shortest, .. } = self.options;
        let (tasks, truths): (Vec<Task>, Vec<_>) = data::draw(architecture, batch, shortest, &mut stream(seed, step))
            .into_iter()
            .map(|e| (e.task, e.truth))
            .unzip();
        let mut states: Vec<_> = tasks.iter().map(Task::classical_state).collect();
        let passes = if matches!(architecture.form, Form::Feedback { .. }) { PASSES } else { 1 };
        let mut gradient = vec![0.0f32; self.state.theta.len()];
        let mut mse = 0.0;
        for _ in 0..passes {
            let pass = Pass::<f32>::new(&self.layout, &self.state.theta, &tasks, &states, Keep::Everything);
            let given: Vec<Vec<[f64; 2]>> = pass
                .states
                .iter()
                .zip(&truths)
                .map(|(s, truth)| loss(s.fit.mse, s.fit.gradient(), &s.uv, truth.as_deref(), supervised))
                .collect();
            let part = pass.backward(&self.layout, &self.state.theta, &tasks, &given);
            gradient.iter_mut().zip(part).for_each(|(g, p)| *g += p / batch as f32);
            states = pass.states;
            mse = states.iter().map(|s| s.fit.mse).sum::<f64>() / batch as f64;
        }
        self.state.advance(mse, &gradient, cosine_rate(self.options.rate, LAST_RATE, step, progress))
    }

    /// The network with averaged weights, and notes on how it came about.
    pub fn network(&self, command: &str) -> Parcnn {
        let GridTrainOptions { steps, batch, shortest, recipe, rate, seed, .. } = self.options;
        let notes = self.state.notes([
            ("command", command.to_owned()),
            ("seed", seed.to_string()),
            ("rate", rate.to_string()),
            ("batch", batch.to_string()),
            ("shortest", shortest.to_string()),
            ("recipe", recipe.name().to_owned()),
            ("steps", steps.to_string()),
        ]);
        Parcnn { layout: self.layout.clone(), theta: self.state.average.clone(), notes }
    }

    /// All that is needed to go on: a weights file with further tensors.
    pub fn checkpoint(&self, command: &str) -> Vec<u8> {
        self.state.checkpoint(self.network(command).to_archive())
    }

    /// Goes on from a checkpoint, bit by bit as if never stopped.
    ///
    /// # Errors
    /// [`NnError::DamagedWeights`], [`NnError::OtherWeights`] if the file is no checkpoint.
    pub fn resume(bytes: &[u8]) -> Result<Self, NnError> {
        let archive = Archive::from_bytes(bytes)?;
        let network = Parcnn::of_archive(archive.clone())?;
        let options = GridTrainOptions {
            architecture: network.architecture(),
            steps: needed(&archive, "steps")?,
            batch: needed(&archive, "batch")?,
            shortest: note(&archive, "shortest").unwrap_or(false),
            recipe: Recipe::named(archive.metadata.get("recipe")),
            rate: needed(&archive, "rate")?,
            seed: needed(&archive, "seed")?,
        };
        let state = State::resume(&archive, network.theta, options.recipe)?;
        Ok(Self { options, layout: network.layout, state })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parcnn::layout::SHIPPED_FORM;

    fn options(dimension: usize, directions: usize) -> GridTrainOptions {
        let architecture = Architecture { dimension, directions, form: SHIPPED_FORM };
        GridTrainOptions {
            architecture,
            steps: 200,
            batch: 4,
            shortest: false,
            recipe: Recipe::AdamW,
            rate: 1e-3,
            seed: 3,
        }
    }

    #[test]
    fn a_resumed_run_takes_the_same_steps() {
        for directions in [1, 2] {
            let mut trainer = GridTrainer::new(options(3, directions));
            trainer.step().unwrap();
            let mut resumed = GridTrainer::resume(&trainer.checkpoint("test")).unwrap();
            assert_eq!(trainer.step().unwrap(), resumed.step().unwrap());
            assert_eq!(trainer.checkpoint("test"), resumed.checkpoint("test"));
        }
    }

    #[test]
    fn the_published_recipe_lowers_the_error_and_is_gone_on_with() {
        for directions in [1, 2] {
            let form = Form::Published { degree: 2, blocks: 2, width: 20 };
            let architecture = Architecture { dimension: 3, directions, form };
            let mut trainer = GridTrainer::new(GridTrainOptions {
                architecture,
                recipe: Recipe::RmsProp,
                shortest: true,
                batch: 16,
                rate: 1e-3,
                ..options(3, directions)
            });
            let validation = GridValidation::published(architecture, 2, true, 5, 10).unwrap();
            let error = |trainer: &GridTrainer| validation.scores(&trainer.network("test"))[0].mse;
            let before = error(&trainer);
            for _ in 0..200 {
                trainer.step().unwrap();
            }
            let after = error(&trainer);
            assert!(after < 0.8 * before, "{directions}: {after} after 200 steps, {before} before");
            let mut resumed = GridTrainer::resume(&trainer.checkpoint("test")).unwrap();
            assert_eq!(resumed.step().unwrap(), trainer.step().unwrap());
            assert_eq!(resumed.checkpoint("test"), trainer.checkpoint("test"));
        }
    }

    #[test]
    fn training_beats_classical_parameters() {
        let options = options(2, 1);
        let validation = GridValidation::new(options.architecture, 1, 6).unwrap();
        let mut trainer = GridTrainer::new(options);
        for _ in 0..options.steps {
            trainer.step().unwrap();
        }
        for score in validation.scores(&trainer.network("test")) {
            assert!(score.mse < 0.7 * score.standard, "{score:?}");
        }
    }
}
