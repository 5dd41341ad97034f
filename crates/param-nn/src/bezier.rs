//! Least squares with one tensor-product Bézier patch.

use ndarray::{Array2, ArrayView2};

use crate::error::NnError;

/// Largest degree of a patch; basis values live on the stack.
pub const LARGEST_DEGREE: usize = 8;

const MAX_FUNCTIONS: usize = LARGEST_DEGREE + 1;

/// A column whose remainder, after the projection onto the columns before it, is this much shorter than the column
/// itself depends on them to the accuracy of a Gram matrix: round-off of its squares is 1e-16. Its coefficient is zero.
const DEPENDENT: f64 = 1e-13;

/// Values of the Bernstein polynomials of a degree at `t`, and of their first derivatives.
fn bernstein(degree: usize, t: f64) -> ([f64; MAX_FUNCTIONS], [f64; MAX_FUNCTIONS]) {
    let mut values = [0.0; MAX_FUNCTIONS];
    let mut slopes = [0.0; MAX_FUNCTIONS];
    values[0] = 1.0;
    for d in 1..=degree {
        if d == degree {
            for i in 0..=d {
                let left = if i > 0 { values[i - 1] } else { 0.0 };
                slopes[i] = d as f64 * (left - if i < d { values[i] } else { 0.0 });
            }
        }
        let mut carried = 0.0;
        for value in &mut values[..d] {
            let kept = *value * (1.0 - t);
            (carried, *value) = (*value * t, kept + carried);
        }
        values[d] = carried;
    }
    (values, slopes)
}

/// Values of the tensor-product functions at `(u, v)` into `out`; u runs first.
pub(crate) fn tensor_values(degree: usize, [u, v]: [f64; 2], out: &mut [f64]) {
    let (along_u, along_v) = (bernstein(degree, u).0, bernstein(degree, v).0);
    for (row, b) in out.chunks_exact_mut(degree + 1).zip(along_v) {
        row.iter_mut().zip(along_u).for_each(|(x, a)| *x = a * b);
    }
}

/// The patch of least squares through points with parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct BezierFit {
    /// Degree in both directions.
    pub degree: usize,
    /// Control points, shape `((degree + 1)², 3)`; u runs first.
    pub coefficients: Array2<f64>,
    /// Mean over the points of the squared distance at the parameter, the three coordinates summed.
    pub mse: f64,
}

impl BezierFit {
    /// Fits `points`, shape `(m, 3)`, at `parameters`, shape `(m, 2)` (Imperatore 2024, (3.5)).
    ///
    /// Normal equations: with degrees up to 5 their condition number stays below 1e8 for spread parameters. Where the
    /// parameters do not determine all control points, the undetermined ones are zero and the residual is the same as
    /// of any other solution.
    ///
    /// # Errors
    /// [`NnError::WrongShape`]; [`NnError::BadOption`] for a degree of 0 or above [`LARGEST_DEGREE`];
    /// [`NnError::Parameter`]; points that are not finite.
    pub fn new(parameters: ArrayView2<'_, f64>, points: ArrayView2<'_, f64>, degree: usize) -> Result<Self, NnError> {
        if points.ncols() != 3 {
            return Err(NnError::WrongShape {
                what: "points",
                given: points.dim().into(),
                required: [points.nrows(), 3],
            });
        }
        if parameters.dim() != (points.nrows(), 2) {
            let required = [points.nrows(), 2];
            return Err(NnError::WrongShape { what: "parameters", given: parameters.dim().into(), required });
        }
        if !(1..=LARGEST_DEGREE).contains(&degree) {
            return Err(NnError::BadOption { name: "degree", value: degree as f64, range: "from 1 to 8" });
        }
        point_cloud::check_finite(points)?;
        let mut uv = Vec::with_capacity(points.nrows());
        for (index, row) in parameters.rows().into_iter().enumerate() {
            let value = [row[0], row[1]];
            if !value.iter().all(|x| (0.0..=1.0).contains(x)) {
                return Err(NnError::Parameter { index, value });
            }
            uv.push(value);
        }
        let xyz: Vec<[f64; 3]> = points.rows().into_iter().map(|p| [p[0], p[1], p[2]]).collect();
        Ok(Self::solve(&uv, &xyz, degree))
    }

    /// The fit of checked data.
    pub(crate) fn solve(uv: &[[f64; 2]], xyz: &[[f64; 3]], degree: usize) -> Self {
        let n = (degree + 1) * (degree + 1);
        // Columns of the functions, then the three right-hand sides: one symmetric update serves both.
        let mut gram = vec![0.0; n * (n + 3)];
        let mut row = vec![0.0; n + 3];
        for (&parameters, point) in uv.iter().zip(xyz) {
            tensor_values(degree, parameters, &mut row[..n]);
            row[n..].copy_from_slice(point);
            for i in 0..n {
                let value = row[i];
                let target = &mut gram[i * (n + 3) + i..(i + 1) * (n + 3)];
                target.iter_mut().zip(&row[i..]).for_each(|(t, x)| *t += value * x);
            }
        }
        let coefficients = solve_normal_equations(&mut gram, n);
        let mut fit = Self { degree, coefficients, mse: 0.0 };
        let squared: f64 =
            uv.iter().zip(xyz).map(|(&uv, p)| fit.residual(uv, p).iter().map(|r| r * r).sum::<f64>()).sum();
        fit.mse = squared / uv.len().max(1) as f64;
        fit
    }

    /// The patch at `uv`.
    pub fn point(&self, uv: [f64; 2]) -> [f64; 3] {
        self.jet(uv)[0]
    }

    /// The patch at `uv` minus a point.
    fn residual(&self, uv: [f64; 2], point: &[f64; 3]) -> [f64; 3] {
        let at = self.point(uv);
        std::array::from_fn(|k| at[k] - point[k])
    }

    /// The patch and its derivatives along u and v.
    pub(crate) fn jet(&self, [u, v]: [f64; 2]) -> [[f64; 3]; 3] {
        let ((bu, du), (bv, dv)) = (bernstein(self.degree, u), bernstein(self.degree, v));
        let mut jet = [[0.0; 3]; 3];
        for (index, control) in self.coefficients.rows().into_iter().enumerate() {
            let (i, j) = (index % (self.degree + 1), index / (self.degree + 1));
            let factors = [bu[i] * bv[j], du[i] * bv[j], bu[i] * dv[j]];
            for (row, factor) in jet.iter_mut().zip(factors) {
                row.iter_mut().zip(control).for_each(|(x, c)| *x += factor * c);
            }
        }
        jet
    }

    /// Derivatives of [`BezierFit::mse`] by the parameters of the points. The control points follow the parameters, but
    /// the residual is orthogonal to what they can change, so they count as constant (variable projection, Golub and
    /// Pereyra 1973).
    pub(crate) fn gradient(&self, uv: &[[f64; 2]], xyz: &[[f64; 3]]) -> Vec<[f64; 2]> {
        let scale = 2.0 / uv.len().max(1) as f64;
        let one = |(&uv, point): (&[f64; 2], &[f64; 3])| {
            let [at, along_u, along_v] = self.jet(uv);
            let residual: [f64; 3] = std::array::from_fn(|k| scale * (at[k] - point[k]));
            [along_u, along_v].map(|d| d.iter().zip(residual).map(|(a, b)| a * b).sum())
        };
        uv.iter().zip(xyz).map(one).collect()
    }
}

/// Solves the normal equations, given as the upper triangle of the Gram matrix with three right-hand sides behind it,
/// row-major, by Cholesky's method. Dependent columns get zero coefficients.
pub(crate) fn solve_normal_equations(gram: &mut [f64], n: usize) -> Array2<f64> {
    let width = n + 3;
    let mut dependent = vec![false; n];
    for i in 0..n {
        let diagonal = gram[i * width + i];
        let (above, current) = gram.split_at_mut(i * width);
        let current = &mut current[..width];
        for (k, row) in above.chunks_exact(width).enumerate() {
            let factor = row[i];
            if !dependent[k] {
                current[i..].iter_mut().zip(&row[i..]).for_each(|(x, r)| *x -= factor * r);
            }
        }
        dependent[i] = current[i] <= DEPENDENT * diagonal;
        let scale = if dependent[i] { 0.0 } else { current[i].sqrt().recip() };
        current[i..].iter_mut().for_each(|x| *x *= scale);
    }
    let mut solution = Array2::zeros((n, 3));
    for i in (0..n).rev().filter(|&i| !dependent[i]) {
        for k in 0..3 {
            let later: f64 = (i + 1..n).map(|j| gram[i * width + j] * solution[[j, k]]).sum();
            solution[[i, k]] = (gram[i * width + n + k] - later) / gram[i * width + i];
        }
    }
    solution
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn places(count: usize) -> Vec<[f64; 2]> {
        (0..count).map(|k| [(0.754_877_666 * k as f64).fract(), (0.569_840_291 * k as f64).fract()]).collect()
    }

    proptest! {
        #[test]
        fn bernstein_polynomials_sum_to_one_and_have_their_slopes(degree in 1..=LARGEST_DEGREE, t in 0.01..0.99f64) {
            let (values, slopes) = bernstein(degree, t);
            prop_assert!((values.iter().sum::<f64>() - 1.0).abs() < 1e-14);
            let h = 1e-6;
            let (after, before) = (bernstein(degree, t + h).0, bernstein(degree, t - h).0);
            for i in 0..=degree {
                prop_assert!((slopes[i] - (after[i] - before[i]) / (2.0 * h)).abs() < 1e-7);
            }
        }
    }

    #[test]
    fn surfaces_of_the_space_come_back() {
        for degree in 1..=5 {
            let uv = places(200);
            let n = (degree + 1) * (degree + 1);
            let control = Array2::from_shape_fn((n, 3), |(i, k)| ((3 * i + 5 * k) as f64).sin());
            let planted = BezierFit { degree, coefficients: control, mse: 0.0 };
            let xyz: Vec<[f64; 3]> = uv.iter().map(|&uv| planted.point(uv)).collect();
            let fit = BezierFit::solve(&uv, &xyz, degree);
            assert!(fit.mse < 1e-20, "degree {degree}: {}", fit.mse);
            let difference = (&fit.coefficients - &planted.coefficients).iter().fold(0.0f64, |d, x| d.max(x.abs()));
            assert!(difference < 1e-8, "degree {degree}: {difference}");
        }
    }

    #[test]
    fn parameters_on_a_line_leave_the_residual_of_least_squares() {
        // Only three functions of u can be told apart; z = u³ is left with the residual of a parabola.
        let uv: Vec<[f64; 2]> = (0..=4000).map(|k| [k as f64 / 4000.0, 0.5]).collect();
        let xyz: Vec<[f64; 3]> = uv.iter().map(|[u, _]| [*u, 0.0, u.powi(3)]).collect();
        let fit = BezierFit::solve(&uv, &xyz, 2);
        // The continuous problem: u³ minus its best parabola is P₃/20 in shifted Legendre polynomials, mean square 1/2800.
        assert!((fit.mse - 1.0 / 2800.0).abs() < 1e-6, "{}", fit.mse);
    }

    #[test]
    fn the_gradient_agrees_with_differences() {
        let mut uv = places(60);
        let xyz: Vec<[f64; 3]> = uv.iter().map(|[u, v]| [u + 0.1 * (7.0 * v).sin(), *v, (3.0 * u * v).cos()]).collect();
        for degree in [2, 3] {
            let gradient = BezierFit::solve(&uv, &xyz, degree).gradient(&uv, &xyz);
            let h = 1e-5;
            for (i, k) in [(3, 0), (17, 1), (42, 0), (59, 1)] {
                let kept = uv[i][k];
                let mut at = |x| {
                    uv[i][k] = x;
                    BezierFit::solve(&uv, &xyz, degree).mse
                };
                let difference = (at(kept + h) - at(kept - h)) / (2.0 * h);
                uv[i][k] = kept;
                assert!((difference - gradient[i][k]).abs() < 1e-8, "{difference} {}", gradient[i][k]);
            }
        }
    }

    #[test]
    fn wrong_input_is_an_error() {
        let (uv, xyz) = (Array2::zeros((4, 2)), Array2::zeros((4, 3)));
        let fit = |uv: &Array2<f64>, xyz: &Array2<f64>, degree| BezierFit::new(uv.view(), xyz.view(), degree);
        assert!(matches!(fit(&uv, &xyz, 0), Err(NnError::BadOption { .. })));
        assert!(matches!(fit(&xyz, &xyz, 2), Err(NnError::WrongShape { what: "parameters", .. })));
        assert!(matches!(fit(&uv, &uv, 2), Err(NnError::WrongShape { what: "points", .. })));
        assert!(matches!(fit(&(&uv + 1.5), &xyz, 2), Err(NnError::Parameter { index: 0, .. })));
        assert!(matches!(fit(&uv, &(&xyz + f64::NAN), 2), Err(NnError::Cloud(_))));
    }
}
