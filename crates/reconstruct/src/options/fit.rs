//! Options of a fit, as they are typed and as they stand in the report.

use std::path::PathBuf;

use adaptive::Marking;
use geom_io::LengthUnit;
use serde::Serialize;
use thb_core::{MAX_DEGREE, MAX_LEVELS};

use super::choices::{BlendChoice, BoundaryChoice, Energy, LambdaChoice, Mark, Method, Samples, Schema, Tolerance};
use super::parameters::{Closed, ParameterOptions, ToldSpline};
use super::policy::Policy;
use super::quasi::QuasiOptions;
use super::reweighting::{MarkerChoice, ReweightingOptions};
use super::typed::{Pair, range, typed};
use crate::Error;

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
    /// Application protocol of STEP files.
    pub schema: Schema,
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
            schema: Schema::Ap214,
            trim_holes: false,
            mark: Mark(Marking::Worst),
            extension: None,
            admissible: None,
            energy: Energy::Exact,
            units: None,
            flip: false,
            policy: Policy::default(),
            exhaustive: false,
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
    /// The options of laying out, which say what is going to be fitted: the first level, where the two directions differ the finer of
    /// both.
    pub(crate) fn told_parameters(&self) -> ParameterOptions {
        let larger = |pair: Pair| pair.0[0].max(pair.0[1]);
        let told = ToldSpline { degree: larger(self.degree), elements: self.mesh.map(larger) };
        ParameterOptions { told: Some(told), ..self.parameters.clone() }
    }

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
}
