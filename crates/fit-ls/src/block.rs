//! Normal equations whose weights couple the coordinates of a point.

use ndarray::Array2;
use thb_core::{CellSpace, SymmetricMatrix, SymmetricPattern};

use crate::kernel::Terms;
use crate::normal::{Expansion, cell_equations};
use crate::{Error, SortedPoints};

/// Cells whose local matrices are held in memory at a time: so few that one batch gets the memory of the one before.
const BATCH: usize = 256;

/// `Σ_i B(u_i) B(u_i)ᵀ ⊗ W_i` and `Σ_i B(u_i) ⊗ q_i` for symmetric `N × N` matrices `W_i` and vectors `q_i`: the equations
/// of distances to tangent planes, and what remains of a joint problem once the parameters are eliminated.
#[derive(Clone, Debug)]
pub struct BlockEquations {
    /// `Σ W_ab B Bᵀ` for the pairs a ≤ b, row by row: `N (N + 1) / 2` matrices.
    pub matrices: Vec<SymmetricMatrix>,
    /// `Σ B qᵀ`, `(n_functions, N)`.
    pub right: Array2<f64>,
}

impl BlockEquations {
    /// The equations of points that are sorted by the cells of the space. `weights` holds one array per pair a ≤ b, row
    /// by row, `right` one per coordinate; both in the order of the sorted points.
    ///
    /// # Errors
    /// [`Error::Shape`].
    pub fn new<const D: usize, S: CellSpace<D>>(
        space: &S,
        pattern: &SymmetricPattern,
        points: &SortedPoints<D>,
        weights: &[Vec<f64>],
        right: &[Vec<f64>],
    ) -> Result<Self, Error> {
        let n = right.len();
        let check = |what, given: usize, expected: usize| {
            if given == expected { Ok(()) } else { Err(Error::Shape { what, given, expected }) }
        };
        check("cells the points are sorted for", points.offsets().len() - 1, space.n_cells())?;
        check("weight columns", weights.len(), n * (n + 1) / 2)?;
        for column in weights.iter().chain(right) {
            check("rows of weights and right-hand sides", column.len(), points.len())?;
        }
        let terms = Terms { parameters: &points.parameters, factors: weights, columns: right, weights: None };
        let count = weights.len();
        let mut matrices = vec![SymmetricMatrix::zeros(pattern); count];
        let mut values: Vec<&mut [f64]> = matrices.iter_mut().map(SymmetricMatrix::values_mut).collect();
        let mut sums = Array2::zeros((pattern.n(), n));
        let expansion = Expansion::new(space.degree());
        for first in (0..space.n_cells()).step_by(BATCH) {
            let cells = first..(first + BATCH).min(space.n_cells());
            for local in cell_equations(space, points.offsets(), terms, cells, &expansion) {
                let functions = space.cell(local.cell).functions;
                let n_active = functions.len();
                pattern.for_each_entry(functions, |place, i, j| {
                    for (m, values) in values.iter_mut().enumerate() {
                        values[place] += local.matrices[(i * count + m) * n_active + j];
                    }
                });
                local.add_right(space, &mut sums);
            }
        }
        Ok(Self { matrices, right: sums })
    }

    /// Adds the equations of further points in the same space.
    ///
    /// # Errors
    /// [`Error::DifferentSpaces`].
    pub fn merge(&mut self, other: &Self) -> Result<(), Error> {
        let patterns = self.matrices.iter().zip(&other.matrices).all(|(a, b)| a.pattern() == b.pattern());
        if !patterns || self.right.dim() != other.right.dim() {
            return Err(Error::DifferentSpaces);
        }
        for (matrix, other) in self.matrices.iter_mut().zip(&other.matrices) {
            matrix.values_mut().iter_mut().zip(other.values()).for_each(|(x, y)| *x += y);
        }
        self.right += &other.right;
        Ok(())
    }
}
