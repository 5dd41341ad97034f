//! The report: what went in, what was asked for, what came out.

use std::collections::BTreeMap;
use std::path::Path;

use adaptive::Iteration;
use deviation::{Deviation, Reason, Thresholds, Verdict};
use fit_ls::LocalSmoothing;
use geom_io::TakenColumn;
use moving_param::Moves;
use serde::Serialize;
use thb_core::SplineMap;

use crate::auto::Tried;
use crate::methods::QuasiReport;
use crate::options::Method;
use crate::orientation::NormalsReport;
use crate::{DefaultTolerance, Error, FitOptions, ParameterOptions, ParameterReport, Parameterized, ReweightingReport};

/// Report of one fit. Keys are added by later versions, never renamed within a schema.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Version of this layout.
    pub schema: u32,
    /// The program and its version.
    pub program: &'static str,
    /// What was read.
    pub input: InputReport,
    /// How parameters were found, and how good they are.
    pub parameterization: ParameterReport,
    /// All options, defaults included, as they are typed.
    pub options: FitOptions,
    /// What came out.
    pub result: ResultReport,
    /// One record per iteration.
    pub history: Vec<IterationReport>,
    /// What the user should know.
    pub warnings: Vec<String>,
}

/// Report of parameters alone.
#[derive(Clone, Debug, Serialize)]
pub struct LayoutReport<'a> {
    /// Version of this layout.
    pub schema: u32,
    /// The file.
    pub file: String,
    /// Points with parameters.
    pub points: usize,
    /// All options, defaults included, as they are typed.
    pub options: &'a ParameterOptions,
    /// How parameters were found, and how good they are.
    pub parameterization: &'a ParameterReport,
    /// What the user should know.
    pub warnings: &'a [String],
}

/// A box of the parameter domain with more smoothing.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct SmoothedMore {
    /// Lower corner.
    pub lower: [f64; 2],
    /// Upper corner.
    pub upper: [f64; 2],
    /// Factor of the smoothing weight.
    pub factor: f64,
}

impl From<LocalSmoothing<2>> for SmoothedMore {
    fn from(local: LocalSmoothing<2>) -> Self {
        Self { lower: local.lower, upper: local.upper, factor: local.factor }
    }
}

/// The report of a scan that was laid out.
pub fn layout_report<'a>(file: &Path, options: &'a ParameterOptions, laid_out: &'a Parameterized) -> LayoutReport<'a> {
    LayoutReport {
        schema: 1,
        file: file.display().to_string(),
        points: laid_out.points.nrows(),
        options,
        parameterization: &laid_out.report,
        warnings: &laid_out.warnings,
    }
}

/// What was read.
#[derive(Clone, Debug, Serialize)]
pub struct InputReport {
    /// The file.
    pub file: String,
    /// Its fingerprint, as `sha256sum` prints it; absent of what was not read from a file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sha256: Option<String>,
    /// Its format.
    pub format: &'static str,
    /// Points in the file.
    pub points: usize,
    /// Triangles in the file, if it holds a mesh.
    pub triangles: Option<usize>,
    /// Which columns of a text file were taken for what; empty for other formats.
    pub columns: Vec<TakenColumn>,
    /// Points that were fitted.
    pub fitted_points: usize,
    /// Diagonal of their bounding box.
    pub diagonal: f64,
    /// How parameters were found.
    pub parameterization: &'static str,
    /// Rows in the file, from 0, of the points at (0,0), (1,0), (1,1), (0,1), where a boundary was laid out.
    pub corners: Option<[u32; 4]>,
}

/// What came out.
#[derive(Clone, Debug, Serialize)]
pub struct ResultReport {
    /// The fitting method; the one that was chosen where that was left open.
    pub method: Method,
    /// What was tried where the method was left open, in this order; empty otherwise.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub tried: Vec<Tried>,
    /// Control points of the hierarchical surface.
    pub dofs: usize,
    /// Levels, level 0 included.
    pub levels: usize,
    /// Cells of the mesh.
    pub cells: usize,
    /// Largest distance of a fitted point to the surface in the last iteration, in the units of the input: to the closest point near
    /// its parameters, or at its parameters where those are given or `--samples vertices` is asked for.
    pub max: f64,
    /// Mean of the squared distances.
    pub mse: f64,
    /// Its root.
    pub rmse: f64,
    /// Share of the fitted points within the tolerance.
    pub within: f64,
    /// The tolerance in the units of the input.
    pub tolerance: f64,
    /// How it was chosen; absent where it was given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub default_tolerance: Option<DefaultTolerance>,
    /// The smoothing weight that was used.
    pub lambda: f64,
    /// Boxes of the parameter domain with more smoothing, where the surface would pass through itself; absent without. A cell has the
    /// largest factor of those that it overlaps.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub local_smoothing: Vec<SmoothedMore>,
    /// Largest distance of a point to the surface, wherever its closest point lies.
    pub dhd: f64,
    /// Two-sided distance: that, or `deviation.farthest` if larger. Far above `dhd` where the surface
    /// spans a void or swings out between points.
    pub hsd: f64,
    /// Share of neighbouring samples of the surface between which its normal turns by more than a right angle.
    pub creases: f64,
    /// Seconds from the points to the result.
    pub seconds: f64,
    /// Why the loop ended: tolerance, levels, too-few-points, max-dofs, stagnation, iterations, interrupted, failed.
    pub stop: &'static str,
    /// Whether the verdict is better than `failed`.
    pub reached: bool,
    /// How good the surface is.
    pub verdict: Verdict,
    /// Why it is not good; empty if it is.
    pub reasons: Vec<Reason>,
    /// The limits that the verdict went by.
    pub thresholds: Thresholds,
    /// How the surface lies on the scan.
    pub deviation: Deviation,
    /// What came of robust losses and markers; absent without.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reweighting: Option<ReweightingReport>,
    /// What the normals of the file say about the outside, where it has some.
    pub normals: Option<NormalsReport>,
    /// For each side of the (u,v) square where it lies on the part.
    pub sides: BTreeMap<&'static str, SideReport>,
    /// Holes that were cut out of the faces of STEP files; `null` unless asked for.
    pub trimmed: Option<usize>,
}

/// Where a side of the parameter square lies on the part.
#[derive(Clone, Debug, Serialize)]
pub struct SideReport {
    /// The side of the part it lies on most clearly, such as `+x`: the axis along which its middle is farthest from
    /// the middle of the surface.
    pub towards: String,
    /// Point where it begins (smaller parameter).
    pub from: Vec<f64>,
    /// Point where it ends.
    pub to: Vec<f64>,
}

/// One iteration of the adaptive loop.
#[derive(Clone, Debug, Serialize)]
pub struct IterationReport {
    /// Number, from 0.
    pub iteration: usize,
    /// Control points.
    pub dofs: usize,
    /// Levels.
    pub levels: usize,
    /// Largest distance.
    pub max: f64,
    /// Mean of the squared distances.
    pub mse: f64,
    /// Its root.
    pub rmse: f64,
    /// Share of the points within the tolerance.
    pub within: f64,
    /// Seconds per phase.
    pub seconds: SecondsReport,
    /// What happened to the parameters; absent where they are fixed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub moves: Option<MovesReport>,
    /// The local problems of quasi-interpolation; absent for other methods.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quasi: Option<QuasiReport>,
}

/// How parameters moved in one iteration.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct MovesReport {
    /// Corrections, or steps of the joint method.
    pub corrections: usize,
    /// Mean share of the points whose distance fell at a correction.
    pub accepted: f64,
    /// Mean number of steps towards a foot point.
    pub mean_steps: f64,
    /// Mean length of the moves, in parameters.
    pub mean_move: f64,
    /// Largest length of a move.
    pub max_move: f64,
    /// Triangles that turned over.
    pub folds: usize,
    /// Moves that were shortened because a triangle would have turned over.
    pub held: usize,
    /// Whether the moves were undone because they did harm.
    pub postponed: bool,
    /// Root mean squared distance before the moves; after them it is that of the iteration.
    pub rmse_before: f64,
}

impl From<&Moves> for MovesReport {
    fn from(moves: &Moves) -> Self {
        Self {
            corrections: moves.corrections,
            accepted: moves.accepted,
            mean_steps: moves.mean_steps,
            mean_move: moves.mean_move,
            max_move: moves.max_move,
            folds: moves.folds,
            held: moves.held,
            postponed: moves.postponed,
            rmse_before: moves.rmse[0],
        }
    }
}

/// Seconds per phase.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct SecondsReport {
    /// Setting up equations.
    pub assemble: f64,
    /// Solving them.
    pub solve: f64,
    /// Evaluating errors.
    pub estimate: f64,
    /// Marking and refining.
    pub refine: f64,
}

pub(crate) fn history(iterations: &[Iteration], moves: &[Moves], quasi: &[QuasiReport]) -> Vec<IterationReport> {
    iterations
        .iter()
        .enumerate()
        .map(|(k, i)| IterationReport {
            iteration: i.iteration,
            dofs: i.dofs,
            levels: i.levels,
            max: i.deviation.max,
            mse: i.deviation.mse,
            rmse: i.deviation.rmse(),
            within: i.deviation.within,
            seconds: SecondsReport {
                assemble: i.seconds.assemble,
                solve: i.seconds.solve,
                estimate: i.seconds.estimate,
                refine: i.seconds.refine,
            },
            moves: moves.get(k).map(MovesReport::from),
            quasi: quasi.get(k).copied(),
        })
        .collect()
}

/// Names the sides of the parameter square by where they lie on the part. A closed direction has none.
pub(crate) fn sides(map: &SplineMap<2>) -> Result<BTreeMap<&'static str, SideReport>, Error> {
    let (a, b) = map.space().domain();
    let at = |s: f64, t: f64| {
        let blend = |d: usize, x: f64| if x == 1.0 { b[d] } else { a[d] + x * (b[d] - a[d]) };
        map.eval([blend(0, s), blend(1, t)])
    };
    let closed = map.space().periodic();
    let centre = at(0.5, 0.5)?;
    let ends = [
        ("u_min", (0.0, 0.0), (0.0, 1.0)),
        ("u_max", (1.0, 0.0), (1.0, 1.0)),
        ("v_min", (0.0, 0.0), (1.0, 0.0)),
        ("v_max", (0.0, 1.0), (1.0, 1.0)),
    ];
    let mut sides = BTreeMap::new();
    let is_seam = |name: &str| closed[usize::from(name.starts_with('v'))];
    for (name, from, to) in ends.into_iter().filter(|(name, ..)| !is_seam(name)) {
        let middle = at(0.5 * (from.0 + to.0), 0.5 * (from.1 + to.1))?;
        let offset: Vec<f64> = middle.iter().zip(&centre).map(|(m, c)| m - c).collect();
        let axis = (0..offset.len()).max_by(|&i, &j| offset[i].abs().total_cmp(&offset[j].abs())).unwrap_or(0);
        let sign = if offset[axis] < 0.0 { '-' } else { '+' };
        let towards = format!("{sign}{}", ["x", "y", "z"].get(axis).copied().unwrap_or("?"));
        sides.insert(name, SideReport { towards, from: at(from.0, from.1)?, to: at(to.0, to.1)? });
    }
    Ok(sides)
}
