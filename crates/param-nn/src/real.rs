//! Numbers and dense products that the networks compute with.

use faer::linalg::matmul::matmul;
use faer::traits::ComplexField;
use faer::{Accum, MatMut, MatRef, Par};

/// `f32` for training and inference, `f64` for the proofs of the kernels.
pub(crate) trait Real: candle_core::WithDType + ComplexField {
    fn root(self) -> Self;
}

impl Real for f32 {
    fn root(self) -> Self {
        self.sqrt()
    }
}

impl Real for f64 {
    fn root(self) -> Self {
        self.sqrt()
    }
}

/// Rows of `columns` numbers as a matrix.
pub(crate) fn matrix<T>(rows: &[T], columns: usize) -> MatRef<'_, T> {
    MatRef::from_row_major_slice(rows, rows.len() / columns, columns)
}

/// `out = a b`, row-major; one thread, as its callers run side by side.
pub(crate) fn product<T: Real>(out: &mut [T], a: MatRef<'_, T>, b: MatRef<'_, T>) {
    multiply(out, Accum::Replace, a, b);
}

/// `out += a b`.
pub(crate) fn add_product<T: Real>(out: &mut [T], a: MatRef<'_, T>, b: MatRef<'_, T>) {
    multiply(out, Accum::Add, a, b);
}

fn multiply<T: Real>(out: &mut [T], accumulate: Accum, a: MatRef<'_, T>, b: MatRef<'_, T>) {
    let out = MatMut::from_row_major_slice_mut(out, a.nrows(), b.ncols());
    matmul(out, accumulate, a, b, T::from_f64(1.0), Par::Seq);
}
