//! Foot points: the parameters of samples follow the surface, across smooth arcs but never across sharp ones.

use point_cloud::vec3::{cross, dot, norm, sub};
use thb_core::{BezierMap, MultiPatchSpace, PatchPlace, descend, side_point};

use crate::Surface;
use crate::samples::{Sample, Samples};

/// Cells that a search crosses at most: each is one Newton descent.
///
/// Limit: a foot point that is farther away than this many cells is found in the next pass.
const MAX_HOPS: usize = 12;

/// Shift across the border of a cell, as a share of the unit square, by which the neighbour is found.
///
/// Derived: below the size of the finest cells, 2⁻¹⁵ of an element.
const BEYOND_BORDER: f64 = 1e-7;

/// Newton steps shorter than this share of a cell end a descent.
///
/// Derived: the squared distance then changes by 10⁻¹² of the squared size of the cell, far below any tolerance.
const STEP_TOLERANCE: f64 = 1e-6;

/// Golden sections by which a parameter on an arc is found, in a stretch of two elements: 0.62²⁰ of that is 10⁻⁴ of an element.
///
/// Limit: parameters are followed again in the next pass.
const ARC_STEPS: usize = 20;

/// A place with its cell and the distance of a sample from there.
#[derive(Clone, Copy, Debug)]
struct Found {
    place: PatchPlace,
    cell: usize,
    distance: f64,
}

/// Moves each sample's parameter to the nearest place that descends from it: within its patch and, over arcs that are not `sharp`, into
/// others; along its arc if it is tied to one. Where the surface there faces away from the sample's normal the parameter stays.
pub(crate) fn follow(samples: &mut Samples, surface: &Surface, sharp: &[bool]) {
    let search = Search { space: surface.space(), bezier: surface.bezier(), sharp };
    samples.move_each(|sample, cell| {
        let found = match sample.arc {
            Some(arc) => search.along_arc(sample, cell, arc),
            None => search.nearest(sample, cell),
        };
        if search.faces(sample, &found) { (found.cell as u32, found.place) } else { (cell as u32, sample.place) }
    });
}

struct Search<'a> {
    space: &'a MultiPatchSpace,
    bezier: &'a BezierMap<2>,
    sharp: &'a [bool],
}

impl Search<'_> {
    /// Whether the surface at a place faces the same side as the sample.
    fn faces(&self, sample: &Sample, found: &Found) -> bool {
        let jet = self.bezier.jet(found.cell, found.place.u);
        sample.normal == [0.0; 3] || dot(cross(jet.first[0], jet.first[1]), sample.normal) > 0.0
    }

    fn descend(&self, sample: &Sample, patch: u32, cell: usize, u: [f64; 2]) -> Found {
        let found = descend(self.bezier, &sample.point, cell, u, STEP_TOLERANCE);
        Found { place: PatchPlace { patch, u: found.u }, cell, distance: found.distance }
    }

    fn nearest(&self, sample: &Sample, cell: usize) -> Found {
        let mut best = self.descend(sample, sample.place.patch, cell, sample.place.u);
        for _ in 0..MAX_HOPS {
            let beyond = self.beyond_borders(&best);
            let Some(next) = beyond.into_iter().flatten().find_map(|(place, cell)| {
                let next = self.descend(sample, place.patch, cell, place.u);
                // Round-off: the same border seen from the other side is no progress.
                (next.distance < best.distance * (1.0 - 1e-12)).then_some(next)
            }) else {
                break;
            };
            best = next;
        }
        best
    }

    /// The places just beyond the borders of the cell that a place lies on, one for each direction.
    fn beyond_borders(&self, at: &Found) -> [Option<(PatchPlace, usize)>; 2] {
        let (lower, upper) = self.bezier.cell_box(at.cell);
        let u = at.place.u;
        [0, 1].map(|d| {
            let beyond = if u[d] <= lower[d] {
                lower[d] - BEYOND_BORDER
            } else if u[d] >= upper[d] {
                upper[d] + BEYOND_BORDER
            } else {
                return None;
            };
            let place = if (0.0..=1.0).contains(&beyond) {
                let mut inside = u;
                inside[d] = beyond;
                PatchPlace { patch: at.place.patch, u: inside }
            } else {
                self.across(at.place, d, beyond > 1.0)?
            };
            self.space.locate(place).ok().map(|cell| (place, cell))
        })
    }

    /// The place behind the side on which direction `d` ends; none over sharp arcs and the boundary.
    fn across(&self, at: PatchPlace, d: usize, is_upper: bool) -> Option<PatchPlace> {
        let side = match (d, is_upper) {
            (0, true) => 1,
            (0, false) => 3,
            (_, true) => 2,
            (_, false) => 0,
        };
        let over = self.space.topology().across(at.patch as usize, side)?;
        if self.sharp[over.arc as usize] {
            return None;
        }
        let along = at.u[1 - d];
        let t = if side < 2 { along } else { 1.0 - along };
        let u = side_point(over.side, if over.opposite { 1.0 - t } else { t });
        Some(PatchPlace { patch: over.patch, u })
    }

    /// The nearest place on a side, near the present one: golden sections of the stretch of one element before and after.
    fn along_arc(&self, sample: &Sample, cell: usize, arc: u32) -> Found {
        let stay = Found { place: sample.place, cell, distance: self.distance(sample, cell, sample.place.u) };
        let uses = self.space.topology().uses(arc as usize);
        let Some(on) = uses.iter().find(|on| on.patch == sample.place.patch) else { return stay };
        let u = sample.place.u;
        let t = [u[0], u[1], 1.0 - u[0], 1.0 - u[1]][usize::from(on.side)];
        let reach = 1.0 / self.space.elements(arc as usize) as f64;
        let at = |t: f64| {
            let place = PatchPlace { patch: on.patch, u: side_point(on.side, t) };
            let cell = self.space.locate(place).unwrap_or(cell);
            Found { place, cell, distance: self.distance(sample, cell, place.u) }
        };
        let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
        let (mut low, mut high) = ((t - reach).max(0.0), (t + reach).min(1.0));
        let mut inner = [at(high - golden * (high - low)), at(low + golden * (high - low))];
        let mut best = if inner[0].distance < inner[1].distance { inner[0] } else { inner[1] };
        for _ in 0..ARC_STEPS {
            let width = golden * (high - low);
            if inner[0].distance < inner[1].distance {
                high = low + width;
                inner = [at(high - golden * width), inner[0]];
            } else {
                low = high - width;
                inner = [inner[1], at(low + golden * width)];
            }
            best = inner.into_iter().chain([best]).fold(best, |a, b| if b.distance < a.distance { b } else { a });
        }
        let ends = [at((t - reach).max(0.0)), at((t + reach).min(1.0))];
        ends.into_iter().chain([best]).fold(stay, |a, b| if b.distance < a.distance { b } else { a })
    }

    fn distance(&self, sample: &Sample, cell: usize, u: [f64; 2]) -> f64 {
        norm(sub(self.bezier.jet(cell, u).value, sample.point))
    }
}
