//! What is typed: arguments and their help.

use std::path::PathBuf;

use clap::{Args, CommandFactory, Parser, Subcommand};
use reconstruct::{
    BlendChoice, ClosedChoice, CornerChoice, CurveOptions, CurveParameters, Ends, FitOptions, KnotChoice, LambdaChoice,
    LengthUnit, Mark, Method, Schema, Tolerance,
};

use crate::fit_args::{FIT_HELP, FitArgs};
use crate::scan_args::{LayoutArgs, ReadArgs, unit};

/// Turns scans into truncated hierarchical B-spline surfaces that CAD opens.
///
///     thb fit scan.ply -o part.step --report part.json
///
/// reads a mesh, lays it out on the unit square, fits a smooth surface adaptively until 95 % of the points are within
/// 0.1 % of the bounding box diagonal, and writes a STEP file and a report. No option is needed.
#[derive(Debug, Parser)]
#[command(name = "thb", version, verbatim_doc_comment, after_help = EXIT_CODES)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
    /// Log what happens to standard error; twice for details.
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    pub(crate) verbose: u8,
}

/// The options of `thb fit` that most people need, which `-h` shows; `--help` shows all.
const IN_SHORT_HELP: [&str; 11] =
    ["inputs", "outputs", "reports", "tol", "within", "layout", "clean", "height_field", "units", "jobs", "resume"];

/// All that can be typed.
pub(crate) fn command() -> clap::Command {
    let is_needed_by_most = |arg: &clap::Arg| IN_SHORT_HELP.contains(&arg.get_id().as_str());
    Cli::command().mut_subcommand("fit", |fit| {
        let fit = fit.mut_args(|arg| if is_needed_by_most(&arg) { arg } else { arg.hide_short_help(true) });
        fit.after_help("thb fit --help has all options, and examples.")
    })
}

const EXIT_CODES: &str = "Exit codes: 0 done; 1 input or numerical error; 2 wrong usage; 3 finished and written, but the \
tolerance was not reached (the report says why). Of several inputs the worst counts: 1, then 3.";

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Fit a surface to a scan, or to many.
    #[command(after_long_help = FIT_HELP, override_usage = "thb fit [OPTIONS] -o <OUT> <INPUTS>...\n       thb fit [OPTIONS] -o <OUT> --manifest <PARTS.csv|PARTS.toml>")]
    Fit(Box<FitArgs>),
    /// Join what runs with --shard, or runs of a part each, have written to a directory: index.html, and a summary.
    #[command(after_long_help = INDEX_HELP)]
    Index {
        /// The output directory of the runs.
        directory: PathBuf,
        /// Summary of all parts, one JSON object a line, in the order of their names.
        #[arg(long, value_name = "FILE")]
        summary: Option<PathBuf>,
    },
    /// Fit a curve to a sequence of points, or to values of a function.
    #[command(after_long_help = CURVE_HELP)]
    FitCurve(Box<CurveArgs>),
    /// Lay out a scan on the unit square: parameters, a picture of them, and how good they are.
    #[command(after_long_help = PARAM_HELP)]
    Param(Box<ParamArgs>),
    /// Points of a model at parameters, as CSV on standard output.
    Eval {
        /// Model, .json or .xml.
        model: PathBuf,
        /// CSV with the columns u and v.
        parameters: PathBuf,
    },
    /// Write a model in another format.
    Convert {
        /// Model, .json or .xml.
        model: PathBuf,
        /// Output: .step .stp .xml .json, a sampled mesh .obj .ply .vtk, or for curves .svg .dxf.
        #[arg(short, long)]
        output: PathBuf,
        /// Control points up to which a STEP file holds one face; beyond, it holds several.
        #[arg(long, default_value_t = FitOptions::default().max_step_control_points)]
        max_step_control_points: usize,
        /// Turn the face normal.
        #[arg(long)]
        flip: bool,
        /// Name of the product in a STEP file. [default: that of the model, else of the file]
        #[arg(long)]
        name: Option<String>,
        /// Application protocol of a STEP file: ap214 or ap242.
        #[arg(long, default_value_t = Schema::Ap214)]
        schema: Schema,
    },
    /// Deviation of a cloud from a model, as JSON on standard output.
    Compare {
        /// Model, .json or .xml.
        model: PathBuf,
        /// Cloud or mesh; its points are compared. - is standard input.
        cloud: PathBuf,
        #[command(flatten)]
        read: ReadArgs,
        /// Distance that counts as within tolerance; % of the cloud's diagonal.
        #[arg(long, default_value_t = Tolerance::Percent(0.1), allow_hyphen_values = true)]
        tol: Tolerance,
        /// Largest distance of the scan from the surface that passes, a length or % of the cloud's diagonal: beyond, the exit code is 3.
        #[arg(long, value_name = "TOL", allow_hyphen_values = true)]
        max: Option<Tolerance>,
        /// Distance that 95 % of the scan's area must keep to pass, a length or % of the cloud's diagonal: beyond, the exit code is 3.
        #[arg(long, value_name = "TOL", allow_hyphen_values = true)]
        p95: Option<Tolerance>,
        /// The points one by one, as CSV: row, x, y, z, distance, the closest point of the surface and its parameters.
        #[arg(long, value_name = "FILE.csv")]
        points: Option<PathBuf>,
    },
    /// What a file holds, as JSON on standard output.
    Info {
        /// Model, cloud or mesh; - is standard input.
        file: PathBuf,
        #[command(flatten)]
        read: ReadArgs,
    },
}

const INDEX_HELP: &str = "Every run of thb fit into a directory keeps a record of each part in parts/NAME.json there. What these say becomes the page
index.html: failures first, and parts that were begun and not finished among them. The exit code is that of the worst part.";

const CURVE_HELP: &str = "Examples:
  thb fit-curve airfoil.dat -o airfoil.step -o airfoil.svg
      a section, closed at its trailing edge; and a picture with points and knots
  thb fit-curve measured.csv --graph --tol 0.5% -o measured.json
      y as a function of x: a smooth curve through values
  thb fit-curve outline.xyz --corners 0,140,311 --tol 0.01 -o outline.dxf
      with corners where you know them
  thb fit-curve outline.csv --method joint --tol 0.01 -o outline.step
      parameters move with the curve: fewer control points

Input: one point a line, in order: .csv .txt .dat .xyz and the other formats of points, with one to three coordinates
(--columns chooses them). A column u holds parameters. A line of words at the top is skipped. Noise is smoothed by
--lambda, with few --knots, not by a tolerance below it.

The exit code is 3 where the curve can't be used: standard error says whether it misses points, swings out or crosses
itself, and where.

If the tolerance is not reached, the report says why: 'too-few-points' (spans run out of points: noise; raise --tol),
'levels' (--halvings), 'max-dofs' (--max-dofs), 'stagnation' (noise), 'fixed-knots' (--knots is a number).";

#[derive(Args, Debug)]
pub(crate) struct CurveArgs {
    /// Points, one a line, in the order of the curve; - is standard input.
    pub(crate) input: PathBuf,
    /// Output, the format by extension (.step .stp .xml .json .svg .dxf); may be repeated. [default: a report only]
    #[arg(short, long = "output", value_name = "OUT")]
    pub(crate) outputs: Vec<PathBuf>,
    /// Report as JSON.
    #[arg(long, value_name = "R.json")]
    pub(crate) report: Option<PathBuf>,
    /// Say nothing on standard error but errors.
    #[arg(short, long)]
    pub(crate) quiet: bool,
    #[command(flatten)]
    read: ReadArgs,
    /// The first coordinate is the parameter, and the others are functions of it.
    #[arg(long, help_heading = "How it is laid out")]
    graph: bool,
    /// Parameters: auto (those of the file, else chord), given, chord, centripetal, parcnn or uniform.
    #[arg(long, default_value_t = CurveOptions::default().param, help_heading = "How it is laid out")]
    param: CurveParameters,
    /// Whether the curve closes: auto (where the last point is the first one, or as near as neighbours are, or goes
    /// round once more), yes or no.
    #[arg(long, default_value_t = CurveOptions::default().closed, help_heading = "How it is laid out")]
    closed: ClosedChoice,
    /// Where the curve may turn sharply: auto (points that turn by 40 degrees and three times as much as their
    /// neighbours, alone or as the ends of a short edge), none, or rows of the input, from 0.
    #[arg(long, default_value_t = CurveOptions::default().corners, help_heading = "How it is laid out")]
    corners: CornerChoice,
    /// Ends of an open curve: free, or held (at the first and the last point).
    #[arg(long, default_value_t = CurveOptions::default().ends, help_heading = "How it is laid out")]
    ends: Ends,

    /// Fitting method: ls (parameters stay), or parameters that move with the curve: a-pdm, a-tdm, a-hdm (in turn), j-pdm,
    /// joint (at once).
    #[arg(long, default_value_t = CurveOptions::default().method, help_heading = "What is fitted")]
    method: Method,
    /// Corrections of the parameters after each refinement, for a-pdm, a-tdm and a-hdm.
    #[arg(long, default_value_t = CurveOptions::default().corrections, help_heading = "What is fitted")]
    corrections: usize,
    /// Weight of the point distance in a-hdm: error, or a number from 0 to 1.
    #[arg(long, default_value_t = CurveOptions::default().blend, help_heading = "What is fitted")]
    blend: BlendChoice,
    /// Relative damping of the steps of a-tdm.
    #[arg(long, default_value_t = CurveOptions::default().damping, help_heading = "What is fitted")]
    damping: f64,
    /// Degree, 1 to 8.
    #[arg(long, default_value_t = CurveOptions::default().degree, help_heading = "What is fitted")]
    degree: usize,
    /// Knots: adaptive (dyadic, where errors are), a number of inner knots (by averaging the parameters), or uniform:N.
    #[arg(long, default_value_t = CurveOptions::default().knots, help_heading = "What is fitted")]
    knots: KnotChoice,
    /// Elements that adaptive knots start from, between corners.
    #[arg(long, default_value_t = CurveOptions::default().elements, help_heading = "What is fitted")]
    mesh: usize,
    /// Smoothing weight: a number, for parameters scaled to the unit interval, auto (by error on held-out points, within the
    /// tolerance), gcv (generalized cross-validation) or discrepancy:SIGMA (noise of the points, a length or %).
    #[arg(long, default_value_t = CurveOptions::default().lambda, allow_hyphen_values = true, help_heading = "What is fitted")]
    lambda: LambdaChoice,

    /// Tolerance, a length in the units of the input or a percentage of the bounding box diagonal (of a graph: of the
    /// values).
    #[arg(long, default_value_t = CurveOptions::default().tol, allow_hyphen_values = true, help_heading = "When it is good enough")]
    tol: Tolerance,
    /// Share of the points that must be within the tolerance; 1 for all.
    #[arg(long, visible_alias = "nu", default_value_t = CurveOptions::default().within, allow_hyphen_values = true, help_heading = "When it is good enough")]
    within: f64,
    /// Spans that get a knot: share:S (those with the worst share S of the points), threshold (those with a point beyond
    /// the tolerance) or worst (those with the worst of these points, as far as --within leaves points out).
    #[arg(long, default_value_t = CurveOptions::default().mark, help_heading = "When it is good enough")]
    mark: Mark,
    /// How often the domain may be halved: no span gets shorter.
    #[arg(long, default_value_t = CurveOptions::default().halvings, help_heading = "When it is good enough")]
    halvings: u32,
    /// Largest number of control points. [default: the number of points]
    #[arg(long, help_heading = "When it is good enough")]
    max_dofs: Option<usize>,
    /// Length unit of the coordinates: um, mm, cm, m, inch or ft. [default: that of the file (.e57 .3mf .las), else mm]
    #[arg(long, value_parser = unit, help_heading = "What is written")]
    units: Option<LengthUnit>,
}

impl CurveArgs {
    /// The options of the fit.
    pub(crate) fn options(&self) -> CurveOptions {
        CurveOptions {
            read: self.read.options(),
            graph: self.graph,
            param: self.param,
            closed: self.closed,
            corners: self.corners.clone(),
            ends: self.ends,
            method: self.method,
            corrections: self.corrections,
            blend: self.blend,
            damping: self.damping,
            degree: self.degree,
            knots: self.knots,
            elements: self.mesh,
            lambda: self.lambda,
            tol: self.tol,
            within: self.within,
            mark: self.mark,
            halvings: self.halvings,
            max_dofs: self.max_dofs,
            units: self.units,
        }
    }
}

const PARAM_HELP: &str = "Examples:
  thb param scan.xyz -o uv.csv -o uv.svg
      parameters of an unordered cloud, and a picture of the square, coloured by stretch
  thb param scan.xyz --clean outliers,stray --corners 0,17,212,96 -o uv.csv --report quality.json
      without stray points, with corners of your choice

uv.csv has the columns row,x,y,z,u,v,boundary: row is the point's in the input, counted from 0. thb fit reads it, with
these parameters.";

#[derive(Args, Debug)]
pub(crate) struct ParamArgs {
    /// Scan to lay out; - is standard input.
    pub(crate) input: PathBuf,
    /// Output: .csv, or a picture .svg; may be repeated. [default: a report on standard output only]
    #[arg(short, long = "output", value_name = "OUT")]
    pub(crate) outputs: Vec<PathBuf>,
    /// Where the report goes, as JSON. [default: standard output]
    #[arg(long, value_name = "R.json")]
    pub(crate) report: Option<PathBuf>,
    /// Threads; 0 for one per core.
    #[arg(long, default_value_t = 0)]
    pub(crate) threads: usize,
    #[command(flatten)]
    pub(crate) layout: LayoutArgs,
}
