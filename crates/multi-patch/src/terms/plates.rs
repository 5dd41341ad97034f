//! The plates: what holds patches smooth where data do not.

use thb_core::{CellSpace, Error, MultiPatchSpace, Quadrature, SymmetricMatrix, SymmetricPattern, ThinPlate};

use crate::equations::Equations;
use crate::term::{State, Term};

/// `(μ/P) Σ_patches ∫ |S_uu|² + 2 |S_uv|² + |S_vv|²` over the unit squares of P patches: `(μ/P) Σ_k c_kᵀ G c_k` for the columns c_k of
/// coefficients. Quadratic, so its linearization is exact.
pub(crate) struct Plates {
    gram: SymmetricMatrix,
    weight: f64,
}

impl Plates {
    pub(crate) fn new(space: &MultiPatchSpace, pattern: &SymmetricPattern) -> Result<Self, Error> {
        let gram = ThinPlate::new(space.degree(), Quadrature::Exact).gram(space, pattern)?;
        Ok(Self { gram, weight: 0.0 })
    }

    /// Sets the weight μ/P.
    pub(crate) fn set_weight(&mut self, weight: f64) {
        self.weight = weight;
    }
}

impl Term for Plates {
    fn energy(&self, at: &State<'_>) -> f64 {
        let of_coordinate = |k: usize| {
            let column: Vec<f64> = at.coefficients.iter().skip(k).step_by(3).copied().collect();
            self.gram.multiply(&column).iter().zip(&column).map(|(a, b)| a * b).sum::<f64>()
        };
        self.weight * (0..3).map(of_coordinate).sum::<f64>()
    }

    fn linearize(&self, at: &State<'_>, equations: &mut Equations) {
        equations.add_quadratic(&self.gram, self.weight, at.coefficients);
    }
}
