//! What a term of the objective is.

use thb_core::MultiPatchSpace;

use crate::equations::Equations;
use crate::samples::Samples;

/// Where a fit is: what energies depend on.
pub(crate) struct State<'a> {
    pub(crate) space: &'a MultiPatchSpace,
    /// `(n_functions, 3)` row-major.
    pub(crate) coefficients: &'a [f64],
    pub(crate) samples: &'a Samples,
}

/// A term of the objective.
pub(crate) trait Term {
    /// Its value.
    fn energy(&self, at: &State<'_>) -> f64;
    /// Adds minus half its gradient by the coefficients, and half its Gauss–Newton matrix.
    fn linearize(&self, at: &State<'_>, equations: &mut Equations);
}
