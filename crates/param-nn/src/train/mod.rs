//! Training on fresh clouds, one a step.

mod comparison;
mod data;
mod gridded;
mod optimizer;
mod pargcn;
mod schedule;
mod state;
mod validation;

use std::f64::consts::PI;
use std::sync::Arc;

use candle_core::{Device, Tensor, Var};
use rand::RngExt;

pub use self::comparison::{Comparison, ComparisonOptions, ComparisonTrainer};
pub use self::gridded::{GridScore, GridTrainOptions, GridTrainer, GridValidation};
pub use self::optimizer::Recipe;
pub use self::pargcn::{PargcnTrainOptions, PargcnTrainer};
use self::schedule::{Epochs, Plateau};
use self::state::{State, needed};
pub use self::validation::{Score, Validation};
use crate::archive::Archive;
use crate::bidgcn::cloud::Cloud;
use crate::bidgcn::layout::{Layout, Variant};
use crate::bidgcn::midpoints::with_midpoints;
use crate::bidgcn::op::{Network, PatchError};
use crate::bidgcn::{Bidgcn, Reading};
use crate::error::NnError;
use crate::graph::Neighbours;
use crate::slots::Slot;
use crate::synthetic::{ControlPoints, ScatteredSpec, stream};

/// Steps of linear warm-up of the rate.
const RATE_WARM_UP: f64 = 500.0;

/// The lowest rate, as a share of its peak.
const LAST_RATE: f64 = 0.01;

/// Share of the run at its end that has the lowest rate: what still falls there does not fall because the rate does.
const FLAT_SHARE: f64 = 0.2;

/// Share of the run over which the distance from the true parameters fades out of the loss. Without it the error of the
/// fit alone has a local minimum with mirrored interior parameters, in which training stays.
const SUPERVISED_SHARE: f64 = 0.08;

/// Interior points of the smallest and the largest cloud.
const SIZES: [f64; 2] = [100.0, 2000.0];

/// Share of the clouds of at most so many interior points that get midpoints: networks are asked about sparse clouds with and
/// without.
const DENSE_SHARE: f64 = 0.5;
const LARGEST_DENSE: usize = 500;

/// The published clouds of BIDGCN: how many, and their patches (Imperatore 2024, §4.3.4).
const PUBLISHED_CLOUDS: u64 = 100_000;
const PUBLISHED: ScatteredSpec =
    ScatteredSpec { control_points: ControlPoints::Jittered, degree: 2, interior: 1000, noise: 0.0 };

/// Streams of random numbers: steps count from 0 on, the initial weights stand apart.
const WEIGHT_STREAM: u64 = u64::MAX;

/// What to train.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrainOptions {
    /// The network or its ablation.
    pub variant: Variant,
    /// Whether points are turned into the frame of the boundary; without, the form as published.
    pub frame: bool,
    /// Which points are neighbours.
    pub neighbours: Neighbours,
    /// How weights move: [`Recipe::AdamW`] on fresh clouds of all kinds, or [`Recipe::Sgd`] on the published clouds.
    pub recipe: Recipe,
    /// Steps of the whole run.
    pub steps: u64,
    /// Largest learning rate.
    pub rate: f64,
    /// Seed of weights and clouds.
    pub seed: u64,
}

/// A training run.
#[derive(Debug)]
pub struct Trainer {
    options: TrainOptions,
    layout: Arc<Layout>,
    state: State,
    epochs: Epochs,
    plateau: Plateau,
}

/// What a step met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepReport {
    /// The step, from 0 on.
    pub step: u64,
    /// Mean squared error of the patch through the cloud.
    pub mse: f64,
    /// Learning rate.
    pub rate: f64,
    /// Length of the gradient.
    pub gradient: f64,
}

/// Weights and biases evenly distributed within ±1/√inputs; normalizations as the identity.
pub(crate) fn initial_weights(slots: &[Slot], seed: u64) -> Vec<f32> {
    let mut random = stream(seed, WEIGHT_STREAM);
    let mut theta = vec![0.0; slots.last().map_or(0, |slot| slot.range.end)];
    for slot in slots {
        let part = &mut theta[slot.range.clone()];
        match slot.fan_in {
            Some(inputs) => {
                let bound = 1.0 / (inputs as f32).sqrt();
                part.iter_mut().for_each(|x| *x = bound * (2.0 * random.random::<f32>() - 1.0));
            }
            None => part[..slot.shape[1]].fill(1.0),
        }
    }
    theta
}

/// The learning rate: a linear warm-up, then half a cosine down to a small share `last` of the peak, which it keeps.
fn cosine_rate(peak: f64, last: f64, step: u64, progress: f64) -> f64 {
    let falling = (progress / (1.0 - FLAT_SHARE)).min(1.0);
    let cosine = last + (1.0 - last) * 0.5 * (1.0 + (PI * falling).cos());
    peak * cosine * (((step + 1) as f64) / RATE_WARM_UP).min(1.0)
}

impl Trainer {
    /// A run from its start.
    pub fn new(options: TrainOptions) -> Self {
        let layout = Arc::new(Layout::new(options.variant));
        let state = State::new(initial_weights(layout.slots(), options.seed), options.recipe);
        let (epochs, plateau) = (Epochs::new(PUBLISHED_CLOUDS), Plateau::new(PUBLISHED_CLOUDS));
        Self { options, layout, state, epochs, plateau }
    }

    /// Steps done.
    pub fn step_count(&self) -> u64 {
        self.state.steps()
    }

    /// Options of the run.
    pub fn options(&self) -> &TrainOptions {
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

    /// One step on a cloud.
    ///
    /// # Errors
    /// [`NnError::Training`].
    pub fn step(&mut self) -> Result<StepReport, NnError> {
        if self.options.recipe.is_published() { self.published_step() } else { self.our_step() }
    }

    /// On one of the published clouds: the mean over points and coordinates of the squared error, in double precision.
    fn published_step(&mut self) -> Result<StepReport, NnError> {
        let step = self.state.steps();
        let item = self.epochs.item(self.options.seed, step);
        let cloud = Cloud::of_sample(&PUBLISHED.sample(&mut stream(self.options.seed, item))?);
        let input = Arc::new(cloud.input::<f64>(self.options.frame, self.options.neighbours));
        let differentiate = || -> candle_core::Result<(f64, Vec<f64>)> {
            let theta = Var::from_vec(self.state.double_weights(), self.state.theta.len(), &Device::Cpu)?;
            let logits = theta.as_tensor().apply_op1(Network::new(self.layout.clone(), input))?;
            let boundary_uv = Arc::new(cloud.boundary_uv().to_vec());
            let error = PatchError::new(Arc::new(cloud.xyz.clone()), boundary_uv, PUBLISHED.degree);
            let error = candle_nn::ops::sigmoid(&logits)?.apply_op1(error)?;
            let gradients = (&error / 3.0)?.backward()?;
            let gradient = gradients.get(&theta).ok_or_else(|| candle_core::Error::msg("no gradient"))?;
            Ok((error.to_scalar::<f64>()?, gradient.to_vec1()?))
        };
        let (mse, gradient) = differentiate().map_err(|e| NnError::Training { step, reason: e.to_string() })?;
        let report = self.state.advance(mse, &gradient, self.options.rate * self.plateau.factor())?;
        self.plateau.advance(step, mse);
        Ok(report)
    }

    /// On a fresh cloud.
    fn our_step(&mut self) -> Result<StepReport, NnError> {
        let step = self.state.steps();
        let progress = step as f64 / self.options.steps.max(1) as f64;
        let supervised = (1.0 - progress / SUPERVISED_SHARE).max(0.0);
        let mut random = stream(self.options.seed, step);
        let (mut cloud, degree) = data::draw(SIZES, &mut random)?;
        if cloud.interior <= LARGEST_DENSE && random.random::<f64>() < DENSE_SHARE {
            cloud = with_midpoints(&cloud);
        }
        let input = Arc::new(cloud.input::<f32>(self.options.frame, self.options.neighbours));
        let differentiate = || -> candle_core::Result<(f64, Vec<f32>)> {
            let theta = Var::from_vec(self.state.theta.clone(), self.state.theta.len(), &Device::Cpu)?;
            let logits = theta.as_tensor().apply_op1(Network::new(self.layout.clone(), input))?;
            let uv = candle_nn::ops::sigmoid(&logits)?;
            let boundary_uv = Arc::new(cloud.boundary_uv().to_vec());
            let error = uv.apply_op1(PatchError::new(Arc::new(cloud.xyz.clone()), boundary_uv, degree))?;
            let mut loss = error.clone();
            if supervised > 0.0 {
                let known: Vec<f32> = cloud.uv[..cloud.interior].iter().flatten().map(|&x| x as f32).collect();
                let known = Tensor::from_vec(known, (cloud.interior, 2), &Device::Cpu)?;
                let distance = (uv - known)?.sqr()?.sum_all()?;
                loss = (loss + (distance * (supervised / cloud.interior as f64))?)?;
            }
            let gradients = loss.backward()?;
            let gradient = gradients.get(&theta).ok_or_else(|| candle_core::Error::msg("no gradient"))?;
            Ok((f64::from(error.to_scalar::<f32>()?), gradient.to_vec1()?))
        };
        let (mse, gradient) = differentiate().map_err(|e| NnError::Training { step, reason: e.to_string() })?;
        let rate = cosine_rate(self.options.rate, LAST_RATE, step, progress);
        self.state.advance(mse, &gradient, rate)
    }

    /// The network with averaged weights, and notes on how it came about.
    pub fn network(&self, command: &str) -> Bidgcn {
        let TrainOptions { variant, frame, neighbours, recipe, steps, rate, seed } = self.options;
        let notes = self.state.notes([
            ("command", command.to_owned()),
            ("recipe", recipe.name().to_owned()),
            ("seed", seed.to_string()),
            ("rate", rate.to_string()),
            ("steps", steps.to_string()),
        ]);
        let (layout, theta) = (self.layout.clone(), self.state.average.clone());
        Bidgcn { layout, variant, frame, neighbours, theta, notes, reading: Reading::default() }
    }

    /// All that is needed to go on: a weights file with further tensors.
    pub fn checkpoint(&self, command: &str) -> Vec<u8> {
        let mut archive = self.network(command).to_archive();
        self.plateau.write(&mut archive);
        self.state.checkpoint(archive)
    }

    /// Goes on from a checkpoint, bit by bit as if never stopped.
    ///
    /// # Errors
    /// [`NnError::DamagedWeights`], [`NnError::OtherWeights`] if the file is no checkpoint.
    pub fn resume(bytes: &[u8]) -> Result<Self, NnError> {
        let archive = Archive::from_bytes(bytes)?;
        let network = Bidgcn::of_archive(archive.clone())?;
        let options = TrainOptions {
            variant: network.variant,
            frame: network.frame,
            neighbours: network.neighbours,
            recipe: Recipe::named(archive.metadata.get("recipe")),
            steps: needed(&archive, "steps")?,
            rate: needed(&archive, "rate")?,
            seed: needed(&archive, "seed")?,
        };
        let state = State::resume(&archive, network.theta, options.recipe)?;
        let plateau = Plateau::read(&archive, PUBLISHED_CLOUDS)?;
        Ok(Self { options, layout: network.layout, state, epochs: Epochs::new(PUBLISHED_CLOUDS), plateau })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OPTIONS: TrainOptions = TrainOptions {
        variant: Variant::Bidgcn,
        frame: true,
        neighbours: Neighbours::WithinRadius,
        recipe: Recipe::AdamW,
        steps: 1000,
        rate: 1e-3,
        seed: 3,
    };

    #[test]
    fn a_resumed_run_takes_the_same_steps() {
        for recipe in [Recipe::AdamW, Recipe::Sgd] {
            let mut trainer = Trainer::new(TrainOptions { recipe, ..OPTIONS });
            for _ in 0..2 {
                trainer.step().unwrap();
            }
            let mut resumed = Trainer::resume(&trainer.checkpoint("test")).unwrap();
            assert_eq!(resumed.options(), trainer.options());
            assert_eq!(trainer.step().unwrap(), resumed.step().unwrap());
            assert_eq!(trainer.checkpoint("test"), resumed.checkpoint("test"));
        }
    }

    #[test]
    fn published_steps_move_against_the_gradient_by_the_rate() {
        let mut trainer = Trainer::new(TrainOptions { frame: false, recipe: Recipe::Sgd, rate: 0.1, ..OPTIONS });
        let before = trainer.state.double_weights();
        let report = trainer.step().unwrap();
        let after = trainer.state.double_weights();
        let moved = before.iter().zip(&after).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
        assert!((moved / (0.1 * report.gradient) - 1.0).abs() < 1e-6, "{moved} {report:?}");
    }

    #[test]
    fn nearest_neighbours_are_trained_on_and_kept() {
        let mut trainer = Trainer::new(TrainOptions { neighbours: Neighbours::Nearest(16), ..OPTIONS });
        let within = Trainer::new(OPTIONS).step().unwrap();
        let report = trainer.step().unwrap();
        assert!(report.gradient > 0.0 && report.mse != within.mse, "{report:?}");
        let resumed = Trainer::resume(&trainer.checkpoint("test")).unwrap();
        assert_eq!(resumed.options(), trainer.options());
        let loaded = Bidgcn::load(&trainer.network("test").to_bytes()).unwrap();
        assert_eq!(loaded.neighbours(), Neighbours::Nearest(16));
    }

    #[test]
    fn a_weights_file_is_no_checkpoint() {
        let bytes = Trainer::new(OPTIONS).network("test").to_bytes();
        assert!(matches!(Trainer::resume(&bytes), Err(NnError::OtherWeights { .. })));
        assert_eq!(Bidgcn::load(&bytes).unwrap().weights(), 192_130);
    }

    #[test]
    fn training_brings_the_parameters_nearer() {
        let validation = Validation::new(1, 2).unwrap();
        let mut trainer = Trainer::new(TrainOptions { steps: 60, rate: 2e-2, ..OPTIONS });
        let error = |trainer: &Trainer| validation.scores(&trainer.network("test"))[0].parameter_error;
        let before = error(&trainer);
        for _ in 0..60 {
            trainer.step().unwrap();
        }
        let after = error(&trainer);
        assert!(after < 0.9 * before, "{after} after 60 steps, {before} before");
    }
}
