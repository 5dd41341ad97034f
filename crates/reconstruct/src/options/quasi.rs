//! Options of quasi-interpolation.

use fit_qi::LocalLambda;
use serde::Serialize;

use super::choices::LambdaChoice;
use super::typed::{Pair, named, range, serialize_as_typed};
use crate::Error;

named!(
    /// How the smoothing weight of a local problem follows from `--lambda`.
    LocalRule, "constant, points or area",
    /// It is that number.
    Constant = "constant",
    /// Times the number of local points.
    Points = "points",
    /// Times the region's share of the parameter domain.
    Area = "area"
);
serialize_as_typed!(LocalRule);

/// Options of `qi` and `a-qi`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct QuasiOptions {
    /// Smallest number of points of a local problem; `None` for the number of functions on a cell.
    pub n_min: Option<usize>,
    /// Points in the support of a function from which on it may be refined; `None` for twice the number of functions on a
    /// cell.
    pub n_loc: Option<usize>,
    /// Smallest share of the cells of a local problem that hold a point.
    pub density: f64,
    /// Parts of a support, each of which must hold its share of `n_loc`.
    pub splits: Pair,
    /// How the smoothing weight of a local problem follows from that of the fit.
    pub local_lambda: LocalRule,
}

impl Default for QuasiOptions {
    fn default() -> Self {
        let usual = fit_qi::Options::<2>::default();
        Self {
            n_min: usual.n_min,
            n_loc: usual.n_loc,
            density: usual.density,
            splits: Pair(usual.splits),
            local_lambda: LocalRule::Constant,
        }
    }
}

impl QuasiOptions {
    /// Checks ranges that types do not express.
    ///
    /// # Errors
    /// [`Error::OptionRange`].
    pub(crate) fn check(&self) -> Result<(), Error> {
        let number = |n: Option<usize>| n.map_or(String::new(), |n| n.to_string());
        range("--n-min", number(self.n_min), "3 or more", self.n_min.is_none_or(|n| n >= 3))?;
        let enough = self.n_loc.is_none_or(|loc| loc >= self.n_min.unwrap_or(3));
        range("--n-loc", number(self.n_loc), "3 or more, and at least --n-min", enough)?;
        range("--density", self.density.to_string(), "0 to 1", (0.0..=1.0).contains(&self.density))?;
        range("--splits", self.splits.to_string(), "1 to 64", self.splits.0.iter().all(|n| (1..=64).contains(n)))
    }

    pub(crate) fn resolve(&self, lambda: LambdaChoice, tolerance: f64) -> fit_qi::Options<2> {
        let lambda = match (lambda, self.local_lambda) {
            // The others are refused with these methods.
            (LambdaChoice::Auto | LambdaChoice::CrossValidation | LambdaChoice::Discrepancy(_), _) => {
                LocalLambda::Automatic { tolerance }
            }
            (LambdaChoice::Fixed(value), LocalRule::Constant) => LocalLambda::Constant(value),
            (LambdaChoice::Fixed(value), LocalRule::Points) => LocalLambda::PerPoint(value),
            (LambdaChoice::Fixed(value), LocalRule::Area) => LocalLambda::PerArea(value),
        };
        let Self { n_min, n_loc, density, splits, .. } = *self;
        fit_qi::Options { lambda, n_min, n_loc, density, splits: splits.0 }
    }
}
