//! Training of PARGCN.

use param_nn::{NnError, PargcnForm, PargcnTrainOptions, PargcnTrainer, StepReport, Validation};

use super::{Judged, Training, VALIDATION_SEED, scattered};

/// Clouds of the published validation (Imperatore 2024, §4.2.6).
const PUBLISHED_VALIDATION: u64 = 2_500;

impl Training for PargcnTrainer {
    type Options = PargcnTrainOptions;
    type Validation = Validation;

    const RIVAL: &'static str = "LPSP";

    fn start(options: PargcnTrainOptions) -> Self {
        Self::new(options)
    }

    fn go_on(checkpoint: &[u8], options: &PargcnTrainOptions) -> Result<Self, NnError> {
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
        match self.options().form {
            PargcnForm::Published => Validation::published_pargcn(VALIDATION_SEED, PUBLISHED_VALIDATION),
            PargcnForm::Guided => Validation::small(VALIDATION_SEED, scattered::VALIDATION_CLOUDS),
        }
    }

    fn judge(&self, validation: &Validation, command: &str) -> Judged {
        let network = self.network(command);
        Judged { weights: network.to_bytes(), columns: scattered::columns(validation.pargcn_scores(&network)) }
    }
}
