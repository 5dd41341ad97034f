//! The report as a page to look at: gathers what [`report_page`] draws.

mod facts;
mod places;
mod shape;

use deviation::Verdict;
use report_page::{Headline, Page, Part, Reason, Scan, Step, Tone};

use crate::page::places::worst_places;
use crate::page::shape::{area_of_vertices, signed_distances, surface_of};
use crate::problem::rows_of;
use crate::{Error, Fit, PieceFits, Report, SolidFit};

/// Share of the tolerance that the triangles of a drawn surface are off at most, as far as their number allows.
///
/// Limit: what the eye can see beside bands of half a tolerance.
const CHORD: f64 = 0.25;

/// The page of a fit.
///
/// # Errors
/// [`Error::Deviation`].
pub fn page_of(fit: &Fit) -> Result<Page, Error> {
    let report = &fit.report;
    let part = part_of(fit, String::new())?;
    let up = fit.scanned.has_heights.then_some([0.0, 0.0, 1.0]);
    let worst = worst_places(&[(report, &part)], fit.scanned.has_side);
    Ok(Page {
        headline: Headline {
            title: name_of(&report.input.file),
            verdict: report.result.verdict.name().to_owned(),
            tone: tone(report.result.verdict),
            figures: facts::figures(report),
        },
        reasons: reasons(report, ""),
        warnings: report.warnings.clone(),
        steps: steps(report),
        tried: facts::tried(report),
        facts: facts::of_report(report),
        options: facts::options(&report.options),
        worst,
        up,
        ..common(report, fit.scanned.has_side, fit.scanned.has_heights, vec![part])
    })
}

/// The page of all pieces of a scan; `None` if none has a surface.
///
/// # Errors
/// [`Error::Deviation`].
pub fn page_of_pieces(fits: &PieceFits) -> Result<Option<Page>, Error> {
    let fitted: Vec<(usize, &Fit)> = fits.fitted().collect();
    let Some((_, first)) = fitted.first() else { return Ok(None) };
    let parts: Vec<Part> =
        fitted.iter().map(|(number, fit)| part_of(fit, format!("piece {number}"))).collect::<Result<_, _>>()?;
    let has_side = fitted.iter().all(|(_, fit)| fit.scanned.has_side);
    let reports: Vec<(&Report, &Part)> = fitted.iter().map(|(_, fit)| &fit.report).zip(&parts).collect();
    let worst = worst_places(&reports, has_side);
    let mut found: Vec<Reason> =
        fitted.iter().flat_map(|(number, fit)| reasons(&fit.report, &format!("piece {number}: "))).collect();
    found.extend(fits.error().map(|text| Reason { tone: Tone::Failed, text, place: None }));
    let of_piece = |(number, fit): &(usize, &Fit)| {
        let of_one = move |text: &String| format!("piece {number}: {text}");
        fit.report.warnings.iter().map(of_one).collect::<Vec<_>>()
    };
    let warnings = fits.warnings.iter().cloned().chain(fitted.iter().flat_map(of_piece)).collect();
    let verdict = fits.verdict();
    Ok(Some(Page {
        headline: Headline {
            title: name_of(&fits.name),
            verdict: verdict.name().to_owned(),
            tone: tone(verdict),
            figures: facts::figures_of_pieces(&reports, fits.pieces.len()),
        },
        reasons: found,
        warnings,
        facts: facts::of_report(&first.report),
        options: facts::options(&fits.options),
        worst,
        ..common(&first.report, has_side, first.scanned.has_heights, parts)
    }))
}

/// The page of a whole part.
///
/// # Errors
/// [`Error::Deviation`].
pub fn page_of_solid(fit: &SolidFit) -> Result<Page, Error> {
    let report = &fit.report;
    let part = shape::solid_part(fit, CHORD * report.tolerance)?;
    let is_reached = fit.reached();
    let worst = places::largest(&[&part], report.tolerance, true);
    Ok(Page {
        headline: Headline {
            title: name_of(&report.input.display().to_string()),
            verdict: if is_reached { "as asked" } else { "not as asked" }.to_owned(),
            tone: if is_reached { Tone::Good } else { Tone::Failed },
            figures: facts::figures_of_solid(report, fit.unit),
        },
        reasons: report
            .reasons
            .iter()
            .map(|reason| Reason { tone: Tone::Failed, text: reason.to_string(), place: None })
            .collect(),
        facts: facts::of_solid(fit),
        options: facts::options(&report.options),
        tolerance: report.tolerance,
        within: report.options.within,
        unit: facts::symbol(fit.unit).to_owned(),
        is_signed: true,
        signs: SIGNS.to_owned(),
        shares_of: "of the samples, weighed by area,".to_owned(),
        worst,
        parts: vec![part],
        ..Page::default()
    })
}

const SIGNS: &str = "Positive (orange): the scan lies outside the surface, on the side that the face points to. \
                     Negative (blue): inside.";
const SIGNS_UP: &str = "Positive (orange): the scan lies above the surface. Negative (blue): below.";
const NO_SIGNS: &str = "Unsigned: neither triangles nor normals tell which side of this scan is outside.";

const OF_VERTICES: &str = "Counted here are vertices, each for the area around it. The verdict goes by the whole area, \
                           where triangles count as exactly as they tell the shape.";
const OF_POINTS: &str = "Counted here are all points alike. The verdict weighs each by the square of its spacing.";

/// What pages of one and of several surfaces have in common.
fn common(report: &Report, has_side: bool, has_heights: bool, parts: Vec<Part>) -> Page {
    let signs = match (has_side, has_heights) {
        (false, _) => NO_SIGNS,
        (true, true) => SIGNS_UP,
        (true, false) => SIGNS,
    };
    let is_mesh = parts.iter().all(|part| !part.scan.triangles.is_empty());
    Page {
        tolerance: report.result.tolerance,
        within: report.options.within,
        unit: facts::symbol(report.options.units.unwrap_or_default()).to_owned(),
        is_signed: has_side,
        signs: signs.to_owned(),
        shares_of: if is_mesh { "of the vertices, weighed by area," } else { "of the points" }.to_owned(),
        shares_note: if is_mesh { OF_VERTICES } else { OF_POINTS }.to_owned(),
        parts,
        ..Page::default()
    }
}

fn part_of(fit: &Fit, name: String) -> Result<Part, Error> {
    let points = rows_of(fit.points.view());
    let (map, tolerance) = (fit.surface(), fit.report.result.tolerance);
    let found = signed_distances(fit, &points)?;
    let is_mesh = !fit.scanned.triangles.is_empty();
    let (lower, upper) = thb_core::ParameterBox::domain(map.space().as_ref());
    let share = |x: f64, d: usize| (x - lower[d]) / (upper[d] - lower[d]);
    let parameters = fit.parameters.outer_iter().map(|u| [share(u[0], 0), share(u[1], 1)]).collect();
    let scan = Scan {
        weights: area_of_vertices(&points, &fit.scanned.triangles),
        deviations: found.iter().map(|found| found.distance).collect(),
        normals: if is_mesh { Vec::new() } else { found.iter().map(|found| found.normal).collect() },
        parameters,
        set_aside: fit.scanned.set_aside.clone(),
        triangles: fit.scanned.triangles.clone(),
        left_out: fit.scanned.left_out.clone(),
        points,
    };
    Ok(Part { name, scan, surface: surface_of(map, fit.reversed, CHORD * tolerance, shape::MOST_VERTICES)? })
}

fn reasons(report: &Report, before: &str) -> Vec<Reason> {
    let of_one = |reason: &deviation::Reason| Reason {
        tone: tone(reason.verdict),
        text: format!("{before}{}", reason.text),
        place: reason.place,
    };
    report.result.reasons.iter().map(of_one).collect()
}

fn steps(report: &Report) -> Vec<Step> {
    let of_one = |step: &crate::IterationReport| Step {
        control_points: step.dofs,
        largest: step.max,
        rms: step.rmse,
        within: step.within,
    };
    report.history.iter().map(of_one).collect()
}

pub(crate) fn tone(verdict: Verdict) -> Tone {
    match verdict {
        Verdict::Good => Tone::Good,
        Verdict::Usable => Tone::Usable,
        Verdict::Failed => Tone::Failed,
    }
}

/// The name of a file without its folders.
fn name_of(file: &str) -> String {
    std::path::Path::new(file).file_name().map_or_else(|| file.to_owned(), |name| name.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests;
