//! Principal axes and quadrics of a handful of points.

/// Centre and principal axes of points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrincipalAxes {
    /// The mean of the points.
    pub centre: [f64; 3],
    /// Variances along the axes, smallest first.
    pub variances: [f64; 3],
    /// Unit directions of the axes, in the order of the variances.
    pub directions: [[f64; 3]; 3],
}

/// The principal axes of `points`; those of no point are the coordinate axes.
pub fn principal_axes(points: &[[f64; 3]]) -> PrincipalAxes {
    let scale = 1.0 / points.len().max(1) as f64;
    let mut centre = [0.0; 3];
    for p in points {
        centre = std::array::from_fn(|k| centre[k] + p[k] * scale);
    }
    let mut covariance = [[0.0; 3]; 3];
    for p in points {
        let d: [f64; 3] = std::array::from_fn(|k| p[k] - centre[k]);
        for r in 0..3 {
            for c in 0..3 {
                covariance[r][c] += d[r] * d[c] * scale;
            }
        }
    }
    let (variances, directions) = symmetric_eigen(covariance);
    PrincipalAxes { centre, variances, directions }
}

/// Eigenvalues, smallest first, and unit eigenvectors of a symmetric matrix, by cyclic Jacobi rotations
/// (Golub & Van Loan 2013, §8.5).
pub(crate) fn symmetric_eigen(mut a: [[f64; 3]; 3]) -> ([f64; 3], [[f64; 3]; 3]) {
    // Convergence is quadratic; three to five sweeps reach round-off, the rest is reserve.
    const SWEEPS: usize = 12;
    let mut v = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for _ in 0..SWEEPS {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if a[p][q].abs() <= f64::EPSILON * 1e-3 * (a[p][p] * a[q][q]).abs().sqrt() || a[p][q] == 0.0 {
                continue;
            }
            let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
            let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
            let c = 1.0 / (t * t + 1.0).sqrt();
            let s = t * c;
            for row in &mut a {
                (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
            }
            for k in 0..3 {
                (a[p][k], a[q][k]) = (c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]);
            }
            // The rows of `v` are the eigenvectors.
            for k in 0..3 {
                (v[p][k], v[q][k]) = (c * v[p][k] - s * v[q][k], s * v[p][k] + c * v[q][k]);
            }
        }
    }
    let mut order = [0, 1, 2];
    order.sort_by(|&i, &j| a[i][i].total_cmp(&a[j][j]));
    (order.map(|i| a[i][i].max(0.0)), order.map(|i| v[i]))
}

/// The quadric `z = c₀ + c₁x + c₂y + c₃x² + c₄xy + c₅y²` that fits points best, seen from the origin.
pub(crate) struct Quadric {
    coefficients: [f64; 6],
    /// Share of the point at the origin in its own fitted value (the diagonal entry of the hat matrix).
    pub(crate) leverage: f64,
}

impl Quadric {
    /// Least squares over `points`; `None` for fewer than six or where they do not determine the quadric.
    pub(crate) fn fit(points: &[[f64; 3]]) -> Option<Self> {
        let n = points.len();
        let radius = points.iter().map(|p| p[0] * p[0] + p[1] * p[1]).fold(0.0, f64::max).sqrt();
        if n < 6 || radius == 0.0 {
            return None;
        }
        let mut a = [[0.0; 6]; 6];
        let mut b = [0.0; 6];
        for p in points {
            let (x, y) = (p[0] / radius, p[1] / radius);
            let basis = basis(x, y);
            for r in 0..6 {
                b[r] += basis[r] * p[2];
                for c in 0..=r {
                    a[r][c] += basis[r] * basis[c];
                }
            }
        }
        let a = factorize(a, n)?;
        let scaled = solve(&a, b);
        let leverage = solve(&a, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0])[0];
        let power = [1.0, radius, radius, radius * radius, radius * radius, radius * radius];
        Some(Self { coefficients: std::array::from_fn(|k| scaled[k] / power[k]), leverage })
    }

    /// Value over a place.
    pub(crate) fn at(&self, x: f64, y: f64) -> f64 {
        let [c, p, q, d, e, f] = self.coefficients;
        c + x * (p + d * x + e * y) + y * (q + f * y)
    }

    /// Value at the origin.
    pub(crate) fn height(&self) -> f64 {
        self.coefficients[0]
    }

    /// Gradient at the origin.
    pub(crate) fn gradient(&self) -> [f64; 2] {
        [self.coefficients[1], self.coefficients[2]]
    }

    /// Principal curvatures at the origin, smaller first: the roots of `κ² − 2Hκ + K`.
    pub(crate) fn principal_curvatures(&self) -> [f64; 2] {
        let [_, p, q, d, e, f] = self.coefficients;
        let (r, s, t) = (2.0 * d, e, 2.0 * f);
        let w = 1.0 + p * p + q * q;
        let mean = ((1.0 + q * q) * r - 2.0 * p * q * s + (1.0 + p * p) * t) / (2.0 * w * w.sqrt());
        let gauss = (r * t - s * s) / (w * w);
        let root = (mean * mean - gauss).max(0.0).sqrt();
        [mean - root, mean + root]
    }
}

/// The functions of a quadric.
pub(crate) fn basis(x: f64, y: f64) -> [f64; 6] {
    [1.0, x, y, x * x, x * y, y * y]
}

/// The Cholesky factor of the normal matrix of `n` points in the unit disk, of which the lower triangle is given; `None` where they do
/// not determine a quadric.
pub(crate) fn factorize(mut a: [[f64; 6]; 6], n: usize) -> Option<[[f64; 6]; 6]> {
    // Pivots below this share of the number of points: the points lie on a conic, or nearly so.
    const PIVOT: f64 = 1e-6;
    for j in 0..6 {
        for i in j..6 {
            let s = a[i][j] - (0..j).map(|k| a[i][k] * a[j][k]).sum::<f64>();
            a[i][j] = if i > j {
                s / a[j][j]
            } else if s > PIVOT * n as f64 {
                s.sqrt()
            } else {
                return None;
            };
        }
    }
    Some(a)
}

/// Solves `L Lᵀ x = b` for the lower triangle `l`.
pub(crate) fn solve(l: &[[f64; 6]; 6], mut b: [f64; 6]) -> [f64; 6] {
    for i in 0..6 {
        b[i] = (b[i] - (0..i).map(|k| l[i][k] * b[k]).sum::<f64>()) / l[i][i];
    }
    for i in (0..6).rev() {
        b[i] = (b[i] - (i + 1..6).map(|k| l[k][i] * b[k]).sum::<f64>()) / l[i][i];
    }
    b
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn eigenvectors_are_orthonormal_and_rebuild_the_matrix(x in prop::array::uniform6(-1.0..1.0)) {
            let a = [[x[0], x[1], x[2]], [x[1], x[3], x[4]], [x[2], x[4], x[5]]];
            let square: [[f64; 3]; 3] =
                std::array::from_fn(|r| std::array::from_fn(|c| (0..3).map(|k| a[r][k] * a[k][c]).sum()));
            let (values, v) = symmetric_eigen(square);
            prop_assert!(values[0] <= values[1] && values[1] <= values[2]);
            for r in 0..3 {
                for c in 0..3 {
                    let rebuilt: f64 = (0..3).map(|k| values[k] * v[k][r] * v[k][c]).sum();
                    prop_assert!((rebuilt - square[r][c]).abs() < 1e-13);
                    let inner: f64 = (0..3).map(|k| v[r][k] * v[c][k]).sum();
                    prop_assert!((inner - f64::from(u8::from(r == c))).abs() < 1e-13);
                }
            }
        }

        #[test]
        fn a_quadric_is_reproduced(c in prop::array::uniform6(-1.0..1.0), scale in 1e-3..1e3) {
            let points: Vec<[f64; 3]> = (0..25)
                .map(|i| {
                    let (x, y) = (scale * ((i / 5) as f64 - 2.0), scale * ((i % 5) as f64 - 2.0));
                    [x, y, c[0] + c[1] * x + c[2] * y + c[3] * x * x + c[4] * x * y + c[5] * y * y]
                })
                .collect();
            let fit: Quadric = Quadric::fit(&points).unwrap();
            let size = f64::max(scale, 1.0).powi(2);
            prop_assert!(f64::abs(fit.height() - c[0]) < 1e-11 * size);
            prop_assert!(f64::abs(fit.gradient()[0] - c[1]) < 1e-11 * size / scale);
            prop_assert!(fit.leverage > 0.0 && fit.leverage < 1.0);
        }
    }
}
