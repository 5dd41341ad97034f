//! Coefficients and parameters as unknowns in which all directions are alike.

use fit_ls::SortedPoints;
use ndarray::Array2;
use rayon::prelude::*;
use thb_core::{CellSpace, HierarchicalSpace, MAX_DEGREE, ParameterBox, SplineMap, SymmetricPattern, bernstein};

use crate::Error;
use crate::equations::{Equations, PointBlock};
use crate::points::constraint::Constraints;
use crate::points::patch::{Jet, Patch};
use crate::points::vector::Vector;
use crate::step_system::StepSystem;

/// Points of one parallel task; sums are formed task by task.
const CHUNK: usize = 1024;

/// Changes `δc` of the coefficients and `δu` of the free parameters from a start, as functions of `x` and `y`:
/// `δc = L⁻ᵀ x` for the matrix `L Lᵀ` of a joint Levenberg–Marquardt step, and `δu` the move that this step gives
/// the parameters with it, plus `l⁻ᵀ y` with `l lᵀ` the 2 × 2 matrix of each point. The damped Gauss–Newton matrix of the
/// objective at the start is the identity by x and y.
///
/// Without this minimization by gradients crawls: most changes of coefficients move points along the surface, and
/// parameters can undo them almost entirely.
pub(crate) struct Unknowns<'a, const D: usize> {
    start: SplineMap<D>,
    points: &'a SortedPoints<D>,
    /// Its matrix of steps of the coefficients is factorized.
    system: StepSystem,
    /// The equations of a step from the start.
    equations: Equations<D>,
    free: Vec<[bool; D]>,
    /// `l⁻¹`, rows and columns of directions that are not free zero.
    inverse: Vec<[[f64; D]; D]>,
}

/// Damping of the steps whose matrix measures the unknowns. From 1e-4 to 1e-3 the ship hull of docs/results/moving.md needs about as
/// many control points; with 1e-2 a tenth more.
const DAMPING: f64 = 1e-3;

/// What unknowns stand for.
pub(crate) struct Place<const D: usize> {
    pub(crate) map: SplineMap<D>,
    /// In the order of the points; those outside the domain are projected to it, or wrapped in periodic directions.
    pub(crate) parameters: Vec<[f64; D]>,
    /// The same before that.
    moved: Vec<[f64; D]>,
}

impl<'a, const D: usize> Unknowns<'a, D> {
    /// Unknowns that are zero at a map and the present parameters, measured by the equations of a step from there.
    pub(crate) fn new(
        start: SplineMap<D>,
        points: &'a SortedPoints<D>,
        constraints: &Constraints<D>,
        equations: Equations<D>,
        mut system: StepSystem,
    ) -> Result<Self, Error> {
        system.factorize(&equations.reduced(start.space().as_ref(), points, constraints, DAMPING, &[])?)?;
        let free: Vec<[bool; D]> = points.order().iter().map(|&index| constraints.free(index as usize)).collect();
        let inverse = |(at, block): (usize, &PointBlock<D>)| {
            let mut metric = block.metric().map(|row| row.map(|x| block.weight * x));
            // Where a tangent vanishes its parameter has no unit of its own.
            (0..D).for_each(|d| metric[d][d] = if metric[d][d] > 0.0 { metric[d][d] * (1.0 + DAMPING) } else { 1.0 });
            inverse_factor(&metric, free[at])
        };
        let inverse = equations.points.iter().enumerate().map(inverse).collect();
        Ok(Self { start, points, system, equations, free, inverse })
    }

    pub(crate) fn points(&self) -> &'a SortedPoints<D> {
        self.points
    }

    /// The pattern of the equations of one coordinate.
    pub(crate) fn pattern(&self) -> &SymmetricPattern {
        self.system.pattern()
    }

    /// The equations that measured them, to be used again.
    pub(crate) fn into_system(self) -> StepSystem {
        self.system
    }

    /// Their number.
    pub(crate) fn len(&self) -> usize {
        self.start.coefficients().len() + self.free.iter().flatten().filter(|free| **free).count()
    }

    /// The map and the parameters that they stand for.
    pub(crate) fn place(&self, unknowns: &[f64]) -> Result<Place<D>, Error> {
        let space = self.start.space();
        let (n, dim) = self.start.coefficients().dim();
        let (x, mut y) = unknowns.split_at(n * dim);
        let x = Array2::from_shape_fn((n * dim, 1), |(i, _)| x[i]);
        let change = self.system.factor().from_whitened(&x).map_err(singular)?;
        let change = Array2::from_shape_fn((n, dim), |(j, k)| change[[j * dim + k, 0]]);
        let map = SplineMap::new(space.clone(), &change + &self.start.coefficients())?;
        let carried = jets(&SplineMap::new(space.clone(), change)?, &self.parameters())?;
        let mut moved = self.parameters();
        for (at, u) in moved.iter_mut().enumerate() {
            let along = self.equations.points[at].step_against(&carried[at].value, &[0.0; D], DAMPING, self.free[at]);
            (0..D).for_each(|d| u[d] += along[d]);
            for d in (0..D).filter(|&d| self.free[at][d]) {
                let Some((own, rest)) = y.split_first() else { break };
                (0..D).for_each(|a| u[a] += self.inverse[at][d][a] * own);
                y = rest;
            }
        }
        let parameters = moved.iter().map(|&u| space.to_domain(u)).collect();
        Ok(Place { map, parameters, moved })
    }

    fn parameters(&self) -> Vec<[f64; D]> {
        (0..self.points.len()).map(|at| self.points.parameter(at)).collect()
    }

    /// The gradient by the unknowns at a place, from those by coefficients, `(n_functions, N)`, and by parameters.
    pub(crate) fn gradient(
        &self,
        place: &Place<D>,
        mut by_coefficients: Array2<f64>,
        mut by_parameters: Vec<[f64; D]>,
    ) -> Result<Vec<f64>, Error> {
        let space = self.start.space();
        let ((lower, upper), periodic) = (space.domain(), space.periodic());
        for (slope, u) in by_parameters.iter_mut().zip(&place.moved) {
            // The projection is constant outside the domain.
            (0..D).filter(|&d| !periodic[d] && (u[d] < lower[d] || u[d] > upper[d])).for_each(|d| slope[d] = 0.0);
        }
        let still = Vector::default();
        let forces: Vec<Vector> = by_parameters
            .iter()
            .enumerate()
            .map(|(at, slope)| {
                let step = self.equations.points[at].step_against(&still, slope, DAMPING, self.free[at]);
                std::array::from_fn(|k| (0..D).map(|d| step[d] * self.equations.points[at].tangents[d][k]).sum())
            })
            .collect();
        let (n, dim) = by_coefficients.dim();
        by_coefficients += &basis_sums(space, &self.parameters(), &forces, dim)?;
        let flat = Array2::from_shape_fn((n * dim, 1), |(i, _)| by_coefficients[[i / dim, i % dim]]);
        let mut gradient = self.system.factor().whitened_gradient(&flat).map_err(singular)?.into_raw_vec_and_offset().0;
        for (at, slope) in by_parameters.iter().enumerate() {
            let along = |row: &[f64; D]| row.iter().zip(slope).map(|(a, b)| a * b).sum::<f64>();
            gradient.extend((0..D).filter(|&d| self.free[at][d]).map(|d| along(&self.inverse[at][d])));
        }
        Ok(gradient)
    }
}

fn singular(error: fit_ls::FactorizationError) -> Error {
    Error::Minimization { reason: error.to_string() }
}

/// `l⁻¹` of a positive definite matrix `l lᵀ` in the free directions, zero elsewhere: the unit vectors, made orthonormal in
/// the scalar product of the matrix.
fn inverse_factor<const D: usize>(matrix: &[[f64; D]; D], free: [bool; D]) -> [[f64; D]; D] {
    let product = |a: &[f64; D], b: &[f64; D]| -> f64 {
        (0..D).map(|i| a[i] * (0..D).map(|j| matrix[i][j] * b[j]).sum::<f64>()).sum()
    };
    let mut inverse = [[0.0; D]; D];
    for i in (0..D).filter(|&i| free[i]) {
        let mut row = [0.0; D];
        row[i] = 1.0;
        for j in (0..i).filter(|&j| free[j]) {
            let (along, other) = (product(&inverse[j], &row), inverse[j]);
            (0..D).for_each(|a| row[a] -= along * other[a]);
        }
        let length = product(&row, &row).sqrt();
        inverse[i] = row.map(|x| x / length);
    }
    inverse
}

/// Values and first derivatives of a map.
pub(crate) fn jets<const D: usize>(map: &SplineMap<D>, parameters: &[[f64; D]]) -> Result<Vec<Jet<D>>, Error> {
    let bezier = map.bezier();
    let chunks: Result<Vec<Vec<Jet<D>>>, Error> = parameters
        .par_chunks(CHUNK)
        .map(|chunk| {
            let mut patch = Patch::new(bezier, map.space().locate_cell(chunk[0])?);
            chunk
                .iter()
                .map(|&u| {
                    if !patch.owns(u) {
                        patch.load(bezier, map.space().locate_cell(u)?);
                    }
                    Ok(patch.first_jet(u))
                })
                .collect()
        })
        .collect();
    Ok(chunks?.into_iter().flatten().collect())
}

/// Cells met one after the other, and the sums of each.
type CellSums = (Vec<u32>, Vec<f64>);

/// `Σ B_j(u_i) v_i` for all functions, `(n_functions, N)`.
pub(crate) fn basis_sums<const D: usize>(
    space: &HierarchicalSpace<D>,
    parameters: &[[f64; D]],
    vectors: &[Vector],
    dim: usize,
) -> Result<Array2<f64>, Error> {
    let orders = space.degree().map(|p| p + 1);
    let per_cell = dim * orders.iter().product::<usize>();
    let parts: Result<Vec<CellSums>, Error> = parameters
        .par_chunks(CHUNK)
        .zip(vectors.par_chunks(CHUNK))
        .map(|(parameters, vectors)| {
            let (mut cells, mut sums) = (Vec::new(), Vec::new());
            let mut basis = [[0.0; MAX_DEGREE + 1]; D];
            for (u, vector) in parameters.iter().zip(vectors) {
                let number = space.locate_cell(*u)? as u32;
                if cells.last() != Some(&number) {
                    cells.push(number);
                    sums.resize(sums.len() + per_cell, 0.0);
                }
                let cell = space.cell(number as usize);
                let (lower, size) = (cell.lower, cell.size());
                (0..D).for_each(|d| bernstein::values(orders[d] - 1, (u[d] - lower[d]) / size[d], &mut basis[d]));
                let first = sums.len() - per_cell;
                for (linear, row) in sums[first..].chunks_exact_mut(dim).enumerate() {
                    let mut rest = linear;
                    let mut product = 1.0;
                    for d in 0..D {
                        product *= basis[d][rest % orders[d]];
                        rest /= orders[d];
                    }
                    row.iter_mut().zip(vector).for_each(|(target, r)| *target += product * r);
                }
            }
            Ok((cells, sums))
        })
        .collect();
    let mut local = vec![0.0; per_cell * space.n_cells()];
    for (cells, sums) in parts? {
        for (cell, sums) in cells.iter().zip(sums.chunks_exact(per_cell)) {
            let target = &mut local[*cell as usize * per_cell..][..per_cell];
            target.iter_mut().zip(sums).for_each(|(a, b)| *a += b);
        }
    }
    let mut result = Array2::<f64>::zeros((space.n_functions(), dim));
    let (mut rows, mut scratch) = (Vec::new(), Vec::new());
    for (number, sums) in local.chunks_exact(per_cell).enumerate() {
        let cell = space.cell(number);
        rows.clear();
        rows.extend_from_slice(sums);
        cell.pull_back(&mut rows, dim, &mut scratch);
        for (row, &function) in rows.chunks_exact(dim).zip(cell.functions) {
            result.row_mut(function as usize).iter_mut().zip(row).for_each(|(g, x)| *g += x);
        }
    }
    Ok(result)
}
