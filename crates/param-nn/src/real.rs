//! Numbers and dense products that the networks compute with.

use std::borrow::Cow;
use std::iter::Sum;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Sub};

use faer::linalg::matmul::matmul;
use faer::traits::ComplexField;
use faer::{Accum, MatMut, MatRef, Par};
use pulp::{Simd, WithSimd};

/// `f32` for training and inference, `f64` for the proofs of the kernels.
pub(crate) trait Real:
    ComplexField
    + Copy
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + AddAssign
    + MulAssign
    + Sum
{
    fn from_f64(x: f64) -> Self;
    fn to_f64(self) -> f64;
    fn root(self) -> Self;

    /// In single precision.
    fn singles(x: &[Self]) -> Cow<'_, [f32]>;
}

impl Real for f32 {
    fn from_f64(x: f64) -> Self {
        x as f32
    }

    fn to_f64(self) -> f64 {
        f64::from(self)
    }

    fn root(self) -> Self {
        self.sqrt()
    }

    fn singles(x: &[Self]) -> Cow<'_, [f32]> {
        Cow::Borrowed(x)
    }
}

impl Real for f64 {
    fn from_f64(x: f64) -> Self {
        x
    }

    fn to_f64(self) -> f64 {
        self
    }

    fn root(self) -> Self {
        self.sqrt()
    }

    fn singles(x: &[Self]) -> Cow<'_, [f32]> {
        x.iter().map(|&x| x as f32).collect()
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

/// Runs a loop with the widest vector instructions of the machine. Closures have to be marked `inline(always)`, and to
/// change something: the calls of others are compiled apart, without these instructions.
#[inline(always)]
pub(crate) fn vectorized(body: impl FnMut()) {
    pulp::Arch::new().dispatch(Vectorized(body));
}

struct Vectorized<F>(F);

impl<F: FnMut()> WithSimd for Vectorized<F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) {
        (self.0)();
    }
}
