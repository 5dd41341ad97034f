//! The two loops over points: sums for the normal equations, and residuals. Both work on blocks of points of one cell,
//! with vector instructions chosen at run time. Each number has a fixed count of partial sums, and products are added
//! with one rounding on every machine, so that results do not depend on the width of its vectors.

use std::ops::Range;

use pulp::{Simd, WithSimd};
use thb_core::BezierMap;
use thb_core::bernstein::{BLOCK, Block, LANES, binomial, total};

use crate::SortedPoints;

/// What is summed over points: moments of factors, and right-hand sides of columns.
#[derive(Clone, Copy)]
pub(crate) struct Terms<'a, const D: usize> {
    /// Parameters, one array per direction.
    pub(crate) parameters: &'a [Vec<f64>; D],
    /// Factors of the matrices: one array per matrix. None at all: one matrix, with the weights as its factor.
    pub(crate) factors: &'a [Vec<f64>],
    /// Right-hand sides, one array per column.
    pub(crate) columns: &'a [Vec<f64>],
    /// Weights that multiply the columns; not used beside factors.
    pub(crate) weights: Option<&'a [f64]>,
}

impl<'a, const D: usize> Terms<'a, D> {
    /// The terms of weighted least squares.
    pub(crate) fn of(points: &'a SortedPoints<D>) -> Self {
        let SortedPoints { parameters, points, weights, .. } = points;
        Self { parameters, factors: &[], columns: points, weights: weights.as_deref() }
    }

    /// Number of matrices.
    pub(crate) fn n_matrices(&self) -> usize {
        self.factors.len().max(1)
    }
}

/// Sums of one cell's points in Bernstein form: moments of degree `2p` and right-hand sides of degree `p`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CellSums {
    /// `Σ ω B^{2p}_k`, `∏(2p_d + 1)` numbers, first direction fastest; one matrix after the other.
    pub moments: Vec<f64>,
    /// `Σ ω B^p_i x`, `(n_local, N)`.
    pub right: Vec<f64>,
}

impl CellSums {
    /// Adds the sums of further points of the same cell.
    pub(crate) fn merge(&mut self, other: &Self) {
        self.moments.iter_mut().zip(&other.moments).for_each(|(a, b)| *a += b);
        self.right.iter_mut().zip(&other.right).for_each(|(a, b)| *a += b);
    }
}

/// The loop of the sums with its memory, for one cell after the other.
pub(crate) struct Summation<const D: usize> {
    single: Orders<D>,
    double: Orders<D>,
    batch: Batch<D>,
    rows: Vec<Block>,
    /// First direction fastest, then the matrix.
    moments: Vec<[f64; LANES]>,
    /// First direction fastest, then the component.
    right: Vec<[f64; LANES]>,
}

impl<const D: usize> Summation<D> {
    /// For polynomials of a degree, points of a dimension, and a number of matrices.
    pub(crate) fn new(degree: [usize; D], dim: usize, matrices: usize) -> Self {
        let (single, double) = (Orders::new(degree), Orders::new(degree.map(|p| 2 * p)));
        let (n_moments, n_right) = (matrices * double.count(), dim * single.count());
        Self {
            batch: Batch::new(&double, dim, matrices),
            rows: vec![[0.0; BLOCK]; (n_moments / double.of[0]).max(n_right / single.of[0])],
            moments: vec![[0.0; LANES]; n_moments],
            right: vec![[0.0; LANES]; n_right],
            single,
            double,
        }
    }

    /// Sums over the points of a range, all in one cell with the given corners.
    pub(crate) fn of(
        &mut self,
        terms: Terms<'_, D>,
        range: Range<usize>,
        lower: [f64; D],
        upper: [f64; D],
    ) -> CellSums {
        self.moments.fill([0.0; LANES]);
        self.right.fill([0.0; LANES]);
        pulp::Arch::new().dispatch(Sums { terms, range, corners: (lower, upper), memory: self });
        let (n, inner) = (terms.columns.len(), self.single.of[0]);
        let mut right = Vec::with_capacity(self.right.len());
        for line in self.right.chunks_exact(inner * n) {
            for i in 0..inner {
                right.extend((0..n).map(|k| total(&line[k * inner + i])));
            }
        }
        let (matrices, inner) = (terms.n_matrices(), self.double.of[0]);
        // PERF: an iterator over lines of all matrices has no known length, and the vector would grow by and by.
        let mut moments = Vec::with_capacity(self.moments.len());
        for matrix in 0..matrices {
            for line in self.moments.chunks_exact(inner).skip(matrix).step_by(matrices) {
                moments.extend(line.iter().map(total));
            }
        }
        CellSums { moments, right }
    }
}

/// Distances of the points of a range, all in one cell, to the cell's polynomial.
pub(crate) fn distances<const D: usize>(
    points: &SortedPoints<D>,
    range: Range<usize>,
    map: &BezierMap<D>,
    cell: usize,
    out: &mut [f64],
) {
    pulp::Arch::new().dispatch(Distances { points, range, map, cell, out });
}

/// Numbers of Bernstein polynomials per direction, with their binomial coefficients.
struct Orders<const D: usize> {
    of: [usize; D],
    binomials: [Vec<f64>; D],
}

impl<const D: usize> Orders<D> {
    fn new(degree: [usize; D]) -> Self {
        Self { of: degree.map(|p| p + 1), binomials: degree.map(|p| (0..=p).map(|k| binomial(p, k)).collect()) }
    }

    fn count(&self) -> usize {
        self.of.iter().product()
    }
}

/// Up to `BLOCK` points of a cell: parameters across the cell (0 to 1), values of Bernstein polynomials, coordinates.
/// Beyond the last point everything is zero or multiplied by zero.
struct Batch<const D: usize> {
    t: [Block; D],
    basis: [Vec<Block>; D],
    columns: Vec<Block>,
    factors: Vec<Block>,
}

impl<const D: usize> Batch<D> {
    fn new(orders: &Orders<D>, dim: usize, matrices: usize) -> Self {
        let zero = [0.0; BLOCK];
        Self {
            t: [zero; D],
            basis: orders.of.map(|n| vec![zero; n]),
            columns: vec![zero; dim],
            factors: vec![zero; matrices],
        }
    }

    /// Loads points and returns their number rounded up to whole vectors.
    #[inline(always)]
    fn load(&mut self, terms: Terms<'_, D>, range: Range<usize>, (lower, upper): ([f64; D], [f64; D])) -> usize {
        let len = range.len().next_multiple_of(LANES);
        for d in 0..D {
            let t = &mut self.t[d];
            copy(&terms.parameters[d][range.clone()], t, len, lower[d]);
            let inverse = 1.0 / (upper[d] - lower[d]);
            t[..len].iter_mut().for_each(|u| *u = (*u - lower[d]) * inverse);
        }
        for (target, column) in self.columns.iter_mut().zip(terms.columns) {
            copy(&column[range.clone()], target, len, 0.0);
        }
        len
    }

    /// Loads the factors, or weights that are multiplied into the columns.
    #[inline(always)]
    fn load_factors(&mut self, terms: Terms<'_, D>, range: Range<usize>, len: usize) {
        for (target, factor) in self.factors.iter_mut().zip(terms.factors) {
            copy(&factor[range.clone()], target, len, 0.0);
        }
        if !terms.factors.is_empty() {
            return;
        }
        let weight = &mut self.factors[0];
        let Some(weights) = terms.weights else {
            weight[..range.len()].fill(1.0);
            weight[range.len()..].fill(0.0);
            return;
        };
        copy(&weights[range], weight, len, 0.0);
        for column in &mut self.columns {
            column[..len].iter_mut().zip(&weight[..len]).for_each(|(x, w)| *x *= w);
        }
    }

    /// Values of all Bernstein polynomials.
    #[inline(always)]
    fn evaluate<S: Simd>(&mut self, simd: S, orders: &Orders<D>, len: usize) {
        for d in 0..D {
            bernstein(simd, &orders.binomials[d], &self.t[d], len, &mut self.basis[d][..orders.of[d]]);
        }
    }
}

/// Copies to the front of a block and fills up to `len`.
#[inline(always)]
fn copy(source: &[f64], target: &mut Block, len: usize, fill: f64) {
    match source.first_chunk::<BLOCK>() {
        // PERF: a copy of known length is no call; bench `assembly`.
        Some(whole) => *target = *whole,
        None => {
            target[..source.len()].copy_from_slice(source);
            target[source.len()..len].fill(fill);
        }
    }
}

/// The first `len` numbers of a block as vectors.
#[inline(always)]
fn vectors<S: Simd>(block: &Block, len: usize) -> &[S::f64s] {
    &S::as_simd_f64s(block).0[..len.min(BLOCK) / S::F64_LANES]
}

#[inline(always)]
fn vectors_mut<S: Simd>(block: &mut Block, len: usize) -> &mut [S::f64s] {
    &mut S::as_mut_simd_f64s(block).0[..len.min(BLOCK) / S::F64_LANES]
}

/// Values of Bernstein polynomials, `out[k] = C(p, k) t^k (1−t)^{p−k}`: powers only, so no cancellation.
#[inline(always)]
fn bernstein<S: Simd>(simd: S, binomials: &[f64], t: &Block, len: usize, out: &mut [Block]) {
    let one = simd.splat_f64s(1.0);
    for (at, &t) in vectors::<S>(t, len).iter().enumerate() {
        let mut power = one;
        for (row, &factor) in out.iter_mut().zip(binomials) {
            vectors_mut::<S>(row, len)[at] = simd.mul_f64s(simd.splat_f64s(factor), power);
            power = simd.mul_f64s(power, t);
        }
        let s = simd.sub_f64s(one, t);
        let mut power = one;
        for row in out.iter_mut().rev() {
            let value = &mut vectors_mut::<S>(row, len)[at];
            *value = simd.mul_f64s(*value, power);
            power = simd.mul_f64s(power, s);
        }
    }
}

/// Arguments of the loop of [`Summation::of`].
struct Sums<'a, const D: usize> {
    terms: Terms<'a, D>,
    range: Range<usize>,
    corners: ([f64; D], [f64; D]),
    memory: &'a mut Summation<D>,
}

impl<const D: usize> WithSimd for Sums<'_, D> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { terms, range, corners, memory } = self;
        let Summation { single, double, batch, rows, moments, right } = memory;
        for start in range.clone().step_by(BLOCK) {
            let part = start..range.end.min(start + BLOCK);
            let len = batch.load(terms, part.clone(), corners);
            batch.load_factors(terms, part, len);
            batch.evaluate(simd, double, len);
            let lines = outer_rows(simd, &batch.factors, &batch.basis, double.of, len, rows);
            add_products(simd, lines, &batch.basis[0][..double.of[0]], len, moments);
            batch.evaluate(simd, single, len);
            let lines = outer_rows(simd, &batch.columns, &batch.basis, single.of, len, rows);
            add_products(simd, lines, &batch.basis[0][..single.of[0]], len, right);
        }
    }
}

/// The products of each factor with the values of all directions but the first, factors fastest.
#[inline(always)]
fn outer_rows<'a, S: Simd, const D: usize>(
    simd: S,
    factors: &[Block],
    basis: &[Vec<Block>; D],
    orders: [usize; D],
    len: usize,
    rows: &'a mut [Block],
) -> &'a [Block] {
    let count = factors.len() * orders[1..].iter().product::<usize>();
    for (line, targets) in rows[..count].chunks_exact_mut(factors.len()).enumerate() {
        let mut rest = line;
        let values: [&[S::f64s]; D] = std::array::from_fn(|d| {
            // The first direction is no factor here; its first row only fills the place.
            let index = if d == 0 { 0 } else { rest % orders[d] };
            rest /= if d == 0 { 1 } else { orders[d] };
            vectors::<S>(&basis[d][index], len)
        });
        for (target, factor) in targets.iter_mut().zip(factors) {
            for (at, product) in vectors_mut::<S>(target, len).iter_mut().enumerate() {
                *product = vectors::<S>(factor, len)[at];
                for values in &values[1..] {
                    *product = simd.mul_f64s(*product, values[at]);
                }
            }
        }
    }
    &rows[..count]
}

/// Rows of a tile of products whose sums are held in registers.
const TILE_ROWS: usize = 3;

/// Columns of such a tile.
const TILE_COLUMNS: usize = 5;

/// Adds the products of each row with each column, summed over the points; `sums` has the columns fastest.
#[inline(always)]
fn add_products<S: Simd>(simd: S, rows: &[Block], columns: &[Block], len: usize, sums: &mut [[f64; LANES]]) {
    let stride = columns.len();
    // As equal parts as possible: a tile of one column would be bound by loads.
    let width = stride.div_ceil(stride.div_ceil(TILE_COLUMNS));
    for (rows, sums) in rows.chunks(TILE_ROWS).zip(sums.chunks_mut(TILE_ROWS * stride)) {
        for (part, columns) in columns.chunks(width).enumerate() {
            let sums = &mut sums[part * width..];
            match rows.len() {
                1 => add_tile_rows::<S, 1>(simd, rows, columns, len, sums, stride),
                2 => add_tile_rows::<S, 2>(simd, rows, columns, len, sums, stride),
                _ => add_tile_rows::<S, TILE_ROWS>(simd, rows, columns, len, sums, stride),
            }
        }
    }
}

#[inline(always)]
fn add_tile_rows<S: Simd, const R: usize>(
    simd: S,
    rows: &[Block],
    columns: &[Block],
    len: usize,
    sums: &mut [[f64; LANES]],
    stride: usize,
) {
    match columns.len() {
        1 => add_tile::<S, R, 1>(simd, rows, columns, len, sums, stride),
        2 => add_tile::<S, R, 2>(simd, rows, columns, len, sums, stride),
        3 => add_tile::<S, R, 3>(simd, rows, columns, len, sums, stride),
        4 => add_tile::<S, R, 4>(simd, rows, columns, len, sums, stride),
        _ => add_tile::<S, R, TILE_COLUMNS>(simd, rows, columns, len, sums, stride),
    }
}

#[inline(always)]
fn add_tile<S: Simd, const R: usize, const C: usize>(
    simd: S,
    rows: &[Block],
    columns: &[Block],
    len: usize,
    sums: &mut [[f64; LANES]],
    stride: usize,
) {
    let rows: [&[S::f64s]; R] = std::array::from_fn(|i| vectors::<S>(&rows[i], len));
    let columns: [&[S::f64s]; C] = std::array::from_fn(|j| vectors::<S>(&columns[j], len));
    // Partial sums are those of vectors of `LANES` numbers, on machines with shorter ones too.
    let groups = LANES / S::F64_LANES;
    for group in 0..groups {
        let mut tile = [[simd.splat_f64s(0.0); C]; R];
        for at in (group..len.min(BLOCK) / S::F64_LANES).step_by(groups) {
            for i in 0..R {
                for j in 0..C {
                    tile[i][j] = simd.mul_add_f64s(rows[i][at], columns[j][at], tile[i][j]);
                }
            }
        }
        for i in 0..R {
            for j in 0..C {
                let sum = &mut S::as_mut_simd_f64s(&mut sums[i * stride + j]).0[group];
                *sum = simd.add_f64s(*sum, tile[i][j]);
            }
        }
    }
}

/// Arguments of the loop of [`distances`].
struct Distances<'a, const D: usize> {
    points: &'a SortedPoints<D>,
    range: Range<usize>,
    map: &'a BezierMap<D>,
    cell: usize,
    out: &'a mut [f64],
}

impl<const D: usize> WithSimd for Distances<'_, D> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { points, range, map, cell, out } = self;
        let orders = Orders::new(map.degree());
        let coefficients = map.cell_coefficients(cell);
        let mut batch = Batch::new(&orders, points.dim(), 0);
        let mut distances = [0.0; BLOCK];
        for (start, target) in range.step_by(BLOCK).zip(out.chunks_mut(BLOCK)) {
            let len = batch.load(Terms::of(points), start..start + target.len(), map.cell_box(cell));
            batch.evaluate(simd, &orders, len);
            for (at, distance) in vectors_mut::<S>(&mut distances, len).iter_mut().enumerate() {
                *distance = simd.sqrt_f64s(squared_distance(simd, &batch, coefficients, orders.of, len, at));
            }
            target.copy_from_slice(&distances[..target.len()]);
        }
    }
}

/// Squared distances of one vector of points to the polynomial with the given coefficients, `(n_local, N)`.
#[inline(always)]
fn squared_distance<S: Simd, const D: usize>(
    simd: S,
    batch: &Batch<D>,
    coefficients: &[f64],
    orders: [usize; D],
    len: usize,
    at: usize,
) -> S::f64s {
    let n = batch.columns.len();
    let mut squared = simd.splat_f64s(0.0);
    for (k, column) in batch.columns.iter().enumerate() {
        let mut difference = simd.neg_f64s(vectors::<S>(column, len)[at]);
        for (line, rows) in coefficients.chunks_exact(orders[0] * n).enumerate() {
            let mut sum = simd.splat_f64s(0.0);
            for (row, basis) in rows.chunks_exact(n).zip(&batch.basis[0]) {
                sum = simd.mul_add_f64s(simd.splat_f64s(row[k]), vectors::<S>(basis, len)[at], sum);
            }
            let mut rest = line;
            let mut outer = simd.splat_f64s(1.0);
            for d in 1..D {
                outer = simd.mul_f64s(outer, vectors::<S>(&batch.basis[d][rest % orders[d]], len)[at]);
                rest /= orders[d];
            }
            difference = simd.mul_add_f64s(outer, sum, difference);
        }
        squared = simd.mul_add_f64s(difference, difference, squared);
    }
    squared
}
