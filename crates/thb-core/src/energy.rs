//! The thin-plate energy, cell by cell.

use crate::bernstein::{inner_products, inner_products_gauss};
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
    /// Inner products of derivatives of order 0, 1, 2 on the unit interval, per direction.
    products: [[Vec<f64>; 3]; D],
}

impl<const D: usize> ThinPlate<D> {
    /// The energy for a degree, on the parameters as they are.
    pub fn new(degree: [usize; D], quadrature: Quadrature) -> Self {
        Self::scaled(degree, quadrature, [1.0; D])
    }

    /// The energy with lengths per direction.
    pub fn scaled(degree: [usize; D], quadrature: Quadrature, lengths: [f64; D]) -> Self {
        let products = degree.map(|p| {
            [0, 1, 2].map(|order| match quadrature {
                Quadrature::Exact => inner_products(p, order, order),
                Quadrature::GaussP => inner_products_gauss(p, order, order, p),
            })
        });
        Self { degree, lengths, products }
    }

    /// Adds `factor` times the energy's matrix in the Bernstein basis of a box with the given edge lengths to `matrix`,
    /// `(n_local, n_local)`.
    pub fn add_bernstein_matrix(&self, size: [f64; D], factor: f64, matrix: &mut [f64]) {
        let scaled: [f64; D] = std::array::from_fn(|d| size[d] * self.lengths[d]);
        for a in 0..D {
            for b in a..D {
                let orders: [usize; D] = std::array::from_fn(|d| usize::from(d == a) + usize::from(d == b));
                let mixed = if a == b { 1.0 } else { 2.0 };
                // ∫ over an edge of length h of derivatives of order r: h^{1−2r} times the one on the unit interval.
                let scale = (0..D).map(|d| scaled[d].powi(1 - 2 * orders[d] as i32)).product::<f64>();
                self.add_product(orders, factor * mixed * scale, matrix);
            }
        }
    }

    fn add_product(&self, orders: [usize; D], factor: f64, matrix: &mut [f64]) {
        let counts = self.degree.map(|p| p + 1);
        let n_local: usize = counts.iter().product();
        for i in 0..n_local {
            let row = crate::tensor::unravel(i, counts);
            for j in 0..n_local {
                let column = crate::tensor::unravel(j, counts);
                let product: f64 =
                    (0..D).map(|d| self.products[d][orders[d]][row[d] * counts[d] + column[d]]).product();
                matrix[i * n_local + j] += factor * product;
            }
        }
    }

    /// The energy's matrix in the functions of a cell, `(n_active, n_active)`, to `out`.
    pub fn cell_matrix(&self, cell: &Cell<'_, D>, out: &mut Vec<f64>, scratch: &mut Vec<f64>) {
        out.clear();
        out.resize(cell.n_local().pow(2), 0.0);
        self.add_bernstein_matrix(cell.size(), 1.0, out);
        cell.pull_back_symmetric(out, scratch);
    }

    /// The Gram matrix G of the energy in a space: `J(s) = Σ_k c_kᵀ G c_k` over the components of the coefficients.
    ///
    /// # Errors
    /// [`Error::Shape`] if the degree is not that of the space.
    pub fn gram<S: CellSpace<D>>(&self, space: &S, pattern: &SymmetricPattern) -> Result<SymmetricMatrix, Error> {
        for d in 0..D {
            if self.degree[d] != space.degree()[d] {
                return Err(Error::Shape { what: "degree", given: self.degree[d], expected: space.degree()[d] });
            }
        }
        let mut matrix = SymmetricMatrix::zeros(pattern);
        let (mut local, mut scratch) = (Vec::new(), Vec::new());
        for number in 0..space.n_cells() {
            let cell = space.cell(number);
            self.cell_matrix(&cell, &mut local, &mut scratch);
            matrix.add_cell(cell.functions, &local);
        }
        Ok(matrix)
    }
}
