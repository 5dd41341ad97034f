//! Options of a curve fit.

use adaptive::Marking;
use geom_io::{LengthUnit, ReadOptions};
use serde::Serialize;
use thb_core::MAX_DEGREE;

use super::choices::{ClosedChoice, CornerChoice, CurveParameters, Ends, KnotChoice};
use crate::options::range;
use crate::{BlendChoice, Error, LambdaChoice, Mark, Method, Tolerance};

/// Options of [`crate::fit_sequence`]. The defaults need no user.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CurveOptions {
    /// How the input is read.
    #[serde(flatten)]
    pub read: ReadOptions,
    /// Whether the first coordinate is the parameter and the others are functions of it.
    pub graph: bool,
    /// How parameters are found; a graph has its own.
    pub param: CurveParameters,
    /// Whether the curve closes.
    pub closed: ClosedChoice,
    /// Where it may turn sharply.
    pub corners: CornerChoice,
    /// What happens at the ends of an open curve.
    pub ends: Ends,
    /// The fitting method: `ls` keeps the parameters; `a-pdm`, `a-tdm`, `a-hdm`, `j-pdm` and `joint` move them.
    pub method: Method,
    /// Corrections after each refinement, of the alternating methods.
    pub corrections: usize,
    /// Weight of the point distance in A-HDM, `error` or a number.
    pub blend: BlendChoice,
    /// Relative damping of A-TDM.
    pub damping: f64,
    /// Degree.
    pub degree: usize,
    /// Where knots lie.
    pub knots: KnotChoice,
    /// Equal elements that adaptive knots start from, in each piece between corners; a periodic curve has degree + 1 at
    /// least.
    pub elements: usize,
    /// The smoothing weight, of the energy over parameters scaled to the unit interval.
    pub lambda: LambdaChoice,
    /// Largest distance of a point that counts as within tolerance; of a graph, in the direction of the values.
    pub tol: Tolerance,
    /// The share of points that must be within the tolerance.
    pub within: f64,
    /// Which spans get a knot.
    pub mark: Mark,
    /// How often the domain may be halved: no span gets shorter than that.
    pub halvings: u32,
    /// Largest number of control points; `None` for the number of points.
    pub max_dofs: Option<usize>,
    /// Length unit of the coordinates; `None` for that of the file, millimetres where it tells none. A report has the one taken.
    #[serde(serialize_with = "crate::units::serialize")]
    pub units: Option<LengthUnit>,
}

impl Default for CurveOptions {
    fn default() -> Self {
        Self {
            read: ReadOptions::default(),
            graph: false,
            param: CurveParameters::Auto,
            closed: ClosedChoice::Auto,
            corners: CornerChoice::Auto,
            ends: Ends::Free,
            method: Method::Ls,
            corrections: 3,
            blend: BlendChoice::Error,
            damping: 1e-3,
            degree: 3,
            knots: KnotChoice::Adaptive,
            elements: 1,
            lambda: LambdaChoice::Fixed(CALM),
            tol: Tolerance::Percent(0.1),
            within: 1.0,
            mark: Mark(Marking::Share(WORST)),
            halvings: 16,
            max_dofs: None,
            units: None,
        }
    }
}

/// The smoothing weight unless told: errors on curves of some hundred spans do not feel it, and a curve of thousands stays
/// calm where it runs out of points.
const CALM: f64 = 1e-12;

/// Share of the points whose spans get a knot at a time. Of 1 %, 5 %, 10 %, 20 % and all beyond the tolerance, 5 % and
/// 10 % gave the fewest control points on two airfoils, a heat curve and a coast; smaller ones take more iterations.
const WORST: f64 = 0.1;

/// Largest number of halvings: half the digits of a parameter are left to tell points of a span apart.
const MOST_HALVINGS: u32 = 26;

impl CurveOptions {
    /// Checks ranges that types do not express, and choices that exclude each other.
    ///
    /// # Errors
    /// [`Error::OptionRange`].
    pub fn check(&self) -> Result<(), Error> {
        range("--degree", self.degree.to_string(), "1 to 8", (1..=MAX_DEGREE).contains(&self.degree))?;
        range("--mesh", self.elements.to_string(), "1 to 4096 elements", (1..=4096).contains(&self.elements))?;
        range("--within", self.within.to_string(), "0 to 1", (0.0..=1.0).contains(&self.within))?;
        range("--halvings", self.halvings.to_string(), "0 to 26", self.halvings <= MOST_HALVINGS)?;
        range("--damping", self.damping.to_string(), "0 or more", self.damping >= 0.0 && self.damping.is_finite())?;
        if let KnotChoice::Averaged(count) | KnotChoice::Uniform(count) = self.knots {
            range("--knots", count.to_string(), "at most 65535 inner knots", count < 1 << 16)?;
        }
        let of_curves = !matches!(self.method, Method::Auto | Method::Qi | Method::AQi);
        let methods = "ls, a-pdm, a-tdm, a-hdm, j-pdm or joint for curves";
        range("--method", self.method.to_string(), methods, of_curves)?;
        let blend = match self.blend {
            BlendChoice::Error => true,
            BlendChoice::Curvature => false,
            BlendChoice::Constant(gamma) => (0.0..=1.0).contains(&gamma),
        };
        range("--blend", self.blend.to_string(), "error, or a number from 0 to 1, for curves", blend)?;
        self.tol.check()?;
        self.lambda.check()?;
        if let Marking::Share(share) = self.mark.0 {
            range("--mark", share.to_string(), "a share above 0, at most 1", share > 0.0 && share <= 1.0)?;
        }
        if self.graph {
            let keeps = self.method == Method::Ls;
            range("--method", self.method.to_string(), "ls with --graph, whose parameters are data", keeps)?;
            let open = self.closed != ClosedChoice::Yes;
            range("--closed", self.closed.to_string(), "auto or no with --graph", open)?;
            let own = matches!(self.param, CurveParameters::Auto | CurveParameters::Given);
            range("--param", self.param.to_string(), "auto with --graph, whose parameter is x", own)?;
        }
        Ok(())
    }
}
