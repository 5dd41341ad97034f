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

/// Elements that are tried at last where every layout leaves folds.
///
/// Limit: time. On `part`, 6 undo the fold that 4 leave on its best layout.
const FINER: [usize; 2] = [6, 8];

/// A fit with its layout.
struct Tried {
    layout: QuadLayout,
    attempt: Attempt,
}

/// The first fit that is near enough and folds nowhere, else the best of all: at each radius of patches cut anew first, then of those
/// that are not; at last, with more elements, of the best layout.
///
/// # Errors
/// [`Error`], where no fit at all succeeds.
pub(super) fn best(part: &Part<'_>, watch: &mut Watch<'_>) -> Result<Attempt, Error> {
    let creases = part.options.sharp.rule();
    let mut best: Option<Tried> = None;
    let mut failure = None;
    for (radius, cut_anew) in RADII.into_iter().flat_map(|radius| [(radius, true), (radius, false)]) {
        let _ = watch(Event::Step("cutting into patches"));
        let curved = &part.mesh.curved;
        let options = BuildOptions { radius, creases, cut_anew };
        let layout = QuadLayout::of_mesh(curved.vertices(), curved.triangles(), &options).map_err(Error::from);
        match layout.and_then(|layout| Ok(Tried { attempt: near_enough(part, &layout, watch)?, layout })) {
            Ok(tried) if tried.attempt.is_reached() => return Ok(tried.attempt),
            Ok(tried) if best.as_ref().is_none_or(|best| is_better(&tried.attempt, &best.attempt)) => {
                best = Some(tried)
            }
            Ok(_) => {}
            Err(error) => failure = failure.or(Some(error)),
        }
    }
    let Some(mut best) = best else { return Err(failure.unwrap_or(Error::NoTriangles)) };
    if part.options.elements.is_none() && !best.attempt.is_only_far() {
        for elements in FINER {
            // What was fitted stays where a finer space cannot be.
            let Ok(finer) = part.attempt(&best.layout, elements, watch) else { break };
            if is_better(&finer, &best.attempt) {
                best.attempt = finer;
            }
            if best.attempt.is_reached() {
                break;
            }
        }
    }
    Ok(best.attempt)
}

/// The best fit on a layout, with twice as many elements as long as it is too far from the mesh: that undoes no fold.
fn near_enough(part: &Part<'_>, layout: &QuadLayout, watch: &mut Watch<'_>) -> Result<Attempt, Error> {
    let mut elements = part.options.elements.unwrap_or(ELEMENTS);
    let mut best = part.attempt(layout, elements, watch)?;
    while !best.is_reached() && best.is_only_far() && part.options.elements.is_none() && 2 * elements <= MOST_ELEMENTS {
        elements *= 2;
        let Ok(finer) = part.attempt(layout, elements, watch) else { break };
        if !finer.is_only_far() {
            break;
        }
        best = finer;
    }
    Ok(best)
}

impl Attempt {
    fn is_reached(&self) -> bool {
        self.report.reasons.is_empty()
    }

    /// Whether nothing else is wrong than the distance.
    fn is_only_far(&self) -> bool {
        self.report.reasons.iter().all(|why| matches!(why, SolidReason::NotWithin { .. }))
    }
}

/// Whether a fit is better than another: by whether it is what was asked for, by how much folds, by the distance.
fn is_better(attempt: &Attempt, than: &Attempt) -> bool {
    let rank = |of: &Attempt| (!of.is_reached(), of.report.folded_faces.len(), of.report.folded_places);
    let far = |of: &Attempt| of.report.mesh_to_surface.p99.max(of.report.surface_to_mesh.p99);
    rank(attempt).cmp(&rank(than)).then(far(attempt).total_cmp(&far(than))).is_lt()
}
