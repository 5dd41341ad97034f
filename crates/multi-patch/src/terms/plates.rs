//! The plates: what holds patches smooth where data do not.

use thb_core::{CellSpace, MultiPatchSpace, Quadrature, SymmetricMatrix, SymmetricPattern, ThinPlate};

use crate::equations::Equations;
use crate::term::{State, Term};

/// `(μ/P) Σ_cells σ_cell ∫_cell r⁻² |S_uu|² + 2 |S_uv|² + r² |S_vv|²` over the unit squares of P patches: `(μ/P) Σ_k c_kᵀ G c_k` for the
/// columns c_k of coefficients.
///
/// r is the ratio of a patch's length to its width: on the unit square alone a long patch would be cheap to shear, and one between two
/// arcs of circles, where nothing else holds lines that run along it, would have them straight, across its borders. σ, the stiffness of a
/// cell, is 1 unless told. Quadratic, so the linearization is exact.
pub(crate) struct Plates {
    gram: SymmetricMatrix,
    /// The energy in each patch.
    of_patch: Vec<ThinPlate<2>>,
    weight: f64,
}

impl Plates {
    /// For patches of given length and width.
    pub(crate) fn new(space: &MultiPatchSpace, pattern: &SymmetricPattern, sizes: &[[f64; 2]]) -> Self {
        let of_patch = sizes.iter().map(|[length, width]| {
            let root = (length / width).sqrt();
            ThinPlate::scaled(space.degree(), Quadrature::Exact, [root, 1.0 / root])
        });
        let mut plates = Self { gram: SymmetricMatrix::zeros(pattern), of_patch: of_patch.collect(), weight: 0.0 };
        plates.set_stiffness(space, &vec![1.0; space.n_functions()]);
        plates
    }

    /// Sets σ: in each cell the mean of what its functions have.
    pub(crate) fn set_stiffness(&mut self, space: &MultiPatchSpace, stiffness: &[f64]) {
        self.gram = SymmetricMatrix::of_cells(space, self.gram.pattern(), |number, matrix, scratch| {
            let cell = space.cell(number);
            self.of_patch[space.patch_of_cell(number)].cell_matrix(&cell, matrix, scratch);
            let sum: f64 = cell.functions.iter().map(|&f| stiffness[f as usize]).sum();
            let mean = sum / cell.functions.len() as f64;
            matrix.iter_mut().for_each(|g| *g *= mean);
        });
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
