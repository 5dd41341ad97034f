//! The data: distances of samples at their parameters.

use rayon::prelude::*;
use thb_core::bernstein;
use thb_core::{Cell, CellSpace, MAX_DEGREE};

use crate::equations::Equations;
use crate::term::{State, Term};

/// `(1/W) Σ_m w_m |S(u_m) − x_m|²` with W = Σ w_m. Linear in the coefficients once parameters are held, so its linearization is exact.
pub(crate) struct Data;

/// Values of all Bernstein polynomials of a cell at a parameter, first direction fastest.
fn values(cell: &Cell<'_, 2>, u: [f64; 2], out: &mut Vec<f64>) {
    let basis: [[f64; MAX_DEGREE + 1]; 2] = std::array::from_fn(|d| {
        let mut values = [0.0; MAX_DEGREE + 1];
        bernstein::values(cell.degree[d], (u[d] - cell.lower[d]) / (cell.upper[d] - cell.lower[d]), &mut values);
        values
    });
    out.clear();
    for v in &basis[1][..=cell.degree[1]] {
        out.extend(basis[0][..=cell.degree[0]].iter().map(|u| u * v));
    }
}

/// `x − S(u)` of a sample x in a cell, by values of the Bernstein polynomials at u and their coefficients, three each.
fn residual(point: [f64; 3], basis: &[f64], coefficients: &[f64]) -> [f64; 3] {
    let mut residual = point;
    for (b, row) in basis.iter().zip(coefficients.chunks_exact(3)) {
        (0..3).for_each(|k| residual[k] -= b * row[k]);
    }
    residual
}

/// Sums of one cell in its functions: `Σ w b bᵀ` and `Σ w b rᵀ` with residuals r.
struct CellSums {
    matrix: Vec<f64>,
    right: Vec<f64>,
}

fn cell_sums(at: &State<'_>, number: usize, samples: &[u32]) -> CellSums {
    let cell = at.space.cell(number);
    let n = cell.n_local();
    let (mut matrix, mut right, mut basis, mut local) = (vec![0.0; n * n], vec![0.0; 3 * n], Vec::new(), Vec::new());
    cell.bernstein_coefficients(at.coefficients, 3, &mut local);
    for &sample in samples {
        let sample = &at.samples.as_slice()[sample as usize];
        values(&cell, sample.place.u, &mut basis);
        let residual = residual(sample.point, &basis, &local);
        for (i, b) in basis.iter().enumerate() {
            let weighted = sample.weight * b;
            (0..3).for_each(|k| right[3 * i + k] += weighted * residual[k]);
            matrix[i * n..(i + 1) * n].iter_mut().zip(&basis).for_each(|(m, c)| *m += weighted * c);
        }
    }
    let mut scratch = Vec::new();
    cell.pull_back_symmetric(&mut matrix, 1, &mut scratch);
    cell.pull_back(&mut right, 3, &mut scratch);
    CellSums { matrix, right }
}

impl Term for Data {
    fn energy(&self, at: &State<'_>) -> f64 {
        let of_cell = |(number, samples): (usize, &Vec<u32>)| {
            let cell = at.space.cell(number);
            let (mut basis, mut local) = (Vec::new(), Vec::new());
            cell.bernstein_coefficients(at.coefficients, 3, &mut local);
            let mut sum = 0.0;
            for &sample in samples {
                let sample = &at.samples.as_slice()[sample as usize];
                values(&cell, sample.place.u, &mut basis);
                let residual = residual(sample.point, &basis, &local);
                sum += sample.weight * residual.iter().map(|r| r * r).sum::<f64>();
            }
            sum
        };
        let of_cells: Vec<f64> = at.samples.by_cell(at.space).par_iter().enumerate().map(of_cell).collect();
        of_cells.iter().sum::<f64>() / at.samples.total_weight()
    }

    fn linearize(&self, at: &State<'_>, equations: &mut Equations) {
        let scale = 1.0 / at.samples.total_weight();
        let of_cell = at.samples.by_cell(at.space);
        let sums: Vec<CellSums> =
            of_cell.par_iter().enumerate().map(|(number, samples)| cell_sums(at, number, samples)).collect();
        for (number, mut sums) in sums.into_iter().enumerate() {
            if of_cell[number].is_empty() {
                continue;
            }
            sums.matrix.iter_mut().for_each(|x| *x *= scale);
            let cell = at.space.cell(number);
            equations.alike.add_cell(cell.functions, &sums.matrix);
            for (&function, row) in cell.functions.iter().zip(sums.right.chunks_exact(3)) {
                (0..3).for_each(|k| equations.right[3 * function as usize + k] += scale * row[k]);
            }
        }
    }
}
