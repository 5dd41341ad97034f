//! The thin-plate energy, cell by cell.

use crate::bernstein::{inner_products, inner_products_gauss};
use crate::tensor::unravel;
use crate::{Cell, CellSpace, Error, SymmetricMatrix, SymmetricPattern};

/// How the integrals of the energy are computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quadrature {
    /// In closed form.
    Exact,
    /// By the Gauss rule with as many nodes per direction as the degree, as G+Smo does: not exact for the highest
    /// powers. For comparisons.
    GaussP,
}

/// The thin-plate energy `J(s) = ∫ Σ_{a,b} |∂_a ∂_b s|²`, Imperatore 2024, (3.16); for curves `∫ |s''|²`.
///
/// Directions may be scaled: with lengths `L_d` the energy is that of the map on the box `∏ [0, L_d (b_d − a_d)]`, which
/// makes it independent of the parameters' units.
#[derive(Clone, Debug)]
pub struct ThinPlate<const D: usize> {
    degree: [usize; D],
    lengths: [f64; D],
    /// For each pair of directions its matrix on the unit box.
    terms: Vec<Term<D>>,
}

/// `∫ |∂_a ∂_b s|²` on the unit box, both orders of `a ≠ b` counted.
#[derive(Clone, Debug)]
struct Term<const D: usize> {
    /// Order of the derivative per direction.
    orders: [usize; D],
    /// `(n_local, n_local)`, in the Bernstein basis.
    matrix: Vec<f64>,
}

impl<const D: usize> ThinPlate<D> {
    /// The energy for a degree, on the parameters as they are.
    pub fn new(degree: [usize; D], quadrature: Quadrature) -> Self {
        Self::scaled(degree, quadrature, [1.0; D])
    }

    /// The energy with lengths per direction.
    pub fn scaled(degree: [usize; D], quadrature: Quadrature, lengths: [f64; D]) -> Self {
        // Inner products of derivatives of order 0, 1, 2 on the unit interval, per direction.
        let products: [[Vec<f64>; 3]; D] = degree.map(|p| {
            [0, 1, 2].map(|order| match quadrature {
                Quadrature::Exact => inner_products(p, order, order),
                Quadrature::GaussP => inner_products_gauss(p, order, order, p),
            })
        });
        let counts = degree.map(|p| p + 1);
        let n_local: usize = counts.iter().product();
        let mut terms = Vec::new();
        for (a, b) in (0..D).flat_map(|a| (a..D).map(move |b| (a, b))) {
            let orders: [usize; D] = std::array::from_fn(|d| usize::from(d == a) + usize::from(d == b));
            let mixed = if a == b { 1.0 } else { 2.0 };
            let entry = |k: usize| {
                let (row, column) = (unravel(k / n_local, counts), unravel(k % n_local, counts));
                mixed * (0..D).map(|d| products[d][orders[d]][row[d] * counts[d] + column[d]]).product::<f64>()
            };
            terms.push(Term { orders, matrix: (0..n_local * n_local).map(entry).collect() });
        }
        Self { degree, lengths, terms }
    }

    /// Adds `factor` times the energy's matrix in the Bernstein basis of a box with the given edge lengths to `matrix`,
    /// `(n_local, n_local)`.
    pub fn add_bernstein_matrix(&self, size: [f64; D], factor: f64, matrix: &mut [f64]) {
        for term in &self.terms {
            // Along an edge of length h, derivatives of order r bring h^{1−2r} times the integral on the unit interval.
            let scale: f64 = (0..D).map(|d| (size[d] * self.lengths[d]).powi(1 - 2 * term.orders[d] as i32)).product();
            matrix.iter_mut().zip(&term.matrix).for_each(|(entry, unit)| *entry += factor * scale * unit);
        }
    }

    /// The energy's matrix in the functions of a cell, `(n_active, n_active)`, to `out`.
    pub fn cell_matrix(&self, cell: &Cell<'_, D>, out: &mut Vec<f64>, scratch: &mut Vec<f64>) {
        out.clear();
        out.resize(cell.n_local().pow(2), 0.0);
        self.add_bernstein_matrix(cell.size(), 1.0, out);
        cell.pull_back_symmetric(out, 1, scratch);
    }

    /// The Gram matrix G of the energy in a space: `J(s) = Σ_k c_kᵀ G c_k` over the components of the coefficients.
    ///
    /// # Errors
    /// [`Error::Shape`] if the degree is not that of the space.
    pub fn gram<S: CellSpace<D>>(&self, space: &S, pattern: &SymmetricPattern) -> Result<SymmetricMatrix, Error> {
        self.weighted_gram(space, pattern, |_| 1.0)
    }

    /// As [`ThinPlate::gram`] with the energy of each cell times its `weight`: G of `Σ_cells weight(cell) ∫_cell |D²s|²`.
    ///
    /// # Errors
    /// [`Error::Shape`] if the degree is not that of the space.
    pub fn weighted_gram<S: CellSpace<D>>(
        &self,
        space: &S,
        pattern: &SymmetricPattern,
        weight: impl Fn(&Cell<'_, D>) -> f64 + Sync,
    ) -> Result<SymmetricMatrix, Error> {
        for d in 0..D {
            if self.degree[d] != space.degree()[d] {
                return Err(Error::Shape { what: "degree", given: self.degree[d], expected: space.degree()[d] });
            }
        }
        Ok(SymmetricMatrix::of_cells(space, pattern, |number, local, scratch| {
            let cell = space.cell(number);
            self.cell_matrix(&cell, local, scratch);
            let weight = weight(&cell);
            if weight != 1.0 {
                local.iter_mut().for_each(|g| *g *= weight);
            }
        }))
    }
}
