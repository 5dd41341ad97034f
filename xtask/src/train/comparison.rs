//! Training of the networks that PARCNN is compared with.

use param_nn::{ComparisonOptions, ComparisonTrainer, GridValidation, NnError, StepReport};

use super::gridded::{PUBLISHED_VALIDATION, columns};
use super::{Judged, Training, VALIDATION_SEED};

impl Training for ComparisonTrainer {
    type Options = ComparisonOptions;
    type Validation = GridValidation;

    const RIVAL: &'static str = "the best of uniform, centripetal, chord length";

    fn start(options: ComparisonOptions) -> Self {
        Self::new(options)
    }

    fn go_on(checkpoint: &[u8], options: &ComparisonOptions) -> Result<Self, NnError> {
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
        self.validation(VALIDATION_SEED, PUBLISHED_VALIDATION)
    }

    fn judge(&self, validation: &GridValidation, command: &str) -> Judged {
        // These networks have no file of weights of their own: the checkpoint is all there is.
        Judged { weights: self.checkpoint(command), columns: columns(self.network().scores(validation)) }
    }
}
