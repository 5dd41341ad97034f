//! Coefficients and parameters together, by Levenberg–Marquardt steps.
//!
//! With residuals `r_i`, tangents `T_i` and damping μ of the parameters a step minimizes
//! `½ Σ ω_i |r_i + B_i δc + T_i δu_i|² + ½ μ Σ ω_i δu_iᵀ diag(T_iᵀT_i) δu_i + ½ λ J(c + δc)`. Each `δu_i` occurs in one residual and
//! is eliminated exactly, as in bundle adjustment: what remains for δc are least squares with the matrices
//! `W_i = I − T_i (T_iᵀT_i + μ diag)⁻¹ T_iᵀ`, which lie between tangent distances (μ = 0) and point distances (μ = ∞).

use thb_core::{CellSpace, HierarchicalSpace, SplineMap, transfer};

use crate::frame::{Frame, Share, columns, frames};
use crate::moving::{Moves, MovingFit};
use crate::points::foot_point::{FootPointOptions, FootPoints, Start, foot_points_from, seek_anew};
use crate::points::patch::dot;
use crate::system::StepSystem;
use crate::terms::lost_area::{Regularity, Sheet, step};
use crate::terms::springs::Anchor;
use crate::terms::triangle_centres::{Between, rim};
use crate::{Error, JointOptions};

/// Damping of the first step.
const FIRST_DAMPING: f64 = 1e-2;

/// Factor of the damping after a step that lowered the objective.
const DECREASE: f64 = 0.1;

/// Factor after one that did not.
const INCREASE: f64 = 10.0;

/// Below this damping the equations are too near to singular; tangent motion is then all but free.
const LEAST_DAMPING: f64 = 1e-10;

/// Beyond this damping a step is one of point distances: if that does not lower the objective nothing will.
const MOST_DAMPING: f64 = 1e4;

/// Steps in a row that lower the objective too little, after which the descent ends.
const SLOW_STEPS: usize = 2;

/// Samples per direction and cell among which the start of a stray point is sought.
const STRAY_SAMPLES: usize = 4;

/// Accepted steps after a refused one for which damping stays as it is: lowered at once, half of all trials are refused.
const WARY_STEPS: usize = 2;

/// Steps between two changes of the emphasis.
const STEPS_PER_ROUND: usize = 2;

/// Share of points outside the tolerance up to which emphasis pays: beyond it the space is too coarse.
const FEW: f64 = 0.02;

/// Largest factor of a point's weight in one round of emphasis, and over all rounds.
const EMPHASIS: (f64, f64) = (4.0, 1e4);

impl<const D: usize> MovingFit<D> {
    pub(crate) fn joint(
        &mut self,
        map: SplineMap<D>,
        previous: Option<&SplineMap<D>>,
        options: &JointOptions,
        moves: &mut Moves,
    ) -> Result<SplineMap<D>, Error> {
        let space = map.space().clone();
        let map = match (previous, self.regularity(&space, options)) {
            // A fit at parameters that have moved may fold where what was reached before does not.
            (Some(previous), Some(regularity)) => {
                let reached = SplineMap::new(space.clone(), transfer(previous, &space)?)?;
                if regularity.turned(&map, &reached) { reached } else { map }
            }
            _ => map,
        };
        let mut system = self.take_system(&space)?;
        // Weights by index: sorted positions change with the parameters.
        let mut weights = self.weights.clone().unwrap_or_else(|| vec![1.0; self.fit.points().len()]);
        if self.anchor.is_none() && (options.stiffness > 0.0 || options.cohesion > 0.0) {
            let start = self.start.outer_iter().map(|row| std::array::from_fn(|d| row[d])).collect();
            let points = self.fit.points();
            let frames = frames(&map, points)?;
            self.anchor = Some(Anchor::new(space.clone(), points, &frames, start, &self.centres, options));
        }
        if self.rim.is_none() && options.between > 0.0 {
            self.rim = Some(rim(&self.centres));
        }
        let mut damping = FIRST_DAMPING;
        let mut map = self.descend(map, &mut system, &weights, &mut damping, options.max_steps, options, moves)?;
        for _ in 0..options.emphasis {
            let tolerance = self.options.tolerance;
            let outside = self.measure(&map)?.outside;
            let counted = weights.iter().filter(|w| **w > 0.0).count();
            if outside == 0 || outside as f64 > FEW * counted as f64 {
                break;
            }
            self.free_strays(&map, moves)?;
            let distances = self.fit.distances(&map)?.to_vec();
            let given = self.weights.as_deref();
            for (&distance, &index) in distances.iter().zip(self.fit.points().order()) {
                let index = index as usize;
                let factor = (distance / tolerance).powi(2).clamp(1.0, EMPHASIS.0);
                weights[index] = (weights[index] * factor).min(EMPHASIS.1 * given.map_or(1.0, |w| w[index]));
            }
            let before = (map.clone(), self.parameters());
            map = self.descend(map, &mut system, &weights, &mut damping, STEPS_PER_ROUND, options, moves)?;
            if self.measure(&map)?.outside > outside {
                self.restore(&before.1, &space)?;
                map = before.0;
                break;
            }
        }
        self.system = Some((space, system));
        Ok(map)
    }

    /// Points outside the tolerance may hang at a foot point that is no longer the nearest: they are sought anew.
    fn free_strays(&mut self, map: &SplineMap<D>, moves: &mut Moves) -> Result<(), Error> {
        let tolerance = self.options.tolerance;
        let distances = self.fit.distances(map)?;
        let strays: Vec<usize> = (0..distances.len()).filter(|&at| distances[at] > tolerance).collect();
        self.seek(map, &strays, moves)
    }

    /// Moves the points at some places to their foot points, sought from there and among samples of the map.
    pub(crate) fn seek(&mut self, map: &SplineMap<D>, places: &[usize], moves: &mut Moves) -> Result<(), Error> {
        let options = FootPointOptions { start: Start::Both(STRAY_SAMPLES), ..self.options.foot_points };
        let points = self.fit.points();
        let found = seek_anew(map, points, places, &self.constraints(), &options)?;
        let mut parameters: Vec<[f64; D]> = (0..points.len()).map(|at| points.parameter(at)).collect();
        let mut cells: Vec<u32> = Vec::with_capacity(points.len());
        for (cell, ends) in points.offsets().windows(2).enumerate() {
            cells.resize(ends[1], cell as u32);
        }
        for (&at, (u, cell)) in places.iter().zip(found) {
            (parameters[at], cells[at]) = (u, cell);
        }
        self.hold(map, &mut parameters, &mut cells, moves)?;
        Ok(self.fit.relocate(&parameters, &cells)?)
    }

    /// At most `max_steps` steps with weights given by index.
    fn descend(
        &mut self,
        mut map: SplineMap<D>,
        system: &mut StepSystem,
        weights: &[f64],
        damping: &mut f64,
        max_steps: usize,
        options: &JointOptions,
        moves: &mut Moves,
    ) -> Result<SplineMap<D>, Error> {
        let space = map.space().clone();
        let constraints = self.constraints();
        let (between, regularity) = (self.between(&space, options)?, self.regularity(&space, options));
        let (mut slow, mut wary) = (0, 0_usize);
        'steps: for _ in 0..max_steps {
            let points = self.fit.points();
            let mut frames = frames(&map, points)?;
            if let Some(anchor) = &mut self.anchor {
                anchor.follow(points, &frames);
                for (at, (frame, &index)) in frames.iter_mut().zip(points.order()).enumerate() {
                    *frame = frame.anchored(anchor, index as usize, points.parameter(at));
                }
            }
            let distances: Vec<f64> = frames.iter().map(|f| dot(&f.residual, &f.residual).sqrt()).collect();
            let weights: Vec<f64> = points.order().iter().map(|&index| weights[index as usize]).collect();
            let is_met = |(distance, weight): (&f64, &f64)| *distance <= self.options.tolerance || *weight == 0.0;
            if distances.iter().zip(&weights).all(is_met) {
                break;
            }
            // As long as distances are beyond the tolerance folds cost as much as they do: for less a step would fold first,
            // and then not be taken.
            let of_points = squares(&distances, &weights);
            let level = of_points.max(0.5 * self.options.tolerance.powi(2) * points.total_weight());
            let fold_weight = options.regularity * 2.0 * level / space.n_cells() as f64;
            let sheet = regularity.as_ref().map(|regularity| Sheet::new(regularity, &map, fold_weight));
            let held = between.as_ref().map(|b| b.equations(&map, system.pattern(), points)).transpose()?;
            let objective = of_points
                + self.springs(|at| points.parameter(at), &weights)
                + system.energy_part(&map.coefficients().to_owned())
                + held.as_ref().map_or(0.0, |(energy, _)| *energy)
                + sheet.as_ref().map_or(0.0, Sheet::energy);
            let lowered = loop {
                let share = |at: usize| Share { point: 0.0, damping: *damping, weight: weights[at] };
                let columns = columns(self.fit.points(), &frames, &constraints, share);
                let mut equations = system.equations(&map, self.fit.points(), &columns)?;
                if let Some((_, further)) = &held {
                    equations.merge(further)?;
                }
                if let Some((trial, folds)) = step(system, &equations, &map, sheet.as_ref())? {
                    let found = self.follow(&trial, &frames, *damping, options.polish, moves)?;
                    let parameter = |at: usize| found.parameters[at];
                    let new = squares(&found.distances, &weights)
                        + self.springs(parameter, &weights)
                        + system.energy_part(&trial.coefficients().to_owned())
                        + between.as_ref().map_or(Ok(0.0), |b| b.energy(&trial, self.fit.points(), parameter))?
                        + folds;
                    if new < objective {
                        moves.count(&found.report);
                        self.fit.relocate(&found.parameters, &found.cells)?;
                        map = trial;
                        if wary == 0 {
                            *damping = (*damping * DECREASE).max(LEAST_DAMPING);
                        }
                        wary = wary.saturating_sub(1);
                        break (objective - new) / objective;
                    }
                }
                *damping *= INCREASE;
                wary = WARY_STEPS;
                if *damping > MOST_DAMPING {
                    *damping = FIRST_DAMPING;
                    break 'steps;
                }
            };
            // One short step may be due to damping; two in a row are not.
            slow = if lowered < options.decrease { slow + 1 } else { 0 };
            if slow == SLOW_STEPS {
                break;
            }
        }
        Ok(map)
    }

    /// The samples between points that hold the surface in a space, if any.
    fn between(&self, space: &HierarchicalSpace<D>, options: &JointOptions) -> Result<Option<Between>, Error> {
        match &self.rim {
            Some(rim) if options.between > 0.0 => {
                Between::new(&self.centres, rim, space, self.fit.points(), options.between)
            }
            _ => Ok(None),
        }
    }

    /// The samples for the penalty on folds of surfaces in space.
    fn regularity(&self, space: &HierarchicalSpace<D>, options: &JointOptions) -> Option<Regularity> {
        let penalized = options.regularity > 0.0 && D == 2 && self.fit.points().dim() == 3;
        penalized.then(|| Regularity::new(space.degree()))
    }

    /// Half the weighted energy of the springs, parameters and weights by the places of the sorted points.
    fn springs(&self, parameter: impl Fn(usize) -> [f64; D], weights: &[f64]) -> f64 {
        let Some(anchor) = &self.anchor else { return 0.0 };
        let order = self.fit.points().order();
        let energy = |at: usize| weights[at] * anchor.squared(order[at] as usize, parameter(at));
        0.5 * (0..order.len()).map(energy).sum::<f64>()
    }

    /// The parameters that belong to a step of the coefficients: eliminated ones, then a few steps towards the foot point.
    fn follow(
        &self,
        trial: &SplineMap<D>,
        before: &[Frame<D>],
        damping: f64,
        polish: usize,
        moves: &mut Moves,
    ) -> Result<FootPoints<D>, Error> {
        let points = self.fit.points();
        let constraints = self.constraints();
        let space = trial.space();
        let stepped = frames(trial, points)?;
        let mut parameters = Vec::with_capacity(points.len());
        let mut cells = Vec::with_capacity(points.len());
        let offsets = points.offsets();
        for cell in 0..space.n_cells() {
            let size = space.cell(cell).size();
            for at in offsets[cell]..offsets[cell + 1] {
                let free = constraints.free(points.order()[at] as usize);
                let step = before[at].parameter_step(&stepped[at].residual, damping, free);
                let from = points.parameter(at);
                let longest = (0..D).map(|d| (step[d] / size[d]).abs()).fold(1.0, f64::max);
                let u = space.to_domain(std::array::from_fn(|d| from[d] + step[d] / longest));
                parameters.push(u);
                cells.push(space.locate_cell(u)? as u32);
            }
        }
        self.hold(trial, &mut parameters, &mut cells, moves)?;
        let options = FootPointOptions { start: Start::Present, max_steps: polish, ..self.options.foot_points };
        let starts = (&parameters[..], &cells[..]);
        let mut found = foot_points_from(trial, points, Some(starts), self.anchor.as_ref(), &constraints, &options)?;
        if polish > 0 && self.hold(trial, &mut found.parameters, &mut found.cells, moves)? {
            let still = FootPointOptions { max_steps: 0, ..options };
            let starts = (&found.parameters[..], &found.cells[..]);
            found.distances =
                foot_points_from(trial, points, Some(starts), self.anchor.as_ref(), &constraints, &still)?.distances;
        }
        Ok(found)
    }
}

/// `½ Σ ω d²`, in the order of the points.
fn squares(distances: &[f64], weights: &[f64]) -> f64 {
    0.5 * distances.iter().zip(weights).map(|(d, w)| w * d * d).sum::<f64>()
}
