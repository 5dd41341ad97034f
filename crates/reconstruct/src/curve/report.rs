//! The report of a curve fit.

use std::fmt;

use geom_io::TakenColumn;
use serde::Serialize;

use super::options::CurveOptions;
use deviation::{Reason, Verdict};

use super::verdict::CurveLimits;
use crate::MovesReport;

/// Report of one curve. Keys are added by later versions, never renamed within a schema.
#[derive(Clone, Debug, Serialize)]
pub struct CurveReport {
    /// Version of this layout.
    pub schema: u32,
    /// What was read, and what was found in it.
    pub input: CurveInput,
    /// All options, defaults included, as they are typed.
    pub options: CurveOptions,
    /// What came out.
    pub result: CurveResult,
    /// One record per iteration.
    pub history: Vec<CurveIteration>,
    /// What the user should know.
    pub warnings: Vec<String>,
}

/// What was read, and what was found in it.
#[derive(Clone, Debug, Serialize)]
pub struct CurveInput {
    /// The file, or a name.
    pub file: String,
    /// Its format; empty for arrays.
    pub format: &'static str,
    /// Points in the file.
    pub points: usize,
    /// Which columns of a text file were taken for what; empty for other formats.
    pub columns: Vec<TakenColumn>,
    /// Points that were fitted: one less or one more where a closed curve was cut.
    pub fitted_points: usize,
    /// Coordinates of a point; of a graph, those that depend on the first.
    pub dimension: usize,
    /// Diagonal of the bounding box of the fitted points.
    pub diagonal: f64,
    /// How the curve ends: open, periodic, or at a corner.
    pub closed: &'static str,
    /// Rows of corners, from 0.
    pub corners: Vec<usize>,
    /// How parameters were found.
    pub parameterization: &'static str,
}

/// What came out.
#[derive(Clone, Debug, Serialize)]
pub struct CurveResult {
    /// Control points.
    pub control_points: usize,
    /// Spans: polynomial pieces.
    pub spans: usize,
    /// Degree.
    pub degree: usize,
    /// Whether the curve is periodic: `knots` are then the breaks, of which the last is the first one a period on.
    pub periodic: bool,
    /// Knots with repetitions.
    pub knots: Vec<f64>,
    /// Largest distance of a point to the curve at its parameter, in the units of the input.
    pub max: f64,
    /// Mean of the squared distances.
    pub mse: f64,
    /// Its root.
    pub rmse: f64,
    /// Share of the points within the tolerance.
    pub within: f64,
    /// The tolerance in the units of the input.
    pub tolerance: f64,
    /// The smoothing weight that was used.
    pub lambda: f64,
    /// Largest distance of a point to the curve, wherever its closest point lies; of functions as `max`.
    pub dhd: f64,
    /// Two-sided Hausdorff distance: also from samples of the curve to the points; of functions as `max`.
    pub hsd: f64,
    /// Seconds from the points to the result.
    pub seconds: f64,
    /// Why the loop ended: tolerance, levels, too-few-points, max-dofs, stagnation, iterations, fixed-knots, failed.
    pub stop: &'static str,
    /// Whether the asked share of points is within the tolerance at their parameters.
    pub reached: bool,
    /// Whether the curve can be used.
    pub verdict: Verdict,
    /// Why it is not good; worst first.
    pub reasons: Vec<Reason>,
    /// With what the verdict compares.
    pub limits: CurveLimits,
    /// Share of the points within the tolerance of their closest point on the curve, weighed by spacing; of a graph at their
    /// parameters.
    pub share: f64,
    /// Largest distance of the curve from the polygon of the points beyond what the turning of the polygon explains.
    pub swing: f64,
    /// Diagonal of the box around the curve over that of the box that points and turning explain.
    pub box_ratio: f64,
    /// Places where the curve crosses itself and the polygon of the points doesn't; null in space and for graphs.
    pub crossings: Option<usize>,
    /// Points that were laid over sparse stretches, where the curve swung out without them.
    pub support_points: usize,
}

/// One iteration.
#[derive(Clone, Debug, Serialize)]
pub struct CurveIteration {
    /// Number, from 0.
    pub iteration: usize,
    /// Control points.
    pub control_points: usize,
    /// Largest distance.
    pub max: f64,
    /// Root of the mean of the squared distances.
    pub rmse: f64,
    /// Share of the points within the tolerance.
    pub within: f64,
    /// What happened to the parameters, where they move.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub moves: Option<MovesReport>,
}

impl CurveIteration {
    pub(super) fn new(record: &adaptive::Iteration, moves: Option<&moving_param::Moves>) -> Self {
        Self {
            iteration: record.iteration,
            control_points: record.dofs,
            max: record.deviation.max,
            rmse: record.deviation.rmse(),
            within: record.deviation.within,
            moves: moves.map(MovesReport::from),
        }
    }
}

/// For people, in a few lines.
impl fmt::Display for CurveReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { input, result, options, .. } = self;
        let kind = if options.graph { "function" } else { "curve" };
        let corners = match input.corners.len() {
            0 => String::new(),
            1 => format!(", corner at row {}", input.corners[0]),
            count => format!(", {count} corners"),
        };
        writeln!(f, "{}: {} points, {kind}, {}{corners}", input.file, input.points, input.closed)?;
        writeln!(
            f,
            "degree {}, {} control points, {} spans, {} parameters, lambda {:.3e}",
            result.degree, result.control_points, result.spans, input.parameterization, result.lambda
        )?;
        writeln!(
            f,
            "MAX {:.4e}  RMSE {:.4e}  {:.2} % within {:.4e}  ({})",
            result.max,
            result.rmse,
            100.0 * result.within,
            result.tolerance,
            result.stop
        )?;
        writeln!(f, "{}", result.verdict)
    }
}

impl CurveReport {
    /// What a person should be told, a sentence each: first the reasons of the verdict, then the warnings.
    pub fn sentences(&self) -> impl Iterator<Item = String> {
        let reasons = self.result.reasons.iter().map(|reason| format!("{}: {}", reason.verdict, reason.text));
        reasons.chain(self.warnings.iter().map(|warning| format!("note: {warning}")))
    }
}
