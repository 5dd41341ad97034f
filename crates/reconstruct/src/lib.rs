//! From a scan to a THB-spline surface in one library call.
//!
//! [`fit`] takes arrays in memory ([`Points`], [`Mesh`]), [`fit_file`] a file: both find parameters ([`parameterize`]), fit adaptively and
//! report how good the result is ([`Fit`]). [`write_outputs`] writes it in the formats of the given file names; [`run_batch`] does all of
//! it for many files. [`compare`], [`eval_model`], [`convert`] and [`info`] answer questions about models and files. This crate parses no
//! arguments and prints nothing.
//!
//! ```
//! use ndarray::Array2;
//! use reconstruct::{FitOptions, Points, Tolerance, Verdict, fit};
//!
//! // A parabolic cylinder by 12 × 10 points, in any order.
//! let points = Array2::from_shape_fn((120, 3), |(i, k)| {
//!     let (x, y) = ((i % 12) as f64 / 11.0, (i / 12) as f64 / 9.0);
//!     [x, y, x * x][k]
//! });
//! let options = FitOptions { tol: Tolerance::Absolute(1e-3), ..FitOptions::default() };
//! let fitted = fit(Points::new(points)?, &options)?;
//! assert_eq!(fitted.report.result.verdict, Verdict::Good);
//! assert_eq!(fitted.surface().eval([0.5, 0.5])?.len(), 3);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod attempt;
mod auto;
mod batch;
mod clean;
mod curve;
mod densify;
mod error;
mod fit;
mod hints;
mod inspect;
mod judge;
mod knots;
mod level_zero;
mod limits;
mod memory;
mod mesh;
mod methods;
mod options;
mod orientation;
mod output;
mod overwriting;
mod page;
mod parameters;
mod paths;
mod picture;
mod pieces;
mod prepare;
mod problem;
mod program;
mod report;
mod scanned;
mod solid;
mod solid_output;
mod step_header;
mod tolerance;
mod trim;
mod units;
mod warnings;
mod watch;

pub use auto::{Candidate, Defect, GaveUp, Reason as ChoiceReason, Tried};
pub use batch::{
    BatchEvent, BatchOptions, BatchPart, BatchResult, PartOptions, PartOutcome, PartResult, RECORDS, SolidSummary,
    join_batch, run_batch, scans_in,
};
pub use clean::CleaningReport;
pub use curve::{
    ClosedChoice, CornerChoice, CurveFit, CurveInput, CurveIteration, CurveLimits, CurveOptions, CurveParameters,
    CurveReport, CurveResult, Ends, KnotChoice, check_curve_outputs, fit_curve_file, fit_sequence, write_curve,
};
pub use deviation::{Deviation, Reason, Thresholds, Verdict};
pub use error::{Error, ErrorKind};
pub use fit::{Fit, fit_file, fit_scan};
pub use inspect::{Comparison, Evaluation, Info, PointDistance, compare, convert, eval_model, info};
pub use limits::{Exceeded, Limits, write_distances};
pub use memory::{Mesh, Points, fit};
pub use methods::QuasiReport;
pub use methods::ReweightingReport;
pub use options::{
    BlendChoice, BoundaryChoice, Clean, Closed, Crop, Domain, Energy, FitOptions, GivenCorners, LambdaChoice,
    LocalRule, LossChoice, Mark, MarkerChoice, Method, Networks, Pair, ParameterChoice, ParameterOptions,
    ParseOptionError, Policy, QuasiOptions, RadiusChoice, Refine, ReweightingOptions, Samples, Schema, SideRule,
    ToldSpline, Tolerance, UpdateChoice,
};
pub use orientation::NormalsReport;
pub use output::{OutputPaths, write_outputs, write_parameters, write_piece_outputs, write_report, write_text};
pub use overwriting::{check_no_input, check_parameter_outputs};
pub use page::{page_of, page_of_pieces, page_of_solid};
pub use parameters::{
    HoleReport, LayersReport, NetworkReport, ParameterReport, Parameterized, SeamReport, Stretch, VoidReport,
    parameterize, parameterize_file,
};
pub use picture::draw_parameters;
pub use pieces::{PieceFit, PieceFits, PieceReport, PiecesReport, fit_pieces, fit_pieces_file};
pub use report::{
    InputReport, IterationReport, LayoutReport, MovesReport, Report, ResultReport, SecondsReport, SmoothedMore,
    layout_report,
};
pub use scanned::{Scanned, fingerprint};
pub use solid::{
    LayoutChoice, Sharp, Smoothness, SolidDistances, SolidFit, SolidLayoutReport, SolidOptions, SolidReason,
    SolidReport, SolidVolume, fit_solid_file, makes_solid,
};
pub use solid_output::{check_solid_outputs, write_solid_outputs};
pub use step_header::step_options;
pub use tolerance::{DefaultTolerance, ScanMeasures, ToleranceRule};
pub use watch::{Event, Watch};

pub use adaptive::{Iteration, Stop};
pub use geom_io::{
    Decimal, Format, LengthUnit, Model, ReadOptions, Scan, StepOptions, StepSize, TakenColumn, remove_unfinished,
};
pub use ndarray;
pub use thb_core::{self, SplineMap};

/// The code of the book's library page, as a test.
#[cfg(doctest)]
#[doc = include_str!("../../../docs/src/library.md")]
struct Book;
