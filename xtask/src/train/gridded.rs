//! Training of PARCNN.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};
use param_nn::{GridScore, GridTrainOptions, GridTrainer, GridValidation};

use super::{CHECKPOINT, CURVE, LOG, VALIDATION_SEED, WEIGHTS, curve, replace};

/// Items of each degree and kind that a validation takes.
const VALIDATION_ITEMS: u64 = 40;

/// A run and where it is written.
#[derive(Clone, Debug)]
pub struct GridRun {
    /// What to train; a resumed run takes all but the number of steps from its checkpoint.
    pub options: GridTrainOptions,
    /// The folder.
    pub out: PathBuf,
    /// Whether to go on from the checkpoint in the folder.
    pub resume: bool,
    /// Minutes between validations; each writes checkpoint, weights, log and curve.
    pub minutes: f64,
    /// Validations without a new best mean error after which the run ends; without it, it takes all its steps.
    pub patience: Option<usize>,
    /// The command, for the notes in the weights.
    pub command: String,
}

impl GridRun {
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
            let mut trainer = GridTrainer::resume(&bytes)?;
            trainer.set_steps(self.options.steps);
            (trainer, log)
        } else {
            ensure!(!path(CHECKPOINT).exists(), "{} holds a run; go on with --resume", self.out.display());
            (GridTrainer::new(self.options), String::new())
        };
        let validation = GridValidation::new(trainer.options().architecture, VALIDATION_SEED, VALIDATION_ITEMS)?;
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
            let mut line = format!(
                "{},{:.0},{step_time:.2},{:.3e},{:.3e},{:.3e},{:.4}",
                trainer.step_count(),
                seconds_before + start.elapsed().as_secs_f64(),
                report.rate,
                report.gradient,
                sum / f64::from(count),
                trainer.clipped_share(),
            );
            for score in validation.scores(&network) {
                write!(line, ",{:.4e},{:.4e}", score.mse, score.standard)?;
            }
            log += &line;
            log.push('\n');
            replace(&path(CHECKPOINT), &trainer.checkpoint(&self.command))?;
            replace(&path(WEIGHTS), &network.to_bytes())?;
            replace(&path(LOG), log.as_bytes())?;
            replace(&path(CURVE), curve::svg(&log, "the best of uniform, centripetal, chord length").as_bytes())?;
            tell(&line);
            if self.patience.is_some_and(|patience| stagnates(&log, patience)) {
                break;
            }
            (last, sum, count) = (Instant::now(), 0.0, 0);
        }
        Ok(())
    }
}

/// Whether the best mean error of a log is older than so many lines.
fn stagnates(log: &str, patience: usize) -> bool {
    let mean = |line: &str| -> f64 { line.split(',').skip(7).step_by(2).filter_map(|x| x.parse::<f64>().ok()).sum() };
    let errors: Vec<f64> = log.lines().skip(1).map(mean).collect();
    let best = (0..errors.len()).min_by(|&a, &b| errors[a].total_cmp(&errors[b]));
    best.is_some_and(|best| errors.len() - best > patience)
}

fn header(scores: &[GridScore]) -> String {
    let mut line = String::from("step,seconds,ms_per_step,rate,gradient,train_mse,clipped");
    scores.iter().for_each(|score| line += &format!(",mse {0},std {0}", score.kind));
    line.push('\n');
    line
}

#[cfg(test)]
mod tests {
    use super::*;
    use param_nn::{Architecture, Parcnn, Recipe, SHIPPED_FORM};

    #[test]
    fn a_run_stagnates_when_its_best_is_old() {
        let log = "a,b,c,d,e,f,g,mse x,std x\n1,,,,,,,3,9\n2,,,,,,,2,9\n3,,,,,,,4,9\n4,,,,,,,2.5,9\n";
        assert!(stagnates(log, 2) && !stagnates(log, 3));
    }

    #[test]
    fn a_run_leaves_weights_log_and_curve_and_goes_on() {
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
        let mut run = GridRun {
            options,
            out: folder.clone(),
            resume: false,
            minutes: 1e9,
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
