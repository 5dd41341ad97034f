//! Choices among methods and rules, and numbers with units.

use std::fmt;
use std::str::FromStr;

use adaptive::Marking;
use fit_ls::Lambda;
use thb_core::Quadrature;

use super::typed::{ParseOptionError, named, parse_error, range, serialize_as_typed};
use crate::Error;

serialize_as_typed!(LambdaChoice, Tolerance, Mark, Method, BoundaryChoice, BlendChoice, Energy, Samples, Schema);

named!(
    /// The fitting method.
    Method, "auto, ls, qi, a-pdm, a-tdm, a-hdm, a-qi, j-pdm or joint",
    /// Least squares with fixed parameters, then joint where that spares control points and does no harm.
    Auto = "auto",
    /// Penalized least squares with fixed parameters.
    Ls = "ls",
    /// Quasi-interpolation by local least squares with fixed parameters (Imperatore 2024, §3.2).
    Qi = "qi",
    /// Coefficients by point distance and foot points in turn (Imperatore 2024, §5.1.2).
    APdm = "a-pdm",
    /// Coefficients by tangent distance and foot points in turn.
    ATdm = "a-tdm",
    /// Coefficients by a blend of both distances and foot points in turn.
    AHdm = "a-hdm",
    /// Quasi-interpolation and foot points in turn.
    AQi = "a-qi",
    /// Coefficients and parameters together by L-BFGS (Imperatore 2024, §5.3).
    JPdm = "j-pdm",
    /// Coefficients and parameters together by Levenberg–Marquardt steps from which the parameters are eliminated.
    Joint = "joint"
);

impl Method {
    /// Whether points keep their parameters, at least in a first fit.
    pub(crate) fn begins_fixed(self) -> bool {
        matches!(self, Self::Ls | Self::Auto)
    }
}
named!(
    /// What happens to points on the boundary of the parameter domain while parameters move.
    BoundaryChoice, "kept or free",
    /// They stay on their side, corners on their corner.
    Kept = "kept",
    /// They move like all others.
    Free = "free"
);

impl BoundaryChoice {
    pub(crate) fn constraint(self) -> moving_param::Boundary {
        match self {
            Self::Kept => moving_param::Boundary::Kept,
            Self::Free => moving_param::Boundary::Free,
        }
    }
}

/// The weight of the point distance in A-HDM.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BlendChoice {
    /// By the error of the point.
    Error,
    /// By the curvature of the cloud at the point.
    Curvature,
    /// The same for all points.
    Constant(f64),
}

impl FromStr for BlendChoice {
    type Err = ParseOptionError;

    fn from_str(text: &str) -> Result<Self, ParseOptionError> {
        match text {
            "error" => Ok(Self::Error),
            "curvature" => Ok(Self::Curvature),
            number => number
                .parse()
                .map(Self::Constant)
                .map_err(|_| parse_error(text, "error, curvature, or a number from 0 to 1")),
        }
    }
}

impl fmt::Display for BlendChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Error => f.write_str("error"),
            Self::Curvature => f.write_str("curvature"),
            Self::Constant(gamma) => write!(f, "{gamma}"),
        }
    }
}
named!(
    /// How the smoothing energy is integrated.
    Energy, "exact or gauss-p",
    /// Exactly.
    Exact = "exact",
    /// With as many Gauss nodes per direction as the degree, as G+Smo does.
    GaussP = "gauss-p"
);
named!(
    /// What of a mesh is fitted.
    Samples, "area or vertices",
    /// Its area: long triangles get further points, and points weigh as much as the area round them.
    Area = "area",
    /// Its vertices, all alike, at their parameters.
    Vertices = "vertices"
);
named!(
    /// The application protocol of STEP files.
    Schema, "ap214 or ap242",
    /// AP214, which every CAD system reads.
    Ap214 = "ap214",
    /// AP242, which has taken its place.
    Ap242 = "ap242"
);
impl Energy {
    pub(crate) fn quadrature(self) -> Quadrature {
        match self {
            Self::Exact => Quadrature::Exact,
            Self::GaussP => Quadrature::GaussP,
        }
    }
}

/// A tolerance in the units of the input, or a percentage of the bounding box diagonal, or chosen by the scan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tolerance {
    /// Of a surface as [`ScanMeasures`](crate::ScanMeasures) say, elsewhere 0.1 % of the diagonal.
    Auto,
    /// In units of the input.
    Absolute(f64),
    /// Percent of the diagonal.
    Percent(f64),
}

/// Percent of the diagonal that [`Tolerance::Auto`] is where nothing is measured.
const AUTO_PERCENT: f64 = 0.1;

impl Tolerance {
    /// Checks that it is positive and finite.
    ///
    /// # Errors
    /// [`Error::OptionRange`].
    pub(crate) fn check(self) -> Result<(), Error> {
        self.check_as("--tol")
    }

    /// The same for an option of another name.
    pub(crate) fn check_as(self, option: &'static str) -> Result<(), Error> {
        let (Self::Absolute(number) | Self::Percent(number)) = self else { return Ok(()) };
        if number.is_finite() && number > 0.0 {
            return Ok(());
        }
        Err(Error::OptionRange { option, given: self.to_string(), allowed: "a positive number" })
    }

    /// In the units of the input, for a given diagonal.
    pub fn resolve(self, diagonal: f64) -> f64 {
        match self {
            Self::Auto => AUTO_PERCENT / 100.0 * diagonal,
            Self::Absolute(tolerance) => tolerance,
            Self::Percent(percent) => percent / 100.0 * diagonal,
        }
    }
}

impl FromStr for Tolerance {
    type Err = ParseOptionError;

    fn from_str(text: &str) -> Result<Self, ParseOptionError> {
        let wrong = |_| parse_error(text, "a length such as 0.05, a percentage of the diagonal such as 0.1%, or auto");
        if text == "auto" {
            return Ok(Self::Auto);
        }
        match text.strip_suffix('%') {
            Some(number) => number.trim().parse().map(Self::Percent).map_err(wrong),
            None => text.parse().map(Self::Absolute).map_err(wrong),
        }
    }
}

impl fmt::Display for Tolerance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Absolute(tolerance) => write!(f, "{tolerance}"),
            Self::Percent(percent) => write!(f, "{percent}%"),
        }
    }
}

/// The smoothing weight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LambdaChoice {
    /// Chosen from the data ([`Lambda::Auto`]).
    Auto,
    /// By generalized cross-validation ([`Lambda::CrossValidation`]).
    CrossValidation,
    /// As large as a known noise allows ([`Lambda::Discrepancy`]).
    Discrepancy(Tolerance),
    /// The given number.
    Fixed(f64),
}

impl LambdaChoice {
    /// Checks the ranges of its numbers.
    pub(crate) fn check(self) -> Result<(), Error> {
        match self {
            Self::Auto | Self::CrossValidation => Ok(()),
            Self::Fixed(lambda) => {
                range("--lambda", lambda.to_string(), "0 or a positive number", lambda.is_finite() && lambda >= 0.0)
            }
            Self::Discrepancy(Tolerance::Auto) => range("--lambda", self.to_string(), "a length of the noise", false),
            Self::Discrepancy(Tolerance::Absolute(noise) | Tolerance::Percent(noise)) => {
                range("--lambda", self.to_string(), "a positive noise", noise.is_finite() && noise > 0.0)
            }
        }
    }

    /// The choice for a tolerance in the units of the input, and a diagonal.
    pub(crate) fn resolve(self, tolerance: f64, diagonal: f64) -> Lambda {
        match self {
            Self::Auto => Lambda::Auto { tolerance },
            Self::CrossValidation => Lambda::CrossValidation,
            Self::Discrepancy(noise) => Lambda::Discrepancy { noise: noise.resolve(diagonal) },
            Self::Fixed(lambda) => Lambda::Fixed(lambda),
        }
    }
}

impl FromStr for LambdaChoice {
    type Err = ParseOptionError;

    fn from_str(text: &str) -> Result<Self, ParseOptionError> {
        let wrong = || {
            parse_error(
                text,
                "auto, gcv, discrepancy:SIGMA with a noise in units of the input or in percent of the diagonal, or a number such as 1e-7",
            )
        };
        match (text, text.strip_prefix("discrepancy:")) {
            ("auto", _) => Ok(Self::Auto),
            ("gcv", _) => Ok(Self::CrossValidation),
            (_, Some(noise)) => noise.parse().map(Self::Discrepancy).map_err(|_| wrong()),
            _ => text.parse().map(Self::Fixed).map_err(|_| wrong()),
        }
    }
}

impl fmt::Display for LambdaChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::CrossValidation => f.write_str("gcv"),
            Self::Discrepancy(noise) => write!(f, "discrepancy:{noise}"),
            Self::Fixed(lambda) => write!(f, "{lambda:e}"),
        }
    }
}

/// Which cells are refined: around the `worst` points as far as points may be left out, around all beyond the tolerance
/// (`threshold`), or `share:0.1` for those with the worst tenth of the points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mark(pub Marking);

impl FromStr for Mark {
    type Err = ParseOptionError;

    fn from_str(text: &str) -> Result<Self, ParseOptionError> {
        let share = text.strip_prefix("share:").and_then(|number| number.parse().ok());
        match (text, share) {
            ("worst", _) => Ok(Self(Marking::Worst)),
            ("threshold", _) => Ok(Self(Marking::Threshold)),
            (_, Some(share)) => Ok(Self(Marking::Share(share))),
            _ => Err(parse_error(text, "worst, threshold, or share:S with a share S such as 0.1")),
        }
    }
}

impl fmt::Display for Mark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Marking::Worst => f.write_str("worst"),
            Marking::Threshold => f.write_str("threshold"),
            Marking::Share(share) => write!(f, "share:{share}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::Pair;

    #[test]
    fn options_read_back_as_they_are_written() {
        for text in ["0.1%", "0.0001", "12", "auto"] {
            assert_eq!(text.parse::<Tolerance>().unwrap().to_string(), text);
        }
        for text in ["worst", "threshold", "share:0.1"] {
            assert_eq!(text.parse::<Mark>().unwrap().to_string(), text);
        }
        assert_eq!("8x4".parse(), Ok(Pair([8, 4])));
        assert_eq!("2".parse(), Ok(Pair([2, 2])));
        assert_eq!("1e-7".parse::<LambdaChoice>().unwrap().to_string(), "1e-7");
        assert!("2,3,4".parse::<Pair>().is_err());
        assert!("share:x".parse::<Mark>().is_err());
        assert!("ten %".parse::<Tolerance>().is_err());
    }
}
