//! One cell's polynomial, with value and derivatives up to the second order at a parameter.

use thb_core::{BezierMap, MAX_DEGREE};

use crate::points::vector::{Vector, padded};

/// Value and derivatives of a map at a parameter.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Jet<const D: usize> {
    pub(crate) value: Vector,
    pub(crate) first: [Vector; D],
    /// Pairs `a ≤ b` only.
    pub(crate) second: [[Vector; D]; D],
}

/// The polynomial of one cell, copied so that rows are padded.
#[derive(Clone, Debug)]
pub(crate) struct Patch<const D: usize> {
    cell: usize,
    degree: [usize; D],
    lower: [f64; D],
    inverse_size: [f64; D],
    coefficients: Vec<Vector>,
}

/// Bernstein polynomials of a direction at a parameter: values, first and second derivatives.
type Basis = [[f64; MAX_DEGREE + 1]; 3];

impl<const D: usize> Patch<D> {
    pub(crate) fn new(map: &BezierMap<D>, cell: usize) -> Self {
        let mut patch = Self {
            cell,
            degree: map.degree(),
            lower: [0.0; D],
            inverse_size: [0.0; D],
            coefficients: Vec::with_capacity(map.degree().iter().map(|p| p + 1).product()),
        };
        patch.load(map, cell);
        patch
    }

    pub(crate) fn cell(&self) -> usize {
        self.cell
    }

    /// Replaces the cell.
    pub(crate) fn load(&mut self, map: &BezierMap<D>, cell: usize) {
        let (lower, upper) = map.cell_box(cell);
        self.cell = cell;
        self.lower = lower;
        self.inverse_size = std::array::from_fn(|d| 1.0 / (upper[d] - lower[d]));
        self.coefficients.clear();
        self.coefficients.extend(map.cell_coefficients(cell).chunks_exact(map.dim()).map(padded));
    }

    /// Whether a parameter lies in the closed cell.
    pub(crate) fn contains(&self, u: [f64; D]) -> bool {
        (0..D).all(|d| {
            let t = (u[d] - self.lower[d]) * self.inverse_size[d];
            (0.0..=1.0).contains(&t)
        })
    }

    /// Edge lengths of the cell.
    pub(crate) fn size(&self) -> [f64; D] {
        self.inverse_size.map(f64::recip)
    }

    /// Whether a parameter lies in the cell, its upper sides not counted.
    pub(crate) fn owns(&self, u: [f64; D]) -> bool {
        (0..D).all(|d| {
            let t = (u[d] - self.lower[d]) * self.inverse_size[d];
            (0.0..1.0).contains(&t)
        })
    }

    /// Value and derivatives. Outside the cell they are those of the extended polynomial.
    #[inline(always)]
    pub(crate) fn jet(&self, u: [f64; D]) -> Jet<D> {
        self.derivatives::<2>(u)
    }

    /// The same without second derivatives, which are zero.
    #[inline(always)]
    pub(crate) fn first_jet(&self, u: [f64; D]) -> Jet<D> {
        self.derivatives::<1>(u)
    }

    /// The value alone, to the last bit that of the others.
    #[inline(always)]
    pub(crate) fn value(&self, u: [f64; D]) -> Vector {
        self.derivatives::<0>(u).value
    }

    #[inline(always)]
    fn derivatives<const ORDER: usize>(&self, u: [f64; D]) -> Jet<D> {
        // PERF: loops of known length for the usual degrees; example `foot_points`.
        if self.degree == [2; D] {
            self.derivatives_of::<ORDER>([3; D], u)
        } else if self.degree == [3; D] {
            self.derivatives_of::<ORDER>([4; D], u)
        } else {
            self.derivatives_of::<ORDER>(self.degree.map(|p| p + 1), u)
        }
    }

    #[inline(always)]
    fn derivatives_of<const ORDER: usize>(&self, orders: [usize; D], u: [f64; D]) -> Jet<D> {
        let mut basis = [[[0.0; MAX_DEGREE + 1]; 3]; D];
        for d in 0..D {
            let scale = self.inverse_size[d];
            bernstein(orders[d] - 1, (u[d] - self.lower[d]) * scale, scale, &mut basis[d]);
        }
        let mut jet = Jet { value: [0.0; 4], first: [[0.0; 4]; D], second: [[[0.0; 4]; D]; D] };
        let inner = orders[0];
        for (line, rows) in self.coefficients.chunks_exact(inner).enumerate() {
            let mut along = [[0.0; 4]; 3];
            for (i, row) in rows.iter().enumerate() {
                for order in 0..=ORDER {
                    add(&mut along[order], basis[0][order][i], row);
                }
            }
            let mut rest = line;
            // Of each direction but the first, the index in this line.
            let index: [usize; D] = std::array::from_fn(|d| {
                let count = if d == 0 { 1 } else { orders[d] };
                let index = rest % count;
                rest /= count;
                index
            });
            let weight = |orders: [usize; D]| (1..D).map(|d| basis[d][orders[d]][index[d]]).product::<f64>();
            let plain = weight([0; D]);
            add(&mut jet.value, plain, &along[0]);
            if ORDER == 0 {
                continue;
            }
            add(&mut jet.first[0], plain, &along[1]);
            if ORDER == 2 {
                add(&mut jet.second[0][0], plain, &along[2]);
            }
            for a in 1..D {
                let w = weight(std::array::from_fn(|d| usize::from(d == a)));
                add(&mut jet.first[a], w, &along[0]);
                if ORDER < 2 {
                    continue;
                }
                add(&mut jet.second[0][a], w, &along[1]);
                for b in a..D {
                    let w = weight(std::array::from_fn(|d| usize::from(d == a) + usize::from(d == b)));
                    add(&mut jet.second[a][b], w, &along[0]);
                }
            }
        }
        jet
    }
}

/// Bernstein polynomials and their derivatives with respect to a parameter that runs `scale` times slower than `t`.
#[inline(always)]
fn bernstein(degree: usize, t: f64, scale: f64, out: &mut Basis) {
    let [values, first, second] = out;
    let s = 1.0 - t;
    values[0] = 1.0;
    for q in 1..=degree {
        // Before the last two raises the values are those that derivatives are differences of.
        if q + 1 == degree {
            let factor = scale * scale * (degree * q) as f64;
            for k in 0..=degree {
                let at = |i: usize| if i <= k && k - i < q { values[k - i] } else { 0.0 };
                second[k] = factor * (at(2) - 2.0 * at(1) + at(0));
            }
        }
        if q == degree {
            let factor = scale * degree as f64;
            for k in 0..=degree {
                let at = |i: usize| if i <= k && k - i < q { values[k - i] } else { 0.0 };
                first[k] = factor * (at(1) - at(0));
            }
        }
        let mut carried = 0.0;
        for value in &mut values[..q] {
            let share = *value;
            *value = carried + s * share;
            carried = t * share;
        }
        values[q] = carried;
    }
}

#[inline(always)]
fn add(target: &mut Vector, weight: f64, row: &Vector) {
    for k in 0..4 {
        target[k] += weight * row[k];
    }
}
