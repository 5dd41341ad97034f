//! Losses that grow slower than the square, and the scale their residuals are measured in.

use crate::Error;

/// Errors up to about this many scales are met as by least squares. The constants of the losses give 95 % of the
/// efficiency of least squares where errors are Gaussian.
const HUBER: f64 = 1.345;

/// Errors beyond this many scales have no weight at all; see [`HUBER`].
const TUKEY: f64 = 4.685;

/// Errors of this many scales have a quarter of the weight; see [`HUBER`].
const GEMAN_MCCLURE: f64 = 3.787;

/// Errors below this share of the scale count as that large in ℓp, so that no weight is infinite. Smaller ones make the
/// equations worse conditioned for a minimum that they hardly move.
const SMALLEST: f64 = 1e-3;

/// From the median of absolute values to the standard deviation of a Gaussian.
const MEDIAN_TO_DEVIATION: f64 = 1.482_602_218_505_602;

/// What an error costs, up to a factor: `½ Σ ωᵢ rᵢ²` with the weights ω of [`Loss::weight`] has the same gradient.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Loss {
    /// Quadratic up to 1.345 scales, linear beyond: bounds the pull of an outlier, but does not end it.
    Huber,
    /// Tukey's biweight: constant beyond 4.685 scales. Outliers have no pull at all.
    Tukey,
    /// `u² / (1 + u²)` with u in 3.787 scales: the pull of an outlier fades with its distance.
    GemanMcClure,
    /// `|r|^p`, 1 < p ≤ 2: iteratively reweighted ℓp approximation (Imperatore 2024, Remark 14; the weight that makes a
    /// fixed point of `½ Σ ω r²` minimize `Σ |r|^p` is `|r|^(p−2)`, not its root).
    Power(f64),
}

impl Loss {
    /// The weight of a residual of `u` scales, `u ≥ 0`.
    pub fn weight(self, u: f64) -> f64 {
        match self {
            Self::Huber if u <= HUBER => 1.0,
            Self::Huber => HUBER / u,
            Self::Tukey => (1.0 - (u / TUKEY).powi(2)).max(0.0).powi(2),
            Self::GemanMcClure => (1.0 + (u / GEMAN_MCCLURE).powi(2)).powi(-2),
            Self::Power(p) => u.max(SMALLEST).powf(p - 2.0),
        }
    }

    /// Whether the loss is the square, so that all weights are 1.
    pub fn is_least_squares(self) -> bool {
        self == Self::Power(2.0)
    }

    /// Checks the exponent.
    ///
    /// # Errors
    /// [`Error::Exponent`].
    pub fn check(self) -> Result<(), Error> {
        match self {
            Self::Power(value) if !(value > 1.0 && value <= 2.0) => Err(Error::Exponent { value }),
            _ => Ok(()),
        }
    }
}

/// Standard deviation of Gaussian errors by the median of their absolute values, times 1.4826 (MAD). Up to half of the values
/// may be anything. 0 for no values.
pub fn median_scale(absolute: &mut [f64]) -> f64 {
    if absolute.is_empty() {
        return 0.0;
    }
    let middle = absolute.len() / 2;
    MEDIAN_TO_DEVIATION * *absolute.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_fall_from_one_and_lp_is_least_squares_at_two() {
        for loss in [Loss::Huber, Loss::Tukey, Loss::GemanMcClure] {
            assert_eq!(loss.weight(0.0), 1.0);
            let weights: Vec<f64> = (0..100).map(|k| loss.weight(f64::from(k) / 10.0)).collect();
            assert!(weights.windows(2).all(|w| w[1] <= w[0]), "{loss:?}");
        }
        assert_eq!(Loss::Tukey.weight(4.7), 0.0);
        assert!((Loss::GemanMcClure.weight(GEMAN_MCCLURE) - 0.25).abs() < 1e-15);
        assert_eq!(Loss::Power(2.0).weight(17.0), 1.0);
        assert!((Loss::Power(1.5).weight(4.0) - 0.5).abs() < 1e-15);
        assert!(Loss::Power(1.0).check().is_err() && Loss::Power(f64::NAN).check().is_err());
        assert!(Loss::Power(1.2).check().is_ok());
    }

    #[test]
    fn the_scale_of_a_gaussian_survives_gross_outliers() {
        // Quantiles of the standard normal distribution by bisection of its series, half of them negative.
        let normal = |x: f64| {
            let (mut term, mut sum) = (x, x);
            for k in 1..200 {
                term *= x * x / f64::from(2 * k + 1);
                sum += term;
            }
            0.5 + sum * (-0.5 * x * x).exp() / (2.0 * std::f64::consts::PI).sqrt()
        };
        let quantile = |q: f64| {
            let (mut low, mut high) = (-6.0, 6.0);
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if normal(middle) < q { low = middle } else { high = middle }
            }
            low
        };
        let clean: Vec<f64> = (0..400).map(|k| 0.3 * quantile((f64::from(k) + 0.5) / 400.0)).collect();
        let mut absolute: Vec<f64> = clean.iter().map(|x| x.abs()).collect();
        assert!((median_scale(&mut absolute) - 0.3).abs() < 0.002);
        absolute.extend(vec![1e6; 100]);
        let contaminated = median_scale(&mut absolute);
        assert!(contaminated > 0.3 && contaminated < 0.45, "{contaminated}");
        assert_eq!(median_scale(&mut []), 0.0);
    }
}
