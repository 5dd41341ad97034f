//! What `cargo xtask train` is told.

use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::{Args, Subcommand, ValueEnum};
use param_nn::{
    Architecture, ComparisonNetwork, ComparisonOptions, ComparisonTrainer, Form, GridTrainOptions, GridTrainer,
    Neighbours, PargcnForm, PargcnTrainOptions, PargcnTrainer, Recipe, SHIPPED_FORM, TrainOptions, Trainer, Variant,
};

use super::{Run, Training};

/// The networks. Run a training in one thread: RAYON_NUM_THREADS=1.
#[derive(Subcommand)]
pub enum Train {
    /// PARCNN, which parameterizes point sequences and grids.
    Parcnn(ParcnnArguments),
    /// BIDGCN, which parameterizes scattered clouds.
    Bidgcn(ScatteredArguments),
    /// DGCNN: BIDGCN without the boundary-informed input layer.
    Dgcnn(ScatteredArguments),
    /// PARGCN, which weighs the neighbours of scattered points.
    Pargcn(ScatteredArguments),
    /// The multilayer perceptron that PARCNN is compared with.
    Mlp(ComparisonArguments),
    /// The transformer that PARCNN is compared with.
    Tra(ComparisonArguments),
    /// The residual network that PARCNN is compared with.
    Res(ComparisonArguments),
    /// The network after the one for polynomial curves that PARCNN is compared with.
    Ppn(ComparisonArguments),
}

impl Train {
    /// Trains to the end; `tell` gets a line at every validation.
    ///
    /// # Errors
    /// An option that is missing; what training, reading and writing meet.
    pub fn run(self, tell: &mut dyn FnMut(&str)) -> Result<()> {
        match self {
            Self::Parcnn(arguments) => arguments.run()?.train(tell),
            Self::Bidgcn(arguments) => arguments.message_passing(Variant::Bidgcn)?.train(tell),
            Self::Dgcnn(arguments) => arguments.message_passing(Variant::Dgcnn)?.train(tell),
            Self::Pargcn(arguments) => arguments.pargcn()?.train(tell),
            Self::Mlp(arguments) => arguments.run(ComparisonNetwork::Mlp).train(tell),
            Self::Tra(arguments) => arguments.run(ComparisonNetwork::Transformer).train(tell),
            Self::Res(arguments) => arguments.run(ComparisonNetwork::Residual).train(tell),
            Self::Ppn(arguments) => arguments.run(ComparisonNetwork::Ppn).train(tell),
        }
    }
}

/// Whose recipe: form of the network, loss, data, optimizer and rates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Whose {
    /// That of the networks that come with the crate.
    Ours,
    /// That of the papers.
    Published,
}

impl Whose {
    fn flag(self) -> &'static str {
        if self == Self::Published { " --recipe published" } else { "" }
    }
}

/// Where a run goes, and how often it is judged and kept.
#[derive(Args)]
struct Place {
    /// The folder of the run: checkpoint, weights, log and curve.
    #[arg(long)]
    out: PathBuf,
    /// Go on from the checkpoint in the folder; all but the number of steps is then taken from it.
    #[arg(long)]
    resume: bool,
    /// Minutes between checkpoints and, with our recipe, between validations.
    #[arg(long, default_value_t = 3.0)]
    minutes: f64,
    /// Steps between validations; with our recipe they come with the checkpoints, with the published one see the defaults
    /// in xtask/src/train/arguments.rs.
    #[arg(long, value_name = "STEPS", value_parser = clap::value_parser!(u64).range(1..))]
    every: Option<u64>,
}

impl Place {
    fn run<T: Training>(
        self,
        options: T::Options,
        every: Option<u64>,
        patience: Option<usize>,
        command: String,
    ) -> Run<T> {
        let Self { out, resume, minutes, .. } = self;
        Run { options, out, resume, minutes, every: self.every.or(every), patience, command }
    }
}

/// What the trainings on scattered clouds are told.
#[derive(Args)]
pub struct ScatteredArguments {
    /// Steps, one cloud each. With the published recipe 500,000 by default for PARGCN, 50 epochs, and 100,000 for the others,
    /// one epoch.
    #[arg(long)]
    steps: Option<u64>,
    /// Largest learning rate; by default 3e-3, 1e-3 for PARGCN, 0.1 for BIDGCN and DGCNN as published.
    #[arg(long)]
    rate: Option<f64>,
    /// Seed of weights and clouds.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Whose recipe is followed.
    #[arg(long, default_value = "ours")]
    recipe: Whose,
    /// In place of the neighbours within a radius, so many nearest ones.
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u16).range(3..))]
    nearest: Option<u16>,
    #[command(flatten)]
    place: Place,
}

/// Steps of the published trainings, and between their validations: epochs of PARGCN, 50 of them as printed; of BIDGCN one,
/// its validations 25.
const PARGCN_STEPS: [u64; 2] = [500_000, 10_000];
const BIDGCN_STEPS: [u64; 2] = [100_000, 4_000];

impl ScatteredArguments {
    fn run<T: Training>(
        self,
        network: &str,
        rates: [f64; 2],
        published: [u64; 2],
        options: impl Fn(&Self, u64, f64) -> T::Options,
    ) -> Result<Run<T>> {
        let is_published = self.recipe == Whose::Published;
        let steps = self.steps.or(is_published.then_some(published[0])).context("our recipe needs --steps")?;
        let rate = self.rate.unwrap_or(rates[usize::from(is_published)]);
        let nearest = self.nearest.map_or(String::new(), |count| format!(" --nearest {count}"));
        let flag = self.recipe.flag();
        let command =
            format!("cargo xtask train {network} --steps {steps} --rate {rate} --seed {}{flag}{nearest}", self.seed);
        let options = options(&self, steps, rate);
        Ok(self.place.run(options, is_published.then_some(published[1]), None, command))
    }

    fn message_passing(self, variant: Variant) -> Result<Run<Trainer>> {
        self.run(variant.name(), [3e-3, 0.1], BIDGCN_STEPS, |Self { seed, recipe, nearest, .. }, steps, rate| {
            TrainOptions {
                variant,
                frame: *recipe == Whose::Ours,
                neighbours: nearest.map_or(Neighbours::WithinRadius, Neighbours::Nearest),
                recipe: if *recipe == Whose::Ours { Recipe::AdamW } else { Recipe::Sgd },
                steps,
                rate,
                seed: *seed,
            }
        })
    }

    fn pargcn(self) -> Result<Run<PargcnTrainer>> {
        self.run("pargcn", [1e-3; 2], PARGCN_STEPS, |Self { seed, recipe, nearest, .. }, steps, rate| {
            PargcnTrainOptions {
                form: if *recipe == Whose::Ours { PargcnForm::Guided } else { PargcnForm::Published },
                nearest: *nearest,
                steps,
                rate,
                seed: *seed,
            }
        })
    }
}

/// The published rate of the networks for sequences and grids (Imperatore 2024, §4.1.4).
const PUBLISHED_RATE: f64 = 1e-5;

/// Steps between validations of those networks.
const PUBLISHED_VALIDATIONS: u64 = 1_000;

/// Validations without a new best after which the published training ends; the text says "stagnates".
const PUBLISHED_PATIENCE: usize = 20;

/// What `train parcnn` is told.
#[derive(Args)]
pub struct ParcnnArguments {
    /// Dimension N of the points: 2 or 3.
    #[arg(long, value_parser = clap::value_parser!(u8).range(2..=3))]
    dimension: u8,
    /// Directions D: 1 for sequences, 2 for grids.
    #[arg(long, value_parser = clap::value_parser!(u8).range(1..=2))]
    directions: u8,
    /// Steps; with the published recipe the most, as it ends when its validation error stagnates.
    #[arg(long)]
    steps: u64,
    /// Sequences or grids a step.
    #[arg(long, default_value_t = 32)]
    batch: usize,
    /// Largest learning rate; by default 2e-3, 1e-5 as published.
    #[arg(long)]
    rate: Option<f64>,
    /// Seed of weights and batches.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Whose recipe is followed.
    #[arg(long, default_value = "ours", requires_if("published", "degree"))]
    recipe: Whose,
    /// The degree that a published network is for.
    #[arg(long, value_parser = clap::value_parser!(u8).range(1..=8))]
    degree: Option<u8>,
    /// A published network with layers of 30 channels before the last, as in Table 4.1, in place of 4 or 5 of 100.
    #[arg(long, requires = "degree")]
    small: bool,
    /// Sequences of 2d + 1 points only, as for Table 4.1.
    #[arg(long)]
    shortest: bool,
    /// Stop after so many validations without a new best; 20 as published, by default all our steps are taken.
    #[arg(long)]
    patience: Option<usize>,
    #[command(flatten)]
    place: Place,
}

impl ParcnnArguments {
    fn run(self) -> Result<Run<GridTrainer>> {
        let Self { dimension, directions, steps, batch, seed, recipe, small, shortest, .. } = self;
        let is_published = recipe == Whose::Published;
        let mut flags = recipe.flag().to_owned();
        let form = if is_published {
            let degree = self.degree.context("--recipe published needs --degree")?;
            flags += &format!(" --degree {degree}");
            let (blocks, width) = if small { (6, 30) } else { (3 + usize::from(directions), 100) };
            Form::Published { degree: usize::from(degree), blocks, width }
        } else {
            SHIPPED_FORM
        };
        for (set, flag) in [(small && is_published, " --small"), (shortest, " --shortest")] {
            flags += if set { flag } else { "" };
        }
        let rate = self.rate.unwrap_or(if is_published { PUBLISHED_RATE } else { 2e-3 });
        let command = format!(
            "cargo xtask train parcnn --dimension {dimension} --directions {directions} --steps {steps} --batch {batch} \
             --rate {rate} --seed {seed}{flags}"
        );
        let architecture =
            Architecture { dimension: usize::from(dimension), directions: usize::from(directions), form };
        let recipe = if is_published { Recipe::RmsProp } else { Recipe::AdamW };
        let options = GridTrainOptions { architecture, steps, batch, shortest, recipe, rate, seed };
        let patience = self.patience.or(is_published.then_some(PUBLISHED_PATIENCE));
        Ok(self.place.run(options, is_published.then_some(PUBLISHED_VALIDATIONS), patience, command))
    }
}

/// What the trainings of compared networks are told. They are trained on plane sequences of 2d + 1 points.
#[derive(Args)]
pub struct ComparisonArguments {
    /// Degree d of the curves.
    #[arg(long, value_parser = clap::value_parser!(u8).range(1..=8))]
    degree: u8,
    /// Steps.
    #[arg(long)]
    steps: u64,
    /// Sequences a step.
    #[arg(long, default_value_t = 32)]
    batch: usize,
    /// Largest learning rate; by default 2e-3, 1e-5 as published.
    #[arg(long)]
    rate: Option<f64>,
    /// Seed of weights and batches.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Whose recipe is followed.
    #[arg(long, default_value = "ours")]
    recipe: Whose,
    #[command(flatten)]
    place: Place,
}

impl ComparisonArguments {
    fn run(self, network: ComparisonNetwork) -> Run<ComparisonTrainer> {
        let Self { degree, steps, batch, seed, .. } = self;
        let is_published = self.recipe == Whose::Published;
        let rate = self.rate.unwrap_or(if is_published { PUBLISHED_RATE } else { 2e-3 });
        let command = format!(
            "cargo xtask train {} --degree {degree} --steps {steps} --batch {batch} --rate {rate} --seed {seed}{}",
            network.name(),
            self.recipe.flag(),
        );
        let recipe = if is_published { Recipe::RmsProp } else { Recipe::AdamW };
        let options = ComparisonOptions { network, degree: usize::from(degree), steps, batch, recipe, rate, seed };
        self.place.run(options, Some(PUBLISHED_VALIDATIONS), None, command)
    }
}
