//! Which directions of a parameter may move.

use ndarray::ArrayView2;
use thb_core::ParameterBox;

/// What happens to points on the boundary of the parameter domain.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Boundary {
    /// They stay on their side, corners on their corner (Imperatore 2024, Remark 22). Along a side that has hardly any, the
    /// points next to it keep their distance from it in their stead: a surface whose points are free to leave its rim
    /// swings out there.
    #[default]
    Kept,
    /// They move like all others, within the domain.
    Free,
}

/// Share of the points that a side of a regular cloud has, from which on it counts as having its own.
const LINED: f64 = 0.25;

/// Distance from a side, in mean spacings, within which points hold it. On average half as many as a regular cloud has
/// on it.
const NEAR: f64 = 0.5;

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
        // Mean spacing, as a share of the domain.
        let spacing = (parameters.nrows().max(1) as f64).powf(-1.0 / D as f64);
        let margins: [[f64; 2]; D] = std::array::from_fn(|d| {
            [lower[d], upper[d]].map(|side| {
                let on_side = parameters.column(d).iter().filter(|&&u| u == side).count() as f64;
                // A regular cloud has one point a spacing along each side.
                let is_lined = on_side * spacing.powi(D as i32 - 1) >= LINED;
                if is_lined { 0.0 } else { NEAR * spacing * (upper[d] - lower[d]) }
            })
        });
        let held = |u: f64, d: usize| u - lower[d] <= margins[d][0] || upper[d] - u <= margins[d][1];
        let bits = |row: ndarray::ArrayView1<'_, f64>| {
            row.iter().take(D).enumerate().fold(0, |bits, (d, &u)| bits | u8::from(held(u, d)) << d)
        };
        Self { held: parameters.outer_iter().map(bits).collect() }
    }

    /// The constraints of points at parameters `(m, D)` of the domain of a space, whose seams are no sides.
    pub fn in_space(parameters: ArrayView2<'_, f64>, space: &impl ParameterBox<D>, boundary: Boundary) -> Self {
        Self::new(parameters, space.domain(), boundary).released(space.periodic())
    }

    /// The same constraints without those on the sides of some directions: at the seam of a periodic one points pass.
    pub fn released(mut self, directions: [bool; D]) -> Self {
        let bits = (0..D).fold(0, |bits, d| bits | u8::from(directions[d]) << d);
        self.held.iter_mut().for_each(|held| *held &= !bits);
        self
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

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    #[test]
    fn sides_are_held_by_their_points_or_by_those_next_to_them() {
        // A lattice that reaches three sides exactly and stays off the fourth by a tenth of a spacing.
        let n = 21;
        let parameters = Array2::from_shape_fn((n * n, 2), |(i, d)| {
            let u = [i / n, i % n][d] as f64 / (n - 1) as f64;
            if d == 0 { u.max(0.1 / n as f64) } else { u }
        });
        let constraints = Constraints::new(parameters.view(), ([0.0; 2], [1.0; 2]), Boundary::Kept);
        for i in 0..n * n {
            let rim = |k: usize| k == 0 || k == n - 1;
            assert_eq!(constraints.free(i), [!rim(i / n), !rim(i % n)], "{i}");
        }
        let free = Constraints::new(parameters.view(), ([0.0; 2], [1.0; 2]), Boundary::Free);
        assert!((0..n * n).all(|i| !free.is_held(i)));
    }
}
