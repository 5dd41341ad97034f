//! Least squares with a spline on uniform knots, at parameters that the networks move.

use crate::bezier::{LARGEST_DEGREE, solve_normal_equations};

const LOCAL: usize = LARGEST_DEGREE + 1;

/// Splines of a degree on equal elements of \[0, 1\]; one element makes polynomials in Bernstein form.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SplineSpace {
    /// Degree, at most [`LARGEST_DEGREE`].
    pub degree: usize,
    /// Number of elements, at least 1.
    pub elements: usize,
}

/// Constants: the space across the only line of a sequence.
pub(crate) const CONSTANTS: SplineSpace = SplineSpace { degree: 0, elements: 1 };

/// Functions that do not vanish at a place.
#[derive(Clone, Copy)]
struct Local {
    first: usize,
    values: [f64; LOCAL],
    slopes: [f64; LOCAL],
}

impl SplineSpace {
    /// Polynomials of a degree.
    pub fn polynomials(degree: usize) -> Self {
        Self { degree, elements: 1 }
    }

    /// Number of functions.
    pub fn functions(self) -> usize {
        self.degree + self.elements
    }

    /// Knots count from 0; the first and the last `degree + 1` coincide.
    fn knot(self, index: usize) -> f64 {
        (index.saturating_sub(self.degree) as f64 / self.elements as f64).min(1.0)
    }

    /// Means of the knots inside each function's support: where control points of the identity lie.
    pub(crate) fn greville(self) -> Vec<f64> {
        let mean = |i: usize| (1..=self.degree).map(|k| self.knot(i + k)).sum::<f64>() / self.degree as f64;
        (0..self.functions()).map(mean).collect()
    }

    /// Values of all functions.
    pub(crate) fn values(self, t: f64) -> Vec<f64> {
        let local = self.local(t);
        let mut values = vec![0.0; self.functions()];
        values[local.first..=local.first + self.degree].copy_from_slice(&local.values[..=self.degree]);
        values
    }

    /// Cox–de Boor recursion.
    fn local(self, t: f64) -> Local {
        let d = self.degree;
        let first = ((t * self.elements as f64) as usize).min(self.elements - 1);
        let (mut values, mut slopes) = ([0.0; LOCAL], [0.0; LOCAL]);
        values[0] = 1.0;
        for k in 1..=d {
            let (mut carried, mut carried_slope) = (0.0, 0.0);
            for r in 0..k {
                // The function of degree k − 1 whose support runs between these knots.
                let (left, right) = (self.knot(first + d - k + 1 + r), self.knot(first + d + 1 + r));
                let share = values[r] / (right - left);
                values[r] = carried + (right - t) * share;
                carried = (t - left) * share;
                if k == d {
                    slopes[r] = carried_slope - d as f64 * share;
                    carried_slope = d as f64 * share;
                }
            }
            values[k] = carried;
            if k == d {
                slopes[k] = carried_slope;
            }
        }
        Local { first, values, slopes }
    }
}

/// The tensor-product spline of least squares through points with parameters.
#[derive(Clone, Debug)]
pub(crate) struct GridFit {
    spaces: [SplineSpace; 2],
    /// Control points; the first direction runs first.
    coefficients: Vec<[f64; 3]>,
    /// Mean of the squared distances.
    pub(crate) mse: f64,
    /// At each point: spline minus point, derivatives of the spline along both directions.
    pub(crate) jets: Vec<[[f64; 3]; 3]>,
}

impl GridFit {
    /// Fits points at parameters in the unit square (Imperatore 2024, (3.5)); undetermined control points are zero.
    pub(crate) fn new(spaces: [SplineSpace; 2], uv: &[[f64; 2]], xyz: &[[f64; 3]]) -> Self {
        let [across, n] = [spaces[0].functions(), spaces[0].functions() * spaces[1].functions()];
        let width = n + 3;
        let mut gram = vec![0.0; n * width];
        let locals: Vec<[Local; 2]> = uv.iter().map(|uv| [spaces[0].local(uv[0]), spaces[1].local(uv[1])]).collect();
        let mut values = [(0, 0.0); LOCAL * LOCAL];
        for ([u, v], point) in locals.iter().zip(xyz) {
            let mut count = 0;
            for j in 0..=spaces[1].degree {
                for i in 0..=spaces[0].degree {
                    values[count] = ((v.first + j) * across + u.first + i, u.values[i] * v.values[j]);
                    count += 1;
                }
            }
            for a in 0..count {
                let (row, value) = values[a];
                let target = &mut gram[row * width..(row + 1) * width];
                for (column, other) in &values[a..count] {
                    target[*column] += value * other;
                }
                (0..3).for_each(|k| target[n + k] += value * point[k]);
            }
        }
        let solution = solve_normal_equations(&mut gram, n);
        let coefficients = solution.rows().into_iter().map(|c| [c[0], c[1], c[2]]).collect();
        let mut fit = Self { spaces, coefficients, mse: 0.0, jets: Vec::with_capacity(uv.len()) };
        let mut squared = 0.0;
        for (local, point) in locals.iter().zip(xyz) {
            let mut jet = fit.jet_of(local);
            (0..3).for_each(|k| jet[0][k] -= point[k]);
            squared += jet[0].iter().map(|r| r * r).sum::<f64>();
            fit.jets.push(jet);
        }
        fit.mse = squared / uv.len().max(1) as f64;
        fit
    }

    /// The spline and its derivatives along both directions.
    fn jet_of(&self, [u, v]: &[Local; 2]) -> [[f64; 3]; 3] {
        let across = self.spaces[0].functions();
        let mut jet = [[0.0; 3]; 3];
        for j in 0..=self.spaces[1].degree {
            for i in 0..=self.spaces[0].degree {
                let control = &self.coefficients[(v.first + j) * across + u.first + i];
                let factors = [u.values[i] * v.values[j], u.slopes[i] * v.values[j], u.values[i] * v.slopes[j]];
                for (row, factor) in jet.iter_mut().zip(factors) {
                    (0..3).for_each(|k| row[k] += factor * control[k]);
                }
            }
        }
        jet
    }

    /// Derivatives of the mean squared error by the parameters. The control points follow the parameters, but the
    /// residual is orthogonal to what they can change, so they count as constant (variable projection, Golub and Pereyra
    /// 1973).
    pub(crate) fn gradient(&self) -> Vec<[f64; 2]> {
        let scale = 2.0 / self.jets.len().max(1) as f64;
        let dot = |a: &[f64; 3], b: &[f64; 3]| scale * (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]);
        self.jets.iter().map(|[r, u, v]| [dot(r, u), dot(r, v)]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bezier::BezierFit;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn functions_sum_to_one_and_have_their_slopes(degree in 1..=LARGEST_DEGREE, elements in 1..7usize, t in 0.001..0.999f64) {
            let space = SplineSpace { degree, elements };
            let local = space.local(t);
            prop_assert!((local.values.iter().sum::<f64>() - 1.0).abs() < 1e-13);
            let h = 1e-6;
            let (after, before) = (space.local(t + h), space.local(t - h));
            if after.first == before.first {
                for i in 0..=degree {
                    let difference = (after.values[i] - before.values[i]) / (2.0 * h);
                    prop_assert!((local.slopes[i] - difference).abs() < 1e-5, "{} {difference}", local.slopes[i]);
                }
            }
        }
    }

    fn places(count: usize) -> Vec<[f64; 2]> {
        (0..count).map(|k| [(0.754_877_666 * k as f64).fract(), (0.569_840_291 * k as f64).fract()]).collect()
    }

    #[test]
    fn one_element_is_the_patch() {
        let uv = places(80);
        let xyz: Vec<[f64; 3]> = uv.iter().map(|[u, v]| [u + 0.1 * (7.0 * v).sin(), *v, (3.0 * u * v).cos()]).collect();
        for degree in 1..=5 {
            let patch = BezierFit::solve(&uv, &xyz, degree);
            let fit = GridFit::new([SplineSpace::polynomials(degree); 2], &uv, &xyz);
            assert!((patch.mse - fit.mse).abs() < 1e-12, "{} {}", patch.mse, fit.mse);
        }
    }

    #[test]
    fn splines_of_the_space_come_back() {
        let space = SplineSpace { degree: 3, elements: 4 };
        let planted = |t: f64| space.local(t);
        let uv: Vec<[f64; 2]> = (0..60).map(|k| [f64::from(k) / 59.0, 0.0]).collect();
        let point = |t: f64| {
            let local = planted(t);
            let sum =
                |k: usize| (0..=3).map(|i| local.values[i] * ((local.first + i) as f64 * (k + 1) as f64).sin()).sum();
            [sum(0), sum(1), sum(2)]
        };
        let xyz: Vec<[f64; 3]> = uv.iter().map(|uv| point(uv[0])).collect();
        let fit = GridFit::new([space, CONSTANTS], &uv, &xyz);
        assert!(fit.mse < 1e-25, "{}", fit.mse);
    }

    #[test]
    fn the_gradient_agrees_with_differences() {
        let mut uv = places(60);
        let xyz: Vec<[f64; 3]> = uv.iter().map(|[u, v]| [u + 0.1 * (7.0 * v).sin(), *v, (3.0 * u * v).cos()]).collect();
        for spaces in [[SplineSpace { degree: 2, elements: 3 }; 2], [SplineSpace::polynomials(5), CONSTANTS]] {
            let gradient = GridFit::new(spaces, &uv, &xyz).gradient();
            let h = 1e-5;
            for (i, k) in [(3, 0), (17, 1), (42, 0), (59, 1)] {
                let kept = uv[i][k];
                let mut at = |x| {
                    uv[i][k] = x;
                    GridFit::new(spaces, &uv, &xyz).mse
                };
                let difference = (at(kept + h) - at(kept - h)) / (2.0 * h);
                uv[i][k] = kept;
                assert!((difference - gradient[i][k]).abs() < 1e-6, "{difference} {}", gradient[i][k]);
            }
        }
    }
}
