//! Robust losses, markers and confidence: their part of the report, and the loop with them.

use std::path::Path;
use std::sync::Arc;

use adaptive::{Deviation, Observer, Outcome, Stop, run};
use fit_ls::{
    Detection, Loss, MarkerRules, Markers, PointWeights, Reweighted, Reweighting, Robust, Update, Weighted,
    detect_markers,
};
use moving_param::MovingFit;
use ndarray::{ArrayView2, Axis};
use point_cloud::{BoundingBox, LocalFrames};
use thb_core::{HierarchicalSpace, Kind, KnotVector};

use super::reweighting_report::ReweightingReport;
use super::task::{Fitted, least_squares_options};
use crate::knots::uniform_knots;
use crate::options::{LossChoice, MarkerChoice, UpdateChoice};
use crate::parameters::places_of;
use crate::problem::Problem;
use crate::{Error, FitOptions, Tolerance};

/// Elements per direction of the first fit that finds markers, as in example 3.1.9 (c) of Imperatore 2024.
const DETECTION_ELEMENTS: usize = 15;

/// Turning of the surface, in radians, between neighbouring points from which on it counts as a sharp feature.
const SHARP: f64 = 0.35;

/// Most rounds in the final space by which markers of type I are still to be met.
const LAST_ROUNDS: usize = 30;

/// Times that stray points are looked for before a fit: those found have no say about their neighbours the next time.
const SCREENINGS: usize = 3;

/// Rows that a report lists at most; the counts are those of all.
const LISTED: usize = 1000;

/// The markers of a file: a row and a type in each line, `I` or `1` and `II` or `2`, separated by blanks, a comma or a
/// semicolon. `#` begins a comment; the first line may name the columns.
///
/// # Errors
/// [`Error::Read`], [`Error::MarkerFile`].
pub(crate) fn read_markers(path: &Path) -> Result<Vec<(u32, bool)>, Error> {
    let text = geom_io::read_text(path)?;
    let mut markers = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let content = line.split('#').next().unwrap_or_default();
        let fields: Vec<&str> =
            content.split([',', ';', ' ', '\t']).map(str::trim).filter(|field| !field.is_empty()).collect();
        let kind = |field: &str| match field {
            "1" | "I" | "i" => Some(true),
            "2" | "II" | "ii" => Some(false),
            _ => None,
        };
        match fields[..] {
            [] => {}
            [row, marker] if row.parse::<u32>().is_ok() && kind(marker).is_some() => {
                markers.extend(row.parse().ok().zip(kind(marker)));
            }
            // A line of names.
            [_, _] if markers.is_empty() && fields.iter().all(|field| field.parse::<f64>().is_err()) => {}
            _ => {
                let (path, text) = (path.to_owned(), line.chars().take(40).collect());
                return Err(Error::MarkerFile { path, line: number + 1, text });
            }
        }
    }
    Ok(markers)
}

/// Markers as indices of the fitted points, whose rows in the file are `rows`.
fn markers_among(listed: &[(u32, bool)], rows: &[u32]) -> Result<Markers, Error> {
    let named: Vec<u64> = listed.iter().map(|&(row, _)| row.into()).collect();
    let mut markers = Markers::default();
    for (at, &(_, met)) in places_of(&named, rows, "--markers")?.into_iter().zip(listed) {
        let places = if met { &mut markers.met } else { &mut markers.ignored };
        places.push(at as usize);
    }
    Ok(markers)
}

/// The diagonal of the box around the points that do not lie grossly off their neighbours: a few stray points should not make
/// a tolerance in percent of it larger.
pub(crate) fn robust_diagonal(points: ArrayView2<'_, f64>, parameters: ArrayView2<'_, f64>) -> Result<f64, Error> {
    let rule = Robust { least_scale: 0.0, ..Robust::adaptive::<2>(Loss::Tukey, 0.0) };
    let reweighting = Reweighting { robust: Some(rule), markers: None };
    let mut weights = PointWeights::new::<2>(parameters, None, &reweighting)?;
    // Residuals of the map that is zero everywhere.
    let columns: Vec<Vec<f64>> = points.columns().into_iter().map(|column| column.to_vec()).collect();
    for _ in 0..SCREENINGS {
        weights.update_robust(&columns)?;
    }
    let kept: Vec<usize> = (0..points.nrows()).filter(|&i| !weights.gross()[i]).collect();
    Ok(BoundingBox::of(points.select(Axis(0), &kept).view())?.diagonal())
}

/// Points where the surface turns sharply between neighbours, by local fits to the points that do not stand out.
fn sharp(problem: &Problem<'_>, gross: &[usize]) -> Result<Vec<bool>, Error> {
    let m = problem.points.nrows();
    let mut sound = vec![true; m];
    gross.iter().for_each(|&i| sound[i] = false);
    let kept: Vec<usize> = (0..m).filter(|&i| sound[i]).collect();
    let frames = LocalFrames::estimate(problem.points.select(Axis(0), &kept).view())?;
    let mut flags = vec![false; m];
    for (at, &i) in kept.iter().enumerate() {
        let curvature = frames.curvatures[[at, 0]].abs().max(frames.curvatures[[at, 1]].abs());
        flags[i] = curvature * frames.spacing[at] > SHARP;
    }
    Ok(flags)
}

/// Markers by a first fit, and of type I also where the surface turns sharply.
fn find_markers(problem: &Problem<'_>, space: &HierarchicalSpace<2>, options: &FitOptions) -> Result<Markers, Error> {
    let (lower, upper) = space.domain();
    let knots = |d: usize| -> Result<KnotVector, Error> {
        let elements = options.elements()[d].max(DETECTION_ELEMENTS);
        Ok(uniform_knots(options.degree.0[d], elements, space.periodic()[d])?.on_interval(lower[d], upper[d])?)
    };
    let first = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots(0)?, knots(1)?])?);
    let max_outliers = options.reweighting.max_set_aside;
    let detection = Detection { threshold: problem.tolerance, standing_out: true, outliers: true, max_outliers };
    let fitting = least_squares_options(problem, options);
    let Problem { points, parameters, weights, .. } = *problem;
    let mut markers = detect_markers(parameters, points, weights, &first, fitting, detection)?;
    let sharp = sharp(problem, &markers.ignored)?;
    let mut marked = vec![false; points.nrows()];
    markers.met.iter().chain(&markers.ignored).for_each(|&i| marked[i] = true);
    markers.met.extend((0..sharp.len()).filter(|&i| sharp[i] && !marked[i]));
    markers.met.sort_unstable();
    Ok(markers)
}

fn rules(problem: &Problem<'_>, space: &HierarchicalSpace<2>, options: &FitOptions) -> Result<Reweighting, Error> {
    let asked = &options.reweighting;
    let length = |tol: Option<Tolerance>| tol.map_or(problem.tolerance, |tol| tol.resolve(problem.diagonal));
    let (met, ignored) = (length(asked.marker_tol), length(asked.ignore_tol));
    let update = match asked.marker_update {
        UpdateChoice::Error => Update::ErrorDriven { unit: met },
        UpdateChoice::Constant(factor) => Update::Constant(factor),
    };
    let markers = match &asked.markers {
        None => None,
        Some(MarkerChoice::Auto) => Some(find_markers(problem, space, options)?),
        Some(MarkerChoice::File(path)) => Some(markers_among(&read_markers(path)?, problem.rows)?),
    };
    Ok(Reweighting {
        robust: asked.robust.map(|LossChoice(loss)| Robust {
            max_set_aside: asked.max_set_aside,
            ..Robust::adaptive::<2>(loss, problem.tolerance)
        }),
        markers: markers.map(|markers| (markers, MarkerRules { update, ..MarkerRules::new(met, ignored) })),
    })
}

/// Fits adaptively with weights that follow the errors: by least squares at fixed parameters, or by a method whose parameters move.
pub(crate) fn fit(
    moving: Option<MovingFit<2>>,
    problem: &Problem<'_>,
    space: &Arc<HierarchicalSpace<2>>,
    options: &FitOptions,
    limits: &adaptive::Options<2>,
    observer: &mut dyn Observer,
) -> Result<Fitted, Error> {
    let rules = rules(problem, space, options)?;
    let Some(moving) = moving else {
        let fitting = least_squares_options(problem, options);
        let solver = Reweighted::new(problem.parameters, problem.points, problem.weights, fitting, &rules)?;
        return Ok(fit_weighted(solver, &rules, problem, space, limits, observer)?.0);
    };
    let solver = Reweighted::of(moving, problem.weights, &rules)?;
    let (fitted, moved) = fit_weighted(solver, &rules, problem, space, limits, observer)?;
    Ok(Fitted { parameters: moved.parameters(), moves: moved.reports().to_vec(), ..fitted })
}

/// The same by a method at hand, which is given back.
fn fit_weighted<S: Weighted<2>>(
    mut solver: Reweighted<2, S>,
    rules: &Reweighting,
    problem: &Problem<'_>,
    space: &Arc<HierarchicalSpace<2>>,
    limits: &adaptive::Options<2>,
    observer: &mut dyn Observer,
) -> Result<(Fitted, S), Error>
where
    Error: From<S::Error>,
{
    let Outcome { mut map, mut stop, failure, mut history, .. } = run(&mut solver, space.clone(), limits, observer)?;
    let mut lambda = solver.least_squares().lambda();
    // What a failed iteration left belongs to another space than the map.
    solver.measure(&map)?;
    let (mut errors, mut report, mut counted) =
        (solver.errors().to_vec(), solver.report()?, solver.weights().counted());
    if report.met[1] < report.met[0] {
        // The loop has ended with markers that are not met: weigh them more in the space there is, unless that keeps others
        // from the tolerance.
        let last = solver.fit(map.space(), LAST_ROUNDS)?;
        let within = |errors: &[f64], counted: &[bool]| {
            let heard: Vec<f64> = (0..errors.len()).filter(|&i| counted[i]).map(|i| errors[i]).collect();
            Deviation::new(&heard, limits.tolerance)
        };
        let now_counted = solver.weights().counted();
        let (before, now) = (within(&errors, &counted), within(solver.errors(), &now_counted));
        let now_report = solver.report()?;
        if now_report.met[1] > report.met[1] && now.within >= before.within.min(limits.within) {
            (map, errors, report, counted) = (last, solver.errors().to_vec(), now_report, now_counted);
            lambda = solver.least_squares().lambda();
            history.iter_mut().last().into_iter().for_each(|record| record.deviation = now);
            if now.within >= limits.within {
                stop = Stop::ToleranceReached;
            }
        }
    }
    let listed = |chosen: &mut dyn Iterator<Item = usize>| chosen.take(LISTED).map(|i| problem.rows[i]).collect();
    let markers = solver.weights().markers();
    let missed = |i: &usize| rules.markers.as_ref().is_some_and(|(_, rules)| errors[*i] >= rules.met);
    let found = ReweightingReport {
        rounds: report.rounds,
        settled: report.settled,
        counted: counted.iter().filter(|&&counts| counts).count(),
        scale: report.scale,
        ignored: report.gross.len(),
        capped: report.capped,
        ignored_rows: listed(&mut report.gross.iter().copied()),
        markers: report.met[0],
        markers_met: report.met[1],
        markers_missed_rows: listed(&mut markers.met.iter().copied().filter(missed)),
        markers_to_ignore: report.ignored[0],
        markers_ignored: report.ignored[1],
    };
    let outcome = Outcome { map, stop, failure, history };
    let fitted = Fitted {
        lambda: lambda.unwrap_or(0.0),
        local_smoothing: solver.least_squares().local_smoothing().to_vec(),
        reweighting: Some(found),
        counted: Some(counted),
        ..Fitted::of(outcome, problem.parameters.to_owned(), errors.into())
    };
    Ok((fitted, solver.into_method()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marker_files_are_read_line_by_line() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("marks.csv");
        std::fs::write(&path, "row,type # first\n12,I\n\n7 2\n3;II # a scratch\n").unwrap();
        let markers = read_markers(&path).unwrap();
        assert_eq!(markers, [(12, true), (7, false), (3, false)]);
        let among = markers_among(&markers, &[3, 7, 12, 20]).unwrap();
        assert_eq!((among.met, among.ignored), (vec![2], vec![1, 0]));
        assert!(matches!(markers_among(&markers, &[3, 7]), Err(Error::NoSuchPoint { row: 12, .. })));
        std::fs::write(&path, "12,I\n13,III\n").unwrap();
        assert!(matches!(read_markers(&path), Err(Error::MarkerFile { line: 2, .. })));
    }
}
