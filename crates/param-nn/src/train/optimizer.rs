//! Optimizers whose state can be saved.

const BETA_1: f32 = 0.9;
const BETA_2: f32 = 0.999;
/// Keeps steps finite where gradients vanish.
const EPSILON: f32 = 1e-8;
const WEIGHT_DECAY: f32 = 0.01;

/// Gradients longer than this many times their running mean are shortened to that.
const CLIP: f64 = 2.0;

/// Steps over which the mean of the gradients' lengths runs.
const NORM_HORIZON: f64 = 200.0;

/// Decay of the mean square and momentum of RMSprop; the first is PyTorch's default, the second stands in Imperatore 2024,
/// §4.1.4.
const RMS_DECAY: f32 = 0.99;
const MOMENTUM: f32 = 0.9;

/// How weights move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Recipe {
    /// AdamW (Loshchilov and Hutter, Decoupled weight decay regularization, ICLR 2019) with a warm-up and half a cosine.
    AdamW,
    /// RMSprop with momentum, the rate constant (Imperatore 2024, §4.1.4).
    RmsProp,
}

impl Recipe {
    /// Its name in files.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::AdamW => "adamw",
            Self::RmsProp => "rmsprop",
        }
    }
}

/// A recipe and its running means.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Optimizer {
    pub(super) recipe: Recipe,
    pub(super) first: Vec<f32>,
    pub(super) second: Vec<f32>,
    pub(super) steps: u64,
    /// Running mean of the gradients' lengths, after shortening.
    pub(super) mean_norm: f64,
    pub(super) clipped: u64,
}

impl Optimizer {
    pub(super) fn new(recipe: Recipe, count: usize) -> Self {
        Self { recipe, first: vec![0.0; count], second: vec![0.0; count], steps: 0, mean_norm: 0.0, clipped: 0 }
    }

    /// Moves the weights against the gradient; returns its length before it was shortened.
    pub(super) fn step(&mut self, theta: &mut [f32], gradient: &[f32], rate: f64) -> f64 {
        let norm = gradient.iter().map(|&g| f64::from(g) * f64::from(g)).sum::<f64>().sqrt();
        let limit = if self.steps == 0 { norm } else { CLIP * self.mean_norm };
        let factor = if norm > limit { limit / norm } else { 1.0 };
        self.clipped += u64::from(factor < 1.0);
        let weight = if self.steps == 0 { 1.0 } else { 1.0 / NORM_HORIZON };
        self.mean_norm += weight * (norm * factor - self.mean_norm);
        self.steps += 1;
        let factor = factor as f32;
        match self.recipe {
            Recipe::AdamW => self.adamw(theta, gradient, factor, rate),
            Recipe::RmsProp => self.rmsprop(theta, gradient, factor, rate as f32),
        }
        norm
    }

    fn rmsprop(&mut self, theta: &mut [f32], gradient: &[f32], factor: f32, rate: f32) {
        for (((t, g), m), v) in theta.iter_mut().zip(gradient).zip(&mut self.first).zip(&mut self.second) {
            let g = g * factor;
            *v += (1.0 - RMS_DECAY) * (g * g - *v);
            *m = MOMENTUM * *m + g / (v.sqrt() + EPSILON);
            *t -= rate * *m;
        }
    }

    fn adamw(&mut self, theta: &mut [f32], gradient: &[f32], factor: f32, rate: f64) {
        let bias = |beta: f32| 1.0 - f64::from(beta).powf(self.steps as f64);
        let scale = (rate / bias(BETA_1)) as f32;
        let root = (1.0 / bias(BETA_2)) as f32;
        let decay = (rate * f64::from(WEIGHT_DECAY)) as f32;
        for (((t, g), m), v) in theta.iter_mut().zip(gradient).zip(&mut self.first).zip(&mut self.second) {
            let g = g * factor;
            *m += (1.0 - BETA_1) * (g - *m);
            *v += (1.0 - BETA_2) * (g * g - *v);
            *t -= decay * *t + scale * *m / ((*v * root).sqrt() + EPSILON);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_step_has_the_length_of_the_rate_in_every_weight() {
        let mut theta = [1.0f32, -2.0, 0.0];
        Optimizer::new(Recipe::AdamW, 3).step(&mut theta, &[0.3, -40.0, 1e-3], 0.1);
        // Decay, then one rate against the sign.
        for (t, expected) in theta.iter().zip([0.999 - 0.1, -1.998 + 0.1, -0.1]) {
            assert!((t - expected).abs() < 1e-5, "{theta:?}");
        }
    }

    #[test]
    fn a_quadratic_bowl_is_left_at_its_bottom() {
        for recipe in [Recipe::AdamW, Recipe::RmsProp] {
            bowl(recipe);
        }
    }

    fn bowl(recipe: Recipe) {
        let (mut theta, mut optimizer) = ([3.0f32, -1.0], Optimizer::new(recipe, 2));
        for k in 0..4000 {
            let gradient = [theta[0] - 1.0, 10.0 * (theta[1] - 2.0)];
            optimizer.step(&mut theta, &gradient, 0.01 * (1.0 - k as f64 / 4000.0));
        }
        assert!((theta[0] - 1.0).abs() < 0.02 && (theta[1] - 2.0).abs() < 0.02, "{theta:?}");
    }

    #[test]
    fn a_burst_is_shortened() {
        let (mut theta, mut optimizer) = (vec![0.0f32; 4], Optimizer::new(Recipe::AdamW, 4));
        for _ in 0..50 {
            optimizer.step(&mut theta, &[1.0; 4], 1e-3);
        }
        assert_eq!(optimizer.clipped, 0);
        let norm = optimizer.step(&mut theta, &[1e6; 4], 1e-3);
        assert!(norm == 2e6 && optimizer.clipped == 1 && optimizer.mean_norm < 2.1);
    }
}
