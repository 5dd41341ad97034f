//! Which directions of a parameter may move.

use ndarray::ArrayView2;

/// What happens to points on the boundary of the parameter domain.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Boundary {
    /// They stay on their side, corners on their corner (Imperatore 2024, Remark 22).
    #[default]
    Kept,
    /// They move like all others, within the domain.
    Free,
}

/// The directions in which each point may move, by the index of the point.
#[derive(Clone, Debug)]
pub struct Constraints<const D: usize> {
    /// Bit `d` is set where direction `d` is held; empty if nothing is.
    held: Vec<u8>,
}

impl<const D: usize> Constraints<D> {
    /// The constraints of points at parameters `(m, D)` of a domain with the given corners.
    pub fn new(parameters: ArrayView2<'_, f64>, (lower, upper): ([f64; D], [f64; D]), boundary: Boundary) -> Self {
        if boundary == Boundary::Free {
            return Self { held: Vec::new() };
        }
        let on_side =
            |row: ndarray::ArrayView1<'_, f64>, d: usize| row.get(d).is_some_and(|&u| u == lower[d] || u == upper[d]);
        let bits = |row| (0..D).fold(0, |bits, d| bits | u8::from(on_side(row, d)) << d);
        Self { held: parameters.outer_iter().map(bits).collect() }
    }

    /// Whether each direction of a point is free.
    pub fn free(&self, index: usize) -> [bool; D] {
        let held = self.held.get(index).copied().unwrap_or(0);
        std::array::from_fn(|d| held & (1 << d) == 0)
    }

    /// Whether a point is held in some direction.
    pub fn is_held(&self, index: usize) -> bool {
        self.held.get(index).is_some_and(|&held| held != 0)
    }
}
