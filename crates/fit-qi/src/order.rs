//! Points along a Morton curve: those of any cell of any level lie side by side.

use fit_ls::SortedPoints;
use rayon::prelude::*;
use thb_core::{CellSpace, HierarchicalSpace, KnotVector, MAX_LEVELS};

use crate::Error;

/// Points of one parallel task.
const CHUNK: usize = 1 << 12;

/// Codes of cells and the codes of sorted points. The code of a cell is the number of its cell of level 0, followed by one
/// bit per direction for each further level; leaf cells come in the same order.
#[derive(Clone, Debug)]
pub(crate) struct MortonOrder<const D: usize> {
    knots: [KnotVector; D],
    /// The level of the cells whose codes points have.
    depth: usize,
    /// Codes of the points, increasing.
    codes: Vec<u64>,
}

impl<const D: usize> MortonOrder<D> {
    /// Sorts the points by the level-0 knots of a space, and divides them among its cells.
    pub(crate) fn sort(space: &HierarchicalSpace<D>, points: &mut SortedPoints<D>) -> Result<Self, Error> {
        let mut knots = Vec::with_capacity(D);
        for d in 0..D {
            knots.push(space.knots(0, d)?.clone());
        }
        let knots: [KnotVector; D] = std::array::from_fn(|d| knots[d].clone());
        let roots: u64 = knots.iter().map(|k| k.n_spans() as u64).product();
        // The bits that the number of a root leaves.
        let depth = (roots.leading_zeros() as usize / D).min(MAX_LEVELS - 1);
        let mut order = Self { knots, depth, codes: Vec::new() };
        let mut places: Vec<(u64, u32)> = (0..points.len() as u32).map(|at| (0, at)).collect();
        let set_code = |(code, at): &mut (u64, u32)| {
            *code = order.code_of_point(points.parameter(*at as usize)).map_err(|source| (*at, source))?;
            Ok(())
        };
        // Of several errors the first, whichever thread is faster.
        let outside = places.par_iter_mut().with_min_len(CHUNK).find_map_first(|place| set_code(place).err());
        if let Some((at, source)) = outside {
            return Err(fit_ls::Error::Parameter { index: points.order()[at as usize] as usize, source }.into());
        }
        // Places differ, so the order does not depend on how it is found.
        places.par_sort_unstable();
        let from: Vec<u32> = places.iter().map(|&(_, at)| at).collect();
        order.codes = places.into_iter().map(|(code, _)| code).collect();
        let offsets = order.offsets(space)?;
        points.rearrange(&from, offsets)?;
        Ok(order)
    }

    /// Whether a space has the knots that the points are sorted by.
    pub(crate) fn is_for(&self, space: &HierarchicalSpace<D>) -> bool {
        (0..D).all(|d| space.knots(0, d).is_ok_and(|knots| *knots == self.knots[d]))
    }

    /// The first point of each leaf cell, and the number of points.
    pub(crate) fn offsets(&self, space: &HierarchicalSpace<D>) -> Result<Vec<usize>, Error> {
        let deepest = space.n_levels() - 1;
        if deepest > self.depth {
            return Err(thb_core::Error::TooManyLevels { given: deepest, limit: self.depth }.into());
        }
        let mut offsets = Vec::with_capacity(space.n_cells() + 1);
        let mut at = 0;
        for cell in 0..space.n_cells() {
            let node = space.node(cell);
            let level = space.mesh().level(node);
            let first = self.cell_code(level, space.mesh().cell_index(node)) << self.shift(level);
            at += self.codes[at..].partition_point(|&code| code < first);
            offsets.push(at);
        }
        offsets.push(self.codes.len());
        Ok(offsets)
    }

    /// Cells of a level that hold points: their codes, increasing, and the first point of each; one more at the end.
    pub(crate) fn occupied(&self, level: usize) -> (Vec<u64>, Vec<usize>) {
        let shift = self.shift(level);
        let (mut codes, mut starts) = (Vec::new(), Vec::new());
        for (at, code) in self.codes.iter().map(|code| code >> shift).enumerate() {
            if codes.last() != Some(&code) {
                codes.push(code);
                starts.push(at);
            }
        }
        starts.push(self.codes.len());
        (codes, starts)
    }

    /// The code of a cell of a level.
    pub(crate) fn cell_code(&self, level: usize, index: [u32; D]) -> u64 {
        let root = (0..D).rev().fold(0, |code, d| code * self.knots[d].n_spans() as u64 + u64::from(index[d] >> level));
        (0..level).rev().fold(root, |code, bit| {
            let child = (0..D).fold(0, |child, d| child | u64::from((index[d] >> bit) & 1) << d);
            code << D | child
        })
    }

    fn shift(&self, level: usize) -> usize {
        D * (self.depth - level)
    }

    fn code_of_point(&self, u: [f64; D]) -> Result<u64, thb_core::Error> {
        let mut index = [0_u32; D];
        for (direction, knots) in self.knots.iter().enumerate() {
            let value = u[direction];
            let (lower, upper) = knots.domain();
            let span = if value == upper { Some(knots.n_spans() - 1) } else { knots.span_at(value) };
            let span = span.ok_or(thb_core::Error::OutsideDomain { value, direction, lower, upper })?;
            let (mut a, mut b) = (knots.breaks()[span], knots.breaks()[span + 1]);
            index[direction] = span as u32;
            // Midpoints as in [`KnotVector::refined`], to the last bit.
            for _ in 0..self.depth {
                let middle = a + 0.5 * (b - a);
                let right = value >= middle;
                index[direction] = index[direction] << 1 | u32::from(right);
                (a, b) = if right { (middle, b) } else { (a, middle) };
            }
        }
        Ok(self.cell_code(self.depth, index))
    }
}
