//! Options of the way from a scan to parameters, as they are typed and as they stand in the report.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use geom_io::ReadOptions;
use param_classic::{Radius, Rule};
use serde::{Serialize, Serializer};

use super::typed::{ParseOptionError, named, parse_error, range, serialize_as_typed, shown, typed};
use crate::Error;

/// How a scan is read, cleaned and laid out on the unit square.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ParameterOptions {
    /// How the input is read.
    #[serde(flatten)]
    pub read: ReadOptions,
    /// What is removed from the points beside what is set aside unasked: see [`crate::CleaningReport`].
    pub clean: Vec<Clean>,
    /// The piece of the mesh or cloud that is kept, from 1, the largest first; `None` for all.
    pub piece: Option<usize>,
    /// Most points that are kept, well spread; `None` for all.
    pub thin: Option<usize>,
    /// Rectangle in x and y outside which points are left out.
    pub crop: Option<Crop>,
    /// A grid file; points over cells of it that are 0 or without data are left out.
    #[serde(serialize_with = "shown_if_any")]
    pub mask: Option<PathBuf>,
    /// Where parameters come from.
    pub param: ParameterChoice,
    /// The parameter domain.
    pub domain: Domain,
    /// The directions in which the surface closes on itself.
    pub closed: Closed,
    /// The points that become the corners.
    pub corners: Option<GivenCorners>,
    /// A file that names the points of the outer boundary.
    #[serde(serialize_with = "shown_if_any")]
    pub outline: Option<PathBuf>,
    /// How the points of a side are spread over it.
    pub side_rule: SideRule,
    /// Radius of the neighbourhoods of `uniform`, `recd` and `lpsp` on clouds.
    pub radius: RadiusChoice,
    /// Whether maps of meshes are refined towards less distortion.
    pub refine: Refine,
    /// Whether networks are asked beside the map of a cloud that is laid out by its shape.
    pub networks: Networks,
    /// Points that are laid out at once; larger clouds are laid out through a well-spread subset of as many.
    pub subset: usize,
    /// What is going to be fitted, for networks that are told: a fit says so of its first level.
    #[serde(skip)]
    pub told: Option<ToldSpline>,
}

/// The splines that `parcnn` is told of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ToldSpline {
    /// Degree.
    pub degree: usize,
    /// Elements along each direction; `None` for about four points a function.
    pub elements: Option<usize>,
}

impl Default for ParameterOptions {
    fn default() -> Self {
        Self {
            read: ReadOptions::default(),
            clean: Vec::new(),
            piece: None,
            thin: None,
            crop: None,
            mask: None,
            param: ParameterChoice::Auto,
            domain: Domain::Unit,
            closed: Closed::Auto,
            corners: None,
            outline: None,
            side_rule: SideRule::Chord,
            radius: RadiusChoice(Radius::Grown),
            refine: Refine::Auto,
            networks: Networks::Off,
            subset: 10_000,
            told: None,
        }
    }
}

/// Fewest points of a subset: enough for a boundary with corners.
const LEAST_SUBSET: usize = 500;

fn shown_if_any<S: Serializer>(path: &Option<PathBuf>, serializer: S) -> Result<S::Ok, S::Error> {
    match path {
        Some(path) => shown(path, serializer),
        None => serializer.serialize_none(),
    }
}

impl ParameterOptions {
    /// Files that the options name, which are read.
    pub fn files(&self) -> impl Iterator<Item = &PathBuf> {
        self.mask.iter().chain(&self.outline)
    }

    /// Checks ranges that types do not express.
    ///
    /// # Errors
    /// [`Error::OptionRange`].
    pub fn check(&self) -> Result<(), Error> {
        let unit = self.closed.directions() == [false; 2] || self.domain == Domain::Unit;
        range(
            "--closed",
            self.closed.to_string(),
            "none with --domain data: closed directions have the period 1",
            unit,
        )?;
        let cleans = self.clean.iter().map(|what| what.to_string()).collect::<Vec<_>>().join(",");
        let is_one = !self.clean.contains(&Clean::Nothing) || self.clean.len() == 1;
        range("--clean", cleans, "none, or some of outliers and stray", is_one)?;
        range(
            "--piece",
            typed(self.piece),
            "1 for the largest piece, 2 for the next, and so on",
            self.piece != Some(0),
        )?;
        range("--thin", typed(self.thin), "4 or more", self.thin.is_none_or(|n| n >= 4))?;
        range("--subset", self.subset.to_string(), "500 or more", self.subset >= LEAST_SUBSET)
    }
}

named!(
    /// Where parameters come from.
    ParameterChoice, "auto, given, chord, centripetal, parcnn, uniform, mean-value, recd, lpsp, pargcn or bidgcn",
    /// Given ones, else a mean-value map of the mesh, else chord length along the grid, else by the shape of the cloud.
    Auto = "auto",
    /// Those of the file.
    Given = "given",
    /// Chord length along the lines of a grid.
    Chord = "chord",
    /// Square root of the chord length along the lines of a grid.
    Centripetal = "centripetal",
    /// By a convolutional network along the lines of a grid (Imperatore 2024, §4.1).
    Parcnn = "parcnn",
    /// Equidistant along the lines of a grid; for meshes the barycentric map with equal weights; for clouds UNIF
    /// (Imperatore 2024, §4.2.1).
    Uniform = "uniform",
    /// Barycentric map with mean-value weights, of a mesh or of one spanned over the cloud.
    MeanValue = "mean-value",
    /// RECD: reciprocal distances in a neighbourhood (Imperatore 2024, §4.2.1).
    Recd = "recd",
    /// LPSP: shape-preserving weights by local projection (Imperatore 2024, §4.2.1).
    Lpsp = "lpsp",
    /// By weights of neighbours that a graph network gives (Imperatore 2024, §4.2); clouds of more than 10,000 points through a
    /// subset.
    Pargcn = "pargcn",
    /// By a graph network from the boundary and the interior points (Imperatore 2024, §4.3); clouds larger than it was trained
    /// for through a subset.
    Bidgcn = "bidgcn"
);
named!(
    /// The parameter domain.
    Domain, "unit or data",
    /// The unit square.
    Unit = "unit",
    /// The box of the parameters in the file.
    Data = "data"
);
named!(
    /// The directions in which the surface closes on itself.
    Closed, "auto, none, u, v or uv",
    /// u for meshes and clouds that are tubes by their shape, else none.
    Auto = "auto",
    /// None: four sides.
    None = "none",
    /// u: a tube round u, with two sides.
    U = "u",
    /// v: a tube round v, with two sides.
    V = "v",
    /// Both: a torus, without sides.
    Uv = "uv"
);

impl Closed {
    /// Whether u and whether v closes as far as the option says; what `auto` finds stands in [`crate::Parameterized::closed`].
    pub fn directions(self) -> [bool; 2] {
        [matches!(self, Self::U | Self::Uv), matches!(self, Self::V | Self::Uv)]
    }

    /// The choice that closes these directions.
    pub(crate) fn of(directions: [bool; 2]) -> Self {
        match directions {
            [false, false] => Self::None,
            [true, false] => Self::U,
            [false, true] => Self::V,
            [true, true] => Self::Uv,
        }
    }
}

named!(
    /// What can be removed from a cloud.
    Clean, "outliers, stray or none",
    /// Points whose neighbours are unusually far away.
    Outliers = "outliers",
    /// All pieces but the largest.
    Stray = "stray",
    /// Nothing, not even what is set aside unasked.
    Nothing = "none"
);
named!(
    /// How the points of a side are spread over it.
    SideRule, "chord, centripetal or uniform",
    /// By chord length.
    Chord = "chord",
    /// By the square root of the chord length.
    Centripetal = "centripetal",
    /// Equidistant.
    Uniform = "uniform"
);
named!(
    /// Whether maps of meshes are refined towards less distortion.
    Refine, "auto, on or off",
    /// Refined where they are stretched in places, but not on the whole, as they come out.
    Auto = "auto",
    /// Refined.
    On = "on",
    /// As they come out.
    Off = "off"
);
named!(
    /// Whether networks are asked beside the map of a cloud.
    Networks, "on or off",
    /// Their parameters are taken where they are better by all measures.
    On = "on",
    /// They are not asked.
    Off = "off"
);
serialize_as_typed!(
    ParameterChoice,
    Domain,
    Closed,
    Clean,
    SideRule,
    Refine,
    Networks,
    GivenCorners,
    Crop,
    RadiusChoice
);

impl SideRule {
    pub(crate) fn rule(self) -> Rule {
        match self {
            Self::Chord => Rule::ChordLength,
            Self::Centripetal => Rule::Centripetal,
            Self::Uniform => Rule::Uniform,
        }
    }
}

/// Reads exactly `N` numbers, separated by commas.
fn numbers<T: FromStr, const N: usize>(text: &str) -> Option<[T; N]> {
    let parts: Vec<T> = text.split(',').map(|part| part.trim().parse().ok()).collect::<Option<_>>()?;
    parts.try_into().ok()
}

/// Four points, named by their rows in the file counted from 0, that become the corners (0,0), (1,0), (1,1), (0,1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GivenCorners(pub [u32; 4]);

impl FromStr for GivenCorners {
    type Err = ParseOptionError;

    fn from_str(text: &str) -> Result<Self, ParseOptionError> {
        numbers(text).map(Self).ok_or_else(|| parse_error(text, "four rows of points, from 0, as in 0,17,212,96"))
    }
}

impl fmt::Display for GivenCorners {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [a, b, c, d] = self.0;
        write!(f, "{a},{b},{c},{d}")
    }
}

/// A rectangle: lower and upper x, lower and upper y.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crop(pub [f64; 4]);

impl Crop {
    pub(crate) fn holds(self, x: f64, y: f64) -> bool {
        let [left, right, bottom, top] = self.0;
        (left..=right).contains(&x) && (bottom..=top).contains(&y)
    }
}

impl FromStr for Crop {
    type Err = ParseOptionError;

    fn from_str(text: &str) -> Result<Self, ParseOptionError> {
        numbers(text)
            .filter(|[left, right, bottom, top]| left < right && bottom < top)
            .map(Self)
            .ok_or_else(|| parse_error(text, "lower and upper x, lower and upper y, as in 0,10,-2.5,2.5"))
    }
}

impl fmt::Display for Crop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [left, right, bottom, top] = self.0;
        write!(f, "{left},{right},{bottom},{top}")
    }
}

/// Radius of neighbourhoods in a cloud.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadiusChoice(pub Radius);

impl FromStr for RadiusChoice {
    type Err = ParseOptionError;

    fn from_str(text: &str) -> Result<Self, ParseOptionError> {
        let length = || text.parse().ok().filter(|r: &f64| r.is_finite() && *r > 0.0);
        match text {
            "grow" => Ok(Self(Radius::Grown)),
            "auto" => Ok(Self(Radius::Automatic)),
            _ => length()
                .map(|r| Self(Radius::Given(r)))
                .ok_or_else(|| parse_error(text, "grow, auto or a length in the units of the input")),
        }
    }
}

impl fmt::Display for RadiusChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Radius::Grown => f.write_str("grow"),
            Radius::Automatic => f.write_str("auto"),
            Radius::Given(length) => write!(f, "{length}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_read_back_as_they_are_written() {
        assert_eq!("0, 17,212,96".parse::<GivenCorners>().unwrap().to_string(), "0,17,212,96");
        assert_eq!("0,10,-2.5,2.5".parse::<Crop>().unwrap().to_string(), "0,10,-2.5,2.5");
        for text in ["grow", "auto", "0.25"] {
            assert_eq!(text.parse::<RadiusChoice>().unwrap().to_string(), text);
        }
        for text in ["1,2,3", "1,2,3,4,5", "a,b,c,d", "-1,2,3,4"] {
            assert!(text.parse::<GivenCorners>().is_err(), "{text}");
        }
        assert!("10,0,0,1".parse::<Crop>().is_err() && "-1".parse::<RadiusChoice>().is_err());
    }
}
