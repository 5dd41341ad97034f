//! The two loops over points: sums for the normal equations, and residuals. Both work on blocks of points of one cell,
//! with vector instructions chosen at run time; partial sums have a fixed width, so results do not depend on them.

use std::ops::Range;

use pulp::NullaryFnOnce;
use thb_core::BezierMap;
use thb_core::bernstein::{BLOCK, Block, LANES, add_products, total, values_block};

use crate::SortedPoints;

/// Sums of one cell's points in Bernstein form: moments of degree `2p` and right-hand sides of degree `p`.
#[derive(Clone, Debug, Default)]
pub(crate) struct CellSums {
    /// `Σ ω B^{2p}_k`, `∏(2p_d + 1)` numbers, first direction fastest.
    pub(crate) moments: Vec<f64>,
    /// `Σ ω B^p_i x`, `(n_local, N)`.
    pub(crate) right: Vec<f64>,
}

impl CellSums {
    /// Adds the sums of further points of the same cell.
    pub(crate) fn merge(&mut self, other: &Self) {
        self.moments.iter_mut().zip(&other.moments).for_each(|(a, b)| *a += b);
        self.right.iter_mut().zip(&other.right).for_each(|(a, b)| *a += b);
    }
}

/// Sums over the points of a range, all in one cell with the given corners.
pub(crate) fn sums<const D: usize>(
    points: &SortedPoints<D>,
    range: Range<usize>,
    degree: [usize; D],
    lower: [f64; D],
    upper: [f64; D],
) -> CellSums {
    let n_moments = degree.iter().map(|p| 2 * p + 1).product();
    let n_local: usize = degree.iter().map(|p| p + 1).product();
    let mut moments = vec![[0.0; LANES]; n_moments];
    let mut right = vec![[0.0; LANES]; n_local * points.dim()];
    let mut scratch = Scratch::new(degree, points.dim());
    let (corners, scratch) = ((lower, upper), &mut scratch);
    pulp::Arch::new().dispatch(Sums { points, range, degree, corners, scratch, moments: &mut moments, right: &mut right });
    CellSums { moments: moments.iter().map(total).collect(), right: right.iter().map(total).collect() }
}

/// Distances of the points of a range, all in one cell, to the cell's polynomial.
pub(crate) fn distances<const D: usize>(
    points: &SortedPoints<D>,
    range: Range<usize>,
    map: &BezierMap<D>,
    cell: usize,
    out: &mut [f64],
) {
    let mut scratch = Scratch::new(map.degree(), points.dim());
    pulp::Arch::new().dispatch(Distances { points, range, map, cell, scratch: &mut scratch, out });
}

/// Arguments of the loop of [`sums`].
///
/// PERF: types instead of closures, whose bodies are too large to be inlined into the functions that `pulp` compiles for
/// wide vectors; bench `assembly`.
struct Sums<'a, const D: usize> {
    points: &'a SortedPoints<D>,
    range: Range<usize>,
    degree: [usize; D],
    corners: ([f64; D], [f64; D]),
    scratch: &'a mut Scratch<D>,
    moments: &'a mut [[f64; LANES]],
    right: &'a mut [[f64; LANES]],
}

impl<const D: usize> NullaryFnOnce for Sums<'_, D> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        sums_inlined(self.points, self.range, self.degree, self.corners, self.scratch, self.moments, self.right);
    }
}

/// Arguments of the loop of [`distances`].
struct Distances<'a, const D: usize> {
    points: &'a SortedPoints<D>,
    range: Range<usize>,
    map: &'a BezierMap<D>,
    cell: usize,
    scratch: &'a mut Scratch<D>,
    out: &'a mut [f64],
}

impl<const D: usize> NullaryFnOnce for Distances<'_, D> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        distances_inlined(self.points, self.range, self.map, self.cell, self.scratch, self.out);
    }
}

struct Scratch<const D: usize> {
    t: [Block; D],
    /// Values of degree 2p, one list per direction.
    double: [Vec<Block>; D],
    /// Values of degree p, one list per direction, and two more blocks.
    basis: Vec<Block>,
    columns: Vec<Block>,
    weight: Block,
    product: Block,
}

impl<const D: usize> Scratch<D> {
    fn new(degree: [usize; D], dim: usize) -> Self {
        let zero = [0.0; BLOCK];
        Self {
            t: [zero; D],
            double: degree.map(|p| vec![zero; 2 * p + 1]),
            basis: vec![zero; degree.iter().map(|p| p + 1).sum::<usize>() + 2],
            columns: vec![zero; dim],
            weight: zero,
            product: zero,
        }
    }

    /// Loads local parameters of up to `BLOCK` points from `start` and returns their number rounded up to whole vectors.
    #[inline(always)]
    fn load(
        &mut self,
        points: &SortedPoints<D>,
        start: usize,
        count: usize,
        (lower, upper): ([f64; D], [f64; D]),
    ) -> usize {
        let len = count.next_multiple_of(LANES);
        for d in 0..D {
            let inverse = 1.0 / (upper[d] - lower[d]);
            let t = &mut self.t[d];
            for (target, u) in t[..count].iter_mut().zip(&points.parameters[d][start..start + count]) {
                *target = (u - lower[d]) * inverse;
            }
            t[count..len].fill(0.0);
        }
        for (target, column) in self.columns.iter_mut().zip(&points.points) {
            target[..count].copy_from_slice(&column[start..start + count]);
            target[count..len].fill(0.0);
        }
        len
    }
}

#[inline(always)]
fn sums_inlined<const D: usize>(
    points: &SortedPoints<D>,
    range: Range<usize>,
    degree: [usize; D],
    corners: ([f64; D], [f64; D]),
    scratch: &mut Scratch<D>,
    moments: &mut [[f64; LANES]],
    right: &mut [[f64; LANES]],
) {
    for start in range.clone().step_by(BLOCK) {
        let count = BLOCK.min(range.end - start);
        let len = scratch.load(points, start, count, corners);
        match &points.weights {
            Some(weights) => scratch.weight[..count].copy_from_slice(&weights[start..start + count]),
            None => scratch.weight[..count].fill(1.0),
        }
        scratch.weight[count..len].fill(0.0);
        for d in 0..D {
            values_block(2 * degree[d], &scratch.t[d], len, &mut scratch.double[d]);
        }
        let inner = 2 * degree[0] + 1;
        for (line, sums) in moments.chunks_exact_mut(inner).enumerate() {
            scratch.product[..len].copy_from_slice(&scratch.weight[..len]);
            let mut index = line;
            for d in 1..D {
                multiply(&mut scratch.product, &scratch.double[d][index % (2 * degree[d] + 1)], len);
                index /= 2 * degree[d] + 1;
            }
            for (row, sum) in scratch.double[0].iter().zip(sums) {
                add_products(&scratch.product, row, len, sum);
            }
        }
        // The values of degree 2p are done with; reuse their blocks for those of degree p.
        for d in 0..D {
            values_block(degree[d], &scratch.t[d], len, &mut scratch.double[d]);
        }
        let n = scratch.columns.len();
        let inner = degree[0] + 1;
        for (line, sums) in right.chunks_exact_mut(inner * n).enumerate() {
            for k in 0..n {
                scratch.product[..len].copy_from_slice(&scratch.weight[..len]);
                multiply(&mut scratch.product, &scratch.columns[k], len);
                let mut index = line;
                for d in 1..D {
                    multiply(&mut scratch.product, &scratch.double[d][index % (degree[d] + 1)], len);
                    index /= degree[d] + 1;
                }
                for i in 0..inner {
                    add_products(&scratch.product, &scratch.double[0][i], len, &mut sums[i * n + k]);
                }
            }
        }
    }
}

#[inline(always)]
fn multiply(product: &mut Block, factor: &Block, len: usize) {
    for (a, b) in product[..len].iter_mut().zip(&factor[..len]) {
        *a *= b;
    }
}

#[inline(always)]
fn distances_inlined<const D: usize>(
    points: &SortedPoints<D>,
    range: Range<usize>,
    map: &BezierMap<D>,
    cell: usize,
    scratch: &mut Scratch<D>,
    out: &mut [f64],
) {
    let corners = map.cell_box(cell);
    let mut image = vec![[0.0; BLOCK]; points.dim()];
    for (start, target) in range.clone().step_by(BLOCK).zip(out.chunks_mut(BLOCK)) {
        let len = scratch.load(points, start, target.len(), corners);
        map.points_block(cell, &scratch.t, len, &mut scratch.basis, &mut image);
        let squared = &mut scratch.product;
        squared[..len].fill(0.0);
        for (value, column) in image.iter().zip(&scratch.columns) {
            for b in 0..len {
                let difference = value[b] - column[b];
                squared[b] += difference * difference;
            }
        }
        for (distance, s) in target.iter_mut().zip(squared.iter()) {
            *distance = s.sqrt();
        }
    }
}
