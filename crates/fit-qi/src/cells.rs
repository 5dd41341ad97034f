//! Cells of one level with the sums of their points.

use std::ops::Range;

use fit_ls::{CellSums, PointBox, SortedPoints, box_sums};
use rayon::prelude::*;
use thb_core::{Cell, Extraction, HierarchicalSpace, KnotVector, unravel};

use crate::Error;
use crate::order::MortonOrder;
use crate::region::Region;
use crate::span::Spans;

/// Marks a cell whose points have not been summed.
const NOT_SUMMED: u32 = u32::MAX;

/// The cells of a level that hold points. Each cell's points are summed once, when a local problem first needs them.
#[derive(Debug)]
pub(crate) struct LevelCells<const D: usize> {
    pub(crate) level: usize,
    pub(crate) knots: [KnotVector; D],
    pub(crate) spans: [Spans; D],
    /// Codes of the cells with points, increasing.
    codes: Vec<u64>,
    /// First point of each cell, and the number of points.
    starts: Vec<usize>,
    /// Number of each cell's sums, or `NOT_SUMMED`.
    slots: Vec<u32>,
    sums: Vec<f64>,
    layout: Layout<D>,
    /// Number of points that were summed.
    pub(crate) summed: usize,
}

/// How the sums of a cell are stored, in the B-splines of the level.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Layout<const D: usize> {
    pub(crate) degree: [usize; D],
    /// Number of right-hand sides.
    pub(crate) columns: usize,
}

/// The sums of a cell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sums<'a> {
    /// `Σ ω β_i β_j`: for each pair of indices in each direction but the first one a full matrix of the first direction's,
    /// `(p_0 + 1)²`.
    pub(crate) products: &'a [f64],
    /// `Σ ω β_i x`, `(n_local, N)`.
    pub(crate) right: &'a [f64],
    /// `Σ ω`, `Σ ω t_d`, `Σ ω t_d t_e` for d ≤ e, with `t` across the cell from 0 to 1.
    pub(crate) spread: &'a [f64],
}

impl<const D: usize> Layout<D> {
    /// Number of pairs of indices in the directions but the first.
    pub(crate) fn outer_pairs(&self) -> usize {
        self.degree[1..].iter().map(|p| (p + 1) * (p + 2) / 2).product()
    }

    pub(crate) fn n_local(&self) -> usize {
        self.degree.iter().map(|p| p + 1).product()
    }

    fn parts(&self) -> [usize; 3] {
        let inner = (self.degree[0] + 1).pow(2);
        [self.outer_pairs() * inner, self.n_local() * self.columns, 1 + D + D * (D + 1) / 2]
    }

    fn stride(&self) -> usize {
        self.parts().iter().sum()
    }
}

impl<const D: usize> LevelCells<D> {
    pub(crate) fn new(
        level: usize,
        space: &HierarchicalSpace<D>,
        order: &MortonOrder<D>,
        layout: Layout<D>,
    ) -> Result<Self, Error> {
        let (mut knots, mut spans) = (Vec::with_capacity(D), Vec::with_capacity(D));
        for d in 0..D {
            knots.push(space.knots(level, d)?.clone());
            spans.push(Spans::new(&knots[d])?);
        }
        let mut spans = spans.into_iter();
        let (codes, starts) = order.occupied(level);
        Ok(Self {
            level,
            knots: std::array::from_fn(|d| knots[d].clone()),
            spans: take_all(&mut spans)?,
            slots: vec![NOT_SUMMED; codes.len()],
            codes,
            starts,
            sums: Vec::new(),
            layout,
            summed: 0,
        })
    }

    /// The cells of a region that hold points: their numbers, and their places in the region.
    pub(crate) fn within(&self, order: &MortonOrder<D>, region: &Region<D>, out: &mut Vec<(u32, [u32; D])>) {
        out.clear();
        for linear in 0..region.n_cells() {
            let place = unravel(linear, region.len);
            let index = std::array::from_fn(|d| region.span(&self.knots, d, place[d]) as u32);
            if let Some(cell) = self.find(order, index) {
                out.push((cell as u32, place.map(|i| i as u32)));
            }
        }
    }

    /// The number of a cell, if it holds points.
    pub(crate) fn find(&self, order: &MortonOrder<D>, index: [u32; D]) -> Option<usize> {
        self.codes.binary_search(&order.cell_code(self.level, index)).ok()
    }

    /// The points of a cell, by their places.
    pub(crate) fn points(&self, cell: usize) -> Range<usize> {
        self.starts[cell]..self.starts[cell + 1]
    }

    /// Sums the points of cells, given by number and span per direction, unless that was done before.
    pub(crate) fn sum(
        &mut self,
        points: &SortedPoints<D>,
        needed: impl Iterator<Item = (u32, [usize; D])>,
    ) -> Result<(), Error> {
        let stride = self.layout.stride();
        let first = self.sums.len() / stride;
        let mut fresh: Vec<(u32, [usize; D])> = Vec::new();
        for (cell, span) in needed {
            let slot = &mut self.slots[cell as usize];
            if *slot == NOT_SUMMED {
                *slot = (first + fresh.len()) as u32;
                fresh.push((cell, span));
            }
        }
        let mut boxes = Vec::with_capacity(fresh.len());
        for &(cell, span) in &fresh {
            let (mut lower, mut upper) = ([0.0; D], [0.0; D]);
            for d in 0..D {
                let breaks = self.knots[d].breaks();
                (lower[d], upper[d]) = (breaks[span[d]], breaks[span[d] + 1]);
            }
            let points = self.points(cell as usize);
            self.summed += points.len();
            boxes.push(PointBox { points, lower, upper });
        }
        let moments = box_sums(points, self.layout.degree, &boxes)?;
        self.sums.resize((first + fresh.len()) * stride, 0.0);
        let (layout, spans) = (self.layout, &self.spans);
        self.sums[first * stride..]
            .par_chunks_exact_mut(stride)
            .zip(fresh)
            .zip(moments)
            .for_each_init(Scratch::default, |scratch, ((target, (_, span)), moments)| {
                layout.convert(spans, span, moments, scratch, target)
            });
        Ok(())
    }

    /// The sums of a cell that was summed.
    #[inline(always)]
    pub(crate) fn sums(&self, cell: u32) -> Sums<'_> {
        let stride = self.layout.stride();
        let [products, right, _] = self.layout.parts();
        let all = &self.sums[self.slots[cell as usize] as usize * stride..][..stride];
        let (first, rest) = all.split_at(products);
        let (second, third) = rest.split_at(right);
        Sums { products: first, right: second, spread: third }
    }
}

/// Memory of a conversion.
#[derive(Default)]
struct Scratch {
    source: Vec<f64>,
    target: Vec<f64>,
    pull_back: Vec<f64>,
}

impl<const D: usize> Layout<D> {
    /// Writes a cell's sums in the B-splines of the level.
    fn convert(
        &self,
        spans: &[Spans; D],
        span: [usize; D],
        CellSums { moments, right }: CellSums,
        scratch: &mut Scratch,
        out: &mut [f64],
    ) {
        let [n_products, n_right, _] = self.parts();
        let (products, rest) = out.split_at_mut(n_products);
        let (right_out, spread) = rest.split_at_mut(n_right);
        self.spread(&moments, spread);
        let of: [Option<&crate::span::Span>; D] = std::array::from_fn(|d| spans[d].get(span[d]));
        let Some(of) = all_of(of) else { return };
        // Direction 0: from moments to full matrices, one per moment of the other directions.
        let (orders, inner) = (self.degree.map(|p| p + 1), self.degree[0] + 1);
        let per_line = 2 * inner - 1;
        scratch.source.clear();
        for line in moments.chunks_exact(per_line) {
            for i in 0..inner {
                for j in 0..inner {
                    let row = &of[0].products[crate::span::pair(inner, i, j) * per_line..][..per_line];
                    scratch.source.push(row.iter().zip(line).map(|(a, b)| a * b).sum());
                }
            }
        }
        // The others: from moments to pairs, whole matrices at a time.
        let mut width = inner * inner;
        for d in 1..D {
            let (n_moments, n_pairs) = (2 * orders[d] - 1, orders[d] * (orders[d] + 1) / 2);
            scratch.target.clear();
            scratch.target.resize(scratch.source.len() / n_moments * n_pairs, 0.0);
            let blocks = scratch.source.chunks_exact(n_moments * width);
            for (source, target) in blocks.zip(scratch.target.chunks_exact_mut(n_pairs * width)) {
                for (target, weights) in target.chunks_exact_mut(width).zip(of[d].products.chunks_exact(n_moments)) {
                    for (source, &weight) in source.chunks_exact(width).zip(weights) {
                        target.iter_mut().zip(source).for_each(|(t, s)| *t += weight * s);
                    }
                }
            }
            std::mem::swap(&mut scratch.source, &mut scratch.target);
            width *= n_pairs;
        }
        products.copy_from_slice(&scratch.source);
        let mut right = right;
        let cell = Cell {
            lower: [0.0; D],
            upper: [1.0; D],
            functions: &[],
            extraction: Extraction::Identity,
            bezier: std::array::from_fn(|d| of[d].bezier.as_slice()),
            degree: self.degree,
        };
        cell.pull_back(&mut right, self.columns, &mut scratch.pull_back);
        right_out.copy_from_slice(&right);
    }

    /// Sums of products of parameters from moments of Bernstein polynomials of degree `n`: `t = Σ k/n B_k` and
    /// `t² = Σ k (k − 1) / (n (n − 1)) B_k`.
    fn spread(&self, moments: &[f64], out: &mut [f64]) {
        let orders = self.degree.map(|p| 2 * p + 1);
        for (linear, moment) in moments.iter().enumerate() {
            let index = unravel(linear, orders);
            let t: [f64; D] = std::array::from_fn(|d| index[d] as f64 / (2 * self.degree[d]) as f64);
            let mut at = 1 + D;
            out[0] += moment;
            for d in 0..D {
                out[1 + d] += moment * t[d];
                for e in d..D {
                    let n = 2 * self.degree[d];
                    let square = (index[d] * index[d].saturating_sub(1)) as f64 / (n * (n - 1)) as f64;
                    out[at] += moment * if e == d { square } else { t[d] * t[e] };
                    at += 1;
                }
            }
        }
    }
}

/// All of an array of options, or nothing.
pub(crate) fn all_of<T: Copy, const D: usize>(options: [Option<T>; D]) -> Option<[T; D]> {
    let first = options[0]?;
    options.iter().all(Option::is_some).then(|| options.map(|option| option.unwrap_or(first)))
}

/// As many things as there are directions.
fn take_all<T, const D: usize>(things: &mut impl Iterator<Item = T>) -> Result<[T; D], Error> {
    let all: Vec<T> = things.take(D).collect();
    let given = all.len();
    all.try_into().map_err(|_| thb_core::Error::Shape { what: "directions", given, expected: D }.into())
}
