//! From a scan to a THB-spline surface in one library call.
//!
//! [`fit_scan`] takes what a file held, finds parameters ([`parameterize`]), fits adaptively and reports how good the
//! result is;
//! [`write_outputs`] writes it in the formats of the given file names; [`run_batch`] does both for many files.
//! [`compare`], [`eval_model`], [`convert`] and [`info`] answer questions about models and files. This crate parses no
//! arguments and prints nothing.
//!
//! ```
//! use reconstruct::{FitOptions, fit_scan};
//! use geom_io::{Format, ReadOptions, parse_scan};
//!
//! // A gridded cloud: a parabolic cylinder.
//! let mut csv = String::from("i,j,x,y,z\n");
//! for (i, j) in (0..12).flat_map(|i| (0..10).map(move |j| (i, j))) {
//!     let (x, y) = (f64::from(i) / 11.0, f64::from(j) / 9.0);
//!     csv += &format!("{i},{j},{x},{y},{}\n", x * x);
//! }
//! let scan = parse_scan(csv.as_bytes(), Format::Csv, &ReadOptions::default())?;
//! let fit = fit_scan(scan, "parabola", &FitOptions::default(), &mut |_| std::ops::ControlFlow::Continue(()))?;
//! assert!(fit.reached() && fit.report.result.max < 1e-3);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod batch;
mod clean;
mod curve;
mod densify;
mod error;
mod fit;
mod fitting;
mod hints;
mod inspect;
mod judge;
mod mesh;
mod options;
mod orientation;
mod output;
mod parameter_options;
mod parameters;
mod picture;
mod pieces;
mod quasi;
mod report;
mod reweighting;
mod tolerance;
mod trim;
mod units;
mod watch;

pub use batch::{BatchEvent, BatchOptions, BatchResult, PartOutcome, PartResult, check_parameter_outputs, run_batch};
pub use clean::CleaningReport;
pub use curve::{
    ClosedChoice, CornerChoice, CurveFit, CurveInput, CurveIteration, CurveLimits, CurveOptions, CurveParameters,
    CurveReport, CurveResult, Ends, KnotChoice, check_curve_outputs, fit_curve_file, fit_sequence, write_curve,
};
pub use deviation::{Deviation, Reason, Thresholds, Verdict};
pub use error::Error;
pub use fit::{Fit, fit_file, fit_scan};
pub use inspect::{Comparison, Evaluation, Info, compare, convert, eval_model, info};
pub use options::{
    BlendChoice, BoundaryChoice, Energy, FitOptions, LambdaChoice, Mark, Method, Pair, ParseOptionError, Samples,
    Tolerance,
};
pub use orientation::NormalsReport;
pub use output::{OutputPaths, write_outputs, write_parameters, write_piece_outputs, write_report, write_text};
pub use parameter_options::{
    Clean, Closed, Crop, Domain, GivenCorners, Networks, ParameterChoice, ParameterOptions, RadiusChoice, Refine,
    SideRule,
};
pub use parameters::{
    HoleReport, LayersReport, NetworkReport, ParameterReport, Parameterized, SeamReport, Stretch, VoidReport,
    parameterize, parameterize_file,
};
pub use picture::draw_parameters;
pub use pieces::{PieceFit, PieceFits, PieceReport, PiecesReport, fit_pieces, fit_pieces_file};
pub use quasi::{LocalRule, QuasiOptions, QuasiReport};
pub use report::{
    InputReport, IterationReport, LayoutReport, MovesReport, Report, ResultReport, SecondsReport, SmoothedMore,
    layout_report,
};
pub use reweighting::{LossChoice, MarkerChoice, ReweightingOptions, ReweightingReport, UpdateChoice};
pub use tolerance::{DefaultTolerance, ScanMeasures, ToleranceRule};
pub use watch::{Event, Watch};

pub use adaptive::{Iteration, Stop};
pub use geom_io::{Decimal, Format, LengthUnit, ReadOptions, TakenColumn, remove_unfinished};

/// The code of the book's library page, as a test.
#[cfg(doctest)]
#[doc = include_str!("../../../docs/src/library.md")]
struct Book;
