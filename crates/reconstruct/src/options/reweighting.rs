//! Options of robust losses and markers.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use fit_ls::{Loss, MAX_SET_ASIDE};
use serde::Serialize;

use super::choices::{Method, Tolerance};
use super::typed::{ParseOptionError, parse_error, range, serialize_as_typed};
use crate::Error;

/// Options of reweighting.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ReweightingOptions {
    /// The robust loss, if any.
    pub robust: Option<LossChoice>,
    /// Largest share of the points that a robust loss, or the search for markers of type II, sets aside.
    pub max_set_aside: f64,
    /// Where markers come from, if there are any.
    pub markers: Option<MarkerChoice>,
    /// Distance below which a marker of type I is met; `None` for the tolerance.
    pub marker_tol: Option<Tolerance>,
    /// Distance above which a marker of type II is ignored; `None` for the tolerance.
    pub ignore_tol: Option<Tolerance>,
    /// How the weights of markers change.
    pub marker_update: UpdateChoice,
}

impl Default for ReweightingOptions {
    /// Nothing is asked for.
    fn default() -> Self {
        Self {
            robust: None,
            max_set_aside: MAX_SET_ASIDE,
            markers: None,
            marker_tol: None,
            ignore_tol: None,
            marker_update: UpdateChoice::default(),
        }
    }
}

impl ReweightingOptions {
    /// Whether anything is asked for.
    pub(crate) fn is_asked_for(&self) -> bool {
        self.robust.is_some() || self.markers.is_some()
    }

    pub(crate) fn check(&self, method: Method) -> Result<(), Error> {
        for (option, asked) in [("--robust", self.robust.is_some()), ("--markers", self.markers.is_some())] {
            if asked && matches!(method, Method::Qi | Method::AQi) {
                return Err(Error::OtherMethod { option, method: method.to_string() });
            }
        }
        if let Some(LossChoice(loss)) = self.robust {
            let in_range = loss.check().is_ok();
            range("--robust", LossChoice(loss).to_string(), "lp:P with 1 < P ≤ 2", in_range)?;
        }
        let share = self.max_set_aside;
        range("--max-set-aside", share.to_string(), "a share from 0 to 1", (0.0..=1.0).contains(&share))?;
        if let UpdateChoice::Constant(factor) = self.marker_update {
            let in_range = factor.is_finite() && factor > 1.0;
            range("--marker-update", factor.to_string(), "error, or a factor above 1", in_range)?;
        }
        self.marker_tol.iter().chain(&self.ignore_tol).try_for_each(|tol| tol.check())
    }
}

/// A robust loss.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LossChoice(pub Loss);

impl FromStr for LossChoice {
    type Err = ParseOptionError;

    fn from_str(text: &str) -> Result<Self, ParseOptionError> {
        let power = text.strip_prefix("lp:").and_then(|p| p.parse().ok());
        Ok(Self(match (text, power) {
            ("huber", _) => Loss::Huber,
            ("tukey", _) => Loss::Tukey,
            ("geman-mcclure", _) => Loss::GemanMcClure,
            (_, Some(p)) => Loss::Power(p),
            _ => return Err(parse_error(text, "huber, tukey, geman-mcclure, or lp:P with 1 < P ≤ 2")),
        }))
    }
}

impl fmt::Display for LossChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Loss::Huber => f.write_str("huber"),
            Loss::Tukey => f.write_str("tukey"),
            Loss::GemanMcClure => f.write_str("geman-mcclure"),
            Loss::Power(p) => write!(f, "lp:{p}"),
            // Losses that have no name here cannot be typed.
            _ => f.write_str("other"),
        }
    }
}

/// Where markers come from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum MarkerChoice {
    /// Found by a first fit and by curvature.
    Auto,
    /// A file with a row and a type, I or II, in each line.
    File(PathBuf),
}

impl FromStr for MarkerChoice {
    type Err = ParseOptionError;

    fn from_str(text: &str) -> Result<Self, ParseOptionError> {
        match text {
            "" => Err(parse_error(text, "auto, or the name of a file")),
            "auto" => Ok(Self::Auto),
            path => Ok(Self::File(path.into())),
        }
    }
}

impl fmt::Display for MarkerChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::File(path) => path.display().fmt(f),
        }
    }
}

/// How the weights of markers change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum UpdateChoice {
    /// By `1 + e / tolerance` for a marker at distance e: (3.14) of Imperatore 2024 with the marker's tolerance as its unit.
    Error,
    /// By a constant factor.
    Constant(f64),
}

impl Default for UpdateChoice {
    /// A quarter more, as in example 3.1.9 (c).
    fn default() -> Self {
        Self::Constant(1.25)
    }
}

impl FromStr for UpdateChoice {
    type Err = ParseOptionError;

    fn from_str(text: &str) -> Result<Self, ParseOptionError> {
        match text {
            "error" => Ok(Self::Error),
            number => number.parse().map(Self::Constant).map_err(|_| parse_error(text, "error, or a factor above 1")),
        }
    }
}

impl fmt::Display for UpdateChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Error => f.write_str("error"),
            Self::Constant(factor) => factor.fmt(f),
        }
    }
}

serialize_as_typed!(LossChoice, MarkerChoice, UpdateChoice);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_read_back_as_they_are_written() {
        for text in ["huber", "tukey", "geman-mcclure", "lp:1.5"] {
            assert_eq!(text.parse::<LossChoice>().unwrap().to_string(), text);
        }
        for text in ["error", "1.25"] {
            assert_eq!(text.parse::<UpdateChoice>().unwrap().to_string(), text);
        }
        for text in ["auto", "marks.csv"] {
            assert_eq!(text.parse::<MarkerChoice>().unwrap().to_string(), text);
        }
        assert!("cauchy".parse::<LossChoice>().is_err() && "lp:x".parse::<LossChoice>().is_err());
        assert!("".parse::<MarkerChoice>().is_err());
    }
}
