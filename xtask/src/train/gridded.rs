//! Training of PARCNN.

use param_nn::{Form, GridScore, GridTrainOptions, GridTrainer, GridValidation, NnError, StepReport};

use super::{Judged, Training, VALIDATION_SEED};

/// Items of each degree and kind that a validation takes.
const VALIDATION_ITEMS: u64 = 40;

/// Items of each length that a validation of the published recipe takes.
pub(super) const PUBLISHED_VALIDATION: u64 = 500;

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
        let GridTrainOptions { architecture, recipe, shortest, .. } = *self.options();
        match architecture.form {
            Form::Published { degree, .. } if recipe.is_published() => {
                GridValidation::published(architecture, degree, shortest, VALIDATION_SEED, PUBLISHED_VALIDATION)
            }
            _ => GridValidation::new(architecture, VALIDATION_SEED, VALIDATION_ITEMS),
        }
    }

    fn judge(&self, validation: &GridValidation, command: &str) -> Judged {
        let network = self.network(command);
        Judged { weights: network.to_bytes(), columns: columns(validation.scores(&network)) }
    }
}

/// Columns of the log, two for each kind of items.
pub(super) fn columns(scores: Vec<GridScore>) -> Vec<(String, String)> {
    let of_kind = |GridScore { kind, mse, standard }| {
        [(format!("mse {kind}"), format!("{mse:.4e}")), (format!("std {kind}"), format!("{standard:.4e}"))]
    };
    scores.into_iter().flat_map(of_kind).collect()
}
