//! Training of PARCNN.

use param_nn::{GridScore, GridTrainOptions, GridTrainer, GridValidation, NnError, StepReport};

use super::{Judged, Training, VALIDATION_SEED};

/// Items of each degree and kind that a validation takes.
const VALIDATION_ITEMS: u64 = 40;

impl Training for GridTrainer {
    type Options = GridTrainOptions;
    type Validation = GridValidation;

    const RIVAL: &'static str = "the best of uniform, centripetal, chord length";

    fn start(options: GridTrainOptions) -> Self {
        Self::new(options)
    }

    fn go_on(checkpoint: &[u8], options: &GridTrainOptions) -> Result<Self, NnError> {
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

    fn validation(&self) -> Result<GridValidation, NnError> {
        GridValidation::new(self.options().architecture, VALIDATION_SEED, VALIDATION_ITEMS)
    }

    fn judge(&self, validation: &GridValidation, command: &str) -> Judged {
        let network = self.network(command);
        let columns = |GridScore { kind, mse, standard }| {
            [(format!("mse {kind}"), format!("{mse:.4e}")), (format!("std {kind}"), format!("{standard:.4e}"))]
        };
        let columns = validation.scores(&network).into_iter().flat_map(columns).collect();
        Judged { weights: network.to_bytes(), columns }
    }
}
