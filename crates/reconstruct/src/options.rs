//! Options of a fit, as they are typed and as they stand in the report.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use adaptive::Marking;
use fit_ls::Lambda;
use geom_io::LengthUnit;
use serde::Serialize;
use thb_core::{MAX_DEGREE, MAX_LEVELS, Quadrature};

use crate::parameter_options::Closed;
use crate::{Error, MarkerChoice, ParameterOptions, Policy, QuasiOptions, ReweightingOptions};

/// Options of [`crate::fit_scan`]. The defaults need no user.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FitOptions {
    /// How the input is read, cleaned and laid out.
    #[serde(flatten)]
    pub parameters: ParameterOptions,
    /// The fitting method.
    pub method: Method,
    /// Corrections after each refinement, of the alternating methods.
    pub corrections: usize,
    /// Weight of the point distance in A-HDM.
    pub blend: BlendChoice,
    /// Relative damping of A-TDM.
    pub damping: f64,
    /// What happens to points on the boundary of the parameter domain while parameters move.
    pub boundary: BoundaryChoice,
    /// Options of quasi-interpolation.
    #[serde(flatten)]
    pub quasi: QuasiOptions,
    /// Degree per direction.
    pub degree: Pair,
    /// Elements of level 0 per direction; 4 if not given, and 8 in closed directions.
    pub mesh: Option<Pair>,
    /// Robust losses and markers.
    #[serde(flatten)]
    pub reweighting: ReweightingOptions,
    /// The smoothing weight.
    pub lambda: LambdaChoice,
    /// Largest distance of a point that counts as within tolerance.
    pub tol: Tolerance,
    /// The share of the scan's area that must be within the tolerance.
    pub within: f64,
    /// What of a mesh is fitted.
    pub samples: Samples,
    /// Whether every piece of the mesh or cloud is fitted for itself; see [`crate::fit_pieces`].
    pub all_pieces: bool,
    /// Largest number of levels, level 0 included.
    pub levels: usize,
    /// Largest number of control points of the hierarchical surface; `None` for the number of points.
    pub max_dofs: Option<usize>,
    /// Control points up to which STEP files hold one tensor-product face instead of several.
    pub max_step_control_points: usize,
    /// Whether STEP files have the holes of the data cut out of their faces.
    pub trim_holes: bool,
    /// Which cells are refined.
    pub mark: Mark,
    /// Extension of a marked region, in cells of the next level; `None` for half the degree, the least with which functions
    /// of the next level fit into it.
    pub extension: Option<Pair>,
    /// Class of admissibility to keep, if any.
    pub admissible: Option<usize>,
    /// How the smoothing energy is integrated.
    pub energy: Energy,
    /// Length unit of the coordinates; `None` for that of the file, millimetres where it tells none. A report has the one taken.
    #[serde(serialize_with = "crate::units::serialize")]
    pub units: Option<LengthUnit>,
    /// Turn the face normal.
    pub flip: bool,
    /// What decides where the method is left open.
    pub policy: Policy,
    /// Whether every method is tried to its end where the choice is left open, to see what the budgets cost.
    #[serde(skip)]
    pub exhaustive: bool,
    /// Seed of random choices, for the report: no method draws random numbers yet.
    pub seed: u64,
    /// Number of threads of the program, 0 for one per core, for the report: the library works in the thread pool of its caller.
    pub threads: usize,
}

impl Default for FitOptions {
    fn default() -> Self {
        Self {
            parameters: ParameterOptions::default(),
            method: Method::Auto,
            corrections: 3,
            blend: BlendChoice::Error,
            damping: 1e-3,
            boundary: BoundaryChoice::Kept,
            quasi: QuasiOptions::default(),
            degree: Pair([3, 3]),
            mesh: None,
            reweighting: ReweightingOptions::default(),
            lambda: LambdaChoice::Auto,
            tol: Tolerance::Auto,
            within: 0.95,
            samples: Samples::Area,
            all_pieces: false,
            levels: 7,
            max_dofs: None,
            max_step_control_points: 20_000,
            trim_holes: false,
            mark: Mark(Marking::Worst),
            extension: None,
            admissible: None,
            energy: Energy::Exact,
            units: None,
            flip: false,
            policy: Policy::default(),
            exhaustive: false,
            seed: 0,
            threads: 0,
        }
    }
}

/// Elements of level 0 in a direction: so few that smooth scans need no more, and most of the way is left to refinement.
const ELEMENTS: usize = 4;

/// The same in a closed one. Four bend a section to the shape of a bean at best, and parameters that move with it fold the
/// ends of tubes over.
const ELEMENTS_ROUND: usize = 8;

impl FitOptions {
    /// Elements of level 0 per direction.
    pub fn elements(&self) -> [usize; 2] {
        let closed = self.parameters.closed.directions();
        // Round a closed direction no function may meet itself.
        let usual = |d: usize| if closed[d] { ELEMENTS_ROUND.max(self.degree.0[d] + 1) } else { ELEMENTS };
        self.mesh.map_or([usual(0), usual(1)], |given| given.0)
    }

    /// The same with a level 0 that has no more functions than there are `points`: fewer elements unless `mesh` is given, then a lower
    /// degree. `None` where that holds already.
    pub(crate) fn for_few(&self, points: usize) -> Option<Self> {
        let closed = self.parameters.closed.directions();
        let count = |degree: [usize; 2], elements: [usize; 2]| -> usize {
            (0..2).map(|d| elements[d] + if closed[d] { 0 } else { degree[d] }).product()
        };
        if self.mesh.is_some() || count(self.degree.0, self.elements()) <= points {
            return None;
        }
        let (mut degree, mut elements) = (self.degree.0, self.elements());
        while count(degree, elements) > points {
            // Round a closed direction no function may meet itself.
            let least = |d: usize| if closed[d] { degree[d] + 1 } else { 1 };
            // The direction with more of them first.
            let larger = |values: [usize; 2]| usize::from(values[1] > values[0]);
            let spare = [0, 1].map(|d| elements[d] - least(d).min(elements[d]));
            let d = larger(spare);
            if spare[d] > 0 {
                elements[d] -= 1;
            } else if degree.iter().any(|&p| p > 1) {
                degree[larger(degree)] -= 1;
            } else {
                break;
            }
        }
        Some(Self { degree: Pair(degree), mesh: Some(Pair(elements)), ..self.clone() })
    }

    /// The options with the directions that were found to close. A coarsest level that is too coarse to go round gets as many elements as
    /// that takes.
    pub(crate) fn with_closed(&self, closed: [bool; 2]) -> Self {
        let mut options = self.clone();
        if self.parameters.closed == Closed::Auto {
            options.parameters.closed = Closed::of(closed);
            if let Some(given) = &mut options.mesh {
                let enough = |d: usize| if closed[d] { self.degree.0[d] + 1 } else { 1 };
                given.0 = std::array::from_fn(|d| given.0[d].max(enough(d)));
            }
        }
        options
    }

    /// The extension of a marked region, in cells of the next level.
    pub fn extension(&self) -> [usize; 2] {
        self.extension.map_or(self.degree.0.map(|p| p / 2), |given| given.0)
    }

    /// Files that the options name, which are read.
    pub fn files(&self) -> impl Iterator<Item = &PathBuf> {
        let markers = match &self.reweighting.markers {
            Some(MarkerChoice::File(path)) => Some(path),
            _ => None,
        };
        self.parameters.files().chain(markers)
    }

    /// Checks ranges that types do not express.
    ///
    /// # Errors
    /// [`Error::OptionRange`].
    pub fn check(&self) -> Result<(), Error> {
        self.parameters.check()?;
        let names_points = self.parameters.corners.is_some()
            || self.parameters.outline.is_some()
            || matches!(self.reweighting.markers, Some(MarkerChoice::File(_)));
        let of_one = !self.all_pieces || !names_points && self.parameters.piece.is_none();
        range(
            "--piece",
            "all".to_owned(),
            "a number beside --corners, --outline and a file of --markers, which name points of one piece",
            of_one,
        )?;
        self.quasi.check()?;
        self.reweighting.check(self.method)?;
        let degrees = self.degree.0.iter().all(|p| (1..=MAX_DEGREE).contains(p));
        range("--degree", self.degree.to_string(), "1 to 8", degrees)?;
        let elements = self.elements();
        range(
            "--mesh",
            Pair(elements).to_string(),
            "1 to 4096 elements",
            elements.iter().all(|n| (1..=4096).contains(n)),
        )?;
        range("--within", self.within.to_string(), "0 to 1", (0.0..=1.0).contains(&self.within))?;
        range("--levels", self.levels.to_string(), "1 to 16", (1..=MAX_LEVELS).contains(&self.levels))?;
        let [u, v] = self.extension();
        range("--extension", Pair([u, v]).to_string(), "0 to 64", u.max(v) <= 64)?;
        range("--admissible", typed(self.admissible), "2 or more", self.admissible.is_none_or(|m| m >= 2))?;
        if let BlendChoice::Constant(gamma) = self.blend {
            range("--blend", gamma.to_string(), "0 to 1", (0.0..=1.0).contains(&gamma))?;
        }
        range("--damping", self.damping.to_string(), "0 or more", self.damping >= 0.0 && self.damping.is_finite())?;
        self.tol.check()?;
        if matches!(self.lambda, LambdaChoice::CrossValidation | LambdaChoice::Discrepancy(_))
            && !self.method.begins_fixed()
        {
            let option = "--lambda gcv and --lambda discrepancy:SIGMA";
            return Err(Error::OtherMethod { option, method: self.method.to_string() });
        }
        self.lambda.check()?;
        if let Marking::Share(share) = self.mark.0 {
            range("--mark", share.to_string(), "a share above 0, at most 1", share > 0.0 && share <= 1.0)?;
        }
        Ok(())
    }
}

/// A number as it was typed.
pub(crate) fn typed(number: Option<usize>) -> String {
    number.map_or_else(String::new, |n| n.to_string())
}

/// The check of an option's range.
pub(crate) fn range(option: &'static str, given: String, allowed: &'static str, ok: bool) -> Result<(), Error> {
    if ok { Ok(()) } else { Err(Error::OptionRange { option, given, allowed }) }
}

/// An option that cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{given:?} is not possible: {expected}")]
pub struct ParseOptionError {
    given: String,
    expected: &'static str,
}

pub(crate) fn parse_error(given: &str, expected: &'static str) -> ParseOptionError {
    ParseOptionError { given: given.to_owned(), expected }
}

/// Serializes an option as it is typed.
macro_rules! serialize_as_typed {
    ($($type:ty),*) => {$(
        impl serde::Serialize for $type {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.collect_str(self)
            }
        }
    )*};
}
pub(crate) use serialize_as_typed;
serialize_as_typed!(LambdaChoice, Tolerance, Mark, Method, BoundaryChoice, BlendChoice, Energy, Samples);

/// An option with a fixed set of names.
macro_rules! named {
    ($(#[$doc:meta])* $type:ident, $expected:literal, $($(#[$variant_doc:meta])* $variant:ident = $name:literal),*) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $type { $($(#[$variant_doc])* $variant),* }

        impl std::fmt::Display for $type {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(match self { $(Self::$variant => $name),* })
            }
        }

        impl std::str::FromStr for $type {
            type Err = $crate::ParseOptionError;

            fn from_str(text: &str) -> Result<Self, $crate::ParseOptionError> {
                match text { $($name => Ok(Self::$variant),)* _ => Err($crate::options::parse_error(text, $expected)) }
            }
        }
    };
}

pub(crate) use named;

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
impl Energy {
    pub(crate) fn quadrature(self) -> Quadrature {
        match self {
            Self::Exact => Quadrature::Exact,
            Self::GaussP => Quadrature::GaussP,
        }
    }
}

/// One number for each direction: `2` for both, or `2,3`; meshes are also written `8x8`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct Pair(pub [usize; 2]);

impl FromStr for Pair {
    type Err = ParseOptionError;

    fn from_str(text: &str) -> Result<Self, ParseOptionError> {
        let wrong = || parse_error(text, "one whole number, or two as in 2,3 or 8x8");
        let parts: Result<Vec<usize>, _> = text.split([',', 'x']).map(|part| part.trim().parse()).collect();
        match parts.map_err(|_| wrong())?.as_slice() {
            [both] => Ok(Self([*both; 2])),
            [u, v] => Ok(Self([*u, *v])),
            _ => Err(wrong()),
        }
    }
}

impl fmt::Display for Pair {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{},{}", self.0[0], self.0[1])
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
        let (Self::Absolute(number) | Self::Percent(number)) = self else { return Ok(()) };
        if number.is_finite() && number > 0.0 {
            return Ok(());
        }
        Err(Error::OptionRange { option: "--tol", given: self.to_string(), allowed: "a positive number" })
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

    #[test]
    fn few_points_start_with_no_more_functions() {
        let options = FitOptions::default();
        let start =
            |points: usize, options: &FitOptions| options.for_few(points).map(|few| (few.degree.0, few.elements()));
        for (points, expected) in [
            (49, None),
            (48, Some(([3, 3], [3, 4]))),
            (16, Some(([3, 3], [1, 1]))),
            (15, Some(([2, 3], [1, 1]))),
            (9, Some(([2, 2], [1, 1]))),
            (8, Some(([1, 2], [1, 1]))),
            (4, Some(([1, 1], [1, 1]))),
        ] {
            assert_eq!(start(points, &options), expected, "{points}");
        }
        let tube = ParameterOptions { closed: Closed::U, ..ParameterOptions::default() };
        assert_eq!(start(16, &FitOptions { parameters: tube, ..FitOptions::default() }), Some(([3, 3], [4, 1])));
        assert_eq!(start(9, &FitOptions { mesh: Some(Pair([4, 4])), ..FitOptions::default() }), None);
    }

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
