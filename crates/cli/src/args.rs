//! What is typed: arguments and their help.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};
use reconstruct::{
    BlendChoice, BoundaryChoice, Clean, Closed, ClosedChoice, CornerChoice, Crop, CurveOptions, CurveParameters,
    Decimal, Domain, Ends, Energy, FitOptions, Format, GivenCorners, KnotChoice, LambdaChoice, LayoutChoice,
    LengthUnit, LocalRule, LossChoice, Mark, MarkerChoice, Method, Networks, Pair, ParameterChoice, ParameterOptions,
    QuasiOptions, RadiusChoice, ReadOptions, Refine, ReweightingOptions, Samples, SideRule, SolidOptions, Tolerance,
    UpdateChoice,
};

use crate::solid_args::SolidArgs;

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

const EXIT_CODES: &str = "Exit codes: 0 done; 1 input or numerical error; 2 wrong usage; 3 finished and written, but the \
tolerance was not reached (the report says why). Of several inputs the worst counts: 1, then 3.";

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Fit a surface to a scan, or to many.
    #[command(after_long_help = FIT_HELP)]
    Fit(Box<FitArgs>),
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
    },
    /// What a file holds, as JSON on standard output.
    Info {
        /// Model, cloud or mesh; - is standard input.
        file: PathBuf,
        #[command(flatten)]
        read: ReadArgs,
    },
}

const FIT_HELP: &str = "Examples:
  thb fit face.off --tol 0.5% -o face.step --report face.json
      the surface as STEP, and how good it is
  thb fit face.off -o face.step --report face.html
      and a page that shows where the surface is how far from the scan
  thb fit face.off -o face.step -o face.json -o face.vtk
      also the exact model, and a mesh coloured by deviation
  thb fit scans/*.ply -o out/ --jobs 2 --summary out/summary.jsonl
      many parts; out/ gets NAME.step, NAME.json, NAME.report.json and NAME.html of each
  thb fit cloud.csv --param given --method ls --degree 2 --mesh 8x8 --extension 2 --lambda 1e-7 --tol 1e-4 --energy gauss-p --within 1
      parameters u,v from the file, and the settings of a G+Smo fit

  thb fit tile.laz --class 2 --height-field -o ground.step
      the ground of a terrain scan, as heights over x and y

Input: meshes .ply .obj .off .stl .glb .3mf; clouds with parameters (.csv with the columns x,y,z,u,v, or G+Smo .xml); gridded clouds
(.csv with the columns i,j,x,y,z, .pcd or .ptx); height fields .asc .grd; unordered clouds .xyz .txt .pts .csv .pcd .las .laz .e57,
laid out by their shape or, with --height-field, by x and y. All may be compressed (.xyz.gz) or alone in a .zip.

If the tolerance is not reached, the report says why: 'levels' (allow more with --levels), 'max-dofs' (--max-dofs),
'stagnation' (noise, or parameters that do not suit the shape; try a larger --tol or another --param).";

#[derive(Args, Debug)]
pub(crate) struct FitArgs {
    /// Scans to fit; - is standard input.
    #[arg(required = true)]
    pub(crate) inputs: Vec<PathBuf>,
    /// Output, the format by extension (.step .stp .xml .json .obj .ply .vtk), or a directory; may be repeated.
    #[arg(short, long = "output", value_name = "OUT", required = true)]
    pub(crate) outputs: Vec<PathBuf>,
    /// Report of a single input: a page to look at (.html), which needs no other file and no network, or JSON; may be repeated.
    #[arg(long = "report", value_name = "R.html|R.json")]
    pub(crate) reports: Vec<PathBuf>,
    /// No page NAME.html beside the other files in an output directory.
    #[arg(long)]
    pub(crate) no_html: bool,
    /// Summary of all inputs, one JSON object a line.
    #[arg(long, value_name = "FILE")]
    pub(crate) summary: Option<PathBuf>,
    /// Parts fitted at a time; no more than threads.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..))]
    pub(crate) jobs: u16,
    /// Threads for the work within a part; 0 for one per core.
    #[arg(long, default_value_t = 0)]
    threads: usize,
    /// No warnings on standard error; the report has them.
    #[arg(long, short)]
    pub(crate) quiet: bool,
    #[command(flatten)]
    layout: LayoutArgs,
    #[command(flatten)]
    pub(crate) solid: SolidArgs,

    /// Fitting method: auto (as joint, or ls where that ends better); ls or qi (fixed parameters: one system for all control
    /// points, or a small local problem for each); or parameters that move together with the surface: a-pdm, a-tdm, a-hdm,
    /// a-qi (in turn), j-pdm, joint (at once).
    #[arg(long, default_value_t = FitOptions::default().method, help_heading = "What is fitted")]
    method: Method,
    /// Corrections of the parameters after each refinement, for a-pdm, a-tdm, a-hdm and a-qi.
    #[arg(long, default_value_t = FitOptions::default().corrections, help_heading = "What is fitted")]
    corrections: usize,
    /// Weight of the point distance in a-hdm: error, curvature, or a number from 0 to 1.
    #[arg(long, default_value_t = FitOptions::default().blend, help_heading = "What is fitted")]
    blend: BlendChoice,
    /// Relative damping of the steps of a-tdm.
    #[arg(long, default_value_t = FitOptions::default().damping, help_heading = "What is fitted")]
    damping: f64,
    /// Points on the boundary of the square, while parameters move: kept (on their side) or free.
    #[arg(long, default_value_t = FitOptions::default().boundary, help_heading = "What is fitted")]
    boundary: BoundaryChoice,
    /// Points that a local problem of qi and a-qi has at least. [default: the number of functions on a cell]
    #[arg(long, value_name = "N", help_heading = "What is fitted")]
    n_min: Option<usize>,
    /// Share of the cells of a local problem that hold a point, at least.
    #[arg(long, default_value_t = QuasiOptions::default().density, allow_hyphen_values = true, help_heading = "What is fitted")]
    density: f64,
    /// How the smoothing weight of a local problem follows from a given --lambda: constant, points (times their number) or
    /// area (times the region's share of the square).
    #[arg(long, default_value_t = QuasiOptions::default().local_lambda, value_name = "RULE", help_heading = "What is fitted")]
    local_lambda: LocalRule,
    /// Degree, for both directions or as U,V; 1 to 8.
    #[arg(long, default_value_t = FitOptions::default().degree, help_heading = "What is fitted")]
    degree: Pair,
    /// Elements of the coarsest level, as 8 or 8x4. [default: 4, in closed directions 8]
    #[arg(long, help_heading = "What is fitted")]
    mesh: Option<Pair>,
    /// Smoothing weight: auto (by error on held-out points, within the tolerance), gcv (generalized cross-validation, for
    /// noise of unknown size), discrepancy:SIGMA (as large as the root mean squared distance SIGMA of the points from the
    /// true surface allows; a length or a percentage of the diagonal), or a number. It multiplies the thin-plate energy G in
    /// BᵀWB + λG.
    #[arg(long, default_value_t = FitOptions::default().lambda, allow_hyphen_values = true, help_heading = "What is fitted")]
    lambda: LambdaChoice,
    /// What of a mesh is fitted: its area (long triangles get further points, which lie on curved triangles; all weigh as much as
    /// the area round them), or its vertices, all alike, at their parameters.
    #[arg(long, default_value_t = FitOptions::default().samples, help_heading = "What is fitted")]
    samples: Samples,
    /// Integration of the energy: exact, or gauss-p as in G+Smo.
    #[arg(long, default_value_t = FitOptions::default().energy, help_heading = "What is fitted")]
    energy: Energy,

    /// Robust loss, for points with gross errors: huber, tukey, geman-mcclure, or lp:P with 1 < P ≤ 2. Points that disagree
    /// with their neighbours are set aside and listed in the report. [default: least squares]
    #[arg(long, value_name = "LOSS", help_heading = "What counts how much")]
    robust: Option<LossChoice>,
    /// Largest share of the points that a robust loss sets aside; of those that --markers auto has ignored, too.
    #[arg(long, value_name = "SHARE", default_value_t = ReweightingOptions::default().max_set_aside, allow_hyphen_values = true, help_heading = "What counts how much")]
    max_set_aside: f64,
    /// Markers: a file with a row (from 0) and a type in each line, I for points that must be met, II for points that
    /// must be ignored; or auto, to find both by a first fit and by curvature.
    #[arg(long, value_name = "FILE|auto", help_heading = "What counts how much")]
    markers: Option<MarkerChoice>,
    /// Distance below which a marker of type I is met. [default: --tol]
    #[arg(long, value_name = "TOL", allow_hyphen_values = true, help_heading = "What counts how much")]
    marker_tol: Option<Tolerance>,
    /// Distance above which a marker of type II is ignored. [default: --tol]
    #[arg(long, value_name = "TOL", allow_hyphen_values = true, help_heading = "What counts how much")]
    ignore_tol: Option<Tolerance>,
    /// Change of the weight of a marker that is not satisfied: a factor, or error for 1 + distance / tolerance.
    #[arg(long, value_name = "UPDATE", default_value_t = UpdateChoice::default(), help_heading = "What counts how much")]
    marker_update: UpdateChoice,
    /// Column of a CSV file with the confidence in each point, 0 or more, which multiplies its weight.
    #[arg(long, value_name = "COLUMN", help_heading = "What counts how much")]
    weights: Option<String>,

    /// Tolerance, a length in the units of the input or a percentage of the bounding box diagonal; or auto: 0.1 % of the diagonal, at
    /// most 2 % of relief, radius or thickness, at least three standard deviations of the noise and the step of rounding.
    #[arg(long, default_value_t = FitOptions::default().tol, allow_hyphen_values = true, help_heading = "When it is good enough")]
    tol: Tolerance,
    /// Share of the points that must be within the tolerance; 1 for all.
    /// [default: 0.95; for whole parts 0.99, of the areas of mesh and surface]
    #[arg(long, visible_alias = "nu", allow_hyphen_values = true, help_heading = "When it is good enough")]
    within: Option<f64>,
    /// Largest number of levels; level 0 counts.
    #[arg(long, default_value_t = FitOptions::default().levels, help_heading = "When it is good enough")]
    levels: usize,
    /// Largest number of control points of the surface. [default: the number of points]
    #[arg(long, help_heading = "When it is good enough")]
    max_dofs: Option<usize>,

    /// Where to refine: worst (around the worst points, as far as --within leaves points out), threshold (around all points
    /// beyond the tolerance) or share:S (around the worst share S of all points).
    #[arg(long, default_value_t = FitOptions::default().mark, help_heading = "How it is refined")]
    mark: Mark,
    /// Cells of the next level by which the region around points beyond the tolerance is extended, as 2 or 2,1: 2 is one
    /// ring of cells of their own level. [default: half the degree, the least with which functions fit into the region]
    #[arg(long, help_heading = "How it is refined")]
    extension: Option<Pair>,
    /// Keep the mesh admissible of this class (2 or more): few levels meet on a cell. [default: not kept]
    #[arg(long, help_heading = "How it is refined")]
    admissible: Option<usize>,

    /// Points in the support of a function from which on qi and a-qi may refine it. [default: twice the number of functions
    /// on a cell]
    #[arg(long, value_name = "N", help_heading = "How it is refined")]
    n_loc: Option<usize>,
    /// Parts of a support, as 2 or 2x2, each of which must hold its share of these points.
    #[arg(long, default_value_t = QuasiOptions::default().splits, help_heading = "How it is refined")]
    splits: Pair,

    /// Length unit of the coordinates: um, mm, cm, m, inch or ft. [default: that of the file (.e57 .3mf .las), else mm]
    #[arg(long, value_parser = unit, help_heading = "What is written")]
    units: Option<LengthUnit>,
    /// Turn the face normal. It follows the orientation of a mesh's triangles otherwise.
    #[arg(long, help_heading = "What is written")]
    flip: bool,
    /// Control points up to which a STEP file holds one face; beyond, it holds several.
    #[arg(long, default_value_t = FitOptions::default().max_step_control_points, help_heading = "What is written")]
    max_step_control_points: usize,
    /// Cut the holes of the data out of the faces of STEP files. The surface itself spans them.
    #[arg(long, help_heading = "What is written")]
    trim_holes: bool,
}

impl FitArgs {
    /// The options of a whole part, if it is one: asked for, or one closed mesh that STEP files are made of.
    pub(crate) fn solid_options(&self) -> Option<SolidOptions> {
        let read = ReadOptions { weights: self.weights.clone(), ..self.layout.read.options() };
        let layout = match &self.solid.layout {
            LayoutChoice::One => return None,
            LayoutChoice::Auto => {
                if !reconstruct::makes_solid(&self.inputs, &self.outputs, &read) {
                    return None;
                }
                LayoutChoice::Patches
            }
            given => given.clone(),
        };
        let default = SolidOptions { layout, ..SolidOptions::default() };
        // Directions with different numbers are refused by the check: 0 is out of range.
        let alike = |Pair([u, v]): Pair| if u == v { u } else { 0 };
        Some(SolidOptions {
            degree: alike(self.degree),
            elements: self.mesh.map(alike),
            smoothness: self.solid.smoothness.unwrap_or(default.smoothness),
            sharp: self.solid.sharp.unwrap_or(default.sharp),
            tol: if self.tol == Tolerance::Auto { default.tol } else { self.tol },
            within: self.within.unwrap_or(default.within),
            units: self.units,
            flip: self.flip,
            read,
            ..default
        })
    }

    /// The options of the fit.
    pub(crate) fn options(&self) -> FitOptions {
        FitOptions {
            parameters: ParameterOptions {
                read: ReadOptions { weights: self.weights.clone(), ..self.layout.read.options() },
                ..self.layout.options()
            },
            method: self.method,
            corrections: self.corrections,
            blend: self.blend,
            damping: self.damping,
            boundary: self.boundary,
            quasi: QuasiOptions {
                n_min: self.n_min,
                n_loc: self.n_loc,
                density: self.density,
                splits: self.splits,
                local_lambda: self.local_lambda,
            },
            reweighting: ReweightingOptions {
                robust: self.robust,
                max_set_aside: self.max_set_aside,
                markers: self.markers.clone(),
                marker_tol: self.marker_tol,
                ignore_tol: self.ignore_tol,
                marker_update: self.marker_update,
            },
            degree: self.degree,
            mesh: self.mesh,
            lambda: self.lambda,
            tol: self.tol,
            within: self.within.unwrap_or(FitOptions::default().within),
            levels: self.levels,
            max_dofs: self.max_dofs,
            max_step_control_points: self.max_step_control_points,
            trim_holes: self.trim_holes,
            mark: self.mark,
            extension: self.extension,
            admissible: self.admissible,
            energy: self.energy,
            samples: self.samples,
            all_pieces: self.layout.all_pieces(),
            units: self.units,
            flip: self.flip,
            threads: self.threads,
            ..FitOptions::default()
        }
    }
}

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

/// How scans are cleaned and laid out.
#[derive(Args, Debug)]
pub(crate) struct LayoutArgs {
    #[command(flatten)]
    read: ReadArgs,
    /// Remove points: outliers (neighbours unusually far away), stray (all pieces but the largest). Without, values far beyond the rest,
    /// points that stand alone and copies are set aside, with a warning; none keeps them too.
    #[arg(long, value_delimiter = ',', value_name = "WHAT", help_heading = "How it is cleaned")]
    clean: Vec<Clean>,
    /// Keep one piece of a mesh or cloud that has several: 1 for the largest, 2 for the next, and so on. With all thb fit fits each for
    /// itself and writes them to one file (.json and .xml: a file each).
    #[arg(long, value_name = "K", value_parser = piece, help_heading = "How it is cleaned")]
    piece: Option<Piece>,
    /// Keep at most as many points, well spread.
    #[arg(long, value_name = "N", help_heading = "How it is cleaned")]
    thin: Option<usize>,
    /// Keep the points within a rectangle of x and y. The parameters of a height field are spread over what is left.
    #[arg(long, value_name = "X0,X1,Y0,Y1", allow_hyphen_values = true, help_heading = "How it is cleaned")]
    crop: Option<Crop>,
    /// Keep the points over cells of a grid file (.asc) that are neither 0 nor without data.
    #[arg(long, value_name = "GRID", help_heading = "How it is cleaned")]
    mask: Option<PathBuf>,

    /// Parameters: auto, given, chord, centripetal, parcnn, uniform, mean-value, recd, lpsp, pargcn, bidgcn. auto takes those of the file, else maps
    /// the mesh with mean-value weights, else goes by chord length along the grid, else spans a mesh over the cloud. uniform,
    /// recd and lpsp lay out a cloud by its boundary and weights of neighbours. parcnn (grids), pargcn and bidgcn (clouds) are networks.
    #[arg(long, default_value_t = ParameterOptions::default().param, help_heading = "How it is laid out")]
    param: ParameterChoice,
    /// Parameter domain: unit (parameters of the file must lie between 0 and 1) or data (the box of the parameters; a fixed
    /// --lambda then applies in their units).
    #[arg(long, default_value_t = ParameterOptions::default().domain, help_heading = "How it is laid out")]
    domain: Domain,
    /// Directions in which the surface closes on itself: auto, none, u, v or uv. auto is u for meshes and clouds that are tubes by their
    /// shape, else none; the others are for grids whose lines close, for meshes and clouds of tubes, and for parameters of the file, which then wrap at 1. --mesh must have more elements there than the degree.
    #[arg(long, default_value_t = ParameterOptions::default().closed, help_heading = "How it is laid out")]
    closed: Closed,
    /// Four points of the outline that become the corners (0,0), (1,0), (1,1), (0,1): their rows in the file, from 0.
    /// [default: chosen by the turning of the outline]
    #[arg(long, value_name = "A,B,C,D", help_heading = "How it is laid out")]
    corners: Option<GivenCorners>,
    /// A text file that names the points of the outer boundary by their rows, from 0. A column `boundary` of a CSV file,
    /// 0 for inside, does the same. [default: found]
    #[arg(long, value_name = "FILE", help_heading = "How it is laid out")]
    outline: Option<PathBuf>,
    /// How the points of a side are spread over it: chord, centripetal or uniform.
    #[arg(long, default_value_t = ParameterOptions::default().side_rule, help_heading = "How it is laid out")]
    side_rule: SideRule,
    /// Radius of the neighbourhoods of uniform, recd and lpsp: grow (until every point has a path to the boundary), auto
    /// (3/√m of the extent) or a length.
    #[arg(long, default_value_t = ParameterOptions::default().radius, help_heading = "How it is laid out")]
    radius: RadiusChoice,
    /// Refine maps of meshes towards less distortion: auto (where they are stretched in places, but not on the whole), on or off.
    #[arg(long, default_value_t = ParameterOptions::default().refine, help_heading = "How it is laid out")]
    refine: Refine,
    /// Ask networks beside the map of a cloud that is laid out by its shape, and take their parameters where they are better:
    /// on or off.
    #[arg(long, default_value_t = ParameterOptions::default().networks, help_heading = "How it is laid out")]
    networks: Networks,
    /// Points laid out at once: a cloud of more than three times as many goes through a well-spread subset of this size.
    #[arg(long, default_value_t = ParameterOptions::default().subset, value_name = "N", help_heading = "How it is laid out")]
    subset: usize,
}

impl LayoutArgs {
    /// Whether every piece is meant.
    pub(crate) fn all_pieces(&self) -> bool {
        self.piece == Some(Piece::All)
    }

    /// The options of laying out.
    pub(crate) fn options(&self) -> ParameterOptions {
        ParameterOptions {
            read: self.read.options(),
            clean: self.clean.clone(),
            piece: self.piece.and_then(Piece::number),
            thin: self.thin,
            crop: self.crop,
            mask: self.mask.clone(),
            param: self.param,
            domain: self.domain,
            closed: self.closed,
            corners: self.corners,
            outline: self.outline.clone(),
            side_rule: self.side_rule,
            radius: self.radius,
            refine: self.refine,
            networks: self.networks,
            subset: self.subset,
            told: None,
        }
    }
}

/// How scans are read where a file leaves it open.
#[derive(Args, Debug)]
#[command(next_help_heading = "How it is read")]
pub(crate) struct ReadArgs {
    /// Format by one of its extensions, such as xyz or ply, whatever the file's name is; needed for standard input.
    /// [default: by the file's extension; .gz behind it is decompressed, and a .zip with one scan inside is opened]
    #[arg(long, value_name = "EXT", value_parser = format)]
    format: Option<Format>,
    /// Columns of text files that hold x, y, z: names, or numbers from 1, as in x_km,y_km,z or 2,3,4. No others are then guessed to be
    /// grid indices or normals.
    #[arg(long, value_delimiter = ',')]
    columns: Vec<String>,
    /// Columns of text files that hold the normal of the surface: names or numbers, as in 4,5,6; or none. [default: nx, ny, nz and
    /// the like, and i, j, k where they aren't grid indices]
    #[arg(long, value_delimiter = ',', value_name = "NX,NY,NZ|none")]
    normals: Option<Vec<String>>,
    /// Columns of text files that hold the row and the column of each point in a grid: names or numbers; or none.
    /// [default: i and j, or row and column, where they are whole numbers]
    #[arg(long, value_delimiter = ',', value_name = "I,J|none")]
    grid: Option<Vec<String>>,
    /// Lines at the start of a text file that are not looked at.
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    skip: usize,
    /// Decimal sign of text files: point or comma; the other one may part thousands. [default: by the numbers]
    #[arg(long, value_name = "SIGN", value_parser = decimal)]
    decimal: Option<Decimal>,
    /// Classes of a LAS or LAZ file whose points are read, as in 2,9. [default: all]
    #[arg(long = "class", value_delimiter = ',', value_name = "CLASSES")]
    classes: Vec<u8>,
    /// Take x and y, each scaled to 0 to 1, as parameters of points that have none: z is a height over them.
    #[arg(long)]
    height_field: bool,
    /// How many times their own size compressed data (.gz, .zip, .laz, .3mf) may expand to. [default: 200, and 12 MiB at most for the first MiB]
    #[arg(long, value_name = "TIMES")]
    max_expand: Option<usize>,
}

impl ReadArgs {
    /// The options of reading.
    pub(crate) fn options(&self) -> ReadOptions {
        ReadOptions {
            format: self.format,
            columns: trimmed(&self.columns),
            normals: self.normals.as_deref().map(named),
            grid: self.grid.as_deref().map(named),
            skip: self.skip,
            decimal: self.decimal,
            classes: self.classes.clone(),
            weights: None,
            height_field: self.height_field,
            max_expand: self.max_expand,
        }
    }
}

fn trimmed(columns: &[String]) -> Vec<String> {
    columns.iter().map(|column| column.trim().to_owned()).collect()
}

/// Columns by name; the one word `none` stands for no columns.
fn named(columns: &[String]) -> Vec<String> {
    if columns.len() == 1 && columns[0].trim() == "none" { Vec::new() } else { trimmed(columns) }
}

fn decimal(text: &str) -> Result<Decimal, String> {
    match text {
        "point" => Ok(Decimal::Point),
        "comma" => Ok(Decimal::Comma),
        _ => Err("point or comma".to_owned()),
    }
}

fn format(text: &str) -> Result<Format, String> {
    let all = || Format::ALL.iter().flat_map(|format| format.extensions()).copied().collect::<Vec<_>>().join(", ");
    Format::from_extension(text.trim_start_matches('.')).map_err(|_| format!("possible are {}", all()))
}

/// The pieces that are laid out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Piece {
    /// Each for itself.
    All,
    /// One, from 1.
    Number(usize),
}

impl Piece {
    fn number(self) -> Option<usize> {
        match self {
            Self::All => None,
            Self::Number(number) => Some(number),
        }
    }
}

fn piece(text: &str) -> Result<Piece, String> {
    let expected = "1 for the largest piece, 2 for the next, and so on, or all";
    match text {
        "all" => Ok(Piece::All),
        _ => text.parse().map(Piece::Number).map_err(|_| expected.to_owned()),
    }
}

fn unit(text: &str) -> Result<LengthUnit, String> {
    match text {
        "um" | "µm" | "μm" => Ok(LengthUnit::Micrometre),
        "mm" => Ok(LengthUnit::Millimetre),
        "cm" => Ok(LengthUnit::Centimetre),
        "m" => Ok(LengthUnit::Metre),
        "inch" | "in" => Ok(LengthUnit::Inch),
        "ft" | "foot" => Ok(LengthUnit::Foot),
        _ => Err("um, mm, cm, m, inch or ft".to_owned()),
    }
}
