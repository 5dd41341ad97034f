//! J-PDM: coefficients and parameters together, by L-BFGS (Imperatore 2024, §5.3).

use std::ops::Range;
use std::sync::{Arc, Mutex};

use argmin::core::{CostFunction, Executor, Gradient, IterState, State};
use argmin::solver::linesearch::MoreThuenteLineSearch;
use argmin::solver::quasinewton::LBFGS;
// For its feature `vec`: the vector operations of L-BFGS on `Vec<f64>`.
use argmin_math as _;
use fit_ls::SortedPoints;
use ndarray::Array2;
use pulp::{Simd, WithSimd};
use rayon::prelude::*;
use thb_core::bernstein;
use thb_core::{BezierMap, CellSpace, HierarchicalSpace, MAX_DEGREE, SplineMap, SymmetricMatrix, transfer};

use crate::constraint::Constraints;
use crate::foot_point::point;
use crate::frame::frames;
use crate::moving::{Moves, MovingFit};
use crate::patch::{MAX_DIM, Patch, difference, dot};
use crate::place::cells_of;
use crate::{Error, Schedule};

/// Corrections of the inverse Hessian that are kept (Imperatore 2024, Remark 27).
const MEMORY: usize = 20;

/// Constants of the strong Wolfe conditions.
const WOLFE: (f64, f64) = (1e-4, 0.9);

/// Points of one parallel task; sums are formed task by task.
const CHUNK: usize = 1024;

impl<const D: usize> MovingFit<D> {
    pub(crate) fn joint_lbfgs(
        &mut self,
        map: SplineMap<D>,
        previous: Option<&SplineMap<D>>,
        schedule: Schedule,
        moves: &mut Moves,
    ) -> Result<SplineMap<D>, Error> {
        let space = map.space().clone();
        // The warm start: what was reached in the space before, exactly.
        let map = match previous {
            Some(previous) => SplineMap::new(space.clone(), transfer(previous, &space)?)?,
            None => map,
        };
        let energy = self.fit.energy(&space)?;
        let (gradient, iterations) = schedule.limits(space.n_levels());
        let points = self.fit.points();
        let problem = Problem::new(&map, points, self.constraints(), energy, self.fit.lambda().unwrap_or(0.0))?;
        let start = problem.pack(&map);
        let failed = |e: argmin::core::Error| Error::Minimization { reason: e.to_string() };
        let search = MoreThuenteLineSearch::new().with_c(WOLFE.0, WOLFE.1).map_err(failed)?;
        let solver = LBFGS::new(search, MEMORY)
            .with_tolerance_grad(gradient)
            .and_then(|solver| solver.with_tolerance_cost(0.0))
            .map_err(failed)?;
        let configured = |state: IterState<Vec<f64>, Vec<f64>, (), (), (), f64>| {
            state.param(start.clone()).max_iters(iterations).target_cost(0.0)
        };
        let result = Executor::new(&problem, solver).configure(configured).run().map_err(failed)?;
        tracing::debug!(status = %result.state.get_termination_status(), "L-BFGS");
        moves.corrections += result.state.get_iter() as usize;
        let Some(best) = result.state.get_best_param() else { return Ok(map) };
        let (coefficients, parameters) = problem.unpack(best);
        let cells = cells_of(&space, &parameters)?;
        let map = SplineMap::new(space, coefficients)?;
        self.fit.relocate(&parameters, &cells)?;
        Ok(map)
    }
}

/// Unknowns, cost and gradient.
type Evaluated = (Vec<f64>, f64, Vec<f64>);

/// `½ Σ ω |s(u) − p|² + ½ λ J(c)` as a function of scaled coefficients and free parameters.
pub(crate) struct Problem<'a, const D: usize> {
    space: Arc<HierarchicalSpace<D>>,
    points: &'a SortedPoints<D>,
    energy: SymmetricMatrix,
    lambda: f64,
    dim: usize,
    /// A coefficient is its unknown times this: unknowns whose second derivatives are about 1.
    coefficient_scale: Vec<f64>,
    /// Position and direction of each parameter that moves, and its scale.
    free: Vec<(u32, u8, f64)>,
    /// The last values, so that cost and gradient at one place cost one pass.
    last: Mutex<Option<Evaluated>>,
}

impl<'a, const D: usize> Problem<'a, D> {
    pub(crate) fn new(
        map: &SplineMap<D>,
        points: &'a SortedPoints<D>,
        constraints: Constraints<D>,
        energy: SymmetricMatrix,
        lambda: f64,
    ) -> Result<Self, Error> {
        let space = map.space().clone();
        let frames = frames(map, points)?;
        let equations = fit_ls::NormalEquations::new(space.as_ref(), energy.pattern(), points)?;
        let columns = energy.pattern().columns();
        let diagonal = |j: usize| equations.matrix.values()[columns[j]] + lambda * energy.values()[columns[j]];
        let scale_of = |second: f64, fallback: f64| if second > 0.0 { second.sqrt().recip() } else { fallback };
        let coefficient_scale = (0..space.n_functions()).map(|j| scale_of(diagonal(j), 1.0)).collect();
        let mut free = Vec::new();
        for (at, frame) in frames.iter().enumerate() {
            let weight = points.weights().map_or(1.0, |w| w[at]);
            let directions = constraints.free(points.order()[at] as usize);
            for d in (0..D).filter(|&d| directions[d]) {
                let second = weight * dot(&frame.tangents[d], &frame.tangents[d]);
                free.push((at as u32, d as u8, scale_of(second, 1.0)));
            }
        }
        Ok(Self { space, points, energy, lambda, dim: map.dim(), coefficient_scale, free, last: Mutex::new(None) })
    }

    /// The unknowns of a map and the present parameters.
    pub(crate) fn pack(&self, map: &SplineMap<D>) -> Vec<f64> {
        let coefficients = map.coefficients();
        let rows = coefficients.outer_iter().zip(&self.coefficient_scale);
        let mut unknowns: Vec<f64> =
            rows.flat_map(|(row, scale)| row.to_vec().into_iter().map(move |c| c / scale)).collect();
        unknowns
            .extend(self.free.iter().map(|&(at, d, scale)| self.points.parameters(d as usize)[at as usize] / scale));
        unknowns
    }

    /// Coefficients and parameters; those outside the domain are projected to it, or wrapped in periodic directions.
    pub(crate) fn unpack(&self, unknowns: &[f64]) -> (Array2<f64>, Vec<[f64; D]>) {
        let n = self.coefficient_scale.len();
        let coefficients =
            Array2::from_shape_fn((n, self.dim), |(j, k)| unknowns[j * self.dim + k] * self.coefficient_scale[j]);
        let mut parameters: Vec<[f64; D]> = (0..self.points.len()).map(|at| self.points.parameter(at)).collect();
        for (&x, &(at, d, scale)) in unknowns[n * self.dim..].iter().zip(&self.free) {
            parameters[at as usize][d as usize] = x * scale;
        }
        parameters.iter_mut().for_each(|u| *u = self.space.to_domain(*u));
        (coefficients, parameters)
    }

    /// Objective and gradient in one pass over the points.
    pub(crate) fn evaluate(&self, unknowns: &[f64]) -> Result<(f64, Vec<f64>), Error> {
        let (coefficients, parameters) = self.unpack(unknowns);
        let map = SplineMap::new(self.space.clone(), coefficients)?;
        let bezier = map.bezier();
        let parts: Vec<Part<D>> = (0..self.points.len().div_ceil(CHUNK))
            .into_par_iter()
            .map(|chunk| {
                let range = chunk * CHUNK..(chunk * CHUNK + CHUNK).min(self.points.len());
                pulp::Arch::new().dispatch(Pass { problem: self, map: bezier, parameters: &parameters, range })
            })
            .collect();
        let n_local: usize = bezier.degree().iter().map(|p| p + 1).product();
        let per_cell = n_local * self.dim;
        let mut local = vec![0.0; per_cell * self.space.n_cells()];
        let mut squares = 0.0;
        let mut parameter_gradient = Vec::with_capacity(parameters.len());
        for part in parts {
            squares += part.squares;
            parameter_gradient.extend(part.parameters);
            for (run, sums) in part.cells.iter().zip(part.sums.chunks_exact(per_cell)) {
                let target = &mut local[*run as usize * per_cell..][..per_cell];
                target.iter_mut().zip(sums).for_each(|(a, b)| *a += b);
            }
        }
        let mut gradient = Array2::<f64>::zeros((self.coefficient_scale.len(), self.dim));
        let (mut rows, mut scratch) = (Vec::new(), Vec::new());
        for (number, sums) in local.chunks_exact(per_cell).enumerate() {
            let cell = self.space.cell(number);
            rows.clear();
            rows.extend_from_slice(sums);
            cell.pull_back(&mut rows, self.dim, &mut scratch);
            for (row, &function) in rows.chunks_exact(self.dim).zip(cell.functions) {
                gradient.row_mut(function as usize).iter_mut().zip(row).for_each(|(g, x)| *g += x);
            }
        }
        let mut energy = 0.0;
        for k in 0..self.dim {
            let column = map.coefficients().column(k).to_vec();
            let product = self.energy.multiply(&column);
            for (j, x) in product.iter().enumerate() {
                gradient[[j, k]] += self.lambda * x;
                energy += column[j] * x;
            }
        }
        let mut scaled: Vec<f64> = gradient.indexed_iter().map(|((j, _), g)| g * self.coefficient_scale[j]).collect();
        let ((lower, upper), periodic) = (self.space.domain(), self.space.periodic());
        let first = scaled.len();
        for (&(at, d, scale), &x) in self.free.iter().zip(&unknowns[first..]) {
            let (d, u) = (d as usize, x * scale);
            // The projection is constant outside the domain.
            let inside = periodic[d] || u >= lower[d] && u <= upper[d];
            scaled.push(if inside { parameter_gradient[at as usize][d] * scale } else { 0.0 });
        }
        Ok((0.5 * squares + 0.5 * self.lambda * energy, scaled))
    }

    fn cached<T>(&self, unknowns: &[f64], pick: impl Fn(f64, &[f64]) -> T) -> Result<T, argmin::core::Error> {
        let mut last = self.last.lock().map_err(|e| argmin::core::Error::msg(e.to_string()))?;
        if let Some((at, cost, gradient)) = last.as_ref()
            && at == unknowns
        {
            return Ok(pick(*cost, gradient));
        }
        let (cost, gradient) = self.evaluate(unknowns)?;
        // The line search would go on for ever with a NaN.
        if !cost.is_finite() || gradient.iter().any(|g| !g.is_finite()) {
            return Err(argmin::core::Error::msg("the objective is not finite"));
        }
        let result = pick(cost, &gradient);
        *last = Some((unknowns.to_vec(), cost, gradient));
        Ok(result)
    }
}

impl<const D: usize> CostFunction for &Problem<'_, D> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, unknowns: &Vec<f64>) -> Result<f64, argmin::core::Error> {
        self.cached(unknowns, |cost, _| cost)
    }
}

impl<const D: usize> Gradient for &Problem<'_, D> {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;

    fn gradient(&self, unknowns: &Vec<f64>) -> Result<Vec<f64>, argmin::core::Error> {
        self.cached(unknowns, |_, gradient| gradient.to_vec())
    }
}

/// Sums over a range of points.
struct Part<const D: usize> {
    squares: f64,
    /// `ω Tᵀr` of each point.
    parameters: Vec<[f64; D]>,
    /// Cells met, in the order of the points, and for each `Σ ω B r`, `(n_local, N)`.
    cells: Vec<u32>,
    sums: Vec<f64>,
}

struct Pass<'a, 'b, const D: usize> {
    problem: &'a Problem<'b, D>,
    map: &'a BezierMap<D>,
    parameters: &'a [[f64; D]],
    range: Range<usize>,
}

impl<const D: usize> WithSimd for Pass<'_, '_, D> {
    type Output = Part<D>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> Self::Output {
        let Self { problem, map, parameters, range } = self;
        let n = problem.dim;
        let orders = map.degree().map(|p| p + 1);
        let per_cell = n * orders.iter().product::<usize>();
        let mut part =
            Part { squares: 0.0, parameters: Vec::with_capacity(range.len()), cells: Vec::new(), sums: Vec::new() };
        let home = problem.points.offsets().partition_point(|&o| o <= range.start) - 1;
        let mut patch = Patch::new(map, home);
        let mut basis = [[0.0; MAX_DEGREE + 1]; D];
        for at in range {
            let u = parameters[at];
            if !patch.owns(u) {
                let cell = problem.space.locate_cell(u).unwrap_or(patch.cell());
                patch.load(map, cell);
            }
            let cell = patch.cell() as u32;
            if part.cells.last() != Some(&cell) {
                part.cells.push(cell);
                part.sums.resize(part.sums.len() + per_cell, 0.0);
            }
            let jet = patch.first_jet(u);
            let residual = difference(&jet.value, &point(problem.points, at));
            let weight = problem.points.weights().map_or(1.0, |w| w[at]);
            part.squares += weight * dot(&residual, &residual);
            part.parameters.push(std::array::from_fn(|d| weight * dot(&jet.first[d], &residual)));
            let (lower, upper) = map.cell_box(cell as usize);
            for d in 0..D {
                bernstein::values(orders[d] - 1, (u[d] - lower[d]) / (upper[d] - lower[d]), &mut basis[d]);
            }
            let first = part.sums.len() - per_cell;
            let scaled: [f64; MAX_DIM] = std::array::from_fn(|k| weight * residual[k]);
            for (linear, row) in part.sums[first..].chunks_exact_mut(n).enumerate() {
                let mut rest = linear;
                let mut product = 1.0;
                for d in 0..D {
                    product *= basis[d][rest % orders[d]];
                    rest /= orders[d];
                }
                row.iter_mut().zip(&scaled).for_each(|(target, r)| *target += product * r);
            }
        }
        part
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Boundary;
    use thb_core::{Kind, KnotVector, Refinement, SymmetricPattern, ThinPlate};

    #[test]
    fn the_gradient_is_the_limit_of_differences() {
        let mut state = 1_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let knots = KnotVector::uniform(3, 3).unwrap();
        let space = HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap();
        let space = Arc::new(space.refine(&[4], &Refinement { extension: [2; 2], ..Refinement::default() }).unwrap());
        // A weighted cloud with points on two sides.
        let parameters = Array2::from_shape_fn((60, 2), |(i, d)| if i % 6 == 0 && d == 0 { 1.0 } else { random() });
        let targets = Array2::from_shape_simple_fn((60, 3), &mut random);
        let weights = ndarray::Array1::from_shape_simple_fn(60, || 0.5 + random());
        let mut points = SortedPoints::new(parameters.view(), targets.view(), Some(weights.view())).unwrap();
        points.sort_refined(&space, None).unwrap();
        let energy = ThinPlate::new([3; 2], thb_core::Quadrature::Exact);
        let energy = energy.gram(space.as_ref(), &SymmetricPattern::new(space.as_ref())).unwrap();
        let map = SplineMap::new(space.clone(), Array2::from_shape_simple_fn((space.n_functions(), 3), &mut random));
        let map = map.unwrap();
        let constraints = Constraints::new(parameters.view(), space.domain(), Boundary::Kept);
        let free: usize = (0..60).map(|i| constraints.free(i).iter().filter(|&&free| free).count()).sum();
        let problem = Problem::new(&map, &points, constraints, energy, 1e-3).unwrap();
        let at = problem.pack(&map);
        assert!(free <= 2 * 60 - 10);
        assert_eq!(at.len(), 3 * space.n_functions() + free);
        let (_, gradient) = problem.evaluate(&at).unwrap();
        let largest = gradient.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
        let step = 1e-6;
        for k in 0..at.len() {
            let cost = |sign: f64| {
                let mut moved = at.clone();
                moved[k] += sign * step;
                problem.evaluate(&moved).unwrap().0
            };
            let difference = (cost(1.0) - cost(-1.0)) / (2.0 * step);
            assert!((difference - gradient[k]).abs() < 1e-6 * largest, "unknown {k}: {difference} {}", gradient[k]);
        }
    }
}
