//! Regions Ω_j: boxes of cells of a level.

use std::ops::Range;

use thb_core::KnotVector;

/// A box of cells of a level, by the first span and the number of spans per direction. In periodic directions spans are
/// counted modulo their number, and a region is cut open where its ends meet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Region<const D: usize> {
    pub(crate) start: [isize; D],
    pub(crate) len: [usize; D],
}

impl<const D: usize> Region<D> {
    /// The support of a B-spline.
    pub(crate) fn support(knots: &[KnotVector; D], function: [usize; D]) -> Self {
        let supports: [Range<usize>; D] = std::array::from_fn(|d| knots[d].support(function[d]));
        Self {
            start: std::array::from_fn(|d| supports[d].start as isize),
            len: std::array::from_fn(|d| supports[d].len()),
        }
    }

    /// The region with one more ring of cells, as far as the domain has them; `None` if it is the whole domain.
    pub(crate) fn grown(&self, knots: &[KnotVector; D]) -> Option<Self> {
        let mut grown = *self;
        for d in 0..D {
            let n = knots[d].n_spans();
            if knots[d].is_periodic() {
                let added = (n - self.len[d]).min(2);
                grown.len[d] += added;
                grown.start[d] -= isize::from(added == 2);
            } else {
                let (start, end) = (self.start[d] as usize, self.start[d] as usize + self.len[d]);
                let (start, end) = (start.saturating_sub(1), (end + 1).min(n));
                grown.start[d] = start as isize;
                grown.len[d] = end - start;
            }
        }
        (grown != *self).then_some(grown)
    }

    /// Number of cells.
    pub(crate) fn n_cells(&self) -> usize {
        self.len.iter().product()
    }

    /// The span at a place of the region.
    pub(crate) fn span(&self, knots: &[KnotVector; D], d: usize, place: usize) -> usize {
        (self.start[d] + place as isize).rem_euclid(knots[d].n_spans() as isize) as usize
    }

    /// Number, within the region, of the first B-spline that does not vanish on the span at a place.
    pub(crate) fn first_local(&self, knots: &[KnotVector; D], d: usize, place: usize) -> usize {
        if knots[d].is_periodic() {
            return place;
        }
        let start = self.start[d] as usize;
        knots[d].first_function(start + place) - knots[d].first_function(start)
    }

    /// Number of B-splines per direction that do not vanish on the region.
    pub(crate) fn n_local(&self, knots: &[KnotVector; D]) -> [usize; D] {
        std::array::from_fn(|d| self.first_local(knots, d, self.len[d] - 1) + knots[d].degree() + 1)
    }

    /// Where the support of a B-spline lies in the region that holds it: its first place and its number of spans.
    pub(crate) fn place_of(&self, knots: &[KnotVector; D], function: [usize; D]) -> ([usize; D], [usize; D]) {
        let support = Self::support(knots, function);
        (std::array::from_fn(|d| (support.start[d] - self.start[d]) as usize), support.len)
    }

    /// Number, within the region, of a B-spline whose support it holds.
    pub(crate) fn local_of(&self, knots: &[KnotVector; D], function: [usize; D]) -> [usize; D] {
        std::array::from_fn(|d| {
            let knots = &knots[d];
            if knots.is_periodic() {
                (knots.support(function[d]).start as isize - self.start[d]) as usize + knots.degree()
            } else {
                function[d] - knots.first_function(self.start[d] as usize)
            }
        })
    }
}
