//! Fits on layouts of our own: another layout where faces fold, more elements where they are too coarse.

use multi_patch::TURNED_OVER;
use quad_layout::{BuildOptions, QuadLayout};

use super::part::{Attempt, ELEMENTS, Part};
use super::report::{KINK, SolidReason, SolidReport};
use crate::{Error, Event, Watch};

/// Radii of regions that are tried, as shares of the diagonal, in this order.
///
/// Calibrated: `thb fit PART.off` on 20 closed meshes. With 0.25 first, `bear`, `blobby`, `joint`, `sphere966` and `spool` have 158, 74, 185,
/// 36 and 159 faces; with these 87, 12, 153, 6 and 139.
const RADII: [f64; 5] = [0.5, 0.35, 0.25, 0.19, 0.14];

/// Most elements along a side that are tried on each layout.
///
/// Limit: 121 control points a patch; smaller patches come as near with fewer.
const MOST_ELEMENTS: usize = 8;

/// Elements that are tried at last where every layout leaves folds, and where it is too far.
///
/// Limit: time. On `part`, 6 undid the fold that 4 left on its best layout.
const FINER: [usize; 2] = [6, 8];
const FINEST: [usize; 1] = [16];

/// A fit with its layout.
struct Tried {
    layout: QuadLayout,
    attempt: Attempt,
}

/// The fit with the fewest faces of the first two radii whose patches, cut anew or not, are near enough and fold nowhere; else the best of
/// all, with more elements at last.
///
/// # Errors
/// [`Error`], where no fit at all succeeds.
pub(super) fn best(part: &Part<'_>, watch: &mut Watch<'_>) -> Result<Attempt, Error> {
    let mut best: Option<Tried> = None;
    let mut failure = None;
    for radius in RADII {
        let had_reached = best.as_ref().is_some_and(|best| best.attempt.is_reached());
        for cut_anew in [true, false] {
            match tried(part, radius, cut_anew, watch) {
                Ok(tried) => {
                    if best.as_ref().is_none_or(|best| is_better(&tried.attempt, &best.attempt)) {
                        best = Some(tried);
                    }
                }
                Err(error) => failure = failure.or(Some(error)),
            }
            if best.as_ref().is_some_and(|best| best.attempt.is_reached()) {
                break;
            }
        }
        if had_reached {
            break;
        }
    }
    let Some(mut best) = best else { return Err(failure.unwrap_or(Error::NoTriangles)) };
    if part.options.elements.is_none() && !best.attempt.is_reached() {
        let is_folded = best.attempt.report.folded_places > 0 || best.attempt.report.angles.max >= TURNED_OVER;
        let finer: &[usize] = match () {
            () if best.attempt.is_only_far() => &FINEST,
            () if is_folded => &FINER,
            () => &[],
        };
        for &elements in finer {
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

/// A fit on a layout of one radius.
fn tried(part: &Part<'_>, radius: f64, cut_anew: bool, watch: &mut Watch<'_>) -> Result<Tried, Error> {
    let _ = watch(Event::Step("cutting into patches"));
    let curved = &part.mesh.curved;
    let options = BuildOptions { radius, creases: part.options.sharp.rule(), cut_anew };
    let layout = QuadLayout::of_mesh(curved.vertices(), curved.triangles(), &options)?;
    Ok(Tried { attempt: near_enough(part, &layout, watch)?, layout })
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
        self.report.is_reached()
    }

    /// Whether nothing else is wrong than the distance.
    fn is_only_far(&self) -> bool {
        self.report.reasons.iter().all(|why| matches!(why, SolidReason::NotWithin { .. } | SolidReason::TooFar { .. }))
    }
}

/// Whether a fit is better than another: by whether it is what was asked for, by how much folds, by how much passes through itself, by what
/// is creased or turned over, by the number of faces where nothing is wrong, by the distance.
fn is_better(attempt: &Attempt, than: &Attempt) -> bool {
    let rank = |of: &Attempt| {
        let SolidReport { folded_faces, folded_places, crossings, layout, .. } = &of.report;
        let faces = if of.is_reached() { layout.faces } else { 0 };
        let creased = [KINK, TURNED_OVER].iter().filter(|&&angle| of.report.angles.max >= angle).count();
        (!of.is_reached(), folded_faces.len(), *folded_places, crossings.pairs, creased, faces)
    };
    let far = |of: &Attempt| of.report.mesh_to_surface.p99.max(of.report.surface_to_mesh.p99);
    rank(attempt).cmp(&rank(than)).then(far(attempt).total_cmp(&far(than))).is_lt()
}
