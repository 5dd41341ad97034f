//! J-PDM: coefficients and parameters together, by L-BFGS (Imperatore 2024, §5.3).

use std::sync::Mutex;

use argmin::core::{CostFunction, Executor, Gradient, IterState, State as _};
use argmin::solver::linesearch::MoreThuenteLineSearch;
use argmin::solver::quasinewton::LBFGS;
// For its feature `vec`: the vector operations of L-BFGS on `Vec<f64>`.
use argmin_math as _;
use thb_core::{HierarchicalSpace, SplineMap, transfer};

use crate::equations::{Equations, PointBlock};
use crate::methods::unknowns::{Place, Unknowns, basis_sums, jets};
use crate::moving::{Moves, MovingFit};
use crate::points::frame::Frame;
use crate::points::place::cells_of;
use crate::points::vector::{Vector, difference, point};
use crate::state::{Snapshot, State, StepStart};
use crate::term::{Objective, Term};
use crate::terms::data::Data;
use crate::{Error, Schedule};

/// Corrections of the inverse Hessian that are kept (Imperatore 2024, Remark 27).
const MEMORY: usize = 20;

/// Iterations after which the unknowns are measured anew and the corrections forgotten. Without, errors on the ship hull of
/// docs/results/moving.md are four times as large after as many iterations; with 20 or 40 they are about the same.
const MEASURED_FOR: u64 = 30;

/// Constants of the strong Wolfe conditions.
const WOLFE: (f64, f64) = (1e-4, 0.9);

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
        let (tolerance, mut left) = schedule.limits(space.n_levels());
        let failed = |e: argmin::core::Error| Error::Minimization { reason: e.to_string() };
        let constraints = self.constraints();
        let (mut data, mut smoothing) = (Data, self.smoothing(&space)?);
        let terms: Vec<&mut dyn Term<D>> = vec![&mut data, &mut smoothing];
        let mut objective = Objective::new(terms);
        let mut map = map;
        while left > 0 {
            let system = self.take_system(&space)?;
            let points = self.fit.points();
            let weights = points.as_given(points.weights().unwrap_or(&vec![1.0; points.len()]));
            let snapshot = Snapshot::new(&map, points, |index| weights[index])?;
            let mut equations = Equations::new(system.pattern().clone());
            objective.freeze(&snapshot.start(&map, points), &mut equations)?;
            let unknowns = Unknowns::new(map.clone(), points, &constraints, equations, system)?;
            let problem = Problem { unknowns, objective: &objective, snapshot, last: Mutex::new(None) };
            let search = MoreThuenteLineSearch::new().with_c(WOLFE.0, WOLFE.1).map_err(failed)?;
            let solver = LBFGS::new(search, MEMORY)
                .with_tolerance_grad(tolerance)
                .and_then(|solver| solver.with_tolerance_cost(0.0))
                .map_err(failed)?;
            let (start, most) = (vec![0.0; problem.unknowns.len()], left.min(MEASURED_FOR));
            let configured = |state: IterState<Vec<f64>, Vec<f64>, (), (), (), f64>| {
                state.param(start).max_iters(most).target_cost(0.0)
            };
            let state = Executor::new(&problem, solver).configure(configured).run().map_err(failed)?.state;
            tracing::debug!(status = %state.get_termination_status(), cost = state.get_best_cost(), "L-BFGS");
            moves.corrections += state.get_iter() as usize;
            let Some(best) = state.get_best_param() else { break };
            let Place { map: reached, parameters, .. } = problem.unknowns.place(best)?;
            map = reached;
            // The structure of the matrix is analysed once in a space.
            self.system = Some((space.clone(), problem.unknowns.into_system()));
            self.fit.relocate(&parameters, &cells_of(&space, &parameters)?)?;
            if state.get_iter() < most {
                break;
            }
            left -= most;
        }
        Ok(map)
    }
}

/// Unknowns, cost and gradient.
type Evaluated = (Vec<f64>, f64, Vec<f64>);

/// The objective as a function of [`Unknowns`].
struct Problem<'a, 't, const D: usize> {
    unknowns: Unknowns<'a, D>,
    objective: &'a Objective<'t, D, HierarchicalSpace<D>>,
    /// The start, whose arrays have the order of the points.
    snapshot: Snapshot<D>,
    /// The last values, so that cost and gradient at one place cost one pass.
    last: Mutex<Option<Evaluated>>,
}

impl<const D: usize> Problem<'_, '_, D> {
    /// Objective and gradient in one pass over the points.
    fn evaluate(&self, x: &[f64]) -> Result<(f64, Vec<f64>), Error> {
        let place = self.unknowns.place(x)?;
        let Place { map, parameters, .. } = &place;
        let points = self.unknowns.points();
        let frames: Vec<Frame<D>> = jets(map, parameters)?
            .iter()
            .enumerate()
            .map(|(at, jet)| Frame { residual: difference(&jet.value, &point(points, at)), tangents: jet.first })
            .collect();
        let distances: Vec<f64> = frames.iter().map(Frame::distance).collect();
        let of_start = self.snapshot.start(map, points).state;
        let state = State { parameters, distances: &distances, ..of_start };
        let mut equations = Equations::new(self.unknowns.pattern().clone());
        self.objective.linearize_at(&StepStart { state, frames: &frames }, &mut equations)?;
        let slopes: Vec<[f64; D]> = equations.points.iter().map(PointBlock::slope).collect();
        let forces: Vec<Vector> =
            equations.points.iter().map(|block| block.residual.map(|x| block.weight * x)).collect();
        let mut gradient = basis_sums(map.space(), parameters, &forces, map.dim())?;
        equations.add_gradient(&mut gradient);
        Ok((self.objective.energy(&state)?, self.unknowns.gradient(&place, gradient, slopes)?))
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

impl<const D: usize> CostFunction for &Problem<'_, '_, D> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, unknowns: &Vec<f64>) -> Result<f64, argmin::core::Error> {
        self.cached(unknowns, |cost, _| cost)
    }
}

impl<const D: usize> Gradient for &Problem<'_, '_, D> {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;

    fn gradient(&self, unknowns: &Vec<f64>) -> Result<Vec<f64>, argmin::core::Error> {
        self.cached(unknowns, |_, gradient| gradient.to_vec())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::Boundary;
    use crate::points::constraint::Constraints;
    use crate::step_system::StepSystem;
    use crate::terms::smoothing::Smoothing;
    use fit_ls::SortedPoints;
    use ndarray::Array2;
    use thb_core::{CellSpace, HierarchicalSpace, Kind, KnotVector, Refinement, SymmetricPattern, ThinPlate};

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
        let constraints = Constraints::new(parameters.view(), space.domain(), Boundary::Kept);
        let free: usize = (0..60).map(|i| constraints.free(i).iter().filter(|&&free| free).count()).sum();
        assert!(free <= 2 * 60 - 10);
        let map = map.unwrap();
        let (mut data, mut smoothing) = (Data, Smoothing::new(energy, 1e-3));
        let system = StepSystem::new(smoothing.gram().pattern(), 3).unwrap();
        let terms: Vec<&mut dyn Term<2>> = vec![&mut data, &mut smoothing];
        let mut objective = Objective::new(terms);
        let snapshot = Snapshot::new(&map, &points, |index| weights[index]).unwrap();
        let mut equations = Equations::new(system.pattern().clone());
        objective.freeze(&snapshot.start(&map, &points), &mut equations).unwrap();
        let unknowns = Unknowns::new(map, &points, &constraints, equations, system).unwrap();
        assert_eq!(unknowns.len(), 3 * space.n_functions() + free);
        let problem = Problem { unknowns, objective: &objective, snapshot, last: Mutex::new(None) };
        // Not at the start: there the parameters have not moved with the coefficients.
        let at: Vec<f64> = (0..problem.unknowns.len()).map(|_| 1e-2 * (random() - 0.5)).collect();
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
