//! Training of BIDGCN.

use param_nn::{NnError, Score, StepReport, TrainOptions, Trainer, Validation};

use super::{Judged, Training, VALIDATION_SEED};

/// Clouds of each kind that a validation takes.
pub(super) const VALIDATION_CLOUDS: u64 = 25;

/// Clouds of a validation of the published recipe. The authors' program takes 20,000 once an epoch; these are judged on far
/// more often.
const PUBLISHED_VALIDATION: u64 = 250;

impl Training for Trainer {
    type Options = TrainOptions;
    type Validation = Validation;

    const RIVAL: &'static str = "LPSP";

    fn start(options: TrainOptions) -> Self {
        Self::new(options)
    }

    fn go_on(checkpoint: &[u8], options: &TrainOptions) -> Result<Self, NnError> {
        let mut trainer = Self::resume(checkpoint)?;
        trainer.set_steps(options.steps);
        Ok(trainer)
    }

    fn progress(&self) -> (u64, u64) {
        (self.step_count(), self.options().steps)
    }

    fn step(&mut self) -> Result<StepReport, NnError> {
        self.step()
    }

    fn clipped_share(&self) -> f64 {
        self.clipped_share()
    }

    fn checkpoint(&self, command: &str) -> Vec<u8> {
        self.checkpoint(command)
    }

    fn validation(&self) -> Result<Validation, NnError> {
        match self.options().recipe.is_published() {
            true => Validation::published_bidgcn(VALIDATION_SEED, PUBLISHED_VALIDATION),
            false => Validation::new(VALIDATION_SEED, VALIDATION_CLOUDS),
        }
    }

    fn judge(&self, validation: &Validation, command: &str) -> Judged {
        let network = self.network(command);
        Judged { weights: network.to_bytes(), columns: columns(validation.scores(&network)) }
    }
}

/// Columns of the log, three for each kind of clouds.
pub(super) fn columns(scores: Vec<Score>) -> Vec<(String, String)> {
    let of_kind = |Score { kind, mse, lpsp, parameter_error, .. }: Score| {
        let kind = kind.replace(", ", " ");
        [
            (format!("mse {kind}"), format!("{mse:.4e}")),
            (format!("lpsp {kind}"), format!("{lpsp:.4e}")),
            (format!("parameter error {kind}"), format!("{parameter_error:.4}")),
        ]
    };
    scores.into_iter().flat_map(of_kind).collect()
}
