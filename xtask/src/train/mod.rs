//! Training of the networks: progress, checkpoints and learning curves as files.

mod curve;
pub mod gridded;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};
use param_nn::{Score, TrainOptions, Trainer, Validation};

/// Clouds of each kind that a validation takes, and their seed; training clouds have other seeds.
const VALIDATION_CLOUDS: u64 = 25;
const VALIDATION_SEED: u64 = 1 << 32;

/// Files in the folder of a run.
const CHECKPOINT: &str = "checkpoint.safetensors";
const WEIGHTS: &str = "weights.safetensors";
const LOG: &str = "log.csv";
const CURVE: &str = "curve.svg";

/// A run and where it is written.
#[derive(Clone, Debug)]
pub struct Run {
    /// What to train; a resumed run takes all but the number of steps from its checkpoint.
    pub options: TrainOptions,
    /// The folder.
    pub out: PathBuf,
    /// Whether to go on from the checkpoint in the folder.
    pub resume: bool,
    /// Minutes between validations; each writes checkpoint, weights, log and curve.
    pub minutes: f64,
    /// The command, for the notes in the weights.
    pub command: String,
}

impl Run {
    /// Trains to the end; `tell` gets a line at every validation.
    ///
    /// # Errors
    /// What training, reading and writing meet.
    pub fn train(&self, mut tell: impl FnMut(&str)) -> Result<()> {
        std::fs::create_dir_all(&self.out).with_context(|| format!("cannot create {}", self.out.display()))?;
        let path = |name: &str| self.out.join(name);
        let (mut trainer, mut log) = if self.resume {
            let bytes = std::fs::read(path(CHECKPOINT)).context("no checkpoint to go on from")?;
            let log = std::fs::read_to_string(path(LOG)).context("no log to go on with")?;
            let mut trainer = Trainer::resume(&bytes)?;
            trainer.set_steps(self.options.steps);
            (trainer, log)
        } else {
            ensure!(!path(CHECKPOINT).exists(), "{} holds a run; go on with --resume", self.out.display());
            (Trainer::new(self.options), String::new())
        };
        let validation = Validation::new(VALIDATION_SEED, VALIDATION_CLOUDS)?;
        if log.is_empty() {
            log = header(&validation.scores(&trainer.network(&self.command)));
        }
        let seconds_before: f64 = log.lines().last().and_then(|l| l.split(',').nth(1)?.parse().ok()).unwrap_or(0.0);
        let start = Instant::now();
        let (mut last, mut sum, mut count) = (Instant::now(), 0.0, 0u32);
        while trainer.step_count() < trainer.options().steps {
            let report = trainer.step()?;
            (sum, count) = (sum + report.mse, count + 1);
            let finished = trainer.step_count() == trainer.options().steps;
            if last.elapsed() < Duration::from_secs_f64(60.0 * self.minutes) && !finished {
                continue;
            }
            let step_time = last.elapsed().as_secs_f64() * 1e3 / f64::from(count);
            let network = trainer.network(&self.command);
            let scores = validation.scores(&network);
            let seconds = seconds_before + start.elapsed().as_secs_f64();
            let mut line = format!(
                "{},{seconds:.0},{step_time:.2},{:.3e},{:.3e},{:.3e},{:.4}",
                trainer.step_count(),
                report.rate,
                report.gradient,
                sum / f64::from(count),
                trainer.clipped_share(),
            );
            for score in &scores {
                write!(line, ",{:.4e},{:.4e},{:.4}", score.mse, score.lpsp, score.parameter_error)?;
            }
            log += &line;
            log.push('\n');
            replace(&path(CHECKPOINT), &trainer.checkpoint(&self.command))?;
            replace(&path(WEIGHTS), &network.to_bytes())?;
            replace(&path(LOG), log.as_bytes())?;
            replace(&path(CURVE), curve::svg(&log, "LPSP").as_bytes())?;
            tell(&line);
            (last, sum, count) = (Instant::now(), 0.0, 0);
        }
        Ok(())
    }
}

fn header(scores: &[Score]) -> String {
    let mut line = String::from("step,seconds,ms_per_step,rate,gradient,train_mse,clipped");
    for score in scores {
        let kind = score.kind.replace(", ", " ");
        line += &format!(",mse {kind},lpsp {kind},parameter error {kind}");
    }
    line.push('\n');
    line
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
    use param_nn::{Bidgcn, Variant};

    #[test]
    fn a_run_leaves_weights_log_and_curve_and_goes_on() {
        let folder = std::env::temp_dir().join(format!("train-{}", std::process::id()));
        let options = TrainOptions { variant: Variant::Bidgcn, frame: true, steps: 2, rate: 1e-3, seed: 1 };
        let mut run = Run { options, out: folder.clone(), resume: false, minutes: 1e9, command: "test".into() };
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
}
