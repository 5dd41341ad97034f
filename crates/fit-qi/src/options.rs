//! What to choose.

use crate::Error;

/// How coefficients are found and functions are marked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options<const D: usize> {
    /// The smoothing weight of the local problems.
    pub lambda: LocalLambda,
    /// Smallest number of points of a local problem; `None` for the number of functions on a cell, `∏ (p_d + 1)`.
    /// Imperatore 2024, §3.3, suggests numbers between `d²` and `(d + 1)²`.
    pub n_min: Option<usize>,
    /// Smallest share of the cells of a local problem that must hold a point (Imperatore 2024, §3.3.3), from 0 to 1.
    pub density: f64,
    /// Number of points in the support of a function from which on it may be refined, at least `n_min` (Remark 19);
    /// `None` for twice the number of functions on a cell, `2 ∏ (p_d + 1)`.
    pub n_loc: Option<usize>,
    /// Parts per direction into which the support of a function is split; each of them must hold its share of `n_loc`.
    pub splits: [usize; D],
}

impl<const D: usize> Default for Options<D> {
    fn default() -> Self {
        Self {
            lambda: LocalLambda::Automatic { tolerance: f64::INFINITY },
            n_min: None,
            density: 0.3,
            n_loc: None,
            splits: [1; D],
        }
    }
}

/// The smoothing weight λ of a local problem: it minimizes `½ Σ ω |s(u) − p|² + ½ λ J(s)` over the points and the energy of
/// its region (Imperatore 2024, (3.20), there without the factors ½).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LocalLambda {
    /// The same number everywhere. Where points are dense or cells are large, data weigh more.
    Constant(f64),
    /// The given number times the sum of the weights of the local points, so that their number does not matter.
    PerPoint(f64),
    /// The given number times the region's share of the area of the domain. Second derivatives of a wave grow with the
    /// inverse square of its length, so this smooths waves of a cell's size alike on all levels.
    PerArea(f64),
    /// One constant, chosen from the data as in [`fit_ls::Lambda::Auto`].
    Automatic {
        /// Distance up to which a point counts as met.
        tolerance: f64,
    },
}

impl LocalLambda {
    /// The number given; none for an automatic one.
    pub fn number(self) -> Option<f64> {
        match self {
            Self::Constant(value) | Self::PerPoint(value) | Self::PerArea(value) => Some(value),
            Self::Automatic { .. } => None,
        }
    }

    /// The weight of a region with the given sum of weights and share of the domain.
    pub(crate) fn of_region(self, weight: f64, share: f64) -> f64 {
        match self {
            Self::Constant(value) => value,
            Self::PerPoint(value) => value * weight,
            Self::PerArea(value) => value * share,
            Self::Automatic { .. } => 0.0,
        }
    }
}

impl<const D: usize> Options<D> {
    /// Checks all that does not depend on the degree.
    pub(crate) fn check(&self, points: usize) -> Result<(), Error> {
        let number = |name, value: f64, valid: bool, allowed| {
            if valid { Ok(()) } else { Err(Error::Option { name, value, allowed }) }
        };
        if let Some(value) = self.lambda.number() {
            number("the smoothing weight", value, value.is_finite() && value >= 0.0, "at least 0")?;
        }
        number("the density", self.density, (0.0..=1.0).contains(&self.density), "between 0 and 1")?;
        if let Some(n) = self.n_min {
            let allowed = ["at least 2", "at least 3", "at least 4"][D.clamp(1, 3) - 1];
            number("n_min", n as f64, n > D, allowed)?;
        }
        if let (Some(loc), Some(min)) = (self.n_loc, self.n_min) {
            number("n_loc", loc as f64, loc >= min, "at least n_min")?;
        }
        let fewest = self.splits.iter().copied().min().unwrap_or(0);
        number("the number of parts of a support", fewest as f64, fewest >= 1, "at least 1")?;
        let needed = self.n_min.unwrap_or(D + 1);
        if points < needed { Err(Error::TooFewPoints { given: points, needed }) } else { Ok(()) }
    }

    /// `n_min` for a degree.
    pub(crate) fn local_points(&self, degree: [usize; D]) -> usize {
        self.n_min.unwrap_or_else(|| degree.iter().map(|p| p + 1).product())
    }

    /// `n_loc` for a degree.
    pub(crate) fn points_to_refine(&self, degree: [usize; D]) -> usize {
        let usual = 2 * degree.iter().map(|p| p + 1).product::<usize>();
        self.n_loc.unwrap_or(usual).max(self.local_points(degree))
    }
}
