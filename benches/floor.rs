//! Floor kernels: the arithmetic that a fit cannot avoid, over the same bytes and in the same order, and nothing else.
//!
//! No scatter into a sparse matrix, no change of basis, no weights. Sums keep eight partial sums, like the real
//! kernels; inner loops hold a tile of them in registers.

use std::hint::black_box;
use std::ops::Range;

use fit_ls::SortedPoints;
use ndarray::ArrayView2;
use pulp::{Simd, WithSimd};
use rayon::prelude::*;
use thb_core::bernstein::{BLOCK, Block, LANES};

/// Points of a parallel task.
const TASK: usize = 1 << 14;

/// Partial sums of one number.
type Lanes = [f64; LANES];

/// The numbers of a sorted cloud of surface points, 40 bytes a point, one array per coordinate.
#[derive(Clone, Debug)]
pub struct Columns {
    /// Parameters.
    pub uv: [Vec<f64>; 2],
    /// Points.
    pub xyz: [Vec<f64>; 3],
    /// Points of cell `c`: `offsets[c]..offsets[c + 1]`.
    pub offsets: Vec<usize>,
    /// Lower corner and reciprocal edge lengths of each cell.
    pub cells: Vec<([f64; 2], [f64; 2])>,
}

impl Columns {
    /// The columns of points `(m, 3)`, in the order of `sorted`.
    pub fn new(sorted: &SortedPoints<2>, points: ArrayView2<'_, f64>, cells: Vec<([f64; 2], [f64; 2])>) -> Self {
        let cells = cells.into_iter().map(|(lower, upper)| (lower, [0, 1].map(|d| 1.0 / (upper[d] - lower[d]))));
        Self {
            uv: [0, 1].map(|d| (0..sorted.len()).map(|at| sorted.parameter(at)[d]).collect()),
            xyz: [0, 1, 2].map(|k| sorted.order().iter().map(|&i| points[[i as usize, k]]).collect()),
            offsets: sorted.offsets().to_vec(),
            cells: cells.collect(),
        }
    }

    fn range(&self, cell: usize) -> Range<usize> {
        self.offsets[cell]..self.offsets[cell + 1]
    }

    /// Ranges of cells with some ten thousand points each.
    fn tasks(&self) -> Vec<Range<usize>> {
        let mut tasks = Vec::new();
        let mut first = 0;
        for cell in 1..=self.cells.len() {
            if cell == self.cells.len() || self.offsets[cell] - self.offsets[first] >= TASK {
                tasks.push(first..cell);
                first = cell;
            }
        }
        tasks
    }
}

/// Products that a point adds to the matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Assembly {
    /// `(½(p+1)(p+2))²`: the Kronecker product of the two symmetric outer products.
    Direct,
    /// `(2p+1)²`: moments in Bernstein polynomials of twice the degree.
    Moments,
}

/// Assembles all points, in parallel, and drops the sums of each cell. Degrees 2 and 3 only; others do nothing.
pub fn assemble(columns: &Columns, degree: usize, assembly: Assembly) {
    columns.tasks().into_par_iter().for_each(|cells| assemble_cells(columns, degree, assembly, cells));
}

fn assemble_cells(columns: &Columns, degree: usize, assembly: Assembly, cells: Range<usize>) {
    let arch = pulp::Arch::new();
    match (degree, assembly) {
        (2, Assembly::Direct) => arch.dispatch(Assemble::<3, 6> { columns, assembly, cells }),
        (2, Assembly::Moments) => arch.dispatch(Assemble::<3, 5> { columns, assembly, cells }),
        (3, Assembly::Direct) => arch.dispatch(Assemble::<4, 10> { columns, assembly, cells }),
        (3, Assembly::Moments) => arch.dispatch(Assemble::<4, 7> { columns, assembly, cells }),
        _ => {}
    }
}

/// Arguments of the assembly loop. A type instead of a closure, because a closure of this size is not inlined into the
/// function that is compiled for wide vectors.
struct Assemble<'a, const ORDER: usize, const FACTORS: usize> {
    columns: &'a Columns,
    assembly: Assembly,
    cells: Range<usize>,
}

impl<const ORDER: usize, const FACTORS: usize> WithSimd for Assemble<'_, ORDER, FACTORS> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { columns, assembly, cells } = self;
        let zero = [0.0; BLOCK];
        let mut points = Points::<ORDER>::new();
        let mut factors = [[zero; FACTORS]; 2];
        let mut weighted = [[zero; ORDER]; 3];
        for cell in cells {
            let mut matrix = [[[0.0; LANES]; FACTORS]; FACTORS];
            let mut right = [[[[0.0; LANES]; ORDER]; ORDER]; 3];
            let range = columns.range(cell);
            for start in range.clone().step_by(BLOCK) {
                let count = BLOCK.min(range.end - start);
                let len = points.load(simd, columns, start, count, cell);
                for d in 0..2 {
                    match assembly {
                        Assembly::Direct => outer_product(simd, &points.basis[d], len, &mut factors[d]),
                        Assembly::Moments => bernstein(simd, &points.t[d], len, &mut factors[d]),
                    }
                }
                if assembly == Assembly::Moments {
                    // Places after the last point count nothing.
                    factors[1].iter_mut().for_each(|row| row[count..len].fill(0.0));
                }
                add_outer(simd, &factors[1], &factors[0], len, &mut matrix);
                for (k, x) in points.xyz.iter().enumerate() {
                    for j in 0..ORDER {
                        multiply(simd, &points.basis[1][j], x, len, &mut weighted[k][j]);
                    }
                    add_outer(simd, &weighted[k], &points.basis[0], len, &mut right[k]);
                }
            }
            black_box((&matrix, &right));
        }
    }
}

/// Up to `BLOCK` points of a cell, with what both loops need of them.
struct Points<const ORDER: usize> {
    t: [Block; 2],
    xyz: [Block; 3],
    basis: [[Block; ORDER]; 2],
}

impl<const ORDER: usize> Points<ORDER> {
    fn new() -> Self {
        let zero = [0.0; BLOCK];
        Self { t: [zero; 2], xyz: [zero; 3], basis: [[zero; ORDER]; 2] }
    }

    /// Loads points, fills up to whole vectors, and returns their number rounded up accordingly.
    #[inline(always)]
    fn load<S: Simd>(&mut self, simd: S, columns: &Columns, start: usize, count: usize, cell: usize) -> usize {
        let (lower, inverse) = columns.cells[cell];
        let len = count.next_multiple_of(LANES);
        for d in 0..2 {
            let t = &mut self.t[d];
            copy(&columns.uv[d][start..start + count], t);
            t[count..len].fill(lower[d]);
            t[..len].iter_mut().for_each(|u| *u = (*u - lower[d]) * inverse[d]);
            bernstein(simd, t, len, &mut self.basis[d]);
        }
        for row in &mut self.basis[1] {
            row[count..len].fill(0.0);
        }
        for (target, column) in self.xyz.iter_mut().zip(&columns.xyz) {
            copy(&column[start..start + count], target);
            target[count..len].fill(0.0);
        }
        len
    }

    /// Squared distances of one vector of points to a polynomial.
    #[inline(always)]
    fn squared_distance<S: Simd>(&self, simd: S, coefficients: &[f64], len: usize, at: usize) -> S::f64s {
        let basis: [[S::f64s; ORDER]; 2] =
            [0, 1].map(|d| std::array::from_fn(|i| vectors::<S>(&self.basis[d][i], len)[at]));
        let mut squared = simd.splat_f64s(0.0);
        for k in 0..3 {
            let mut difference = simd.neg_f64s(vectors::<S>(&self.xyz[k], len)[at]);
            for j in 0..ORDER {
                let mut line = simd.splat_f64s(0.0);
                for i in 0..ORDER {
                    let c = simd.splat_f64s(coefficients[(j * ORDER + i) * 3 + k]);
                    line = simd.mul_add_f64s(c, basis[0][i], line);
                }
                difference = simd.mul_add_f64s(basis[1][j], line, difference);
            }
            squared = simd.mul_add_f64s(difference, difference, squared);
        }
        squared
    }
}

/// Copies to the front of a block; without a call if the block is full.
#[inline(always)]
fn copy(source: &[f64], target: &mut Block) {
    match source.first_chunk::<BLOCK>() {
        Some(whole) => *target = *whole,
        None => target[..source.len()].copy_from_slice(source),
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

/// Bernstein polynomials of degree `ORDER − 1`.
#[inline(always)]
fn bernstein<S: Simd, const ORDER: usize>(simd: S, t: &Block, len: usize, out: &mut [Block; ORDER]) {
    let binomials: [f64; ORDER] = match ORDER {
        3 => std::array::from_fn(|k| [1.0, 2.0, 1.0][k]),
        4 => std::array::from_fn(|k| [1.0, 3.0, 3.0, 1.0][k]),
        5 => std::array::from_fn(|k| [1.0, 4.0, 6.0, 4.0, 1.0][k]),
        _ => std::array::from_fn(|k| [1.0, 6.0, 15.0, 20.0, 15.0, 6.0, 1.0][k]),
    };
    let one = simd.splat_f64s(1.0);
    for (at, &t) in vectors::<S>(t, len).iter().enumerate() {
        let s = simd.sub_f64s(one, t);
        let mut values = [one; ORDER];
        let mut power = t;
        for k in 1..ORDER {
            values[k] = simd.mul_f64s(power, simd.splat_f64s(binomials[k]));
            power = simd.mul_f64s(power, t);
        }
        let mut power = s;
        for k in (0..ORDER - 1).rev() {
            values[k] = simd.mul_f64s(values[k], power);
            power = simd.mul_f64s(power, s);
        }
        for k in 0..ORDER {
            vectors_mut::<S>(&mut out[k], len)[at] = values[k];
        }
    }
}

/// The products of pairs, each once.
#[inline(always)]
fn outer_product<S: Simd, const ORDER: usize, const PAIRS: usize>(
    simd: S,
    basis: &[Block; ORDER],
    len: usize,
    pairs: &mut [Block; PAIRS],
) {
    let mut at = 0;
    for i in 0..ORDER {
        for j in 0..=i {
            multiply(simd, &basis[i], &basis[j], len, &mut pairs[at]);
            at += 1;
        }
    }
}

#[inline(always)]
fn multiply<S: Simd>(simd: S, a: &Block, b: &Block, len: usize, out: &mut Block) {
    let factors = vectors::<S>(a, len).iter().zip(vectors::<S>(b, len));
    for (product, (&x, &y)) in vectors_mut::<S>(out, len).iter_mut().zip(factors) {
        *product = simd.mul_f64s(x, y);
    }
}

/// Rows of a tile: with up to 7 columns a tile and its operands fit into 32 vector registers.
const TILE: usize = 3;

/// Adds all products of a row of `a` and a row of `b`, summed over points.
#[inline(always)]
fn add_outer<S: Simd, const M: usize, const N: usize>(
    simd: S,
    a: &[Block; M],
    b: &[Block; N],
    len: usize,
    sums: &mut [[Lanes; N]; M],
) {
    for (a, sums) in a.chunks(TILE).zip(sums.chunks_mut(TILE)) {
        match a.len() {
            1 => add_columns::<S, 1, N>(simd, a, b, len, sums),
            2 => add_columns::<S, 2, N>(simd, a, b, len, sums),
            _ => add_columns::<S, TILE, N>(simd, a, b, len, sums),
        }
    }
}

#[inline(always)]
fn add_columns<S: Simd, const M: usize, const N: usize>(
    simd: S,
    a: &[Block],
    b: &[Block; N],
    len: usize,
    sums: &mut [[Lanes; N]],
) {
    match N {
        10 => {
            add_tile::<S, M, 5, N>(simd, a, &b[..5], len, sums, 0);
            add_tile::<S, M, 5, N>(simd, a, &b[5..], len, sums, 5);
        }
        _ => add_tile::<S, M, N, N>(simd, a, b, len, sums, 0),
    }
}

#[inline(always)]
fn add_tile<S: Simd, const M: usize, const C: usize, const N: usize>(
    simd: S,
    a: &[Block],
    b: &[Block],
    len: usize,
    sums: &mut [[Lanes; N]],
    first: usize,
) {
    let a: [&[S::f64s]; M] = std::array::from_fn(|i| vectors::<S>(&a[i], len));
    let b: [&[S::f64s]; C] = std::array::from_fn(|j| vectors::<S>(&b[j], len));
    let groups = LANES / S::F64_LANES;
    for group in 0..groups {
        let mut tile = [[simd.splat_f64s(0.0); C]; M];
        for at in (group..len.min(BLOCK) / S::F64_LANES).step_by(groups) {
            for i in 0..M {
                for j in 0..C {
                    tile[i][j] = simd.mul_add_f64s(a[i][at], b[j][at], tile[i][j]);
                }
            }
        }
        for i in 0..M {
            for j in 0..C {
                let sum = &mut S::as_mut_simd_f64s(&mut sums[i][first + j]).0[group];
                *sum = simd.add_f64s(*sum, tile[i][j]);
            }
        }
    }
}

/// Distances of all points, in parallel, to each cell's polynomial with Bernstein coefficients `(p+1)² × 3`. Degrees 2
/// and 3 only; others do nothing.
pub fn evaluate(columns: &Columns, degree: usize, coefficients: &[f64], out: &mut [f64]) {
    let mut rest = out;
    let mut tasks = Vec::new();
    for cells in columns.tasks() {
        let count = columns.offsets[cells.end] - columns.offsets[cells.start];
        let (part, further) = std::mem::take(&mut rest).split_at_mut(count);
        tasks.push((cells, part));
        rest = further;
    }
    tasks.into_par_iter().for_each(|(cells, part)| evaluate_cells(columns, degree, coefficients, cells, part));
}

fn evaluate_cells(columns: &Columns, degree: usize, coefficients: &[f64], cells: Range<usize>, out: &mut [f64]) {
    let arch = pulp::Arch::new();
    match degree {
        2 => arch.dispatch(Evaluate::<3> { columns, coefficients, cells, out }),
        3 => arch.dispatch(Evaluate::<4> { columns, coefficients, cells, out }),
        _ => {}
    }
}

/// Arguments of the evaluation loop.
struct Evaluate<'a, const ORDER: usize> {
    columns: &'a Columns,
    coefficients: &'a [f64],
    cells: Range<usize>,
    out: &'a mut [f64],
}

impl<const ORDER: usize> WithSimd for Evaluate<'_, ORDER> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { columns, coefficients, cells, out } = self;
        let begin = columns.offsets[cells.start];
        let mut points = Points::<ORDER>::new();
        let mut distances = [0.0; BLOCK];
        for cell in cells {
            let local = &coefficients[cell * 3 * ORDER * ORDER..][..3 * ORDER * ORDER];
            let range = columns.range(cell);
            for start in range.clone().step_by(BLOCK) {
                let count = BLOCK.min(range.end - start);
                let len = points.load(simd, columns, start, count, cell);
                for (at, distance) in vectors_mut::<S>(&mut distances, len).iter_mut().enumerate() {
                    *distance = simd.sqrt_f64s(points.squared_distance(simd, local, len, at));
                }
                out[start - begin..][..count].copy_from_slice(&distances[..count]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct AddOuter<'a>(&'a [Block; 4], &'a [Block; 5], &'a mut [[Lanes; 5]; 4]);

    impl WithSimd for AddOuter<'_> {
        type Output = ();

        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) {
            add_outer(simd, self.0, self.1, BLOCK - LANES, self.2);
        }
    }

    #[test]
    fn sums_of_products_are_those_of_single_points() {
        let a: [Block; 4] = std::array::from_fn(|i| std::array::from_fn(|b| (i + 1) as f64 * b as f64));
        let b: [Block; 5] = std::array::from_fn(|j| std::array::from_fn(|b| j as f64 - b as f64));
        let mut sums = [[[0.0; LANES]; 5]; 4];
        pulp::Arch::new().dispatch(AddOuter(&a, &b, &mut sums));
        for i in 0..4 {
            for j in 0..5 {
                let expected: f64 = (0..BLOCK - LANES).map(|k| a[i][k] * b[j][k]).sum();
                assert_eq!(sums[i][j].iter().sum::<f64>(), expected);
            }
        }
    }
}
