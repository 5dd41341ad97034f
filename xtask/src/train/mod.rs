//! Training of the networks: progress, checkpoints and learning curves as files.

mod arguments;
mod comparison;
mod curve;
mod gridded;
mod pargcn;
mod scattered;

pub use self::arguments::Train;

use std::fmt::Debug;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};
use param_nn::{NnError, StepReport};

/// Seed of what validations judge on; training has other seeds.
const VALIDATION_SEED: u64 = 1 << 32;

/// Files in the folder of a run.
const CHECKPOINT: &str = "checkpoint.safetensors";
const WEIGHTS: &str = "weights.safetensors";
const LOG: &str = "log.csv";
const CURVE: &str = "curve.svg";

/// Columns of the log that every run has.
const COLUMNS: &str = "step,seconds,ms_per_step,rate,gradient,train_mse,clipped";

/// A trainer, and what it is judged on.
pub trait Training: Sized {
    /// What to train.
    type Options: Clone + Debug;
    /// What networks are judged on.
    type Validation;

    /// What the errors of the network are compared with.
    const RIVAL: &'static str;

    /// A run from its start.
    fn start(options: Self::Options) -> Self;

    /// Goes on from a checkpoint, with the number of steps of these options.
    ///
    /// # Errors
    /// Those of the library.
    fn go_on(checkpoint: &[u8], options: &Self::Options) -> Result<Self, NnError>;

    /// Steps done, and steps of the whole run.
    fn progress(&self) -> (u64, u64);

    /// One step.
    ///
    /// # Errors
    /// Those of the library.
    fn step(&mut self) -> Result<StepReport, NnError>;

    /// Share of the steps so far whose gradient was shortened.
    fn clipped_share(&self) -> f64;

    /// The bytes of a checkpoint; the command goes into its notes.
    fn checkpoint(&self, command: &str) -> Vec<u8>;

    /// What networks of this run are judged on.
    ///
    /// # Errors
    /// Those of the library.
    fn validation(&self) -> Result<Self::Validation, NnError>;

    /// The network at this step.
    fn judge(&self, validation: &Self::Validation, command: &str) -> Judged;
}

/// A network and its scores.
#[derive(Clone, Debug)]
pub struct Judged {
    /// The bytes of its weights file.
    pub weights: Vec<u8>,
    /// Names and numbers of the columns in the log. The one after `mse …` is that of the rival.
    pub columns: Vec<(String, String)>,
}

impl Judged {
    /// Names or numbers, each after a comma.
    fn join(&self, of: impl Fn(&(String, String)) -> &String) -> String {
        self.columns.iter().map(|column| format!(",{}", of(column))).collect()
    }
}

/// A run and where it is written.
#[derive(Clone, Debug)]
pub struct Run<T: Training> {
    /// What to train; a resumed run takes all but the number of steps from its checkpoint.
    pub options: T::Options,
    /// The folder.
    pub out: PathBuf,
    /// Whether to go on from the checkpoint in the folder.
    pub resume: bool,
    /// Minutes between validations; each writes checkpoint, weights, log and curve.
    pub minutes: f64,
    /// In place of minutes, steps between validations; checkpoints are then written between them, too.
    pub every: Option<u64>,
    /// Validations without a new best mean error after which the run ends; without it, it takes all its steps.
    pub patience: Option<usize>,
    /// The command, for the notes in the weights.
    pub command: String,
}

impl<T: Training> Run<T> {
    /// Trains to the end; `tell` gets a line at every validation.
    ///
    /// # Errors
    /// What training, reading and writing meet.
    pub fn train(&self, mut tell: impl FnMut(&str)) -> Result<()> {
        std::fs::create_dir_all(&self.out).with_context(|| format!("cannot create {}", self.out.display()))?;
        let path = |name: &str| self.out.join(name);
        let (mut trainer, mut log) = if self.resume {
            let bytes = std::fs::read(path(CHECKPOINT)).context("no checkpoint to go on from")?;
            // There is none before the first validation.
            let log = std::fs::read_to_string(path(LOG)).unwrap_or_default();
            (T::go_on(&bytes, &self.options)?, log)
        } else {
            ensure!(!path(CHECKPOINT).exists(), "{} holds a run; go on with --resume", self.out.display());
            (T::start(self.options.clone()), String::new())
        };
        let validation = trainer.validation()?;
        if log.is_empty() {
            log = format!("{COLUMNS}{}\n", trainer.judge(&validation, &self.command).join(|(name, _)| name));
        }
        let seconds_before: f64 = log.lines().last().and_then(|l| l.split(',').nth(1)?.parse().ok()).unwrap_or(0.0);
        let start = Instant::now();
        let (mut last, mut sum, mut count) = (Instant::now(), 0.0, 0u32);
        let (mut saved, pause) = (Instant::now(), Duration::from_secs_f64(60.0 * self.minutes));
        while trainer.progress().0 < trainer.progress().1 {
            let report = trainer.step()?;
            (sum, count) = (sum + report.mse, count + 1);
            let (done, steps) = trainer.progress();
            let is_due = self.every.map_or(last.elapsed() >= pause, |every| done.is_multiple_of(every));
            if !is_due && done != steps {
                if self.every.is_some() && saved.elapsed() >= pause {
                    replace(&path(CHECKPOINT), &trainer.checkpoint(&self.command))?;
                    saved = Instant::now();
                }
                continue;
            }
            let step_time = last.elapsed().as_secs_f64() * 1e3 / f64::from(count);
            let judged = trainer.judge(&validation, &self.command);
            let line = format!(
                "{done},{:.0},{step_time:.2},{:.3e},{:.3e},{:.3e},{:.4}{}",
                seconds_before + start.elapsed().as_secs_f64(),
                report.rate,
                report.gradient,
                sum / f64::from(count),
                trainer.clipped_share(),
                judged.join(|(_, number)| number),
            );
            log += &line;
            log.push('\n');
            replace(&path(CHECKPOINT), &trainer.checkpoint(&self.command))?;
            replace(&path(WEIGHTS), &judged.weights)?;
            replace(&path(LOG), log.as_bytes())?;
            replace(&path(CURVE), curve::svg(&log, T::RIVAL).as_bytes())?;
            tell(&line);
            if self.patience.is_some_and(|patience| stagnates(&log, patience)) {
                break;
            }
            (last, sum, count, saved) = (Instant::now(), 0.0, 0, Instant::now());
        }
        Ok(())
    }
}

/// Whether the best mean error of a log is older than so many lines.
fn stagnates(log: &str, patience: usize) -> bool {
    let mut lines = log.lines();
    let errors: Vec<bool> = lines.next().unwrap_or_default().split(',').map(|name| name.starts_with("mse ")).collect();
    let mean = |line: &str| -> f64 {
        let numbers = line.split(',').zip(&errors).filter(|(_, is_error)| **is_error);
        numbers.filter_map(|(x, _)| x.parse::<f64>().ok()).sum()
    };
    let errors: Vec<f64> = lines.map(mean).collect();
    let best = (0..errors.len()).min_by(|&a, &b| errors[a].total_cmp(&errors[b]));
    best.is_some_and(|best| errors.len() - best > patience)
}

/// Writes a file whole or not at all: a run may be stopped at any time.
fn replace(path: &Path, bytes: &[u8]) -> Result<()> {
    let draft = path.with_extension("tmp");
    std::fs::write(&draft, bytes).with_context(|| format!("cannot write {}", draft.display()))?;
    std::fs::rename(&draft, path).with_context(|| format!("cannot write {}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use param_nn::{
        Architecture, Bidgcn, ComparisonNetwork, ComparisonOptions, ComparisonTrainer, GridTrainOptions, GridTrainer,
        Neighbours, Parcnn, Recipe, SHIPPED_FORM, TrainOptions, Trainer, Variant,
    };

    #[test]
    fn a_run_leaves_weights_log_and_curve_and_goes_on() {
        let folder = std::env::temp_dir().join(format!("train-{}", std::process::id()));
        let options = TrainOptions {
            variant: Variant::Bidgcn,
            frame: true,
            neighbours: Neighbours::WithinRadius,
            recipe: Recipe::AdamW,
            steps: 2,
            rate: 1e-3,
            seed: 1,
        };
        let mut run = Run::<Trainer> {
            options,
            out: folder.clone(),
            resume: false,
            minutes: 1e9,
            every: None,
            patience: None,
            command: "test".into(),
        };
        let mut lines = Vec::new();
        run.train(|line| lines.push(line.to_owned())).unwrap();
        assert!(run.train(|_| ()).is_err(), "a run was overwritten");
        run.resume = true;
        run.train(|_| ()).unwrap();
        let weights = Bidgcn::load(&std::fs::read(folder.join(WEIGHTS)).unwrap()).unwrap();
        assert_eq!((weights.notes()["command"].as_str(), weights.notes()["steps_done"].as_str()), ("test", "2"));
        assert!(std::fs::read_to_string(folder.join(CURVE)).unwrap().contains("polyline"));
        let log = std::fs::read_to_string(folder.join(LOG)).unwrap();
        let columns: Vec<usize> = log.lines().map(|line| line.split(',').count()).collect();
        assert_eq!(columns, [7 + 3 * 5; 2], "{log}");
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn validations_come_every_so_many_steps() {
        let folder = std::env::temp_dir().join(format!("train-compared-{}", std::process::id()));
        let options = ComparisonOptions {
            network: ComparisonNetwork::Mlp,
            degree: 2,
            steps: 5,
            batch: 2,
            recipe: Recipe::RmsProp,
            rate: 1e-5,
            seed: 1,
        };
        let run = Run::<ComparisonTrainer> {
            options,
            out: folder.clone(),
            resume: false,
            minutes: 0.0,
            every: Some(2),
            patience: None,
            command: "test".into(),
        };
        run.train(|_| ()).unwrap();
        let log = std::fs::read_to_string(folder.join(LOG)).unwrap();
        let steps: Vec<&str> = log.lines().skip(1).filter_map(|line| line.split(',').next()).collect();
        assert_eq!(steps, ["2", "4", "5"]);
        // A run that was stopped before its first validation goes on, too.
        std::fs::remove_file(folder.join(LOG)).unwrap();
        Run { resume: true, options: ComparisonOptions { steps: 6, ..options }, ..run }.train(|_| ()).unwrap();
        assert_eq!(std::fs::read_to_string(folder.join(LOG)).unwrap().lines().count(), 2);
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_run_stagnates_when_its_best_is_old() {
        let log = "a,b,c,d,e,f,g,mse x,std x\n1,,,,,,,3,9\n2,,,,,,,2,9\n3,,,,,,,4,9\n4,,,,,,,2.5,9\n";
        assert!(stagnates(log, 2) && !stagnates(log, 3));
    }

    #[test]
    fn a_run_on_sequences_goes_on_for_longer() {
        let folder = std::env::temp_dir().join(format!("train-parcnn-{}", std::process::id()));
        let architecture = Architecture { dimension: 2, directions: 1, form: SHIPPED_FORM };
        let options = GridTrainOptions {
            architecture,
            steps: 2,
            batch: 2,
            shortest: false,
            recipe: Recipe::AdamW,
            rate: 1e-3,
            seed: 1,
        };
        let mut run = Run::<GridTrainer> {
            options,
            out: folder.clone(),
            resume: false,
            minutes: 1e9,
            every: None,
            patience: None,
            command: "test".into(),
        };
        run.train(|_| ()).unwrap();
        assert!(run.train(|_| ()).is_err(), "a run was overwritten");
        run.resume = true;
        run.options.steps = 3;
        run.train(|_| ()).unwrap();
        let weights = Parcnn::load(&std::fs::read(folder.join(WEIGHTS)).unwrap()).unwrap();
        assert_eq!((weights.notes()["command"].as_str(), weights.notes()["steps_done"].as_str()), ("test", "3"));
        let log = std::fs::read_to_string(folder.join(LOG)).unwrap();
        assert_eq!(log.lines().map(|line| line.split(',').count()).collect::<Vec<_>>(), [7 + 2 * 5; 3], "{log}");
        std::fs::remove_dir_all(folder).unwrap();
    }
}
