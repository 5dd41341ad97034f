//! Training of BIDGCN.

use param_nn::{NnError, Score, StepReport, TrainOptions, Trainer, Validation};

use super::{Judged, Training, VALIDATION_SEED};

/// Clouds of each kind that a validation takes.
const VALIDATION_CLOUDS: u64 = 25;

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
        Validation::new(VALIDATION_SEED, VALIDATION_CLOUDS)
    }

    fn judge(&self, validation: &Validation, command: &str) -> Judged {
        let network = self.network(command);
        let columns = |Score { kind, mse, lpsp, parameter_error, .. }| {
            let kind = kind.replace(", ", " ");
            [
                (format!("mse {kind}"), format!("{mse:.4e}")),
                (format!("lpsp {kind}"), format!("{lpsp:.4e}")),
                (format!("parameter error {kind}"), format!("{parameter_error:.4}")),
            ]
        };
        let columns = validation.scores(&network).into_iter().flat_map(columns).collect();
        Judged { weights: network.to_bytes(), columns }
    }
}
