//! The bending energy of the map.

use std::sync::Arc;

use ndarray::{Array2, ArrayView2};
use thb_core::{ParameterBox, SymmetricMatrix};

use crate::Error;
use crate::equations::Linearization;
use crate::state::{State, StepStart};
use crate::term::Term;

/// `½ λ Σ_k c_kᵀ G c_k` for the coefficients `c_k` of each coordinate and the Gram matrix G of the bending energy. Nothing is held
/// constant.
#[derive(Clone, Debug)]
pub(crate) struct Smoothing {
    gram: Arc<SymmetricMatrix>,
    lambda: f64,
}

impl Smoothing {
    pub(crate) fn new(gram: SymmetricMatrix, lambda: f64) -> Self {
        Self { gram: Arc::new(gram), lambda }
    }

    /// λ.
    pub(crate) fn lambda(&self) -> f64 {
        self.lambda
    }

    /// G.
    pub(crate) fn gram(&self) -> &SymmetricMatrix {
        &self.gram
    }

    /// `λ G c`, the gradient.
    pub(crate) fn gradient(&self, coefficients: ArrayView2<'_, f64>) -> Array2<f64> {
        let mut gradient = Array2::zeros(coefficients.raw_dim());
        for k in 0..coefficients.ncols() {
            let product = self.gram.multiply(&coefficients.column(k).to_vec());
            gradient.column_mut(k).iter_mut().zip(product).for_each(|(g, x)| *g = self.lambda * x);
        }
        gradient
    }

    /// The energy of a map with some coefficients.
    pub(crate) fn energy_of(&self, coefficients: ArrayView2<'_, f64>) -> f64 {
        0.5 * self.gradient(coefficients).iter().zip(&coefficients).map(|(g, c)| g * c).sum::<f64>()
    }
}

impl<const D: usize, S: ParameterBox<D>> Term<D, S> for Smoothing {
    fn name(&self) -> &'static str {
        "smoothing"
    }

    fn energy(&self, at: &State<'_, D, S>) -> Result<f64, Error> {
        Ok(self.energy_of(at.map.coefficients()))
    }

    fn linearize(&self, at: &StepStart<'_, D, S>, _: &[u32], into: &mut Linearization<'_, D>) -> Result<(), Error> {
        let right = -self.gradient(at.state.map.coefficients());
        into.coefficients.add_uniform(self.lambda, self.gram.clone(), right);
        Ok(())
    }
}
