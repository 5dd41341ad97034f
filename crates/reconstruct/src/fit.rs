//! The pipeline: read, parameterize, fit, report.

use std::path::Path;
use std::time::Instant;

use adaptive::Stop;
use deviation::{Reason, Thresholds, Verdict, directed_hausdorff, verdict};
use geom_io::{Format, LengthUnit, Model, Scan, TakenColumn, read_scan};
use ndarray::{Array1, Array2, Axis};
use thb_core::{CellSpace, SplineMap};

use crate::attempt::Attempt;
use crate::auto::Chosen;
use crate::level_zero::{level_zero, shaped};
use crate::methods::Fitted;
use crate::methods::robust_diagonal;
use crate::options::Pair;
use crate::orientation::vote;
use crate::parameters::{Parameterized, parameterize};
use crate::prepare;
use crate::problem::Problem;
use crate::program::{PROGRAM, SCHEMA};
use crate::report::{InputReport, Report, ResultReport, SmoothedMore, history, sides};
use crate::scanned::{ReadPoints, Scanned, fingerprint};
use crate::tolerance::{hint, hint_if_large};
use crate::trim::trims;
use crate::warnings::{Warning, of_surface};
use crate::{DefaultTolerance, Error, Event, FitOptions, ScanMeasures, Tolerance, Watch, units};

/// A fitted surface with its report and its data.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The surface.
    pub model: Model,
    /// How good it is.
    pub report: Report,
    /// Points that were fitted, `(m, 3)`.
    pub points: Array2<f64>,
    /// Their parameters, `(m, 2)`.
    pub parameters: Array2<f64>,
    /// Their distances to the surface at their parameters.
    pub errors: Array1<f64>,
    /// Holes that are cut out of the faces of STEP files, as [`geom_io::StepOptions::holes`]; none unless asked for.
    pub holes: Vec<Array2<f64>>,
    /// Whether the face normal is opposite to `S_u × S_v`.
    pub reversed: bool,
    /// What else is known of the scan.
    pub scanned: Scanned,
}

impl Fit {
    /// Whether the surface is near the scan as asked, and can be worked with.
    pub fn reached(&self) -> bool {
        self.report.result.reached
    }

    /// The surface.
    pub fn surface(&self) -> &SplineMap<2> {
        match &self.model.geometry {
            geom_io::Geometry::Surface(map) => map,
            geom_io::Geometry::Curve(_) => unreachable!("a fit makes a surface"),
        }
    }
}

/// Reads a file, as the options say, and fits it.
///
/// # Errors
/// [`Error`].
pub fn fit_file(path: &Path, options: &FitOptions, watch: &mut Watch<'_>) -> Result<Fit, Error> {
    let _ = watch(Event::Step("reading"));
    let scan = read_scan(path, &options.parameters.read)?;
    let mut fit = fit_scan(scan, &path.display().to_string(), options, watch)?;
    fit.report.input.sha256 = fingerprint(path);
    Ok(fit)
}

/// Fits what a file held; `name` stands in the report.
///
/// # Errors
/// [`Error`]. A tolerance that is not reached is no error: the report says why the loop ended.
pub fn fit_scan(scan: Scan, name: &str, options: &FitOptions, watch: &mut Watch<'_>) -> Result<Fit, Error> {
    let start = Instant::now();
    options.check()?;
    let span = tracing::info_span!("fit", name);
    let _guard = span.enter();
    let source = Source::of(&scan, name, options);
    let read = ReadPoints::of(&scan);
    let laid_out = parameterize(scan, &options.told_parameters(), watch)?;
    let asked = Asked::of(options, &laid_out)?;
    let chosen = fit_laid_out(&laid_out, &asked, watch)?;
    let mut warnings = laid_out.warnings.clone();
    warnings.extend(units::hint(options.units, source.unit, laid_out.diagonal));
    warnings.extend(asked.warnings.iter().cloned());
    let given = laid_out.report.method == "given" && !source.has_heights;
    let of_surface = of_surface(&chosen.attempt, &laid_out, &asked.options, asked.diagonal, given);
    warnings.extend(of_surface.iter().map(Warning::to_string));
    let Fitted { map, parameters, reweighting, history: iterations, moves, quasi, .. } = &chosen.attempt.fitted;
    let set_aside = asked.options.reweighting.max_set_aside;
    warnings.extend(reweighting.iter().flat_map(|found| found.warnings(laid_out.points.nrows(), set_aside)));
    let trimmed =
        if options.trim_holes { Some(trims(&laid_out, map, parameters.view(), asked.tolerance)?) } else { None };
    warnings.extend(trimmed.iter().flat_map(|found| found.warnings.clone()));
    let holes = trimmed.map(|found| found.holes);
    let normals = laid_out.normals.as_ref().map(|normals| vote(map, parameters, normals)).transpose()?.flatten();
    warnings.extend(normals.and_then(|normals| normals.warning()));
    let thresholds = asked.thresholds();
    let mut reasons = chosen.attempt.judgement.reasons.clone();
    reasons.extend(thresholds.set_aside(laid_out.report.cleaning.share_set_aside()));
    reasons.extend(laid_out.report.layers.as_ref().map(|found| thresholds.two_layers(found.distance, found.share)));

    let unit = units::resolve(options.units, source.unit);
    let mut result = result(&chosen, reasons, &laid_out, &asked)?;
    (result.normals, result.trimmed) = (normals, holes.as_ref().map(Vec::len));
    result.seconds = start.elapsed().as_secs_f64();
    let has_heights = source.has_heights;
    let input = source.report(&laid_out, asked.diagonal);
    let scanned = Scanned {
        left_out: read.left_out(&laid_out),
        set_aside: chosen.attempt.fitted.counted.iter().flatten().map(|counts| !counts).collect(),
        has_heights,
        has_side: laid_out.is_mesh || has_heights || normals.is_some(),
        triangles: if laid_out.is_mesh { [laid_out.triangles, laid_out.left_out].concat() } else { Vec::new() },
    };
    let report = Report {
        schema: SCHEMA,
        program: PROGRAM,
        history: history(iterations, moves, quasi),
        result,
        input,
        parameterization: laid_out.report,
        options: FitOptions { units: Some(unit), ..options.clone() },
        warnings,
    };
    let Fitted { map, parameters, errors, .. } = chosen.attempt.fitted;
    let mut model = Model::surface(map, unit);
    model.metadata.insert("source".into(), name.into());
    let reversed = normals.map_or(laid_out.reversed, |normals| normals.reversed) != options.flip;
    let (points, holes) = (laid_out.points, holes.unwrap_or_default());
    Ok(Fit { model, report, points, parameters, errors, holes, reversed, scanned })
}

/// What is known of a scan before it is laid out.
struct Source {
    name: String,
    format: Format,
    unit: Option<LengthUnit>,
    columns: Vec<TakenColumn>,
    /// Whether its parameters are its coordinates.
    has_heights: bool,
    points: usize,
    triangles: Option<usize>,
}

impl Source {
    fn of(scan: &Scan, name: &str, options: &FitOptions) -> Self {
        Self {
            name: name.to_owned(),
            format: scan.format,
            unit: scan.unit,
            columns: scan.columns.clone(),
            has_heights: scan.cell.is_some() || options.parameters.read.height_field,
            points: scan.cloud.points.nrows(),
            triangles: scan.triangles.as_ref().map(Vec::len),
        }
    }

    fn report(self, laid_out: &Parameterized, diagonal: f64) -> InputReport {
        InputReport {
            file: self.name,
            sha256: None,
            format: self.format.name(),
            points: self.points,
            triangles: self.triangles,
            columns: self.columns,
            fitted_points: laid_out.points.nrows(),
            diagonal,
            parameterization: laid_out.report.method,
            corners: laid_out.report.corners,
        }
    }
}

/// What is asked for, as it follows from the options and the points.
struct Asked {
    /// The options with the directions that close and a level 0 that has no more functions than there are points.
    options: FitOptions,
    diagonal: f64,
    tolerance: f64,
    /// How the tolerance was chosen, where it was left to us.
    measured: Option<DefaultTolerance>,
    warnings: Vec<String>,
}

impl Asked {
    fn of(options: &FitOptions, laid_out: &Parameterized) -> Result<Self, Error> {
        let points = &laid_out.points;
        let mut options = options.with_closed(laid_out.closed);
        let mut warnings = Vec::new();
        if let Some(for_few) = options.for_few(points.nrows()) {
            let (degree, elements) = (for_few.degree, Pair(for_few.elements()));
            warnings.push(Warning::FewPoints { points: points.nrows(), degree, elements }.to_string());
            options = for_few;
        }
        let diagonal = match options.reweighting.robust {
            Some(_) => robust_diagonal(points.view(), laid_out.parameters.view())?,
            None => laid_out.diagonal,
        };
        let measured = match options.tol {
            Tolerance::Auto => {
                let (uv, triangles) = (laid_out.parameters.view(), &laid_out.triangles);
                Some(ScanMeasures::of(points.view(), uv, triangles, laid_out.closed, diagonal)?.tolerance())
            }
            _ => None,
        };
        let tolerance = measured.map_or(options.tol.resolve(diagonal), |found| found.value);
        if measured.is_none() {
            warnings.extend(hint(points.view(), tolerance)?);
            warnings.extend(hint_if_large(tolerance, diagonal));
        }
        let (method, verdict) = (laid_out.report.method, laid_out.report.verdict);
        tracing::info!(points = points.nrows(), method, verdict, tolerance, "parameterized");
        Ok(Self { options, diagonal, tolerance, measured, warnings })
    }

    fn thresholds(&self) -> Thresholds {
        Thresholds { within: self.options.within, ..Thresholds::default() }
    }
}

/// Fits points that are laid out; once more from cells of the shape of the part where that fails on a long strip.
fn fit_laid_out(laid_out: &Parameterized, asked: &Asked, watch: &mut Watch<'_>) -> Result<Chosen, Error> {
    let options = &asked.options;
    let space = level_zero(laid_out, options)?;
    if let Some(most) = options.max_dofs.filter(|&most| most < space.n_functions()) {
        return Err(Error::MaxDofs { most, dofs: space.n_functions() });
    }
    let problem = Problem {
        points: laid_out.points.view(),
        parameters: laid_out.parameters.view(),
        weights: laid_out.weights.as_ref().map(|w| w.view()),
        rows: &laid_out.rows,
        triangles: &laid_out.triangles,
        left_out: &laid_out.left_out,
        is_mesh: laid_out.is_mesh,
        is_given: laid_out.report.method == "given",
        tolerance: asked.tolerance,
        diagonal: asked.diagonal,
    };
    let found = prepare::fit(&problem, &space, options, watch)?;
    let failed = |chosen: &Chosen| chosen.attempt.judgement.verdict() == Verdict::Failed;
    if !failed(&found) || found.attempt.fitted.stop == Stop::Interrupted {
        return Ok(found);
    }
    let Some(shaped) = shaped(laid_out, options) else { return Ok(found) };
    let space = level_zero(laid_out, &shaped)?;
    if space.n_functions() > shaped.max_dofs.unwrap_or(laid_out.points.nrows()) {
        return Ok(found);
    }
    let _ = watch(Event::Step("fitting from cells of the shape of the part"));
    let other = prepare::fit(&problem, &space, &shaped, watch)?;
    Ok(if failed(&other) { found } else { other })
}

/// The part of the report on what came out, without what is found out later: seconds, normals, holes cut out.
fn result(
    chosen: &Chosen,
    reasons: Vec<Reason>,
    laid_out: &Parameterized,
    asked: &Asked,
) -> Result<ResultReport, Error> {
    let Attempt { method, fitted, creases, judgement } = &chosen.attempt;
    let last = fitted.history[fitted.history.len() - 1];
    let (verdict, dhd) = (verdict(&reasons), farthest_point(fitted, &laid_out.points)?);
    Ok(ResultReport {
        method: *method,
        tried: chosen.tried.clone(),
        dofs: last.dofs,
        levels: last.levels,
        cells: last.cells,
        max: last.deviation.max,
        mse: last.deviation.mse,
        rmse: last.deviation.rmse(),
        within: last.deviation.within,
        tolerance: asked.tolerance,
        default_tolerance: asked.measured,
        lambda: fitted.lambda,
        local_smoothing: fitted.local_smoothing.iter().copied().map(SmoothedMore::from).collect(),
        dhd,
        hsd: dhd.max(judgement.deviation.farthest),
        creases: *creases,
        seconds: 0.0,
        stop: fitted.stop.name(),
        reached: verdict < Verdict::Failed,
        verdict,
        reasons,
        thresholds: asked.thresholds(),
        deviation: judgement.deviation.clone(),
        reweighting: fitted.reweighting.clone(),
        normals: None,
        sides: sides(&fitted.map)?,
        trimmed: None,
    })
}

/// Largest distance of a point that counts to a surface.
fn farthest_point(fitted: &Fitted, points: &Array2<f64>) -> Result<f64, Error> {
    let Fitted { map, parameters, .. } = fitted;
    Ok(match fitted.kept() {
        None => directed_hausdorff(map, parameters.view(), points.view())?,
        Some(kept) => {
            let of_kept = |all: &Array2<f64>| all.select(Axis(0), &kept);
            directed_hausdorff(map, of_kept(parameters).view(), of_kept(points).view())?
        }
    })
}
