//! The equations of a step: what the terms add up to, and their solution.

use fit_ls::{Cholesky, FactorizationError};
use ndarray::Array2;
use thb_core::{SymmetricMatrix, SymmetricPattern};

use crate::Error;

/// `H d = g` for a step d of the coefficients, where g is minus half the gradient of the objective and H the Gauss–Newton matrix of
/// half of it.
///
/// H = A ⊗ I₃ + C: `alike` is A, what all coordinates have in common; `coupled` is C, unknown k of function j at 3 j + k, or nothing
/// where no term couples coordinates.
pub(crate) struct Equations {
    pub(crate) alike: SymmetricMatrix,
    pub(crate) coupled: Option<SymmetricMatrix>,
    /// g, `(n_functions, 3)` row-major.
    pub(crate) right: Vec<f64>,
}

impl Equations {
    /// `alike += factor * matrix`, and `right −= factor * matrix * coefficients`: a quadratic term.
    pub(crate) fn add_quadratic(&mut self, matrix: &SymmetricMatrix, factor: f64, coefficients: &[f64]) {
        self.alike.values_mut().iter_mut().zip(matrix.values()).for_each(|(a, b)| *a += factor * b);
        for k in 0..3 {
            let column: Vec<f64> = coefficients.iter().skip(k).step_by(3).copied().collect();
            let image = matrix.multiply(&column);
            self.right.iter_mut().skip(k).step_by(3).zip(image).for_each(|(g, x)| *g -= factor * x);
        }
    }
}

/// Solves equations of one pattern; what depends on the pattern alone is found once.
pub(crate) struct Solver {
    alike: Cholesky,
    coupled: Option<Cholesky>,
    /// Whether a matrix was definite as it was: data and plates, which are part of every one, have a unique solution.
    is_determined: bool,
}

impl Solver {
    pub(crate) fn new(pattern: &SymmetricPattern) -> Result<Self, Error> {
        let failed = |cause| Error::Solve { functions: pattern.n(), cause };
        Ok(Self { alike: Cholesky::new(pattern).map_err(failed)?, coupled: None, is_determined: false })
    }

    /// Equations without any term; with a matrix for terms that couple coordinates if `is_coupled`.
    pub(crate) fn equations(&mut self, is_coupled: bool) -> Result<Equations, Error> {
        let pattern = self.alike.pattern();
        let (alike, right) = (SymmetricMatrix::zeros(pattern), vec![0.0; 3 * pattern.n()]);
        if !is_coupled {
            return Ok(Equations { alike, coupled: None, right });
        }
        if self.coupled.is_none() {
            let failed = |cause| Error::Solve { functions: pattern.n(), cause };
            self.coupled = Some(Cholesky::new(&pattern.blocked(3)).map_err(failed)?);
        }
        let coupled = self.coupled.as_ref().map(|cholesky| SymmetricMatrix::zeros(cholesky.pattern()));
        Ok(Equations { alike, coupled, right })
    }

    /// The step d, `(n_functions, 3)` row-major.
    pub(crate) fn solve(&mut self, equations: Equations) -> Result<Vec<f64>, Error> {
        let n = self.alike.pattern().n();
        let failed = |cause| Error::Solve { functions: n, cause };
        let Equations { mut alike, coupled, right } = equations;
        let (Some(coupled), Some(cholesky)) = (coupled, &mut self.coupled) else {
            factorize(&mut self.alike, &mut alike, self.is_determined).map_err(failed)?;
            self.is_determined = true;
            let right = Array2::from_shape_fn((n, 3), |(i, k)| right[3 * i + k]);
            return Ok(self.alike.solve(&right).map_err(failed)?.into_iter().collect());
        };
        let none = SymmetricMatrix::zeros(alike.pattern());
        let parts = [alike.clone(), none.clone(), none.clone(), alike.clone(), none, alike];
        let mut matrix = SymmetricMatrix::from_blocks(cholesky.pattern(), &parts, 3)?;
        matrix.values_mut().iter_mut().zip(coupled.values()).for_each(|(a, b)| *a += b);
        factorize(cholesky, &mut matrix, self.is_determined).map_err(failed)?;
        let right = Array2::from_shape_fn((3 * n, 1), |(i, _)| right[i]);
        Ok(cholesky.solve(&right).map_err(failed)?.into_iter().collect())
    }
}

/// Shares of the diagonal that are added to it, one after the other, where a matrix is not positive definite.
///
/// Limit: round-off, at corners where weights of the angle term are 10⁶ times those of others. A step is shortened by it, and the point at
/// which steps vanish is the same. Not before a matrix was definite without: too few data are an error.
const DAMPING: [f64; 2] = [1e-12, 1e-10];

fn factorize(cholesky: &mut Cholesky, matrix: &mut SymmetricMatrix, may_damp: bool) -> Result<(), FactorizationError> {
    let mut result = cholesky.factorize(matrix);
    if !may_damp {
        return result;
    }
    for share in DAMPING {
        if result != Err(FactorizationError::NotPositiveDefinite) {
            break;
        }
        tracing::debug!(share, "damped");
        let pattern = matrix.pattern().clone();
        // The diagonal opens each column of the lower triangle.
        let diagonal = pattern.columns()[..pattern.n()].iter();
        diagonal.for_each(|&place| matrix.values_mut()[place] *= 1.0 + share);
        result = cholesky.factorize(matrix);
    }
    result
}
