//! MARK by functions (Imperatore 2024, §3.2.2 and Algorithm 4).

use adaptive::Estimate;
use fit_ls::SortedPoints;
use thb_core::{CellSpace, HierarchicalSpace, unravel};

use crate::cells::LevelCells;
use crate::order::MortonOrder;
use crate::region::Region;

/// The leaf cells of their own level in the supports of functions that have an error beyond the tolerance and, in each of
/// `splits` equal parts per direction of the support, their share of `needed` points. By decreasing largest error, equal
/// ones by number.
pub(crate) fn mark_functions<const D: usize>(
    space: &HierarchicalSpace<D>,
    estimate: Estimate<'_>,
    tolerance: f64,
    (order, levels): (&MortonOrder<D>, &[LevelCells<D>]),
    points: &SortedPoints<D>,
    needed: usize,
    splits: [usize; D],
) -> Vec<usize> {
    let mut worst = vec![0.0_f64; space.n_functions()];
    for (cell, ends) in estimate.offsets.windows(2).enumerate() {
        let largest = estimate.errors[ends[0]..ends[1]].iter().copied().fold(0.0, f64::max);
        if largest > tolerance {
            for &function in space.cell(cell).functions {
                worst[function as usize] = worst[function as usize].max(largest);
            }
        }
    }
    let mut of_cell = vec![0.0_f64; space.n_cells()];
    for level in 0..space.n_levels() {
        let cells = &levels[level];
        let counts = space.function_counts(level);
        let first = space.first_of_level(level);
        for (k, &function) in space.active_functions(level).iter().enumerate() {
            let error = worst[first + k];
            if error <= tolerance {
                continue;
            }
            let support = Region::support(&cells.knots, unravel(function as usize, counts));
            if !holds(cells, order, &support, points, needed, splits) {
                continue;
            }
            for linear in 0..support.n_cells() {
                let place = unravel(linear, support.len);
                let index = std::array::from_fn(|d| support.span(&cells.knots, d, place[d]) as u32);
                let leaf = space.mesh().find(level, index).and_then(|node| space.cell_of_node(node));
                if let Some(cell) = leaf {
                    of_cell[cell] = of_cell[cell].max(error);
                }
            }
        }
    }
    let mut marked: Vec<usize> = (0..space.n_cells()).filter(|&cell| of_cell[cell] > 0.0).collect();
    marked.sort_by(|&a, &b| of_cell[b].total_cmp(&of_cell[a]).then(a.cmp(&b)));
    marked
}

/// Whether each part of a support holds its share of the points.
fn holds<const D: usize>(
    cells: &LevelCells<D>,
    order: &MortonOrder<D>,
    support: &Region<D>,
    points: &SortedPoints<D>,
    needed: usize,
    splits: [usize; D],
) -> bool {
    let n_parts: usize = splits.iter().product();
    let share = needed.div_ceil(n_parts);
    let mut counts = vec![0_usize; n_parts];
    let mut occupied = Vec::new();
    cells.within(order, support, &mut occupied);
    // Ends of the spans from the start of the support, in parameters.
    let ends: [Vec<f64>; D] = std::array::from_fn(|d| {
        let breaks = cells.knots[d].breaks();
        let mut ends = vec![0.0];
        for place in 0..support.len[d] {
            let span = support.span(&cells.knots, d, place);
            ends.push(ends[place] + breaks[span + 1] - breaks[span]);
        }
        ends
    });
    let part = |d: usize, distance: f64| {
        let whole = ends[d][support.len[d]];
        ((distance / whole * splits[d] as f64) as usize).min(splits[d] - 1)
    };
    for (cell, place) in occupied {
        let place = place.map(|i| i as usize);
        let range = cells.points(cell as usize);
        let corner = |upper: usize| -> [usize; D] { std::array::from_fn(|d| part(d, ends[d][place[d] + upper])) };
        let linear = |index: [usize; D]| (0..D).rev().fold(0, |at, d| at * splits[d] + index[d]);
        if splits == [1; D] || corner(0) == corner(1) {
            counts[linear(corner(0))] += range.len();
            continue;
        }
        for at in range {
            let u = points.parameter(at);
            let index = std::array::from_fn(|d| {
                let lower = cells.knots[d].breaks()[support.span(&cells.knots, d, place[d])];
                part(d, ends[d][place[d]] + u[d] - lower)
            });
            counts[linear(index)] += 1;
        }
    }
    counts.iter().all(|&count| count >= share)
}
