//! Options of whole parts.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use geom_io::{LengthUnit, ReadOptions};
use quad_layout::CreaseRule;
use serde::Serialize;

use crate::options::{Tolerance, parse_error, serialize_as_typed};
use crate::{Error, ParseOptionError};

/// How much smooth joins count against distances.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Smoothness {
    /// With this weight ω.
    Weight(f64),
    /// Patches meet without gaps, and at any angle.
    Off,
}

impl Smoothness {
    /// ω; 0 for none.
    pub fn weight(self) -> f64 {
        match self {
            Self::Weight(weight) => weight,
            Self::Off => 0.0,
        }
    }
}

impl fmt::Display for Smoothness {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Weight(weight) => weight.fmt(f),
            Self::Off => f.write_str("off"),
        }
    }
}

impl FromStr for Smoothness {
    type Err = ParseOptionError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        positive_or_off(text).map(|weight| weight.map_or(Self::Off, Self::Weight))
    }
}

/// How a part is cut into faces.
#[derive(Clone, Debug, PartialEq)]
pub enum LayoutChoice {
    /// In patches if it is a closed mesh, as one sheet of four sides otherwise.
    Auto,
    /// As one sheet of four sides.
    One,
    /// In patches.
    Patches,
    /// In the patches of a file.
    File(PathBuf),
}

impl fmt::Display for LayoutChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::One => f.write_str("one"),
            Self::Patches => f.write_str("patches"),
            Self::File(path) => path.display().fmt(f),
        }
    }
}

impl FromStr for LayoutChoice {
    type Err = ParseOptionError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Ok(match text {
            "auto" => Self::Auto,
            "one" => Self::One,
            "patches" => Self::Patches,
            "" => return Err(parse_error(text, "auto, one, patches, or a file")),
            path => Self::File(path.into()),
        })
    }
}

/// Which arcs of a layout are creases.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sharp {
    /// Those along edges of the mesh sharper than 40°, and blunter ones between large facets, if the mesh has creases at all.
    Auto,
    /// Those along which the mesh is sharper than this angle, in degrees.
    Angle(f64),
    /// None.
    Off,
}

impl Sharp {
    /// Which edges of the mesh are creases.
    pub(super) fn rule(self) -> CreaseRule {
        match self {
            Self::Auto => CreaseRule::Auto,
            Self::Angle(degrees) => CreaseRule::Angle(degrees),
            Self::Off => CreaseRule::Off,
        }
    }
}

impl fmt::Display for Sharp {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Angle(degrees) => degrees.fmt(f),
            Self::Off => f.write_str("off"),
        }
    }
}

impl FromStr for Sharp {
    type Err = ParseOptionError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if text == "auto" {
            return Ok(Self::Auto);
        }
        let typed = positive_or_off(text).map_err(|_| parse_error(text, "auto, a positive number, or off"))?;
        Ok(typed.map_or(Self::Off, Self::Angle))
    }
}

/// A positive number, or nothing for `off`.
fn positive_or_off(text: &str) -> Result<Option<f64>, ParseOptionError> {
    if text == "off" {
        return Ok(None);
    }
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(Some(value)),
        _ => Err(parse_error(text, "a positive number, or off")),
    }
}

serialize_as_typed!(Smoothness, Sharp, LayoutChoice);

/// How a whole part is fitted.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SolidOptions {
    /// The layout: of a file, or else found here.
    pub layout: LayoutChoice,
    /// Degree in both directions.
    pub degree: usize,
    /// Elements along each side of a patch; by default 4, and more where these are too few for the tolerance.
    pub elements: Option<usize>,
    /// Weight of smooth joins.
    pub smoothness: Smoothness,
    /// Which arcs are creases.
    pub sharp: Sharp,
    /// μ, the weight of the plates.
    pub plates: f64,
    /// Tolerance.
    pub tol: Tolerance,
    /// Share of the area of the mesh and of the surface that must be within the tolerance of the other.
    pub within: f64,
    /// Length unit of the coordinates; that of the file, else millimetres.
    #[serde(serialize_with = "crate::units::serialize")]
    pub units: Option<LengthUnit>,
    /// Turns faces round: normals point inward.
    pub flip: bool,
    /// How the mesh is read.
    pub read: ReadOptions,
}

impl Default for SolidOptions {
    fn default() -> Self {
        Self {
            layout: LayoutChoice::Patches,
            degree: 3,
            elements: None,
            smoothness: Smoothness::Weight(1.0),
            sharp: Sharp::Auto,
            plates: multi_patch::Options::default().plates,
            tol: Tolerance::Percent(0.3),
            within: 0.99,
            units: None,
            flip: false,
            read: ReadOptions::default(),
        }
    }
}

impl SolidOptions {
    /// The defaults for the layout of a file.
    pub fn of_layout(layout: PathBuf) -> Self {
        Self { layout: LayoutChoice::File(layout), ..Self::default() }
    }

    /// Refuses what is not possible.
    ///
    /// # Errors
    /// [`Error::OptionRange`].
    pub fn check(&self) -> Result<(), Error> {
        let refused = |option, given: String, allowed| Err(Error::OptionRange { option, given, allowed });
        if !(2..=thb_core::MAX_DEGREE).contains(&self.degree) {
            return refused(
                "--degree",
                self.degree.to_string(),
                "from 2 to 8 for whole parts, equal in both directions",
            );
        }
        if let Some(elements) = self.elements
            && !(1..=MAX_ELEMENTS).contains(&elements)
        {
            return refused("--mesh", elements.to_string(), "from 1 to 256 for whole parts, equal in both directions");
        }
        if !(self.within > 0.0 && self.within <= 1.0) {
            return refused("--within", self.within.to_string(), "above 0 and at most 1");
        }
        Ok(())
    }
}

/// Most elements along a side of a patch.
///
/// Limit: 65,536 control points a patch; more detail is a matter of refinement.
const MAX_ELEMENTS: usize = 256;
