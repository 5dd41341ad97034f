//! Training of PARGCN.

use std::sync::Arc;

use super::optimizer::Recipe;
use super::schedule::Epochs;
use super::state::{State, needed, note};
use super::{LAST_RATE, StepReport, cosine_rate, data, initial_weights};
use crate::archive::Archive;
use crate::bezier::BezierFit;
use crate::bidgcn::cloud::Cloud;
use crate::error::NnError;
use crate::pargcn::layout::Layout;
use crate::pargcn::model::Input;
use crate::pargcn::network::{backward, forward};
use crate::pargcn::solve::{softmax_backward, solve};
use crate::pargcn::{Pargcn, PargcnForm, PargcnOptions};
use crate::synthetic::{ControlPoints, ScatteredSpec, stream};

/// Interior points of the smallest and the largest cloud of the guided form.
const SIZES: [f64; 2] = [80.0, 500.0];

/// The published clouds and how many of them are trained on (Imperatore 2024, §4.2.6).
pub(super) const PUBLISHED: ScatteredSpec =
    ScatteredSpec { control_points: ControlPoints::Greville, degree: 2, interior: 200, noise: 0.0 };
const PUBLISHED_CLOUDS: u64 = 10_000;

/// The guided form is trained on the root of the mean squared error, so that clouds with large errors do not drown the
/// others; to the square a floor is added, far below what any parameters leave.
const FLOOR: f64 = 1e-8;

/// What to train.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PargcnTrainOptions {
    /// The form; the published one is trained as published: on the mean squared error of a fixed set of clouds, by Adam.
    pub form: PargcnForm,
    /// In place of the radius graph, so many nearest neighbours.
    pub nearest: Option<u16>,
    /// Steps of the whole run, one cloud each.
    pub steps: u64,
    /// Largest learning rate.
    pub rate: f64,
    /// Seed of weights and clouds.
    pub seed: u64,
}

impl PargcnTrainOptions {
    /// How clouds are mapped in training.
    fn mapping(&self) -> PargcnOptions {
        let radius = PargcnOptions::default();
        match self.nearest {
            None => radius,
            Some(count) => PargcnOptions { nearest: true, neighbours: usize::from(count), ..radius },
        }
    }

    fn recipe(&self) -> Recipe {
        match self.form {
            PargcnForm::Published => Recipe::Adam,
            PargcnForm::Guided => Recipe::AdamW,
        }
    }
}

/// A training run of [`Pargcn`].
#[derive(Debug)]
pub struct PargcnTrainer {
    options: PargcnTrainOptions,
    layout: Arc<Layout>,
    state: State,
    epochs: Epochs,
}

impl PargcnTrainer {
    /// A run from its start. A guided network starts from the weights that it is guided by.
    pub fn new(options: PargcnTrainOptions) -> Self {
        let layout = Layout::new();
        let mut theta = initial_weights(layout.slots(), options.seed);
        if options.form == PargcnForm::Guided {
            theta[layout.last.clone()].fill(0.0);
        }
        let state = State::new(theta, options.recipe());
        Self { options, layout: Arc::new(layout), state, epochs: Epochs::new(PUBLISHED_CLOUDS) }
    }

    /// Steps done.
    pub fn step_count(&self) -> u64 {
        self.state.steps()
    }

    /// Options of the run.
    pub fn options(&self) -> &PargcnTrainOptions {
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
    /// [`NnError::Training`]; those of the map.
    pub fn step(&mut self) -> Result<StepReport, NnError> {
        let step = self.state.steps();
        let (cloud, degree) = self.draw(step)?;
        let (mse, gradient) =
            loss_gradient(&self.layout, &self.state.theta, self.options.form, &self.options.mapping(), &cloud, degree)?;
        let progress = step as f64 / self.options.steps.max(1) as f64;
        let rate = match self.options.form {
            PargcnForm::Published => self.options.rate,
            PargcnForm::Guided => cosine_rate(self.options.rate, LAST_RATE, step, progress),
        };
        self.state.advance(mse, &gradient, rate)
    }

    fn draw(&mut self, step: u64) -> Result<(Cloud, usize), NnError> {
        let seed = self.options.seed;
        if self.options.form == PargcnForm::Guided {
            return data::draw(SIZES, &mut stream(seed, step));
        }
        let sample = PUBLISHED.sample(&mut stream(seed, self.epochs.item(seed, step)))?;
        Ok((Cloud::of_sample(&sample), PUBLISHED.degree))
    }

    /// The network with averaged weights, and notes on how it came about.
    pub fn network(&self, command: &str) -> Pargcn {
        let PargcnTrainOptions { form, nearest, steps, rate, seed } = self.options;
        let mut notes = self.state.notes([
            ("command", command.to_owned()),
            ("seed", seed.to_string()),
            ("rate", rate.to_string()),
            ("steps", steps.to_string()),
        ]);
        if let Some(count) = nearest {
            notes.insert("nearest".into(), count.to_string());
        }
        Pargcn { layout: self.layout.clone(), form, theta: self.state.average.clone(), notes }
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
        let network = Pargcn::of_archive(archive.clone())?;
        let options = PargcnTrainOptions {
            form: network.form,
            nearest: note(&archive, "nearest"),
            steps: needed(&archive, "steps")?,
            rate: needed(&archive, "rate")?,
            seed: needed(&archive, "seed")?,
        };
        let state = State::resume(&archive, network.theta, options.recipe())?;
        Ok(Self { options, layout: network.layout, state, epochs: Epochs::new(PUBLISHED_CLOUDS) })
    }
}

/// Mean squared error of the patch through a cloud, and the gradient of the loss by all weights: the chain of network,
/// softmax, linear system and fit, each by its closed form.
fn loss_gradient<T: crate::real::Real>(
    layout: &Layout,
    theta: &[T],
    form: PargcnForm,
    options: &PargcnOptions,
    cloud: &Cloud,
    degree: usize,
) -> Result<(f64, Vec<T>), NnError> {
    let mut input = Input::<T>::new(cloud, form, options)?;
    let (logits, tape) = forward(layout, theta, &input.graph, std::mem::take(&mut input.features), true);
    let weights = input.weights(&logits);
    let mut mse = 0.0;
    let by_parameters = |uv: &[[f64; 2]]| {
        let fit = BezierFit::solve(uv, &cloud.xyz, degree);
        mse = fit.mse;
        let factor = match form {
            PargcnForm::Published => 1.0,
            PargcnForm::Guided => 0.5 / (mse + FLOOR).sqrt(),
        };
        let mut gradient = fit.gradient(uv, &cloud.xyz);
        gradient.truncate(cloud.interior);
        gradient.iter_mut().for_each(|g| *g = g.map(|x| factor * x));
        gradient
    };
    let (_, by_weights) = solve(&input.graph, &weights, cloud.boundary_uv(), by_parameters)?;
    let by_logits = softmax_backward(&input.graph, &weights, &by_weights);
    let by_logits: Vec<T> = by_logits.into_iter().map(|x| T::from_f64(input.gain * x)).collect();
    let gradient = tape.map_or_else(Vec::new, |tape| backward(layout, theta, &input.graph, &tape, &by_logits));
    Ok((mse, gradient))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::Validation;
    use rand::RngExt;

    const OPTIONS: PargcnTrainOptions =
        PargcnTrainOptions { form: PargcnForm::Guided, nearest: None, steps: 1000, rate: 2e-3, seed: 3 };

    /// Network, softmax, linear system and fit in double precision, in every tensor.
    #[test]
    fn the_gradient_of_the_loss_agrees_with_differences() {
        let layout = Layout::new();
        let spec = ScatteredSpec { control_points: ControlPoints::Jittered, degree: 2, interior: 120, noise: 0.0 };
        let cloud = Cloud::of_sample(&spec.sample(&mut stream(6, 0)).unwrap());
        let options = PargcnOptions { radius: Some(0.1), neighbours: 8, ..PargcnOptions::default() };
        let input = Input::<f64>::new(&cloud, PargcnForm::Guided, &options).unwrap();
        assert!(input.gain < 1.0, "{}", input.gain);
        for form in [PargcnForm::Published, PargcnForm::Guided] {
            let mut theta: Vec<f64> = initial_weights(layout.slots(), 2).into_iter().map(f64::from).collect();
            let (_, gradient) = loss_gradient(&layout, &theta, form, &options, &cloud, 2).unwrap();
            let loss = |theta: &[f64]| {
                let mse = loss_gradient(&layout, theta, form, &options, &cloud, 2).unwrap().0;
                if form == PargcnForm::Guided { (mse + FLOOR).sqrt() } else { mse }
            };
            let largest = gradient.iter().fold(0.0f64, |m, g| m.max(g.abs()));
            let mut random = stream(7, 0);
            for slot in layout.slots() {
                for _ in 0..2 {
                    let place = random.random_range(slot.range.clone());
                    let (kept, h) = (theta[place], 1e-6);
                    theta[place] = kept + h;
                    let after = loss(&theta);
                    theta[place] = kept - h;
                    let difference = (after - loss(&theta)) / (2.0 * h);
                    theta[place] = kept;
                    let error = (difference - gradient[place]).abs();
                    assert!(error < 1e-5 * largest, "{} {difference} {}", slot.name, gradient[place]);
                    assert!(slot.active || gradient[place] == 0.0, "{}", slot.name);
                }
            }
        }
    }

    #[test]
    fn a_resumed_run_takes_the_same_steps() {
        let mut trainer = PargcnTrainer::new(OPTIONS);
        for form in [PargcnForm::Published, PargcnForm::Guided] {
            trainer = PargcnTrainer::new(PargcnTrainOptions { form, ..OPTIONS });
            for _ in 0..2 {
                trainer.step().unwrap();
            }
            let mut resumed = PargcnTrainer::resume(&trainer.checkpoint("test")).unwrap();
            assert_eq!(trainer.step().unwrap(), resumed.step().unwrap());
            assert_eq!(trainer.checkpoint("test"), resumed.checkpoint("test"));
        }
        let weights = trainer.network("test").to_bytes();
        assert!(matches!(PargcnTrainer::resume(&weights), Err(NnError::OtherWeights { .. })));
        assert_eq!(Pargcn::load(&weights).unwrap().weights(), 80_641);
    }

    #[test]
    fn training_lowers_the_error() {
        let validation = Validation::small(1, 2).unwrap();
        let error = |trainer: &PargcnTrainer| -> f64 {
            validation.pargcn_scores(&trainer.network("test")).iter().map(|score| score.mse).sum()
        };
        let mut trainer =
            PargcnTrainer::new(PargcnTrainOptions { form: PargcnForm::Published, steps: 60, rate: 1e-2, ..OPTIONS });
        let before = error(&trainer);
        for _ in 0..60 {
            trainer.step().unwrap();
        }
        let after = error(&trainer);
        assert!(after < 0.9 * before, "{after} after 60 steps, {before} before");
    }
}
