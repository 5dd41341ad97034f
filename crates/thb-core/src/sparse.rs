//! Symmetric sparse matrices with the pattern of a space, lower triangle by columns.

use std::sync::Arc;

use rayon::prelude::*;

use crate::{CellSpace, Error};

/// Which pairs of functions share a cell: the lower triangle in compressed columns, rows increasing.
#[derive(Clone, Debug, PartialEq)]
pub struct SymmetricPattern {
    n: usize,
    columns: Arc<[usize]>,
    rows: Arc<[usize]>,
}

impl SymmetricPattern {
    /// The pattern of a space.
    pub fn new<const D: usize, S: CellSpace<D>>(space: &S) -> Self {
        Self::of_groups(space.n_functions(), space.n_cells(), |cell| space.cell(cell).functions)
    }

    /// The pattern of a space with further groups of functions that are coupled, each increasing and below the number of functions.
    pub fn with_groups<const D: usize, S: CellSpace<D>>(space: &S, groups: &[Vec<u32>]) -> Self {
        let n_cells = space.n_cells();
        Self::of_groups(space.n_functions(), n_cells + groups.len(), |group| {
            if group < n_cells { space.cell(group).functions } else { &groups[group - n_cells] }
        })
    }

    /// Which pairs of `n` functions share one of several groups, each increasing.
    pub fn of_groups<'a>(n: usize, count: usize, functions_of: impl Fn(usize) -> &'a [u32]) -> Self {
        // Groups of each function, then for each function the union of the larger functions of its groups.
        let mut starts = vec![0_usize; n + 1];
        for group in 0..count {
            functions_of(group).iter().for_each(|&f| starts[f as usize + 1] += 1);
        }
        for i in 0..n {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        let mut groups = vec![0_u32; starts[n]];
        for group in 0..count {
            for &f in functions_of(group) {
                groups[next[f as usize]] = group as u32;
                next[f as usize] += 1;
            }
        }
        let mut columns = Vec::with_capacity(n + 1);
        let mut rows: Vec<usize> = Vec::new();
        let mut last_column = vec![usize::MAX; n];
        columns.push(0);
        for column in 0..n {
            let start = rows.len();
            for &group in &groups[starts[column]..starts[column + 1]] {
                let functions = functions_of(group as usize);
                for &f in &functions[functions.partition_point(|&f| (f as usize) < column)..] {
                    if last_column[f as usize] != column {
                        last_column[f as usize] = column;
                        rows.push(f as usize);
                    }
                }
            }
            rows[start..].sort_unstable();
            columns.push(rows.len());
        }
        Self { n, columns: columns.into(), rows: rows.into() }
    }

    /// Number of rows and columns.
    pub fn n(&self) -> usize {
        self.n
    }

    /// Start of each column among the rows, `n + 1` numbers.
    pub fn columns(&self) -> &[usize] {
        &self.columns
    }

    /// Row indices, increasing in each column, from the diagonal down.
    pub fn rows(&self) -> &[usize] {
        &self.rows
    }
}

impl SymmetricPattern {
    /// Calls `entry(place, i, j)` for the entries i ≥ j of a cell's matrix, with their places among the values; `functions`
    /// increasing and part of the pattern.
    pub fn for_each_entry(&self, functions: &[u32], mut entry: impl FnMut(usize, usize, usize)) {
        for (j, &column) in functions.iter().enumerate() {
            let range = self.columns[column as usize]..self.columns[column as usize + 1];
            let (rows, mut at) = (&self.rows[range.clone()], 0);
            for (i, &row) in functions.iter().enumerate().skip(j) {
                while rows[at] < row as usize {
                    at += 1;
                }
                entry(range.start + at, i, j);
            }
        }
    }

    /// The pattern in which each entry is a dense block of `size` rows and columns: unknown `k` of function `j` has the
    /// number `j · size + k`.
    pub fn blocked(&self, size: usize) -> Self {
        let mut columns = Vec::with_capacity(self.n * size + 1);
        let mut rows = Vec::with_capacity(self.rows.len() * size * size);
        columns.push(0);
        for j in 0..self.n {
            let below = &self.rows[self.columns[j] + 1..self.columns[j + 1]];
            for k in 0..size {
                rows.extend(j * size + k..(j + 1) * size);
                rows.extend(below.iter().flat_map(|&i| i * size..(i + 1) * size));
                columns.push(rows.len());
            }
        }
        Self { n: self.n * size, columns: columns.into(), rows: rows.into() }
    }
}

/// A symmetric matrix with the pattern of a space.
#[derive(Clone, Debug)]
pub struct SymmetricMatrix {
    pattern: SymmetricPattern,
    values: Vec<f64>,
}

/// Cells whose matrices are held in memory at a time.
const BATCH: usize = 1 << 12;

impl SymmetricMatrix {
    /// The sum of matrices of cells, each in the functions of its cell and written to the first of two buffers; the second is for scratch.
    /// Cells are computed in parallel and added in their order.
    pub fn of_cells<const D: usize, S: CellSpace<D>>(
        space: &S,
        pattern: &SymmetricPattern,
        cell_matrix: impl Fn(usize, &mut Vec<f64>, &mut Vec<f64>) + Sync,
    ) -> Self {
        let mut matrix = Self::zeros(pattern);
        for first in (0..space.n_cells()).step_by(BATCH) {
            let cells = first..(first + BATCH).min(space.n_cells());
            let of_cell = |scratch: &mut Vec<f64>, number: usize| {
                let mut local = Vec::new();
                cell_matrix(number, &mut local, scratch);
                local
            };
            let local: Vec<Vec<f64>> = cells.clone().into_par_iter().map_init(Vec::new, of_cell).collect();
            for (number, local) in cells.zip(local) {
                matrix.add_cell(space.cell(number).functions, &local);
            }
        }
        matrix
    }

    /// The zero matrix; shares the pattern.
    pub fn zeros(pattern: &SymmetricPattern) -> Self {
        Self { values: vec![0.0; pattern.rows.len()], pattern: pattern.clone() }
    }

    /// The pattern.
    pub fn pattern(&self) -> &SymmetricPattern {
        &self.pattern
    }

    /// Values of the lower triangle, in the order of the pattern.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Values of the lower triangle, to change.
    pub fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// Adds a cell's matrix, `(n_active, n_active)` row-major; `functions` increasing and part of the pattern.
    pub fn add_cell(&mut self, functions: &[u32], matrix: &[f64]) {
        let (n_active, values) = (functions.len(), &mut self.values);
        self.pattern.for_each_entry(functions, |place, i, j| values[place] += matrix[i * n_active + j]);
    }

    /// The matrix of [`SymmetricPattern::blocked`] whose block of functions i and j has the entries `parts[a][b]` of i and j,
    /// each part symmetric: `parts` holds the pairs a ≤ b row by row, `size (size + 1) / 2` matrices of one pattern.
    ///
    /// # Errors
    /// [`Error::Shape`].
    pub fn from_blocks(pattern: &SymmetricPattern, parts: &[Self], size: usize) -> Result<Self, Error> {
        let expected = size * (size + 1) / 2;
        if parts.len() != expected || size == 0 {
            return Err(Error::Shape { what: "parts of a block matrix", given: parts.len(), expected });
        }
        let base = &parts[0].pattern;
        if pattern.n != base.n * size {
            return Err(Error::Shape {
                what: "unknowns of a block pattern",
                given: pattern.n,
                expected: base.n * size,
            });
        }
        let part = |a: usize, b: usize| {
            let (low, high) = (a.min(b), a.max(b));
            &parts[low * size - low * (low + 1) / 2 + high].values
        };
        let mut values = Vec::with_capacity(pattern.rows.len());
        for j in 0..base.n {
            let (first, last) = (base.columns[j], base.columns[j + 1]);
            for b in 0..size {
                values.extend((b..size).map(|a| part(a, b)[first]));
                values.extend(
                    (first + 1..last).flat_map(|at| (0..size).map(move |a| (at, a))).map(|(at, a)| part(a, b)[at]),
                );
            }
        }
        Ok(Self { pattern: pattern.clone(), values })
    }

    /// Sum of the diagonal.
    pub fn trace(&self) -> f64 {
        // The diagonal opens each column of the lower triangle.
        (0..self.pattern.n).map(|j| self.values[self.pattern.columns[j]]).sum()
    }

    /// The product with a vector.
    pub fn multiply(&self, x: &[f64]) -> Vec<f64> {
        let mut y = vec![0.0; self.pattern.n];
        for j in 0..self.pattern.n {
            for k in self.pattern.columns[j]..self.pattern.columns[j + 1] {
                let i = self.pattern.rows[k];
                y[i] += self.values[k] * x[j];
                if i != j {
                    y[j] += self.values[k] * x[i];
                }
            }
        }
        y
    }
}
