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
    /// Adam (Kingma and Ba, ICLR 2015), the rate constant (Imperatore 2024, §4.2.6; its momentum 0.9 is the decay of the mean).
    Adam,
    /// Stochastic gradient descent in double precision, the rate lowered on plateaus (Imperatore 2024, §4.3.5).
    Sgd,
}

impl Recipe {
    /// Its name in files.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::AdamW => "adamw",
            Self::RmsProp => "rmsprop",
            Self::Adam => "adam",
            Self::Sgd => "sgd",
        }
    }

    /// The recipe of a name; ours for any other.
    pub(super) fn named(name: Option<&String>) -> Self {
        let mut known = [Self::RmsProp, Self::Adam, Self::Sgd].into_iter();
        known.find(|recipe| name.is_some_and(|n| n == recipe.name())).unwrap_or(Self::AdamW)
    }

    /// Whether it is one of the papers: no gradient is shortened, no weights are averaged, nothing but the error of the fit
    /// is in the loss.
    pub fn is_published(self) -> bool {
        self != Self::AdamW
    }
}

/// A recipe and its running means.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Optimizer {
    pub(super) recipe: Recipe,
    pub(super) first: Vec<f32>,
    /// The mean square; of [`Recipe::Sgd`], which has none, what single precision cuts off the weights.
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
    pub(super) fn step<G: Copy + Into<f64>>(&mut self, theta: &mut [f32], gradient: &[G], rate: f64) -> f64 {
        let norm = gradient.iter().map(|&g| g.into() * g.into()).sum::<f64>().sqrt();
        let limit = if self.steps == 0 || self.recipe.is_published() { norm } else { CLIP * self.mean_norm };
        let factor = if norm > limit { limit / norm } else { 1.0 };
        self.clipped += u64::from(factor < 1.0);
        let weight = if self.steps == 0 { 1.0 } else { 1.0 / NORM_HORIZON };
        self.mean_norm += weight * (norm * factor - self.mean_norm);
        self.steps += 1;
        let factor = factor as f32;
        match self.recipe {
            Recipe::AdamW => self.adam(theta, gradient, factor, rate, WEIGHT_DECAY),
            Recipe::Adam => self.adam(theta, gradient, factor, rate, 0.0),
            Recipe::RmsProp => self.rmsprop(theta, gradient, rate as f32),
            Recipe::Sgd => self.sgd(theta, gradient, rate),
        }
        norm
    }

    fn sgd<G: Copy + Into<f64>>(&mut self, theta: &mut [f32], gradient: &[G], rate: f64) {
        for ((t, &g), rest) in theta.iter_mut().zip(gradient).zip(&mut self.second) {
            let moved = f64::from(*t) + f64::from(*rest) - rate * g.into();
            *t = moved as f32;
            *rest = (moved - f64::from(*t)) as f32;
        }
    }

    fn rmsprop<G: Copy + Into<f64>>(&mut self, theta: &mut [f32], gradient: &[G], rate: f32) {
        for (((t, &g), m), v) in theta.iter_mut().zip(gradient).zip(&mut self.first).zip(&mut self.second) {
            let g = g.into() as f32;
            *v += (1.0 - RMS_DECAY) * (g * g - *v);
            *m = MOMENTUM * *m + g / (v.sqrt() + EPSILON);
            *t -= rate * *m;
        }
    }

    fn adam<G>(&mut self, theta: &mut [f32], gradient: &[G], factor: f32, rate: f64, decay: f32)
    where
        G: Copy + Into<f64>,
    {
        let bias = |beta: f32| 1.0 - f64::from(beta).powf(self.steps as f64);
        let scale = (rate / bias(BETA_1)) as f32;
        let root = (1.0 / bias(BETA_2)) as f32;
        let decay = (rate * f64::from(decay)) as f32;
        for (((t, &g), m), v) in theta.iter_mut().zip(gradient).zip(&mut self.first).zip(&mut self.second) {
            let g = g.into() as f32 * factor;
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
        Optimizer::new(Recipe::AdamW, 3).step(&mut theta, &[0.3f32, -40.0, 1e-3], 0.1);
        // Decay, then one rate against the sign.
        for (t, expected) in theta.iter().zip([0.999 - 0.1, -1.998 + 0.1, -0.1]) {
            assert!((t - expected).abs() < 1e-5, "{theta:?}");
        }
    }

    #[test]
    fn a_quadratic_bowl_is_left_at_its_bottom() {
        for recipe in [Recipe::AdamW, Recipe::RmsProp, Recipe::Adam, Recipe::Sgd] {
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
    fn published_recipes_shorten_nothing() {
        let mut optimizer = Optimizer::new(Recipe::Adam, 1);
        let mut theta = [0.0f32];
        for gradient in [1.0f32, 1e6] {
            optimizer.step(&mut theta, &[gradient], 1e-3);
        }
        assert_eq!(optimizer.clipped, 0);
    }

    #[test]
    fn steps_below_single_precision_add_up() {
        let (mut theta, mut optimizer) = ([1.0f32], Optimizer::new(Recipe::Sgd, 1));
        (0..1000).for_each(|_| {
            optimizer.step(&mut theta, &[-1e-9f64], 1.0);
        });
        let weight = f64::from(theta[0]) + f64::from(optimizer.second[0]);
        assert!((weight - 1.0 - 1e-6).abs() < 1e-12, "{weight:e}");
    }

    #[test]
    fn a_burst_is_shortened() {
        let (mut theta, mut optimizer) = (vec![0.0f32; 4], Optimizer::new(Recipe::AdamW, 4));
        for _ in 0..50 {
            optimizer.step(&mut theta, &[1.0f32; 4], 1e-3);
        }
        assert_eq!(optimizer.clipped, 0);
        let norm = optimizer.step(&mut theta, &[1e6f32; 4], 1e-3);
        assert!(norm == 2e6 && optimizer.clipped == 1 && optimizer.mean_norm < 2.1);
    }
}
