//! Steps of the coefficients where the coordinates are coupled.

use fit_ls::{BlockEquations, Cholesky, FactorizationError, Fixed, eliminate};
use ndarray::Array2;
use thb_core::{SymmetricMatrix, SymmetricPattern};

use crate::Error;

/// What is added to a diagonal, as shares of its mean, until a matrix is positive definite that unknowns are measured with.
const SHIFTS: [f64; 4] = [0.0, 1e-10, 1e-6, 1.0];

/// The solver of the equations of steps of the coefficients in one space, `N n` unknowns.
#[derive(Debug)]
pub(crate) struct StepSystem {
    pattern: SymmetricPattern,
    blocked: SymmetricPattern,
    solver: Cholesky,
    dim: usize,
}

impl StepSystem {
    /// For maps to R^N, N = `dim`, in a space of some pattern.
    pub(crate) fn new(pattern: &SymmetricPattern, dim: usize) -> Result<Self, Error> {
        let blocked = pattern.blocked(dim);
        let solver =
            Cholesky::new(&blocked).map_err(|_| fit_ls::Error::OutOfMemory { functions: pattern.n() * dim })?;
        Ok(Self { pattern: pattern.clone(), blocked, solver, dim })
    }

    /// The pattern of the equations of one coordinate.
    pub(crate) fn pattern(&self) -> &SymmetricPattern {
        &self.pattern
    }

    /// The matrix that was factorized last.
    pub(crate) fn factor(&self) -> &Cholesky {
        &self.solver
    }

    /// The step `δc` that solves equations, with `½ ν |δc|²` added to what they minimize, some steps given, and what
    /// `coupled` adds to matrix and right-hand side, unknown `k` of function `j` at `j N + k`. `None` if they are singular.
    pub(crate) fn step(
        &mut self,
        equations: &BlockEquations,
        ridge: f64,
        given: &Fixed,
        coupled: impl FnOnce(&mut SymmetricMatrix, &mut Array2<f64>),
    ) -> Result<Option<Array2<f64>>, Error> {
        let BlockEquations { matrices, right } = equations;
        let mut matrix = SymmetricMatrix::from_blocks(&self.blocked, matrices, self.dim)?;
        let unknowns = right.len();
        if ridge > 0.0 {
            let values = matrix.values_mut();
            self.blocked.columns()[..unknowns].iter().for_each(|&first| values[first] += ridge);
        }
        let mut flat = Array2::from_shape_fn((unknowns, 1), |(i, _)| right[[i / self.dim, i % self.dim]]);
        coupled(&mut matrix, &mut flat);
        let scalar_rows = |(function, row): &(usize, Vec<f64>)| {
            let first = function * self.dim;
            row.iter().enumerate().map(move |(k, &x)| (first + k, vec![x])).collect::<Vec<_>>()
        };
        let fixed: Fixed = given.iter().flat_map(scalar_rows).collect();
        eliminate(&mut matrix, &mut flat, &fixed)?;
        let functions = self.pattern.n();
        let Some(solution) = solve(&mut self.solver, &matrix, &flat, functions)? else { return Ok(None) };
        Ok(Some(Array2::from_shape_fn(right.raw_dim(), |(j, k)| solution[[j * self.dim + k, 0]])))
    }

    /// Factorizes the matrix of a step; where points and smoothing leave it singular, with a little more on its diagonal.
    pub(crate) fn factorize(&mut self, equations: &BlockEquations) -> Result<(), Error> {
        let mut matrix = SymmetricMatrix::from_blocks(&self.blocked, &equations.matrices, self.dim)?;
        let mean = matrix.trace() / self.blocked.n() as f64;
        for shift in SHIFTS {
            let values = matrix.values_mut();
            self.blocked.columns()[..self.blocked.n()].iter().for_each(|&first| values[first] += shift * mean);
            if self.solver.factorize(&matrix).is_ok() {
                return Ok(());
            }
        }
        Err(Error::Minimization { reason: FactorizationError::NotPositiveDefinite.to_string() })
    }
}

pub(crate) fn solve(
    solver: &mut Cholesky,
    matrix: &SymmetricMatrix,
    right: &Array2<f64>,
    functions: usize,
) -> Result<Option<Array2<f64>>, Error> {
    match solver.factorize(matrix).and_then(|()| solver.solve(right)) {
        Ok(solution) => Ok(Some(solution)),
        Err(FactorizationError::NotPositiveDefinite) => Ok(None),
        Err(FactorizationError::OutOfMemory) => Err(fit_ls::Error::OutOfMemory { functions }.into()),
    }
}
