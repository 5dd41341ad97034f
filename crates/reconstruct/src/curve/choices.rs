//! Choices of a curve fit, as they are typed and as they stand in the report.

use std::fmt;
use std::str::FromStr;

use param_classic::Rule;

use crate::ParseOptionError;
use crate::options::{named, parse_error, serialize_as_typed};

named!(
    /// How parameters of a sequence are found.
    CurveParameters, "auto, given, chord, centripetal, parcnn or uniform",
    /// Those of the file, else by chord length.
    Auto = "auto",
    /// Those of the file, in its column u.
    Given = "given",
    /// Steps proportional to the distance of neighbours.
    Chord = "chord",
    /// Steps proportional to the root of that distance.
    Centripetal = "centripetal",
    /// By a convolutional network (Imperatore 2024, §4.1).
    Parcnn = "parcnn",
    /// Equal steps.
    Uniform = "uniform"
);

impl CurveParameters {
    /// The classical rule, if it is one.
    pub(super) fn rule(self) -> Option<Rule> {
        match self {
            Self::Auto | Self::Chord => Some(Rule::ChordLength),
            Self::Centripetal => Some(Rule::Centripetal),
            Self::Uniform => Some(Rule::Uniform),
            Self::Given | Self::Parcnn => None,
        }
    }
}

named!(
    /// Whether a curve closes.
    ClosedChoice, "auto, yes or no",
    /// It does where the last point is the first one, or as near as neighbours are.
    Auto = "auto",
    /// It does.
    Yes = "yes",
    /// It does not, even if the last point is the first one.
    No = "no"
);

named!(
    /// What happens at the ends of an open curve.
    Ends, "free or held",
    /// The curve comes near the first and the last point, as near any other.
    Free = "free",
    /// It starts at the first and ends at the last point.
    Held = "held"
);

/// The points where a curve may turn sharply.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CornerChoice {
    /// Points whose turning stands out from that of their neighbours.
    Auto,
    /// None.
    None,
    /// Rows of the input, from 0.
    Rows(Vec<usize>),
}

impl FromStr for CornerChoice {
    type Err = ParseOptionError;

    fn from_str(text: &str) -> Result<Self, ParseOptionError> {
        match text {
            "auto" => Ok(Self::Auto),
            "none" => Ok(Self::None),
            rows => {
                let rows: Result<Vec<usize>, _> = rows.split(',').map(|row| row.trim().parse()).collect();
                rows.map(Self::Rows).map_err(|_| parse_error(text, "auto, none, or rows of the input such as 0,17,42"))
            }
        }
    }
}

impl fmt::Display for CornerChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::None => f.write_str("none"),
            Self::Rows(rows) => {
                let rows: Vec<String> = rows.iter().map(usize::to_string).collect();
                f.write_str(&rows.join(","))
            }
        }
    }
}

/// Where the knots of a curve lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KnotChoice {
    /// Inserted where errors are largest, until the tolerance is reached.
    Adaptive,
    /// So many inner knots, by averaging parameters: spans hold about equally many points.
    Averaged(usize),
    /// So many inner knots, equidistant.
    Uniform(usize),
}

impl FromStr for KnotChoice {
    type Err = ParseOptionError;

    fn from_str(text: &str) -> Result<Self, ParseOptionError> {
        let wrong = |_| parse_error(text, "adaptive, a number of inner knots, or uniform:N");
        match (text, text.strip_prefix("uniform:")) {
            ("adaptive", _) => Ok(Self::Adaptive),
            (_, Some(count)) => count.parse().map(Self::Uniform).map_err(wrong),
            (count, None) => count.parse().map(Self::Averaged).map_err(wrong),
        }
    }
}

impl fmt::Display for KnotChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Adaptive => f.write_str("adaptive"),
            Self::Averaged(count) => write!(f, "{count}"),
            Self::Uniform(count) => write!(f, "uniform:{count}"),
        }
    }
}

serialize_as_typed!(CurveParameters, ClosedChoice, Ends, CornerChoice, KnotChoice);
