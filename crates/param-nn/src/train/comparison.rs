//! Training of the networks that PARCNN is compared with.

use candle_core::{D, Device, Tensor, Var};
use candle_nn::ops::softmax;
use ndarray::{Array1, Array2, ArrayView2};
use rand::RngExt;

use super::gridded::{FLOOR, GridScore, GridValidation, POWER};
use super::optimizer::Recipe;
use super::state::{State, needed};
use super::{LAST_RATE, StepReport, cosine_rate};
use crate::archive::Archive;
use crate::error::NnError;
use crate::gridded::scale_to_unit_box;
use crate::parcnn::SplineSpace;
use crate::parcnn::comparison::{ComparisonNetwork, SequenceError, edges, merge_windows, random_tasks};
use crate::parcnn::fit::GridFit;
use crate::parcnn::grid::Grid;
use crate::parcnn::layout::{Architecture, Form};
use crate::parcnn::pass::Task;
use crate::synthetic::stream;

/// Share of what the transformer computes that is dropped in training (Imperatore 2024, §4.1.5); ours drops nothing.
const DROPOUT: f64 = 0.1;

/// Streams of the dropped, counted down from here: sequences count from 0 on, initial weights have the last one.
const DROPOUT_STREAM: u64 = u64::MAX - 1;

/// Seed of the reference of [`Comparison::scores`].
const REFERENCE_SEED: u64 = 1;

/// Random sequences that batch normalization takes its statistics from.
const REFERENCE: usize = 64;

/// Sequences as the compared networks read them: what [`GridValidation::published`] is asked for.
const PLANE_SEQUENCES: Architecture =
    Architecture { dimension: 2, directions: 1, form: Form::Published { degree: 2, blocks: 6, width: 30 } };

/// What to train.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ComparisonOptions {
    /// The architecture.
    pub network: ComparisonNetwork,
    /// Degree of the curves.
    pub degree: usize,
    /// Steps of the whole run.
    pub steps: u64,
    /// Sequences of 2d + 1 points a step.
    pub batch: usize,
    /// How weights move: ours, or [`Recipe::RmsProp`] on the mean squared error.
    pub recipe: Recipe,
    /// Largest learning rate.
    pub rate: f64,
    /// Seed of weights and sequences.
    pub seed: u64,
}

/// A training run of [`Comparison`].
#[derive(Debug)]
pub struct ComparisonTrainer {
    options: ComparisonOptions,
    state: State,
}

/// A trained network for plane sequences on curves of one degree.
#[derive(Clone, Debug)]
pub struct Comparison {
    network: ComparisonNetwork,
    degree: usize,
    theta: Vec<f32>,
}

impl ComparisonTrainer {
    /// A run from its start.
    pub fn new(options: ComparisonOptions) -> Self {
        let theta = options.network.initial_weights(options.degree, options.seed);
        Self { options, state: State::new(theta, options.recipe) }
    }

    /// Steps done.
    pub fn step_count(&self) -> u64 {
        self.state.steps()
    }

    /// Options of the run.
    pub fn options(&self) -> &ComparisonOptions {
        &self.options
    }

    /// Makes the run shorter or longer.
    pub fn set_steps(&mut self, steps: u64) {
        self.options.steps = steps;
    }

    /// Share of the steps so far whose gradient was shortened.
    pub fn clipped_share(&self) -> f64 {
        self.state.clipped_share()
    }

    /// Fixed sequences of 2d + 1 points to judge the network on.
    ///
    /// # Errors
    /// Those of the generator.
    pub fn validation(&self, seed: u64, count: u64) -> Result<GridValidation, NnError> {
        GridValidation::published(PLANE_SEQUENCES, self.options.degree, true, seed, count)
    }

    /// One step on fresh sequences.
    ///
    /// # Errors
    /// [`NnError::Training`].
    pub fn step(&mut self) -> Result<StepReport, NnError> {
        let ComparisonOptions { network, degree, batch, recipe, seed, .. } = self.options;
        let step = self.state.steps();
        let tasks = random_tasks(degree, batch, seed, step)?;
        let (power, floor) = if recipe.is_published() { (1.0, 0.0) } else { (POWER, FLOOR) };
        let mut random = stream(seed, DROPOUT_STREAM - step);
        let mut dropout = |x: Tensor| -> candle_core::Result<Tensor> {
            if !recipe.is_published() {
                return Ok(x);
            }
            let kept = (1.0 / (1.0 - DROPOUT)) as f32;
            let mask = (0..x.elem_count()).map(|_| if random.random::<f64>() < DROPOUT { 0.0 } else { kept });
            let mask = Tensor::from_vec(mask.collect::<Vec<f32>>(), x.shape(), &Device::Cpu)?;
            x * mask
        };
        let mut differentiate = || -> candle_core::Result<(f64, Vec<f32>)> {
            let var = Var::from_vec(self.state.theta.clone(), self.state.theta.len(), &Device::Cpu)?;
            let logits = network.logits_in_training(degree, var.as_tensor(), &edges(&tasks)?, &mut dropout)?;
            let loss = softmax(&logits, D::Minus1)?.apply_op1(SequenceError::new(tasks.clone(), power, floor))?;
            let gradients = loss.backward()?;
            let gradient = gradients.get(&var).ok_or_else(|| candle_core::Error::msg("no gradient"))?;
            Ok((f64::from(loss.to_scalar::<f32>()?), gradient.to_vec1()?))
        };
        let (loss, gradient) = differentiate().map_err(|e| NnError::Training { step, reason: e.to_string() })?;
        let rate = match recipe.is_published() {
            true => self.options.rate,
            false => cosine_rate(self.options.rate, LAST_RATE, step, step as f64 / self.options.steps as f64),
        };
        self.state.advance(loss, &gradient, rate)
    }

    /// The network of the last step.
    pub fn network(&self) -> Comparison {
        let ComparisonOptions { network, degree, .. } = self.options;
        Comparison { network, degree, theta: self.state.theta.clone() }
    }

    /// All that is needed to go on.
    pub fn checkpoint(&self, command: &str) -> Vec<u8> {
        let ComparisonOptions { network, degree, steps, batch, recipe, rate, seed } = self.options;
        let notes = [
            ("command", command.to_owned()),
            ("architecture", network.name().to_owned()),
            ("degree", degree.to_string()),
            ("steps", steps.to_string()),
            ("batch", batch.to_string()),
            ("recipe", recipe.name().to_owned()),
            ("rate", rate.to_string()),
            ("seed", seed.to_string()),
        ];
        self.state.checkpoint(Archive { metadata: self.state.notes(notes), ..Archive::default() })
    }

    /// Goes on from a checkpoint, bit by bit as if never stopped.
    ///
    /// # Errors
    /// [`NnError::DamagedWeights`], [`NnError::OtherWeights`] if the file is no checkpoint of such a network.
    pub fn resume(bytes: &[u8]) -> Result<Self, NnError> {
        let archive = Archive::from_bytes(bytes)?;
        let name = needed::<String>(&archive, "architecture")?;
        let Some(network) = ComparisonNetwork::named(&name) else {
            return Err(NnError::OtherWeights { what: "architecture", found: name, required: "mlp, tra, res or ppn" });
        };
        let options = ComparisonOptions {
            network,
            degree: needed(&archive, "degree")?,
            steps: needed(&archive, "steps")?,
            batch: needed(&archive, "batch")?,
            recipe: Recipe::named(archive.metadata.get("recipe")),
            rate: needed(&archive, "rate")?,
            seed: needed(&archive, "seed")?,
        };
        let weights = vec![0.0; network.initial_weights(options.degree, 0).len()];
        let mut state = State::resume(&archive, weights, options.recipe)?;
        state.average.copy_from_slice(&state.theta);
        Ok(Self { options, state })
    }
}

impl Comparison {
    /// Trains on fresh sequences of 2d + 1 points, `batch` a step.
    ///
    /// # Errors
    /// [`NnError::Training`].
    pub fn train(
        network: ComparisonNetwork,
        degree: usize,
        (steps, batch): (u64, usize),
        rate: f64,
        seed: u64,
    ) -> Result<Self, NnError> {
        let options = ComparisonOptions { network, degree, steps, batch, recipe: Recipe::AdamW, rate, seed };
        let mut trainer = ComparisonTrainer::new(options);
        for _ in 0..steps {
            trainer.step()?;
        }
        Ok(trainer.network())
    }

    /// Scores on sequences of the length that it is trained on. One that it cannot map makes the mean no number.
    pub fn scores(&self, validation: &GridValidation) -> Vec<GridScore> {
        validation.scores_of(|task| {
            let points = Array2::from_shape_fn((task.grid.xyz.len(), 2), |(i, k)| task.grid.xyz[i][k]);
            let Ok(u) = self.predict(points.view(), REFERENCE_SEED) else { return f64::NAN };
            let uv: Vec<[f64; 2]> = u.iter().map(|&u| [u, 0.0]).collect();
            GridFit::new(task.spaces, &uv, &task.grid.xyz).mse
        })
    }

    /// Parameters of a plane sequence, shape `(m, 2)`, m ≥ 2d + 1; longer ones are cut into windows. Batch normalization takes the statistics of `reference`, random sequences of the kind trained on, and the
    /// windows.
    ///
    /// # Errors
    /// [`NnError::WrongShape`], [`NnError::Training`] if candle fails.
    pub fn predict(&self, points: ArrayView2<'_, f64>, reference: u64) -> Result<Array1<f64>, NnError> {
        let width = 2 * self.degree + 1;
        if points.nrows() < width || points.ncols() != 2 {
            return Err(NnError::WrongShape { what: "points", given: points.dim().into(), required: [width, 2] });
        }
        let xyz: Vec<[f64; 3]> = points.rows().into_iter().map(|p| [p[0], p[1], 0.0]).collect();
        let space = SplineSpace::polynomials(self.degree);
        let task = |window: &[[f64; 3]]| {
            // As large as what the network was trained on.
            let mut xyz = window.to_vec();
            scale_to_unit_box(&mut xyz);
            Task::new(Grid { xyz, size: [width, 1], dimension: 2 }, space)
        };
        let mut tasks: Vec<Task> = xyz.windows(width).map(task).collect();
        let count = tasks.len();
        if self.network == ComparisonNetwork::Residual {
            tasks.extend(random_tasks(self.degree, REFERENCE, reference, 0)?);
        }
        let run = || -> candle_core::Result<Vec<Vec<f32>>> {
            let theta = Tensor::from_slice(&self.theta, self.theta.len(), &Device::Cpu)?;
            softmax(&self.network.logits(self.degree, &theta, &edges(&tasks)?)?, D::Minus1)?.to_vec2()
        };
        let steps = run().map_err(|e| NnError::Training { step: 0, reason: e.to_string() })?;
        let windows: Vec<Vec<f64>> =
            steps[..count].iter().map(|row| row.iter().map(|&s| f64::from(s)).collect()).collect();
        let grid = Grid { xyz, size: [points.nrows(), 1], dimension: 2 };
        Ok(grid.parameters(&[merge_windows(&windows)]).iter().map(|uv| uv[0]).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gridded::{GriddedSpec, Shape};

    #[test]
    fn a_published_run_is_gone_on_with_and_lowers_the_error() {
        for network in [ComparisonNetwork::Mlp, ComparisonNetwork::Residual, ComparisonNetwork::Transformer] {
            let options = ComparisonOptions {
                network,
                degree: 2,
                steps: 60,
                batch: 8,
                recipe: Recipe::RmsProp,
                rate: 1e-4,
                seed: 2,
            };
            let mut trainer = ComparisonTrainer::new(options);
            let validation = GridValidation::published(PLANE_SEQUENCES, 2, true, 3, 40).unwrap();
            let error = |trainer: &ComparisonTrainer| trainer.network().scores(&validation)[0].mse;
            let before = error(&trainer);
            // Two kinds of words at most come out of the transformer, see there: nothing to be lowered.
            for _ in 0..if network == ComparisonNetwork::Transformer { 2 } else { options.steps } {
                trainer.step().unwrap();
            }
            let after = error(&trainer);
            assert!(
                network == ComparisonNetwork::Transformer || after < 0.95 * before,
                "{network:?}: {before} {after}"
            );
            let mut resumed = ComparisonTrainer::resume(&trainer.checkpoint("test")).unwrap();
            assert_eq!(resumed.step().unwrap(), trainer.step().unwrap());
            assert_eq!(resumed.checkpoint("test"), trainer.checkpoint("test"));
        }
    }

    #[test]
    fn training_lowers_the_error_and_any_length_is_read() {
        let spec =
            |count| GriddedSpec { shape: Shape::Curve { degree: 2, dimension: 2 }, size: [count, 1], noise: 0.0 };
        let error = |network: &Comparison| -> f64 {
            (0..20)
                .map(|k| {
                    let points = spec(5).sample(&mut stream(9, k)).unwrap().points;
                    let u = network.predict(points.view(), 1).unwrap();
                    let uv: Vec<[f64; 2]> = u.iter().map(|&u| [u, 0.0]).collect();
                    let xyz: Vec<[f64; 3]> = points.rows().into_iter().map(|p| [p[0], p[1], 0.0]).collect();
                    let spaces = [SplineSpace::polynomials(2), crate::parcnn::CONSTANTS];
                    crate::parcnn::GridFit::new(spaces, &uv, &xyz).mse
                })
                .sum()
        };
        let train = |steps| Comparison::train(ComparisonNetwork::Mlp, 2, (steps, 16), 2e-3, 1).unwrap();
        let (before, after) = (train(0), train(400));
        assert!(error(&after) < 0.5 * error(&before), "{} {}", error(&after), error(&before));
        let long = spec(20).sample(&mut stream(9, 99)).unwrap().points;
        let u = after.predict(long.view(), 1).unwrap();
        assert!(u.len() == 20 && u[0] == 0.0 && u[19] == 1.0 && u.windows(2).into_iter().all(|w| w[0] <= w[1]));
    }
}
