//! Steps of the coefficients where the coordinates are coupled.

use std::sync::Arc;

use fit_ls::{BlockEquations, Cholesky, FactorizationError, Fixed, NormalEquations, SortedPoints, eliminate};
use ndarray::{Array1, Array2};
use thb_core::{CellSpace, HierarchicalSpace, SplineMap, SymmetricMatrix, SymmetricPattern};

use crate::Error;
use crate::frame::{Columns, Frame};

/// What is added to a diagonal, as shares of its mean, until a matrix is positive definite that unknowns are measured with.
const SHIFTS: [f64; 4] = [0.0, 1e-10, 1e-6, 1.0];

/// Equations of steps of the coefficients in one space, `N n` unknowns.
#[derive(Debug)]
pub(crate) struct StepSystem {
    energy: SymmetricMatrix,
    lambda: f64,
    blocked: SymmetricPattern,
    solver: Cholesky,
    dim: usize,
}

impl StepSystem {
    pub(crate) fn new(energy: SymmetricMatrix, lambda: f64, dim: usize) -> Result<Self, Error> {
        let blocked = energy.pattern().blocked(dim);
        let solver = Cholesky::new(&blocked)
            .map_err(|_| fit_ls::Error::OutOfMemory { functions: energy.pattern().n() * dim })?;
        Ok(Self { energy, lambda, blocked, solver, dim })
    }

    /// Whether this energy and this weight are those of the equations.
    pub(crate) fn smooths_by(&self, energy: &SymmetricMatrix, lambda: f64) -> bool {
        self.lambda == lambda && self.energy.values() == energy.values()
    }

    /// The pattern of the equations of one coordinate.
    pub(crate) fn pattern(&self) -> &SymmetricPattern {
        self.energy.pattern()
    }

    /// The matrix that was factorized last.
    pub(crate) fn factor(&self) -> &Cholesky {
        &self.solver
    }

    /// `λ G c`, the gradient of the energy's part of the objective.
    pub(crate) fn energy_gradient(&self, coefficients: &Array2<f64>) -> Array2<f64> {
        let mut gradient = Array2::zeros(coefficients.raw_dim());
        for k in 0..coefficients.ncols() {
            let product = self.energy.multiply(&coefficients.column(k).to_vec());
            gradient.column_mut(k).iter_mut().zip(product).for_each(|(g, x)| *g = self.lambda * x);
        }
        gradient
    }

    /// `½ λ J`.
    pub(crate) fn energy_part(&self, coefficients: &Array2<f64>) -> f64 {
        let gradient = self.energy_gradient(coefficients);
        0.5 * gradient.iter().zip(coefficients).map(|(g, c)| g * c).sum::<f64>()
    }

    /// The equations of a step from a map: those of the points, `Σ B (q − W B δc)`, and of the energy.
    pub(crate) fn equations<const D: usize>(
        &self,
        map: &SplineMap<D>,
        points: &SortedPoints<D>,
        columns: &Columns,
    ) -> Result<BlockEquations, Error> {
        let pattern = self.energy.pattern();
        let space = map.space().as_ref();
        let mut equations = BlockEquations::new(space, pattern, points, &columns.weights, &columns.right)?;
        equations.right -= &self.energy_gradient(&map.coefficients().to_owned());
        let mut diagonal = 0;
        for a in 0..self.dim {
            let values = equations.matrices[diagonal].values_mut();
            values.iter_mut().zip(self.energy.values()).for_each(|(x, g)| *x += self.lambda * g);
            diagonal += self.dim - a;
        }
        Ok(equations)
    }

    /// The step `δc` that solves equations, with `½ ν |δc|²` added to what they minimize, some steps given, and what
    /// `coupled` adds to matrix and right-hand side, unknown `k` of function `j` at `j N + k`. `None` if they are singular.
    pub(crate) fn step(
        &mut self,
        equations: &BlockEquations,
        ridge: f64,
        given: &Fixed,
        coupled: impl FnOnce(&mut SymmetricMatrix, &mut Array2<f64>),
    ) -> Result<Option<Array2<f64>>, Error> {
        let BlockEquations { matrices, right } = equations;
        let mut matrix = SymmetricMatrix::from_blocks(&self.blocked, matrices, self.dim)?;
        let unknowns = right.len();
        if ridge > 0.0 {
            let values = matrix.values_mut();
            self.blocked.columns()[..unknowns].iter().for_each(|&first| values[first] += ridge);
        }
        let mut flat = Array2::from_shape_fn((unknowns, 1), |(i, _)| right[[i / self.dim, i % self.dim]]);
        coupled(&mut matrix, &mut flat);
        let scalar_rows = |(function, row): &(usize, Vec<f64>)| {
            let first = function * self.dim;
            row.iter().enumerate().map(move |(k, &x)| (first + k, vec![x])).collect::<Vec<_>>()
        };
        let fixed: Fixed = given.iter().flat_map(scalar_rows).collect();
        eliminate(&mut matrix, &mut flat, &fixed)?;
        let functions = self.energy.pattern().n();
        let Some(solution) = solve(&mut self.solver, &matrix, &flat, functions)? else { return Ok(None) };
        Ok(Some(Array2::from_shape_fn(right.raw_dim(), |(j, k)| solution[[j * self.dim + k, 0]])))
    }

    /// Factorizes the matrix of a step; where points and smoothing leave it singular, with a little more on its diagonal.
    pub(crate) fn factorize(&mut self, equations: &BlockEquations) -> Result<(), Error> {
        let mut matrix = SymmetricMatrix::from_blocks(&self.blocked, &equations.matrices, self.dim)?;
        let mean = matrix.trace() / self.blocked.n() as f64;
        for shift in SHIFTS {
            let values = matrix.values_mut();
            self.blocked.columns()[..self.blocked.n()].iter().for_each(|&first| values[first] += shift * mean);
            if self.solver.factorize(&matrix).is_ok() {
                return Ok(());
            }
        }
        Err(Error::Minimization { reason: FactorizationError::NotPositiveDefinite.to_string() })
    }

    /// The step of the boundary's coefficients that fits the points of the boundary in the sense of point distances
    /// (Imperatore 2024, Remark 25), all others held. `None` if the points do not determine it.
    pub(crate) fn boundary_step<const D: usize>(
        &self,
        space: &HierarchicalSpace<D>,
        points: &SortedPoints<D>,
        frames: &[Frame<D>],
        held_points: &[usize],
        coefficients: &Array2<f64>,
        boundary: &[bool],
    ) -> Result<Option<Fixed>, Error> {
        let count = held_points.len();
        let targets = Array2::from_shape_fn((count, self.dim), |(i, k)| -frames[held_points[i]].residual[k]);
        let parameters = Array2::from_shape_fn((count, D), |(i, d)| points.parameters(d)[held_points[i]]);
        let weights: Option<Array1<f64>> = points.weights().map(|w| held_points.iter().map(|&at| w[at]).collect());
        let weights = weights.as_ref().map(|w| w.view());
        let mut residuals = SortedPoints::new(parameters.view(), targets.view(), weights)?;
        residuals.sort_refined(space, None)?;
        let NormalEquations { mut matrix, mut right } = NormalEquations::new(space, self.energy.pattern(), &residuals)?;
        matrix.values_mut().iter_mut().zip(self.energy.values()).for_each(|(x, g)| *x += self.lambda * g);
        right -= &self.energy_gradient(coefficients);
        let held: Fixed =
            (0..boundary.len()).filter(|&j| !boundary[j]).map(|j| (j, vec![0.0; right.ncols()])).collect();
        eliminate(&mut matrix, &mut right, &held)?;
        let mut solver =
            Cholesky::new(matrix.pattern()).map_err(|_| fit_ls::Error::OutOfMemory { functions: boundary.len() })?;
        let Some(step) = solve(&mut solver, &matrix, &right, boundary.len())? else { return Ok(None) };
        Ok(Some((0..boundary.len()).filter(|&j| boundary[j]).map(|j| (j, step.row(j).to_vec())).collect()))
    }
}

fn solve(
    solver: &mut Cholesky,
    matrix: &SymmetricMatrix,
    right: &Array2<f64>,
    functions: usize,
) -> Result<Option<Array2<f64>>, Error> {
    match solver.factorize(matrix).and_then(|()| solver.solve(right)) {
        Ok(solution) => Ok(Some(solution)),
        Err(FactorizationError::NotPositiveDefinite) => Ok(None),
        Err(FactorizationError::OutOfMemory) => Err(fit_ls::Error::OutOfMemory { functions }.into()),
    }
}

/// Which functions do not vanish on the boundary of the domain; a seam is none.
pub(crate) fn boundary_functions<const D: usize>(space: &HierarchicalSpace<D>) -> Vec<bool> {
    let mut boundary = vec![false; space.n_functions()];
    let periodic = space.periodic();
    for level in 0..space.n_levels() {
        let counts = space.function_counts(level);
        let first = space.first_of_level(level);
        for (k, &index) in space.active_functions(level).iter().enumerate() {
            let mut rest = index as usize;
            for (count, periodic) in counts.into_iter().zip(periodic) {
                let i = rest % count;
                boundary[first + k] |= !periodic && (i == 0 || i + 1 == count);
                rest /= count;
            }
        }
    }
    boundary
}

/// The map with stepped coefficients.
pub(crate) fn stepped<const D: usize>(
    space: &Arc<HierarchicalSpace<D>>,
    coefficients: &Array2<f64>,
    step: &Array2<f64>,
) -> Result<SplineMap<D>, Error> {
    Ok(SplineMap::new(space.clone(), coefficients + step)?)
}
