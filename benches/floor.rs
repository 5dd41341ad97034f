//! Floor kernels: the arithmetic that a fit cannot avoid, over the same bytes and in the same order, and nothing else.
//!
//! No scatter into a sparse matrix, no change of basis, no weights. Sums keep eight partial sums, like the real
//! kernels; inner loops hold a tile of them in registers.

use std::hint::black_box;
use std::ops::Range;

use fit_ls::SortedPoints;
use ndarray::ArrayView2;
use pulp::NullaryFnOnce;
use rayon::prelude::*;
use thb_core::bernstein::{BLOCK, Block, LANES, values_block};

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

impl<const ORDER: usize, const FACTORS: usize> NullaryFnOnce for Assemble<'_, ORDER, FACTORS> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        assemble_inlined::<ORDER, FACTORS>(self.columns, self.assembly, self.cells);
    }
}

/// Up to `BLOCK` points of a cell, with what both loops need of them.
struct Points<const ORDER: usize> {
    len: usize,
    t: [Block; 2],
    xyz: [Block; 3],
    basis: [[Block; ORDER]; 2],
}

impl<const ORDER: usize> Points<ORDER> {
    fn new() -> Self {
        let zero = [0.0; BLOCK];
        Self { len: 0, t: [zero; 2], xyz: [zero; 3], basis: [[zero; ORDER]; 2] }
    }

    /// Loads points and fills up to whole vectors with zeros.
    #[inline(always)]
    fn load(&mut self, columns: &Columns, start: usize, count: usize, cell: usize) {
        let (lower, inverse) = columns.cells[cell];
        self.len = count.next_multiple_of(LANES);
        for d in 0..2 {
            let t = &mut self.t[d];
            for (target, u) in t[..count].iter_mut().zip(&columns.uv[d][start..start + count]) {
                *target = (u - lower[d]) * inverse[d];
            }
            t[count..self.len].fill(0.0);
            values_block(ORDER - 1, t, self.len, &mut self.basis[d]);
            for row in &mut self.basis[d] {
                row[count..self.len].fill(0.0);
            }
        }
        for (target, column) in self.xyz.iter_mut().zip(&columns.xyz) {
            target[..count].copy_from_slice(&column[start..start + count]);
            target[count..self.len].fill(0.0);
        }
    }
}

#[inline(always)]
fn assemble_inlined<const ORDER: usize, const FACTORS: usize>(
    columns: &Columns,
    assembly: Assembly,
    cells: Range<usize>,
) {
    let zero = [0.0; BLOCK];
    let mut points = Points::<ORDER>::new();
    let mut factors = [[zero; FACTORS]; 2];
    let mut weighted = [[zero; ORDER]; 3];
    for cell in cells {
        let mut matrix = [[[0.0; LANES]; FACTORS]; FACTORS];
        let mut right = [[[[0.0; LANES]; ORDER]; ORDER]; 3];
        let range = columns.range(cell);
        for start in range.clone().step_by(BLOCK) {
            points.load(columns, start, BLOCK.min(range.end - start), cell);
            let len = points.len;
            for d in 0..2 {
                if assembly == Assembly::Direct {
                    outer_product(&points.basis[d], len, &mut factors[d]);
                } else {
                    values_block(FACTORS - 1, &points.t[d], len, &mut factors[d]);
                }
            }
            add_outer(&factors[1], &factors[0], len, &mut matrix);
            for (k, x) in points.xyz.iter().enumerate() {
                for j in 0..ORDER {
                    multiply(&points.basis[1][j], x, len, &mut weighted[k][j]);
                }
                add_outer(&weighted[k], &points.basis[0], len, &mut right[k]);
            }
        }
        black_box((&matrix, &right));
    }
}

/// The products of pairs, each once.
#[inline(always)]
fn outer_product<const ORDER: usize, const PAIRS: usize>(
    basis: &[Block; ORDER],
    len: usize,
    pairs: &mut [Block; PAIRS],
) {
    let mut at = 0;
    for i in 0..ORDER {
        for j in 0..=i {
            multiply(&basis[i], &basis[j], len, &mut pairs[at]);
            at += 1;
        }
    }
}

#[inline(always)]
fn multiply(a: &Block, b: &Block, len: usize, out: &mut Block) {
    for ((c, x), y) in out[..len].iter_mut().zip(&a[..len]).zip(&b[..len]) {
        *c = x * y;
    }
}

/// Rows of a tile; a tile with its operands fits into 32 vector registers for up to 7 columns.
const TILE: usize = 3;

/// Adds all products of a row of `a` and a row of `b`, summed over points.
#[inline(always)]
fn add_outer<const M: usize, const N: usize>(a: &[Block; M], b: &[Block; N], len: usize, sums: &mut [[Lanes; N]; M]) {
    let mut first = 0;
    while first + TILE <= M {
        add_tile::<TILE, N>(&a[first..], b, len, &mut sums[first..]);
        first += TILE;
    }
    match M - first {
        1 => add_tile::<1, N>(&a[first..], b, len, &mut sums[first..]),
        2 => add_tile::<2, N>(&a[first..], b, len, &mut sums[first..]),
        _ => {}
    }
}

#[inline(always)]
fn add_tile<const M: usize, const N: usize>(a: &[Block], b: &[Block; N], len: usize, sums: &mut [[Lanes; N]]) {
    let mut tile: [[Lanes; N]; M] = std::array::from_fn(|i| sums[i]);
    for at in (0..len.min(BLOCK)).step_by(LANES) {
        for i in 0..M {
            for j in 0..N {
                for lane in 0..LANES {
                    tile[i][j][lane] = a[i][at + lane].mul_add(b[j][at + lane], tile[i][j][lane]);
                }
            }
        }
    }
    sums[..M].copy_from_slice(&tile);
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

impl<const ORDER: usize> NullaryFnOnce for Evaluate<'_, ORDER> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        evaluate_inlined::<ORDER>(self.columns, self.coefficients, self.cells, self.out);
    }
}

#[inline(always)]
fn evaluate_inlined<const ORDER: usize>(
    columns: &Columns,
    coefficients: &[f64],
    cells: Range<usize>,
    out: &mut [f64],
) {
    let begin = columns.offsets[cells.start];
    let mut points = Points::<ORDER>::new();
    let mut squared = [0.0; BLOCK];
    for cell in cells {
        let local = &coefficients[cell * 3 * ORDER * ORDER..][..3 * ORDER * ORDER];
        let range = columns.range(cell);
        for start in range.clone().step_by(BLOCK) {
            let count = BLOCK.min(range.end - start);
            points.load(columns, start, count, cell);
            for at in (0..points.len.min(BLOCK)).step_by(LANES) {
                let mut sum = [0.0; LANES];
                for k in 0..3 {
                    let mut difference: Lanes = std::array::from_fn(|lane| -points.xyz[k][at + lane]);
                    for j in 0..ORDER {
                        let mut line = [0.0; LANES];
                        for i in 0..ORDER {
                            let c = local[(j * ORDER + i) * 3 + k];
                            for lane in 0..LANES {
                                line[lane] = points.basis[0][i][at + lane].mul_add(c, line[lane]);
                            }
                        }
                        for lane in 0..LANES {
                            difference[lane] = points.basis[1][j][at + lane].mul_add(line[lane], difference[lane]);
                        }
                    }
                    for lane in 0..LANES {
                        sum[lane] = difference[lane].mul_add(difference[lane], sum[lane]);
                    }
                }
                for lane in 0..LANES {
                    squared[at + lane] = sum[lane].sqrt();
                }
            }
            out[start - begin..start - begin + count].copy_from_slice(&squared[..count]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_of_products_are_those_of_single_points() {
        let a: [Block; 4] = std::array::from_fn(|i| std::array::from_fn(|b| (i + 1) as f64 * b as f64));
        let b: [Block; 5] = std::array::from_fn(|j| std::array::from_fn(|b| j as f64 - b as f64));
        let mut sums = [[[0.0; LANES]; 5]; 4];
        add_outer(&a, &b, BLOCK - LANES, &mut sums);
        for i in 0..4 {
            for j in 0..5 {
                let expected: f64 = (0..BLOCK - LANES).map(|k| a[i][k] * b[j][k]).sum();
                assert_eq!(sums[i][j].iter().sum::<f64>(), expected);
            }
        }
    }
}
