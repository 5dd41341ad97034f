//! Markers: points that must be met, and points that must not be followed.

use crate::Error;

/// Marked points, by their index in the order in which the points were given; the two sets are disjoint (Imperatore 2024,
/// §3.1.7).
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Markers {
    /// Type I: points that must be met.
    pub met: Vec<usize>,
    /// Type II: points that must be ignored.
    pub ignored: Vec<usize>,
}

impl Markers {
    /// Whether no point is marked.
    pub fn is_empty(&self) -> bool {
        self.met.is_empty() && self.ignored.is_empty()
    }

    /// Checks that the markers name some of `points` points, each once.
    ///
    /// # Errors
    /// [`Error::Marker`], [`Error::MarkedTwice`].
    pub fn check(&self, points: usize) -> Result<(), Error> {
        let mut marked = vec![false; points];
        for &index in self.met.iter().chain(&self.ignored) {
            match marked.get_mut(index) {
                None => return Err(Error::Marker { index, points }),
                Some(true) => return Err(Error::MarkedTwice { index }),
                Some(marked) => *marked = true,
            }
        }
        Ok(())
    }
}

/// The factor α by which the weight of a marker that is not satisfied is multiplied (type I) or divided (type II).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Update {
    /// `1 + e / unit` for a point at distance e. (3.14) of Imperatore 2024 has the unit 1, which suits points in the unit cube;
    /// with the tolerance as the unit, weights grow alike in all units.
    ErrorDriven {
        /// The distance that doubles a weight.
        unit: f64,
    },
    /// The same for all: 1.25 in example 3.1.9 (c).
    Constant(f64),
}

impl Update {
    /// The factor for a point at a distance; above 1.
    pub fn factor(self, error: f64) -> f64 {
        match self {
            Self::ErrorDriven { unit } => 1.0 + error / unit,
            Self::Constant(factor) => factor,
        }
    }
}

/// When markers are satisfied, and how their weights change until they are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MarkerRules {
    /// tol_I: a marker of type I is satisfied below this distance.
    pub met: f64,
    /// tol_II: a marker of type II is satisfied above this distance.
    pub ignored: f64,
    /// The change of weights.
    pub update: Update,
    /// The weight, 0 to 1, that markers of type II begin with. The text has 1, so that they are followed at first and fade
    /// away; with 0, they count for nothing from the start.
    pub first_weight: f64,
    /// Whether a marker that is satisfied leaves its set and keeps its weight, as in Algorithm 2; in Algorithm 1 it
    /// may be called again.
    pub shrink: bool,
}

impl MarkerRules {
    /// Both tolerances, weights that change by a quarter, type II ignored from the start, sets that shrink.
    pub fn new(met: f64, ignored: f64) -> Self {
        Self { met, ignored, update: Update::Constant(1.25), first_weight: 0.0, shrink: true }
    }

    /// Algorithm 1 of Imperatore 2024, for a fixed space: the update (3.14), type II with weight 1 at first, sets that
    /// keep their markers.
    pub fn algorithm_1(met: f64, ignored: f64) -> Self {
        Self { update: Update::ErrorDriven { unit: 1.0 }, first_weight: 1.0, shrink: false, ..Self::new(met, ignored) }
    }

    /// Algorithm 2 of Imperatore 2024, for the adaptive loop: as the first, with sets that shrink.
    pub fn algorithm_2(met: f64, ignored: f64) -> Self {
        Self { shrink: true, ..Self::algorithm_1(met, ignored) }
    }

    /// Checks ranges.
    ///
    /// # Errors
    /// [`Error::MarkerRule`].
    pub fn check(&self) -> Result<(), Error> {
        let fail = |what, value| Err(Error::MarkerRule { what, value });
        if !(self.met.is_finite() && self.met > 0.0) {
            return fail("tolerance of type I above 0", self.met);
        }
        if !(self.ignored.is_finite() && self.ignored >= 0.0) {
            return fail("tolerance of type II of 0 or more", self.ignored);
        }
        if !(0.0..=1.0).contains(&self.first_weight) {
            return fail("first weight from 0 to 1", self.first_weight);
        }
        match self.update {
            Update::ErrorDriven { unit } if !(unit.is_finite() && unit > 0.0) => fail("unit of errors above 0", unit),
            Update::Constant(factor) if !(factor.is_finite() && factor > 1.0) => fail("factor above 1", factor),
            _ => Ok(()),
        }
    }
}

/// Weights beyond this change nothing but the condition of the equations: by Remark 13 of Imperatore 2024 the fit tends to
/// one that interpolates the markers, and here it does so to seven digits.
const LARGEST: f64 = 1e7;

/// The inverse for type II.
const SMALLEST: f64 = 1e-7;

/// Markers with their weights in the course of a fit.
#[derive(Clone, Debug)]
pub(super) struct MarkerWeights {
    all: Markers,
    /// Those that are still to be satisfied.
    active: Markers,
    rules: MarkerRules,
    /// Factor of each point.
    pub(super) factors: Vec<f64>,
}

impl MarkerWeights {
    pub(super) fn new(markers: Markers, rules: MarkerRules, points: usize) -> Result<Self, Error> {
        markers.check(points)?;
        if !markers.is_empty() {
            rules.check()?;
        }
        let mut factors = vec![1.0; points];
        markers.ignored.iter().for_each(|&i| factors[i] = rules.first_weight);
        Ok(Self { active: markers.clone(), all: markers, rules, factors })
    }

    pub(super) fn markers(&self) -> &Markers {
        &self.all
    }

    /// One update for the errors of all points; whether all markers were satisfied.
    pub(super) fn update(&mut self, errors: &[f64]) -> bool {
        let Self { all, active, rules, factors } = self;
        for &i in &active.met {
            if errors[i] >= rules.met {
                factors[i] = (factors[i] * rules.update.factor(errors[i])).min(LARGEST);
            }
        }
        for &i in &active.ignored {
            if errors[i] <= rules.ignored && factors[i] > 0.0 {
                factors[i] = (factors[i] / rules.update.factor(errors[i])).max(SMALLEST);
            }
        }
        if rules.shrink {
            active.met.retain(|&i| errors[i] >= rules.met);
            active.ignored.retain(|&i| errors[i] <= rules.ignored);
        }
        Self::unsatisfied(all, rules, factors, errors) == [0, 0]
    }

    /// Markers of both types that are not satisfied. What has no weight is ignored, wherever the fit passes.
    pub(super) fn count_unsatisfied(&self, errors: &[f64]) -> [usize; 2] {
        Self::unsatisfied(&self.all, &self.rules, &self.factors, errors)
    }

    fn unsatisfied(all: &Markers, rules: &MarkerRules, factors: &[f64], errors: &[f64]) -> [usize; 2] {
        [
            all.met.iter().filter(|&&i| errors[i] >= rules.met).count(),
            all.ignored.iter().filter(|&&i| errors[i] <= rules.ignored && factors[i] > 0.0).count(),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_grow_and_fall_until_markers_are_satisfied() {
        let markers = Markers { met: vec![0, 1], ignored: vec![2, 3] };
        let rules = MarkerRules::algorithm_2(0.1, 0.5);
        let mut weights = MarkerWeights::new(markers, rules, 5).unwrap();
        assert!(!weights.update(&[0.2, 0.05, 0.25, 0.6, 9.0]));
        assert_eq!(weights.factors, [1.2, 1.0, 0.8, 1.0, 1.0]);
        // Satisfied markers have left their sets and keep their weights, whatever comes.
        assert!(!weights.update(&[0.0, 0.3, 0.6, 0.1, 9.0]));
        assert_eq!(weights.factors, [1.2, 1.0, 0.8, 1.0, 1.0]);
        assert_eq!(weights.count_unsatisfied(&[0.0, 0.3, 0.6, 0.1, 9.0]), [1, 1]);
        assert!(weights.update(&[0.0, 0.0, 0.6, 0.7, 9.0]));
    }

    #[test]
    fn what_has_no_weight_is_ignored_wherever_the_fit_passes() {
        let markers = Markers { met: vec![], ignored: vec![1] };
        let mut weights = MarkerWeights::new(markers, MarkerRules::new(0.1, 0.5), 2).unwrap();
        assert_eq!(weights.factors, [1.0, 0.0]);
        assert!(weights.update(&[0.0, 0.0]));
    }

    #[test]
    fn wrong_markers_are_refused() {
        let check = |met: &[usize], ignored: &[usize]| {
            Markers { met: met.to_vec(), ignored: ignored.to_vec() }.check(4).unwrap_err()
        };
        assert_eq!(check(&[4], &[]), Error::Marker { index: 4, points: 4 });
        assert_eq!(check(&[1], &[2, 1]), Error::MarkedTwice { index: 1 });
        assert!(MarkerRules::new(0.0, 1.0).check().is_err());
        assert!(MarkerRules { update: Update::Constant(1.0), ..MarkerRules::new(1.0, 1.0) }.check().is_err());
    }
}
