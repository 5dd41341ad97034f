//! What is typed for fits of surfaces.

use std::path::PathBuf;

use clap::Args;
use reconstruct::{
    BlendChoice, BoundaryChoice, Energy, FitOptions, LambdaChoice, LengthUnit, LocalRule, LossChoice, Mark,
    MarkerChoice, Method, Pair, ParameterOptions, PartOptions, QuasiOptions, ReadOptions, ReweightingOptions, Samples,
    Schema, SolidOptions, Tolerance, UpdateChoice,
};

use crate::scan_args::{LayoutArgs, unit};
use crate::solid_args::SolidArgs;

pub(crate) const FIT_HELP: &str = "Examples:
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
    /// Scans to fit, or directories of scans; - is standard input.
    pub(crate) inputs: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) run: RunArgs,
    #[command(flatten)]
    pub(crate) part: PartArgs,
    #[command(flatten)]
    pub(crate) said: SaidArgs,
}

/// What concerns a run, not a part.
#[derive(Args, Debug)]
pub(crate) struct RunArgs {
    /// Output, the format by extension (.step .stp .xml .json .obj .ply .vtk), or a directory; may be repeated.
    #[arg(short, long = "output", value_name = "OUT")]
    pub(crate) outputs: Vec<PathBuf>,
    /// Report of a single input: a page to look at (.html), which needs no other file and no network, or JSON; may be repeated.
    #[arg(long = "report", value_name = "R.html|R.json")]
    pub(crate) reports: Vec<PathBuf>,
    /// Name of the part, of a single input: of the product in STEP files, and of the files in an output directory.
    /// [default: the product is named as its file, the files as the scan]
    #[arg(long)]
    pub(crate) name: Option<String>,
    /// No page NAME.html beside the other files in an output directory.
    #[arg(long)]
    pub(crate) no_html: bool,
    /// No warnings on standard error; the report has them.
    #[arg(long, short)]
    pub(crate) quiet: bool,
    /// Summary of all inputs, one JSON object a line.
    #[arg(long, value_name = "FILE", help_heading = "Many parts")]
    pub(crate) summary: Option<PathBuf>,
    /// Parts fitted at a time; no more than threads.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..), help_heading = "Many parts")]
    pub(crate) jobs: u16,
    /// Threads for the work within a part; 0 for one per core.
    #[arg(long, default_value_t = 0, help_heading = "Many parts")]
    pub(crate) threads: usize,
    /// Keep what an earlier run into the same directory has done, where neither scan nor options nor program have changed since.
    #[arg(long, help_heading = "Many parts")]
    pub(crate) resume: bool,
}

/// Where options are said beside the command line. The last that says one counts: preset, file, command line, manifest.
#[derive(Args, Debug)]
pub(crate) struct SaidArgs {
    /// Inputs from a file, a part a line: .csv whose first line names the columns, or .toml with a table `part` each. input is the scan, name
    /// that of its files in the output directory, all others are options by their names.
    #[arg(long, value_name = "PARTS.csv|PARTS.toml", help_heading = "Many parts")]
    pub(crate) manifest: Option<PathBuf>,
    /// Fit the I-th of N shares of the parts, as 2/8, beside N - 1 other runs; thb index joins what they write.
    #[arg(long, value_name = "I/N", value_parser = shard, help_heading = "Many parts")]
    pub(crate) shard: Option<Shard>,
    /// Options from a file: .toml, as --print-config prints, or the .json report of a fit, which is done again.
    #[arg(long, value_name = "FIT.toml|REPORT.json", help_heading = "Options in files")]
    pub(crate) config: Option<PathBuf>,
    /// Options for a kind of scan.
    #[arg(long, value_name = "NAME", value_enum, help_heading = "Options in files")]
    pub(crate) preset: Option<Preset>,
    /// Print all options, as a file for --config, and do nothing.
    #[arg(long, help_heading = "Options in files")]
    pub(crate) print_config: bool,
}

/// Options for a kind of scan, each a file for `--config` in the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Preset {
    /// A raw cloud of a scanner.
    Scan,
    /// A mesh without noise, of CAD or of a simulation.
    Mesh,
    /// Heights over x and y.
    Terrain,
    /// A blade, measured in sections.
    Blade,
    /// Nothing is decided by the data, for comparisons with other programs.
    Research,
}

impl Preset {
    /// The file.
    pub(crate) fn text(self) -> &'static str {
        match self {
            Self::Scan => include_str!("../presets/scan.toml"),
            Self::Mesh => include_str!("../presets/mesh.toml"),
            Self::Terrain => include_str!("../presets/terrain.toml"),
            Self::Blade => include_str!("../presets/blade.toml"),
            Self::Research => include_str!("../presets/research.toml"),
        }
    }
}

/// One of several equal shares of the parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Shard {
    /// Which, from 1.
    pub(crate) number: usize,
    /// Of how many.
    pub(crate) of: usize,
}

fn shard(text: &str) -> Result<Shard, String> {
    let numbers = text.split_once('/').and_then(|(number, of)| Some((number.parse().ok()?, of.parse().ok()?)));
    let shard = numbers.map(|(number, of)| Shard { number, of });
    shard
        .filter(|shard| (1..=shard.of).contains(&shard.number))
        .ok_or_else(|| "two numbers, the first from 1 to the second, as in 2/8".to_owned())
}

/// What may differ from part to part.
#[derive(Args, Debug)]
pub(crate) struct PartArgs {
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

    /// Tolerance, a length in the units of the input or a percentage of the bounding box diagonal; or auto, by the scan.
    ///
    /// auto is 0.1 % of the diagonal, at most 2 % of relief, radius or thickness, at least three standard deviations of the noise and the step of rounding.
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
    /// Application protocol of STEP files: ap214, which every CAD system reads, or ap242.
    #[arg(long, default_value_t = FitOptions::default().schema, help_heading = "What is written")]
    schema: Schema,
    /// Cut the holes of the data out of the faces of STEP files. The surface itself spans them.
    #[arg(long, help_heading = "What is written")]
    trim_holes: bool,
}

impl PartArgs {
    /// All options.
    pub(crate) fn options(&self, threads: usize) -> PartOptions {
        PartOptions { surface: self.surface(threads), solid: self.solid_options() }
    }

    /// The options for a whole part.
    fn solid_options(&self) -> SolidOptions {
        let default = SolidOptions::default();
        // Directions with different numbers are refused by the check: 0 is out of range.
        let alike = |Pair([u, v]): Pair| if u == v { u } else { 0 };
        SolidOptions {
            layout: self.solid.layout.clone(),
            degree: alike(self.degree),
            elements: self.mesh.map(alike),
            smoothness: self.solid.smoothness.unwrap_or(default.smoothness),
            sharp: self.solid.sharp.unwrap_or(default.sharp),
            tol: if self.tol == Tolerance::Auto { default.tol } else { self.tol },
            within: self.within.unwrap_or(default.within),
            units: self.units,
            flip: self.flip,
            read: self.read_options(),
            ..default
        }
    }

    fn read_options(&self) -> ReadOptions {
        ReadOptions { weights: self.weights.clone(), ..self.layout.read.options() }
    }

    /// The options for a sheet of four sides.
    fn surface(&self, threads: usize) -> FitOptions {
        FitOptions {
            parameters: ParameterOptions { read: self.read_options(), ..self.layout.options() },
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
            schema: self.schema,
            trim_holes: self.trim_holes,
            mark: self.mark,
            extension: self.extension,
            admissible: self.admissible,
            energy: self.energy,
            samples: self.samples,
            all_pieces: self.layout.all_pieces(),
            units: self.units,
            flip: self.flip,
            threads,
            ..FitOptions::default()
        }
    }
}
