//! The domain cut into boxes, so that tensor-product patches need few control points.

use std::collections::BTreeMap;

use thb_core::{CellSpace, HierarchicalSpace};

use crate::model::ModelErrorKind;

/// A box in cells of the finest level, upper corner exclusive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct GridBox {
    pub(super) lower: [u32; 2],
    pub(super) upper: [u32; 2],
}

/// What a face costs beyond its control points. Faces are few and large in a model that people work with, so a cut must
/// save that many points. With 0 the patches would follow every cell; a large value gives fewer faces, larger files.
const FACE_COST: usize = 250;

/// A part of the domain, with the cells that overlap it.
struct Region {
    bounds: GridBox,
    cells: Vec<GridBox>,
}

/// A cell boundary inside a region: its weight as a knot, and how far it reaches in the other direction.
struct Line {
    at: u32,
    multiplicity: usize,
    from: u32,
    to: u32,
}

struct Cut {
    direction: usize,
    at: u32,
    cost: usize,
    /// Distance to the middle of the region: of equal cuts the most central one is taken.
    offset: u32,
}

/// Cuts the domain along cell boundaries until each box has at most `limit` control points, and further where a cut saves
/// more than [`FACE_COST`]: at each step the cut after which both parts need the fewest. A patch of one cell has
/// (p + 1)(q + 1) points whatever the limit. No cut runs through one of the boxes `whole`, even where that leaves more than the
/// limit.
///
/// A cut may run through a coarse cell: the map is one polynomial there, and any part of it exact.
pub(super) fn partition(
    space: &HierarchicalSpace<2>,
    limit: usize,
    whole: &[GridBox],
) -> Result<Vec<GridBox>, ModelErrorKind> {
    let finest = space.n_levels() - 1;
    let grid = space.mesh().grid(finest).map(|n| n as u32);
    let cells = space
        .mesh()
        .leaves()
        .into_iter()
        .map(|leaf| {
            let (shift, index) = (finest - space.mesh().level(leaf), space.mesh().cell_index(leaf));
            GridBox { lower: index.map(|i| i << shift), upper: index.map(|i| (i + 1) << shift) }
        })
        .collect();
    let knots = KnotGrid::new(space)?;
    let mut stack = vec![Region { bounds: GridBox { lower: [0; 2], upper: grid }, cells }];
    let mut boxes = Vec::new();
    while let Some(region) = stack.pop() {
        let lines = [0, 1].map(|d| knots.lines(&region, d));
        let points = knots.points(&lines);
        let best = knots.best_cut(&region.bounds, &lines, whole).filter(|cut| cut.cost + FACE_COST < points);
        let cut = match best {
            None if points > limit => central_cut(&region.bounds, &lines, whole),
            best => best.map(|cut| (cut.direction, cut.at)),
        };
        match cut {
            Some((direction, at)) => stack.extend(region.cut(direction, at)),
            None => boxes.push(region.bounds),
        }
    }
    Ok(boxes)
}

/// The cut nearest to the middle, across the direction with more lines.
fn central_cut(bounds: &GridBox, lines: &[Vec<Line>; 2], whole: &[GridBox]) -> Option<(usize, u32)> {
    let more = usize::from(lines[1].len() > lines[0].len());
    [more, 1 - more].into_iter().find_map(|direction| {
        let middle = bounds.lower[direction].midpoint(bounds.upper[direction]);
        let allowed = lines[direction].iter().map(|line| line.at).filter(|&at| may_cut(bounds, whole, direction, at));
        allowed.min_by_key(|at| at.abs_diff(middle)).map(|at| (direction, at))
    })
}

/// Whether a cut across a region leaves the boxes in it whole.
fn may_cut(bounds: &GridBox, whole: &[GridBox], direction: usize, at: u32) -> bool {
    let inside = |b: &&GridBox| (0..2).all(|d| bounds.lower[d] <= b.lower[d] && b.upper[d] <= bounds.upper[d]);
    !whole.iter().filter(inside).any(|b| b.lower[direction] < at && at < b.upper[direction])
}

impl Region {
    /// Both parts, the upper one first.
    fn cut(self, direction: usize, at: u32) -> [Self; 2] {
        let part = |bounds: GridBox| {
            let overlaps = |c: &&GridBox| (0..2).all(|d| c.upper[d] > bounds.lower[d] && c.lower[d] < bounds.upper[d]);
            Self { bounds, cells: self.cells.iter().filter(overlaps).copied().collect() }
        };
        let (mut below, mut above) = (self.bounds, self.bounds);
        (below.upper[direction], above.lower[direction]) = (at, at);
        [part(above), part(below)]
    }
}

/// Degrees, and the knots of level 0 that count more than once.
struct KnotGrid {
    degree: [usize; 2],
    /// Multiplicity of breaks by index in the finest level; 1 for all others.
    multiplicity: [BTreeMap<u32, usize>; 2],
}

impl KnotGrid {
    fn new(space: &HierarchicalSpace<2>) -> Result<Self, ModelErrorKind> {
        let shift = space.n_levels() - 1;
        let mut multiplicity = [BTreeMap::new(), BTreeMap::new()];
        for (d, repeated) in multiplicity.iter_mut().enumerate() {
            let knots = space.knots(0, d)?;
            for (index, &at) in knots.breaks().iter().enumerate() {
                repeated.insert((index as u32) << shift, knots.knots().iter().filter(|&&k| k == at).count());
            }
        }
        Ok(Self { degree: space.degree(), multiplicity })
    }

    /// The boundaries in direction `d` of a region's cells that lie inside it, increasing.
    fn lines(&self, region: &Region, d: usize) -> Vec<Line> {
        let (bounds, other) = (region.bounds, 1 - d);
        let mut reach: BTreeMap<u32, (u32, u32)> = BTreeMap::new();
        for cell in &region.cells {
            for at in [cell.lower[d], cell.upper[d]] {
                if bounds.lower[d] < at && at < bounds.upper[d] {
                    let (from, to) = reach.entry(at).or_insert((u32::MAX, 0));
                    *from = (*from).min(cell.lower[other].max(bounds.lower[other]));
                    *to = (*to).max(cell.upper[other].min(bounds.upper[other]));
                }
            }
        }
        let multiplicity = |at| self.multiplicity[d].get(&at).copied().unwrap_or(1);
        reach.into_iter().map(|(at, (from, to))| Line { at, multiplicity: multiplicity(at), from, to }).collect()
    }

    fn points(&self, lines: &[Vec<Line>; 2]) -> usize {
        let count = |d: usize| self.degree[d] + 1 + lines[d].iter().map(|line| line.multiplicity).sum::<usize>();
        count(0).saturating_mul(count(1))
    }

    /// The cut after which both parts together need the fewest control points.
    ///
    /// A line of the cut's own direction survives in the part where it lies: the leaf cells tile the region, so where a
    /// cell ends its neighbour begins. A line of the other direction survives in the parts that it reaches into.
    fn best_cut(&self, bounds: &GridBox, lines: &[Vec<Line>; 2], whole: &[GridBox]) -> Option<Cut> {
        let mut best: Option<Cut> = None;
        for direction in 0..2 {
            let other = 1 - direction;
            let order = [self.degree[direction] + 1, self.degree[other] + 1];
            let along: usize = lines[direction].iter().map(|line| line.multiplicity).sum();
            let mut starts: Vec<_> = lines[other].iter().map(|line| (line.from, line.multiplicity)).collect();
            let mut ends: Vec<_> = lines[other].iter().map(|line| (line.to, line.multiplicity)).collect();
            starts.sort_unstable();
            ends.sort_unstable();
            let (mut starts, mut ends) = (starts.into_iter().peekable(), ends.into_iter().peekable());
            let (mut before, mut across) = (0, [0, lines[other].iter().map(|line| line.multiplicity).sum::<usize>()]);
            for line in &lines[direction] {
                while let Some((_, weight)) = starts.next_if(|(from, _)| *from < line.at) {
                    across[0] += weight;
                }
                while let Some((_, weight)) = ends.next_if(|(to, _)| *to <= line.at) {
                    across[1] -= weight;
                }
                let after = along - before - line.multiplicity;
                let points = |own: usize, cross: usize| (order[0] + own).saturating_mul(order[1] + cross);
                let cost = points(before, across[0]).saturating_add(points(after, across[1]));
                let offset = (line.at - bounds.lower[direction]).abs_diff(bounds.upper[direction] - line.at);
                let better = best.as_ref().is_none_or(|b| (cost, offset) < (b.cost, b.offset));
                if better && may_cut(bounds, whole, direction, line.at) {
                    best = Some(Cut { direction, at: line.at, cost, offset });
                }
                before += line.multiplicity;
            }
        }
        best
    }
}
