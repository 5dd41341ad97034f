//! The pipeline: read, parameterize, fit, report.

use std::borrow::Cow;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use adaptive::Stop;
use deviation::{Reason, Thresholds, Verdict, directed_hausdorff};
use geom_io::{Model, Scan, read_scan};
use ndarray::{Array1, Array2, Axis};
use param_classic::triangulate_parameters;
use point_cloud::loop_length;
use point_cloud::vec3::norm;
use thb_core::{CellSpace, HierarchicalSpace, Kind, KnotVector, SplineMap};

use crate::attempt::Attempt;
use crate::auto::Chosen;
use crate::methods::Fitted;
use crate::methods::reweighting::robust_diagonal;
use crate::options::{BoundaryChoice, Pair};
use crate::orientation::vote;
use crate::parameter_options::Domain;
use crate::parameters::{Parameterized, extent, parameterize};
use crate::prepare;
use crate::problem::Problem;
use crate::report::{InputReport, Report, ResultReport, SmoothedMore, history, sides};
use crate::tolerance::hint;
use crate::trim::trims;
use crate::{Error, Event, FitOptions, ScanMeasures, Tolerance, Watch, units};

/// Distance between surface and points, as a share of the diagonal, from which on the user is warned. Gaps between
/// the points of a scan are smaller.
const FAR: f64 = 0.07;

/// Control points as a share of the points from which on the user is warned: then there are hardly more equations than
/// unknowns, in a fit with moving parameters fewer.
const CROWDED: f64 = 0.7;

/// Share of neighbouring samples between which the normal may turn by more than a right angle before the user is warned.
const MOST_CREASES: f64 = 2e-3;

/// Reasons of a verdict that parameters which are none bring about.
const TORN: [&str; 3] = ["folded", "crosses-itself", "swings-out"];

/// Width of the strip along the sides of the domain, as a share of it, and the share of the cells in it from which on the outline is
/// told to be ragged: of even cells 8 % are there. Surfaces of few control points are not told.
const RIM: f64 = 0.02;
const RIM_CELLS: f64 = 0.35;
const RIM_DOFS: usize = 100;

/// Length of a hole's rim, as a share of the outline's, from which on both may be the ends of a tube.
const LIKE: f64 = 0.5;

/// Length of a surface in widths from which on a fit that failed begins again with cells of its shape.
///
/// Derived: cells of the usual level 0 are then two refinements longer than wide.
const FAR_LONGER: f64 = 4.0;

/// Elements per direction of such a level 0, at most.
///
/// Limit: there may be no more functions than points.
const MOST_ELEMENTS: f64 = 32.0;

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
    fit_scan(scan, &path.display().to_string(), options, watch)
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
    let (format, of_file) = (scan.format, scan.unit);
    let columns = scan.columns.clone();
    let has_heights = scan.cell.is_some() || options.parameters.read.height_field;
    let (read_points, read_triangles) = (scan.cloud.points.nrows(), scan.triangles.as_ref().map(Vec::len));
    let laid_out = parameterize(scan, &options.parameters, watch)?;
    let asked = options;
    let unit = units::resolve(asked.units, of_file);
    let options = &asked.with_closed(laid_out.closed);
    let mut warnings = laid_out.warnings.clone();
    warnings.extend(units::hint(asked.units, of_file, laid_out.diagonal));
    let points = &laid_out.points;
    let for_few = options.for_few(points.nrows());
    let options = for_few.as_ref().unwrap_or(options);
    if for_few.is_some() {
        warnings.push(format!(
            "{} points start with degree {} and {} elements, so that they are no fewer than the functions; --mesh starts with more",
            points.nrows(),
            options.degree,
            Pair(options.elements())
        ));
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
    }
    tracing::info!(
        points = points.nrows(),
        method = laid_out.report.method,
        verdict = laid_out.report.verdict,
        tolerance,
        "parameterized"
    );

    let space = Arc::new(HierarchicalSpace::new(Kind::Thb, level_zero_knots(&laid_out.parameters, options)?)?);
    if let Some(most) = options.max_dofs.filter(|&most| most < space.n_functions()) {
        return Err(Error::MaxDofs { most, dofs: space.n_functions() });
    }
    let problem = Problem {
        points: laid_out.points.view(),
        parameters: laid_out.parameters.view(),
        weights: laid_out.weights.as_ref().map(|w| w.view()),
        rows: &laid_out.rows,
        triangles: &laid_out.triangles,
        is_mesh: laid_out.is_mesh,
        is_given: laid_out.report.method == "given",
        tolerance,
        diagonal,
    };
    let mut found = prepare::fit(&problem, &space, options, watch)?;
    if found.attempt.judgement.verdict() == Verdict::Failed
        && found.attempt.fitted.stop != Stop::Interrupted
        && let Some(elements) = elements_by_shape(points, &laid_out.parameters, &triangles(&laid_out), options)
    {
        let _ = watch(Event::Step("fitting from cells of the shape of the part"));
        let shaped = FitOptions { mesh: Some(Pair(elements)), ..options.clone() };
        let space = Arc::new(HierarchicalSpace::new(Kind::Thb, level_zero_knots(&laid_out.parameters, &shaped)?)?);
        if space.n_functions() <= shaped.max_dofs.unwrap_or(points.nrows()) {
            let other = prepare::fit(&problem, &space, &shaped, watch)?;
            if other.attempt.judgement.verdict() < Verdict::Failed {
                found = other;
            }
        }
    }
    let Chosen { attempt: Attempt { method, fitted, creases, mut judgement }, tried } = found;
    let dhd = farthest_point(&fitted, points)?;
    let Fitted {
        map,
        stop,
        failure,
        history: iterations,
        moves,
        quasi,
        reweighting,
        parameters,
        errors,
        lambda,
        local_smoothing,
        ..
    } = fitted;
    let hsd = dhd.max(judgement.deviation.farthest);
    if let Some(failure) = failure {
        warnings.push(format!("the last refinement could not be solved: {failure}"));
    }
    let postponed = moves.iter().filter(|m| m.postponed).count();
    if postponed > 0 {
        warnings.push(format!(
            "moving the parameters did harm in {postponed} of {} iterations and was undone there",
            moves.len()
        ));
    }

    let dofs = map.space().n_functions();
    if dofs as f64 > CROWDED * points.nrows() as f64 {
        warnings.push(format!(
            "{dofs} control points for {} points: the surface follows their noise; choose a larger tolerance unless the \
             points are exact",
            points.nrows()
        ));
    }
    let farthest = judgement.deviation.farthest;
    if farthest > FAR * diagonal {
        let advice = match is_tube_like(&laid_out) {
            true => "two rims are of like length, as those of a tube, which --closed u goes round",
            false => "look at it, and raise --lambda if it swings",
        };
        warnings.push(format!(
            "the surface leaves the points by up to {farthest:.4e}, {:.1} % of the diagonal: it spans a void or swings out \
             between points; {advice}",
            100.0 * farthest / diagonal
        ));
    }
    let at_rim = share_at_rim(map.space());
    if options.boundary == BoundaryChoice::Kept && dofs > RIM_DOFS && at_rim > RIM_CELLS {
        warnings.push(format!(
            "{:.0} % of the cells lie within {:.0} % of the sides of the domain: the surface follows a ragged outline; try --boundary \
             free, with which it need not",
            100.0 * at_rim,
            100.0 * RIM
        ));
    }
    if let Some(sagitta) = judgement.deviation.sagitta_p95.filter(|&sagitta| sagitta > tolerance) {
        warnings.push(format!(
            "the tolerance of {tolerance:.4e} is less than what the triangles of the scan tell: the surface may lie up to {sagitta:.4e} \
             off their facets (95 % of the area)"
        ));
    }
    if creases > MOST_CREASES {
        warnings.push(format!(
            "the surface turns by more than a right angle between {:.2} % of its neighbouring samples: at sharp edges, or where it is \
             folded; look at it",
            100.0 * creases
        ));
    }
    warnings
        .extend(reweighting.iter().flat_map(|found| found.warnings(points.nrows(), options.reweighting.max_set_aside)));
    let mut holes = Vec::new();
    if options.trim_holes {
        let found = trims(&laid_out, &map, parameters.view(), tolerance)?;
        holes = found.holes;
        warnings.extend(found.warnings);
    }
    let is_torn = |reason: &Reason| TORN.contains(&reason.code);
    if laid_out.report.method == "given" && !has_heights && judgement.reasons.iter().any(is_torn) {
        warnings.push(
            "the parameters u, v of the file fold or tear the surface, as places in a texture do: --param mean-value lays the points \
             out by their shape"
                .to_owned(),
        );
    }
    let normals = match &laid_out.normals {
        Some(normals) => vote(&map, &parameters, normals)?,
        None => None,
    };
    warnings.extend(normals.and_then(|normals| normals.warning()));
    let last = iterations[iterations.len() - 1];
    let thresholds = Thresholds { within: options.within, ..Thresholds::default() };
    judgement.reasons.extend(thresholds.set_aside(laid_out.report.cleaning.share_set_aside()));
    let layers = laid_out.report.layers.as_ref();
    judgement.reasons.extend(layers.map(|found| thresholds.two_layers(found.distance, found.share)));
    let verdict = judgement.verdict();
    let deviation = last.deviation;
    let report = Report {
        schema: 1,
        input: InputReport {
            file: name.to_owned(),
            format: format.name(),
            points: read_points,
            triangles: read_triangles,
            columns,
            fitted_points: points.nrows(),
            diagonal,
            parameterization: laid_out.report.method,
            corners: laid_out.report.corners,
        },
        parameterization: laid_out.report,
        options: FitOptions { units: Some(unit), ..asked.clone() },
        result: ResultReport {
            method,
            tried,
            dofs: last.dofs,
            levels: last.levels,
            cells: last.cells,
            max: deviation.max,
            mse: deviation.mse,
            rmse: deviation.rmse(),
            within: deviation.within,
            tolerance,
            default_tolerance: measured,
            lambda,
            local_smoothing: local_smoothing.into_iter().map(SmoothedMore::from).collect(),
            dhd,
            hsd,
            creases,
            seconds: start.elapsed().as_secs_f64(),
            stop: stop.name(),
            reached: verdict < Verdict::Failed,
            verdict,
            reasons: judgement.reasons,
            thresholds,
            deviation: judgement.deviation,
            reweighting,
            normals,
            sides: sides(&map)?,
            trimmed: options.trim_holes.then_some(holes.len()),
        },
        history: history(&iterations, &moves, &quasi),
        warnings,
    };
    let mut model = Model::surface(map, unit);
    model.metadata.insert("source".into(), name.into());
    let reversed = normals.map_or(laid_out.reversed, |normals| normals.reversed) != options.flip;
    Ok(Fit { model, report, points: laid_out.points, parameters, errors, holes, reversed })
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

/// Share of the cells whose middle is within [`RIM`] of a side of the domain.
fn share_at_rim(space: &HierarchicalSpace<2>) -> f64 {
    let ((lower, upper), periodic) = (space.domain(), space.periodic());
    let is_at_rim = |number: &usize| {
        let cell = space.cell(*number);
        (0..2).any(|d| {
            let middle = 0.5 * (cell.lower[d] + cell.upper[d]);
            !periodic[d] && (middle - lower[d]).min(upper[d] - middle) < RIM * (upper[d] - lower[d])
        })
    };
    (0..space.n_cells()).filter(is_at_rim).count() as f64 / space.n_cells() as f64
}

/// The triangles of a scan, or some over its parameters.
fn triangles(laid_out: &Parameterized) -> Cow<'_, [[u32; 3]]> {
    match laid_out.triangles.is_empty() {
        true => Cow::Owned(triangulate_parameters(laid_out.parameters.view()).unwrap_or_default()),
        false => Cow::Borrowed(&laid_out.triangles),
    }
}

/// Elements of a level 0 whose cells are about as long as they are wide on a surface that is far longer than wide, as many as there are
/// by default; `None` for a surface that is not, and where the user names the elements. Refinement halves cells both ways: those of a
/// long strip become narrower than the points are apart before they are short enough.
fn elements_by_shape(
    points: &Array2<f64>,
    parameters: &Array2<f64>,
    triangles: &[[u32; 3]],
    options: &FitOptions,
) -> Option<[usize; 2]> {
    let usual = options.elements();
    if options.mesh.is_some() || options.parameters.closed.directions() != [false; 2] {
        return None;
    }
    // On each triangle points are linear in the parameters.
    let ratio_on = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| i as usize);
        let edge = |table: &Array2<f64>, to: usize, k: usize| table[[to, k]] - table[[a, k]];
        let [[ub, vb], [uc, vc]] = [b, c].map(|to| [edge(parameters, to, 0), edge(parameters, to, 1)]);
        let tangent =
            |wb: f64, wc: f64| norm(std::array::from_fn(|k| wb * edge(points, b, k) + wc * edge(points, c, k)));
        tangent(vc, -vb) / tangent(-uc, ub)
    };
    let mut ratios: Vec<f64> = triangles.iter().map(ratio_on).filter(|r| r.is_finite() && *r > 0.0).collect();
    ratios.sort_unstable_by(f64::total_cmp);
    let ratio = *ratios.get(ratios.len() / 2)?;
    if ratio.max(1.0 / ratio) < FAR_LONGER {
        return None;
    }
    let count = |usual: usize, factor: f64| (usual as f64 * factor.sqrt()).round().clamp(1.0, MOST_ELEMENTS) as usize;
    Some([count(usual[0], ratio), count(usual[1], 1.0 / ratio)])
}

/// Whether a hole is about as long as the outline.
fn is_tube_like(laid_out: &Parameterized) -> bool {
    let rows: Vec<usize> = laid_out.boundary.iter().map(|&i| i as usize).collect();
    let outline = loop_length(laid_out.points.select(Axis(0), &rows).view());
    outline > 0.0
        && laid_out.closed == [false; 2]
        && laid_out.report.holes.iter().any(|hole| hole.length > LIKE * outline)
}

fn level_zero_knots(parameters: &Array2<f64>, options: &FitOptions) -> Result<[KnotVector; 2], Error> {
    let (elements, closed) = (options.elements(), options.parameters.closed.directions());
    let knots = |d: usize| -> Result<KnotVector, Error> {
        let uniform = uniform_knots(options.degree.0[d], elements[d], closed[d])?;
        Ok(match options.parameters.domain {
            Domain::Unit => uniform,
            Domain::Data => {
                let (lower, upper) = extent(parameters.column(d));
                uniform.on_interval(lower, upper)?
            }
        })
    };
    Ok([knots(0)?, knots(1)?])
}

/// Even knots over the unit interval.
pub(crate) fn uniform_knots(degree: usize, elements: usize, closed: bool) -> Result<KnotVector, Error> {
    Ok(if closed { KnotVector::uniform_periodic(degree, elements)? } else { KnotVector::uniform(degree, elements)? })
}

#[cfg(test)]
mod tests {
    use super::*;
    use thb_core::Refinement;

    #[test]
    fn a_strip_gets_cells_of_its_shape() {
        let grid = |length: f64| {
            let parameters = Array2::from_shape_fn((400, 2), |(i, d)| [i % 20, i / 20][d] as f64 / 19.0);
            let points = Array2::from_shape_fn((400, 3), |(i, k)| match k {
                0 => length * parameters[[i, 0]],
                1 => parameters[[i, 1]],
                _ => 0.0,
            });
            let triangles = triangulate_parameters(parameters.view()).unwrap();
            elements_by_shape(&points, &parameters, &triangles, &FitOptions::default())
        };
        assert_eq!(grid(1.0), None);
        assert_eq!(grid(3.9), None);
        assert_eq!(grid(16.0), Some([16, 1]));
        assert_eq!(grid(1e6), Some([32, 1]));
        assert_eq!(grid(1.0 / 9.0), Some([1, 12]));
    }

    #[test]
    fn cells_along_a_ragged_outline_are_many() {
        let knots = KnotVector::uniform(2, 32).unwrap();
        let even = HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap();
        // The outermost of 32 rows have their middles at 1/64.
        assert_eq!(share_at_rim(&even), 124.0 / 1024.0);
        let mut space = even;
        for _ in 0..3 {
            let rim: Vec<usize> = (0..space.n_cells()).filter(|&cell| space.cell(cell).lower[0] == 0.0).collect();
            space = space.refine(&rim, &Refinement::default()).unwrap();
        }
        assert!(share_at_rim(&space) > RIM_CELLS, "{}", share_at_rim(&space));
    }
}
