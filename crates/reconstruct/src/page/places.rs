//! Places to look at.

use point_cloud::vec3::{diagonal, norm, sub};
use report_page::{Part, Place};

use crate::Report;

/// Places that are listed.
const LISTED: usize = 20;

/// Places that are listed for being the largest around.
const LARGEST: usize = 12;

/// Distance in diagonals within which one place stands for others.
const APART: f64 = 0.03;

/// Local maxima that are listed where none is beyond the tolerance.
const LARGEST_WITHIN: usize = 3;

/// The worst places of fits: where the surface passes through itself, then by distance.
pub(super) fn worst_places(fits: &[(&Report, &Part)], signed: bool) -> Vec<Place> {
    let mut first = Vec::new();
    let mut found = Vec::new();
    for (report, part) in fits {
        let deviation = &report.result.deviation;
        first.extend(deviation.crossings.places.iter().map(|crossing| Place {
            what: "the surface passes through itself".to_owned(),
            deviation: crossing.depth,
            place: crossing.place,
        }));
        let near = |what: String, distance: f64, place: [f64; 3]| Place {
            what,
            deviation: sign_at(part, place, signed) * distance,
            place,
        };
        let to_surface = &deviation.scan_to_surface;
        if to_surface.max > 0.0 {
            found.push(near("largest distance of the scan".to_owned(), to_surface.max, to_surface.place));
        }
        found.extend(deviation.gathered.patches.iter().map(|patch| {
            near(
                format!("patch beyond the tolerance, {:.2} % of the scan", 100.0 * patch.share),
                patch.distance,
                patch.place,
            )
        }));
        if deviation.surface_to_scan.max > to_surface.max {
            let side = &deviation.surface_to_scan;
            let what = "largest distance of the surface from the scan".to_owned();
            found.push(Place { what, deviation: side.max, place: side.place });
        }
    }
    let parts: Vec<&Part> = fits.iter().map(|(_, part)| *part).collect();
    let near = APART * parts.iter().map(|part| diagonal(&part.scan.points)).fold(0.0, f64::max);
    let tolerance = fits.iter().map(|(report, _)| report.result.tolerance).fold(0.0, f64::max);
    found.extend(largest(&parts, tolerance, signed));
    found.sort_by(|a, b| b.deviation.abs().total_cmp(&a.deviation.abs()));
    let mut listed: Vec<Place> = first;
    for place in found {
        if listed.iter().all(|other| norm(sub(other.place, place.place)) > near) {
            listed.push(place);
        }
    }
    listed.truncate(LISTED);
    listed
}

/// The points of the largest distances, apart from one another: those beyond the tolerance, or a few.
pub(super) fn largest(parts: &[&Part], tolerance: f64, signed: bool) -> Vec<Place> {
    let near = APART * parts.iter().map(|part| diagonal(&part.scan.points)).fold(0.0, f64::max);
    let of_part = |part: &&Part| {
        let is_aside = |i: usize| part.scan.set_aside.get(i).is_some_and(|&aside| aside);
        let places = part.scan.points.iter().zip(&part.scan.deviations).enumerate();
        places.filter(|(i, _)| !is_aside(*i)).map(|(_, (&p, &d))| (d, p)).collect::<Vec<_>>()
    };
    let mut all: Vec<(f64, [f64; 3])> = parts.iter().flat_map(of_part).collect();
    all.sort_unstable_by(|a, b| b.0.abs().total_cmp(&a.0.abs()));
    let mut found: Vec<Place> = Vec::new();
    for (deviation, place) in all {
        let most = if deviation.abs() > tolerance { LARGEST } else { LARGEST_WITHIN };
        if found.len() >= most || deviation == 0.0 {
            break;
        }
        if found.iter().all(|other| norm(sub(other.place, place)) > near) {
            let deviation = if signed { deviation } else { deviation.abs() };
            found.push(Place { what: "local maximum".to_owned(), deviation, place });
        }
    }
    found
}

/// The sign of the deviation of the point nearest to a place.
fn sign_at(part: &Part, place: [f64; 3], signed: bool) -> f64 {
    let squared = |p: &[f64; 3]| (0..3).map(|k| (p[k] - place[k]).powi(2)).sum::<f64>();
    let points = part.scan.points.iter().map(squared).zip(&part.scan.deviations);
    let nearest = points.min_by(|a, b| a.0.total_cmp(&b.0));
    if signed { nearest.map_or(1.0, |(_, deviation)| 1.0_f64.copysign(*deviation)) } else { 1.0 }
}
