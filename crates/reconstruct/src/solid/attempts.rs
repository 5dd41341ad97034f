//! Fits on layouts of our own: another layout where faces fold, more elements where they are too coarse.

use quad_layout::{BuildOptions, QuadLayout};

use super::part::{Attempt, ELEMENTS, Part};
use super::report::SolidReason;
use crate::{Error, Event, Watch};

/// Radii of regions that are tried, as shares of the diagonal.
///
/// Limit: the first fits ten smooth shapes without folds; the others are not calibrated yet.
const RADII: [f64; 3] = [0.25, 0.19, 0.14];

/// Most elements along a side that are tried unasked.
///
/// Limit: 361 control points a patch.
const MOST_ELEMENTS: usize = 16;

/// The first fit that is near enough and folds nowhere, else the one with the fewest folds; of these the nearest.
///
/// # Errors
/// [`Error`], where no fit at all succeeds.
pub(super) fn best(part: &Part<'_>, watch: &mut Watch<'_>) -> Result<Attempt, Error> {
    let creases = part.options.sharp.rule();
    let mut best: Option<Attempt> = None;
    let mut failure = None;
    for radius in RADII {
        let _ = watch(Event::Step("cutting into patches"));
        let curved = &part.mesh.curved;
        let layout = QuadLayout::of_mesh(curved.vertices(), curved.triangles(), &BuildOptions { radius, creases });
        let layout = match layout {
            Ok(layout) => layout,
            Err(error) => {
                failure.get_or_insert(Error::from(error));
                continue;
            }
        };
        let mut elements = part.options.elements.unwrap_or(ELEMENTS);
        loop {
            let attempt = match part.attempt(&layout, elements, watch) {
                Ok(attempt) => attempt,
                Err(error) => {
                    failure.get_or_insert(error);
                    break;
                }
            };
            let is_reached = attempt.report.reasons.is_empty();
            // More elements bring a surface nearer, but undo no fold.
            let is_only_far = attempt.report.reasons.iter().all(|why| matches!(why, SolidReason::NotWithin { .. }));
            if best.as_ref().is_none_or(|best| is_better(&attempt, best)) {
                best = Some(attempt);
            }
            elements *= 2;
            if is_reached || !is_only_far || part.options.elements.is_some() || elements > MOST_ELEMENTS {
                break;
            }
        }
        if best.as_ref().is_some_and(|best| best.report.reasons.is_empty()) {
            break;
        }
    }
    match (best, failure) {
        (Some(best), _) => Ok(best),
        (None, Some(failure)) => Err(failure),
        (None, None) => Err(Error::NoTriangles),
    }
}

fn is_better(attempt: &Attempt, than: &Attempt) -> bool {
    let rank = |of: &Attempt| {
        let far = of.report.mesh_to_surface.p99.max(of.report.surface_to_mesh.p99);
        (!of.report.reasons.is_empty(), of.report.folded_faces.len(), far)
    };
    let (a, b) = (rank(attempt), rank(than));
    (a.0, a.1) < (b.0, b.1) || ((a.0, a.1) == (b.0, b.1) && a.2 < b.2)
}
