//! Equations of the few unknowns of one point.

/// The Cholesky factor of a symmetric matrix, with something added to its diagonal, in the directions that are free.
///
/// Steps of Newton's method for the parameter of a point are solved with it: `D` is small, so it lies on the stack.
#[derive(Clone, Copy, Debug)]
pub struct SmallCholesky<const D: usize> {
    factor: [[f64; D]; D],
    free: [bool; D],
}

impl<const D: usize> SmallCholesky<D> {
    /// Factorizes `M + diag(added)`, of which the lower triangle is read; `None` unless positive definite beyond round-off in the
    /// free directions.
    #[inline(always)]
    pub fn new(matrix: &[[f64; D]; D], added: &[f64; D], free: [bool; D]) -> Option<Self> {
        let mut factor = [[0.0; D]; D];
        for i in 0..D {
            for j in 0..=i {
                let entry = match (i == j, free[i] && free[j]) {
                    (true, true) => matrix[i][i] + added[i],
                    (true, false) => 1.0,
                    (false, true) => matrix[i][j],
                    (false, false) => 0.0,
                };
                let mut rest = entry;
                for k in 0..j {
                    rest -= factor[i][k] * factor[j][k];
                }
                if i == j {
                    // Below round-off of the entry the pivot says nothing.
                    if rest <= f64::EPSILON * entry.abs() || rest.is_nan() {
                        return None;
                    }
                    factor[i][i] = rest.sqrt();
                } else {
                    factor[i][j] = rest / factor[j][j];
                }
            }
        }
        Some(Self { factor, free })
    }

    /// The step that solves the equations for a gradient `g`, whose right-hand side is `−g`; zero in directions that are not free.
    #[inline(always)]
    pub fn step(&self, gradient: &[f64; D]) -> [f64; D] {
        let Self { factor, free } = self;
        let mut x = [0.0; D];
        for i in 0..D {
            let mut right = if free[i] { -gradient[i] } else { 0.0 };
            for k in 0..i {
                right -= factor[i][k] * x[k];
            }
            x[i] = right / factor[i][i];
        }
        for i in (0..D).rev() {
            for k in i + 1..D {
                x[i] -= factor[k][i] * x[k];
            }
            x[i] /= factor[i][i];
        }
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_step_solves_the_free_equations_and_indefinite_ones_have_none() {
        let (matrix, gradient) = ([[4.0, 1.0, 0.5], [1.0, 3.0, -1.0], [0.5, -1.0, 2.0]], [1.0, -2.0, 3.0]);
        for free in [[true; 3], [true, false, true], [false, true, true]] {
            let added = [0.1, 0.2, 0.3];
            let x = SmallCholesky::new(&matrix, &added, free).unwrap().step(&gradient);
            for i in 0..3 {
                let rest = (0..3).map(|j| matrix[i][j] * x[j]).sum::<f64>() + added[i] * x[i] + gradient[i];
                assert!(if free[i] { rest.abs() < 1e-14 } else { x[i] == 0.0 }, "{free:?}: {x:?}");
            }
        }
        assert!(SmallCholesky::new(&[[1.0, 2.0], [2.0, 1.0]], &[0.0; 2], [true; 2]).is_none());
        assert!(SmallCholesky::new(&[[1.0, 2.0], [2.0, 1.0]], &[0.0; 2], [true, false]).is_some());
    }
}
