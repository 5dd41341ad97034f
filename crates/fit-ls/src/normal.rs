//! Normal equations of a space: the statistic that points are reduced to.

use std::ops::Range;

use ndarray::Array2;
use rayon::prelude::*;
use thb_core::bernstein::binomial;
use thb_core::{CellSpace, SymmetricMatrix, SymmetricPattern};

use crate::kernel::{CellSums, Summation, Terms};
use crate::{Error, SortedPoints};

/// `BᵀWB` and `BᵀWp` of points in a space. Statistics of different points in the same space add up, so chunks, threads
/// and machines can be merged.
#[derive(Clone, Debug)]
pub struct NormalEquations {
    /// `BᵀWB`, `(n_functions, n_functions)`.
    pub matrix: SymmetricMatrix,
    /// `BᵀWp`, `(n_functions, N)`.
    pub right: Array2<f64>,
}

/// Points of one parallel task. Sums are formed task by task, whatever the number of threads.
const CHUNK: usize = 1 << 14;

/// Cells whose local matrices are held in memory at a time.
pub(crate) const BATCH: usize = 1 << 12;

impl NormalEquations {
    /// Zero equations for points of dimension `n`.
    pub fn zeros(pattern: &SymmetricPattern, n: usize) -> Self {
        Self { matrix: SymmetricMatrix::zeros(pattern), right: Array2::zeros((pattern.n(), n)) }
    }

    /// The equations of points that are sorted by the cells of the space.
    ///
    /// # Errors
    /// [`Error::Shape`] if they are sorted for another number of cells.
    pub fn new<const D: usize, S: CellSpace<D>>(
        space: &S,
        pattern: &SymmetricPattern,
        points: &SortedPoints<D>,
    ) -> Result<Self, Error> {
        let (given, expected) = (points.offsets().len() - 1, space.n_cells());
        if given != expected {
            return Err(Error::Shape { what: "cells the points are sorted for", given, expected });
        }
        let mut equations = Self::zeros(pattern, points.dim());
        let expansion = Expansion::new(space.degree());
        for first in (0..space.n_cells()).step_by(BATCH) {
            let cells = first..(first + BATCH).min(space.n_cells());
            equations.add_cells(space, points, cells, &expansion);
        }
        Ok(equations)
    }

    fn add_cells<const D: usize, S: CellSpace<D>>(
        &mut self,
        space: &S,
        points: &SortedPoints<D>,
        cells: Range<usize>,
        expansion: &Expansion,
    ) {
        for local in cell_equations(space, points.offsets(), Terms::of(points), cells, expansion) {
            self.matrix.add_cell(space.cell(local.cell).functions, &local.matrices);
            local.add_right(space, &mut self.right);
        }
    }

    /// Adds the equations of further points in the same space.
    ///
    /// # Errors
    /// [`Error::DifferentSpaces`].
    pub fn merge(&mut self, other: &Self) -> Result<(), Error> {
        if self.matrix.pattern() != other.matrix.pattern() || self.right.dim() != other.right.dim() {
            return Err(Error::DifferentSpaces);
        }
        self.matrix.values_mut().iter_mut().zip(other.matrix.values()).for_each(|(a, b)| *a += b);
        self.right += &other.right;
        Ok(())
    }
}

/// Equations of one cell in its functions.
pub(crate) struct CellEquations {
    pub(crate) cell: usize,
    /// The matrices, row beside row: `(n_active, count, n_active)`.
    pub(crate) matrices: Vec<f64>,
    /// `(n_active, N)`.
    right: Vec<f64>,
}

impl CellEquations {
    /// Adds the right-hand sides to those of all functions, `(n_functions, N)`.
    pub(crate) fn add_right<const D: usize, S: CellSpace<D>>(&self, space: &S, right: &mut Array2<f64>) {
        let functions = space.cell(self.cell).functions;
        for (row, &function) in self.right.chunks_exact(right.ncols()).zip(functions) {
            let mut target = right.row_mut(function as usize);
            target.iter_mut().zip(row).for_each(|(a, b)| *a += b);
        }
    }
}

/// The equations of a range of cells, given the points of each cell.
pub(crate) fn cell_equations<const D: usize, S: CellSpace<D>>(
    space: &S,
    offsets: &[usize],
    terms: Terms<'_, D>,
    cells: Range<usize>,
    expansion: &Expansion,
) -> Vec<CellEquations> {
    let (n, matrices) = (terms.columns.len(), terms.n_matrices());
    let boxes = cells.map(|number| {
        let cell = space.cell(number);
        (number, PointBox { points: offsets[number]..offsets[number + 1], lower: cell.lower, upper: cell.upper })
    });
    sums(space.degree(), terms, boxes)
        .into_par_iter()
        .map_init(Vec::new, |scratch, (number, sums)| {
            let cell = space.cell(number);
            let mut local = expansion.matrices(&sums.moments, matrices);
            cell.pull_back_symmetric(&mut local, matrices, scratch);
            let mut right = sums.right;
            cell.pull_back(&mut right, n, scratch);
            CellEquations { cell: number, matrices: local, right }
        })
        .collect()
}

/// Points of a box of parameters in which they are sums of polynomials.
#[derive(Clone, Debug, PartialEq)]
pub struct PointBox<const D: usize> {
    /// The points, by their places among sorted points; all must lie in the box.
    pub points: Range<usize>,
    /// Lower corner.
    pub lower: [f64; D],
    /// Upper corner.
    pub upper: [f64; D],
}

/// The sums of the points of each box, in the Bernstein basis of the box: moments `Σ ω B^{2p}_k` and right-hand sides
/// `Σ ω B^p_i x`. Boxes without points have empty sums. The same bits for any number of threads.
///
/// # Errors
/// [`Error::Shape`] for a range of points that does not exist.
pub fn box_sums<const D: usize>(
    points: &SortedPoints<D>,
    degree: [usize; D],
    boxes: &[PointBox<D>],
) -> Result<Vec<CellSums>, Error> {
    if let Some(outside) = boxes.iter().find(|b| b.points.start > b.points.end || b.points.end > points.len()) {
        return Err(Error::Shape {
            what: "end of a range of points",
            given: outside.points.end,
            expected: points.len(),
        });
    }
    let mut result = vec![CellSums::default(); boxes.len()];
    for (number, part) in sums(degree, Terms::of(points), boxes.iter().cloned().enumerate()) {
        result[number] = part;
    }
    Ok(result)
}

/// The sums of numbered boxes; those without points are left out.
fn sums<const D: usize>(
    degree: [usize; D],
    terms: Terms<'_, D>,
    boxes: impl Iterator<Item = (usize, PointBox<D>)>,
) -> Vec<(usize, CellSums)> {
    let (n, matrices) = (terms.columns.len(), terms.n_matrices());
    let tasks: Vec<(usize, PointBox<D>)> = boxes
        .flat_map(|(number, PointBox { points: Range { start, end }, lower, upper })| {
            (start..end).step_by(CHUNK).map(move |at| {
                let points = at..(at + CHUNK).min(end);
                (number, PointBox { points, lower, upper })
            })
        })
        .collect();
    let partial: Vec<(usize, CellSums)> = tasks
        .into_par_iter()
        .map_init(
            || Summation::new(degree, n, matrices),
            |summation, (number, part)| (number, summation.of(terms, part.points, part.lower, part.upper)),
        )
        .collect();
    let mut of_boxes: Vec<(usize, CellSums)> = Vec::with_capacity(partial.len());
    for (number, part) in partial {
        match of_boxes.last_mut() {
            Some((last, whole)) if *last == number => whole.merge(&part),
            _ => of_boxes.push((number, part)),
        }
    }
    of_boxes
}

/// From moments of degree 2p to the products of Bernstein polynomials of degree p:
/// `B_i B_j = C(p,i) C(p,j) / C(2p,i+j) · B^{2p}_{i+j}` in each direction.
pub(crate) struct Expansion {
    /// For each entry of the matrix the moment and its factor.
    entries: Vec<(usize, f64)>,
}

impl Expansion {
    pub(crate) fn new<const D: usize>(degree: [usize; D]) -> Self {
        let n_local: usize = degree.iter().map(|p| p + 1).product();
        let entry = |k: usize| {
            let (mut i, mut j) = (k / n_local, k % n_local);
            let (mut moment, mut stride, mut factor) = (0, 1, 1.0);
            for p in degree {
                let (a, b) = (i % (p + 1), j % (p + 1));
                (i, j) = (i / (p + 1), j / (p + 1));
                moment += (a + b) * stride;
                stride *= 2 * p + 1;
                factor *= binomial(p, a) * binomial(p, b) / binomial(2 * p, a + b);
            }
            (moment, factor)
        };
        Self { entries: (0..n_local * n_local).map(entry).collect() }
    }

    /// The matrices `Σ ω B Bᵀ` of `count` factors ω, row beside row, `(n_local, count, n_local)`.
    fn matrices(&self, moments: &[f64], count: usize) -> Vec<f64> {
        let n_local = self.entries.len().isqrt();
        let per_matrix = moments.len() / count;
        let mut matrices = Vec::with_capacity(self.entries.len() * count);
        for entries in self.entries.chunks_exact(n_local) {
            for moments in moments.chunks_exact(per_matrix) {
                matrices.extend(entries.iter().map(|&(moment, factor)| factor * moments[moment]));
            }
        }
        matrices
    }
}
