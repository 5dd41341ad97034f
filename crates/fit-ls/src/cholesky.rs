//! Sparse Cholesky factorization of the normal equations.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltError;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side};
use ndarray::Array2;
use thb_core::{SymmetricMatrix, SymmetricPattern};

/// A sparse Cholesky solver for matrices of one pattern: the fill-reducing order and the structure of the factor are
/// found once, the numbers as often as needed.
#[derive(Debug)]
pub struct Cholesky {
    pattern: SymmetricPattern,
    symbolic: SymbolicCholesky<usize>,
    /// Values of the factor; empty before the first factorization.
    factor: Vec<f64>,
}

/// Why a factorization failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FactorizationError {
    /// The matrix is not positive definite, up to round-off.
    #[error("the matrix is not positive definite")]
    NotPositiveDefinite,
    /// Not enough memory.
    #[error("not enough memory for the factor")]
    OutOfMemory,
}

impl Cholesky {
    /// Analyses a pattern.
    ///
    /// # Errors
    /// [`FactorizationError::OutOfMemory`].
    pub fn new(pattern: &SymmetricPattern) -> Result<Self, FactorizationError> {
        let symbolic = factorize_symbolic_cholesky(
            structure(pattern),
            Side::Lower,
            SymmetricOrdering::Amd,
            CholeskySymbolicParams::default(),
        )
        .map_err(|_| FactorizationError::OutOfMemory)?;
        Ok(Self { pattern: pattern.clone(), symbolic, factor: Vec::new() })
    }

    /// The pattern it was made for.
    pub fn pattern(&self) -> &SymmetricPattern {
        &self.pattern
    }

    /// Factorizes a matrix of the pattern.
    ///
    /// # Errors
    /// [`FactorizationError`].
    pub fn factorize(&mut self, matrix: &SymmetricMatrix) -> Result<(), FactorizationError> {
        self.factor.clear();
        self.factor.resize(self.symbolic.len_val(), 0.0);
        let scratch = self.symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
        let mut memory = MemBuffer::try_new(scratch).map_err(|_| FactorizationError::OutOfMemory)?;
        // One thread: measured faster than two at all sizes up to 2·10⁵ unknowns.
        let factorized = self.symbolic.factorize_numeric_llt(
            &mut self.factor,
            SparseColMatRef::new(structure(&self.pattern), matrix.values()),
            Side::Lower,
            Default::default(),
            Par::Seq,
            MemStack::new(&mut memory),
            Default::default(),
        );
        match factorized {
            Ok(_) => Ok(()),
            Err(LltError::NonPositivePivot { .. }) => Err(FactorizationError::NotPositiveDefinite),
        }
    }

    /// Solves with the last factorized matrix for all columns of `right`, `(n, N)`.
    ///
    /// # Errors
    /// [`FactorizationError::NotPositiveDefinite`] if nothing was factorized or the solution is not finite.
    pub fn solve(&self, right: &Array2<f64>) -> Result<Array2<f64>, FactorizationError> {
        let (n, columns) = right.dim();
        if self.factor.is_empty() || n != self.pattern.n() {
            return Err(FactorizationError::NotPositiveDefinite);
        }
        // Column-major copy: faer solves in place.
        let mut values: Vec<f64> = right.t().iter().copied().collect();
        let scratch = self.symbolic.solve_in_place_scratch::<f64>(columns, Par::Seq);
        let mut memory = MemBuffer::try_new(scratch).map_err(|_| FactorizationError::OutOfMemory)?;
        faer::sparse::linalg::cholesky::LltRef::new(&self.symbolic, &self.factor).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(&mut values, n, columns),
            Par::Seq,
            MemStack::new(&mut memory),
        );
        if values.iter().any(|x| !x.is_finite()) {
            return Err(FactorizationError::NotPositiveDefinite);
        }
        Ok(Array2::from_shape_fn((n, columns), |(i, k)| values[k * n + i]))
    }
}

fn structure(pattern: &SymmetricPattern) -> SymbolicSparseColMatRef<'_, usize> {
    SymbolicSparseColMatRef::new_checked(pattern.n(), pattern.n(), pattern.columns(), None, pattern.rows())
}
