//! Vectors of at most three coordinates.

use fit_ls::SortedPoints;

/// Coordinates of a point or vector in R^N, N ≤ 3, padded with zeros to one vector register.
pub type Vector = [f64; 4];

/// Largest dimension of the points.
pub(crate) const MAX_DIM: usize = 3;

/// A sorted point, padded.
pub(crate) fn point<const D: usize>(points: &SortedPoints<D>, at: usize) -> Vector {
    let mut target = [0.0; 4];
    (0..points.dim()).for_each(|k| target[k] = points.coordinates(k)[at]);
    target
}

/// A row of at most three numbers as a vector.
pub(crate) fn padded(row: &[f64]) -> Vector {
    let mut vector = [0.0; 4];
    row.iter().zip(&mut vector).for_each(|(x, target)| *target = *x);
    vector
}

/// A vector of length 1 in the same direction; zero stays.
pub(crate) fn unit(v: Vector) -> Vector {
    let length = dot(&v, &v).sqrt().max(f64::MIN_POSITIVE);
    v.map(|x| x / length)
}

/// The cross product in space.
pub(crate) fn cross(a: &Vector, b: &Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0], 0.0]
}

#[inline(always)]
pub(crate) fn dot(a: &Vector, b: &Vector) -> f64 {
    (a[0] * b[0] + a[2] * b[2]) + (a[1] * b[1] + a[3] * b[3])
}

#[inline(always)]
pub(crate) fn difference(a: &Vector, b: &Vector) -> Vector {
    std::array::from_fn(|k| a[k] - b[k])
}
