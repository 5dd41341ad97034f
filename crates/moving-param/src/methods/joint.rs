//! Coefficients and parameters together, by Levenberg–Marquardt steps.
//!
//! With residuals `r_i`, tangents `T_i` and damping μ of the parameters a step minimizes
//! `½ Σ ω_i |r_i + B_i δc + T_i δu_i|² + ½ μ Σ ω_i δu_iᵀ diag(T_iᵀT_i) δu_i + ½ λ J(c + δc)`. Each `δu_i` occurs in one residual and
//! is eliminated exactly, as in bundle adjustment: what remains for δc are least squares with the matrices
//! `W_i = I − T_i (T_iᵀT_i + μ diag)⁻¹ T_iᵀ`, which lie between tangent distances (μ = 0) and point distances (μ = ∞). The other terms
//! of the objective ([`crate::terms`]) add to these equations.

use std::time::{Duration, Instant};

use fit_ls::{BlockEquations, LeastSquares, SortedPoints};
use pulp::{Simd, WithSimd};
use rayon::prelude::*;
use thb_core::{BezierMap, CellSpace, HierarchicalSpace, ParameterBox, SplineMap, transfer};

use crate::damping::{Damping, DampingRule};
use crate::driver::{Limits, StepProblem, minimize};
use crate::equations::{Equations, PointBlock};
use crate::moving::{Moves, MovingFit};
use crate::points::constraint::Constraints;
use crate::points::foot_point::{FootPointOptions, FootPoints, Start, foot_points_from};
use crate::points::frame::{PatchOfPlace, frames_at};
use crate::points::vector::{difference, point};
use crate::safeguards::flipping_triangles::{FlippingTriangles, Triangles};
use crate::safeguards::stray_points::Stray;
use crate::safeguards::turned_cells::turns;
use crate::safeguards::{Admission, CoefficientStep, Parameters, Safeguard, admit_all};
use crate::state::{Snapshot, State};
use crate::step_system::StepSystem;
use crate::term::{Objective, Term};
use crate::terms::data::Data;
use crate::terms::lost_area::LostArea;
use crate::terms::rim_edges::rim;
use crate::terms::springs::Springs;
use crate::terms::triangle_centres::TriangleCentres;
use crate::{Error, JointOptions};

/// The damping μ of the parameters. Below 1e-10 tangent motion is all but free; beyond 1e4 a step is one of point distances: if that
/// does not lower the objective nothing will. Lowered at once after a refusal, half of all trials are refused.
const DAMPING: DampingRule = DampingRule { first: 1e-2, least: 1e-10, most: 1e4, accept: 0.1, refuse: 10.0, pause: 2 };

/// Steps in a row that lower the objective too little, after which the descent ends: one short step may be due to damping.
const SLOW_STEPS: usize = 2;

/// Times that a step is computed anew because it activates further penalties.
const EXTENSIONS: usize = 3;

/// Steps between two changes of the emphasis.
const STEPS_PER_ROUND: usize = 2;

/// Share of points outside the tolerance up to which emphasis pays: beyond it the space is too coarse.
const EMPHASIS_MAX_OUTSIDE_SHARE: f64 = 0.02;

/// Largest factor of a point's weight in one round of emphasis, and over all rounds.
const EMPHASIS: (f64, f64) = (4.0, 1e4);

/// Points of one parallel task.
const CHUNK: usize = 512;

/// What the descents in one space share.
struct Run {
    system: StepSystem,
    /// Weights by index: places change with the parameters.
    weights: Vec<f64>,
    damping: Damping,
}

impl<const D: usize> MovingFit<D> {
    pub(crate) fn joint(
        &mut self,
        map: SplineMap<D>,
        previous: Option<&SplineMap<D>>,
        options: &JointOptions,
        moves: &mut Moves,
    ) -> Result<SplineMap<D>, Error> {
        let space = map.space().clone();
        let map = match previous {
            // A fit at parameters that have moved may fold where what was reached before does not.
            Some(previous) if self.may_fold(options) => {
                let reached = SplineMap::new(space.clone(), transfer(previous, &space)?)?;
                if turns(&map, &reached) { reached } else { map }
            }
            _ => map,
        };
        self.prepare(&map, options)?;
        let weights = self.weights.clone().unwrap_or_else(|| vec![1.0; self.fit.points().len()]);
        let mut run = Run { system: self.take_system(&space)?, weights, damping: Damping::new(DAMPING) };
        let mut map = self.descend(map, options.max_steps, options, &mut run, moves)?;
        for _ in 0..options.emphasis {
            let outside = self.measure(&map)?.outside;
            let counted = run.weights.iter().filter(|w| **w > 0.0).count();
            if outside == 0 || outside as f64 > EMPHASIS_MAX_OUTSIDE_SHARE * counted as f64 {
                break;
            }
            // Points outside the tolerance may be at a foot point that is no longer the nearest.
            self.seek(&map, Stray::FartherThan(self.options.tolerance), moves)?;
            self.emphasize(&map, &mut run.weights)?;
            let before = (map.clone(), self.parameters());
            map = self.descend(map, STEPS_PER_ROUND, options, &mut run, moves)?;
            if self.measure(&map)?.outside > outside {
                self.restore(&before.1, &space)?;
                map = before.0;
                break;
            }
        }
        self.system = Some((space, run.system));
        Ok(map)
    }

    /// Whether lost area is penalized: that of surfaces in space.
    fn may_fold(&self, options: &JointOptions) -> bool {
        options.regularity > 0.0 && D == 2 && self.fit.points().dim() == 3
    }

    /// Makes what lasts from space to space.
    fn prepare(&mut self, map: &SplineMap<D>, options: &JointOptions) -> Result<(), Error> {
        if self.springs.is_none() && (options.stiffness > 0.0 || options.cohesion > 0.0) {
            let start = self.start.outer_iter().map(|row| std::array::from_fn(|d| row[d])).collect();
            let points = self.fit.points();
            self.springs = Some(Springs::new(points, &frames_at(map, points)?, start, &self.centres, options));
        }
        if self.rim.is_none() && options.between > 0.0 {
            self.rim = Some(rim(&self.centres));
        }
        Ok(())
    }

    /// Gives the points outside the tolerance more weight, by index.
    fn emphasize(&mut self, map: &SplineMap<D>, weights: &mut [f64]) -> Result<(), Error> {
        let tolerance = self.options.tolerance;
        let distances = self.fit.distances(map)?.to_vec();
        let given = self.weights.as_deref();
        for (&distance, &index) in distances.iter().zip(self.fit.points().order()) {
            let index = index as usize;
            let factor = (distance / tolerance).powi(2).clamp(1.0, EMPHASIS.0);
            weights[index] = (weights[index] * factor).min(EMPHASIS.1 * given.map_or(1.0, |w| w[index]));
        }
        Ok(())
    }

    /// At most so many steps.
    fn descend(
        &mut self,
        map: SplineMap<D>,
        steps: usize,
        options: &JointOptions,
        run: &mut Run,
        moves: &mut Moves,
    ) -> Result<SplineMap<D>, Error> {
        let limits = Limits { steps, decrease: options.decrease, slow_steps: SLOW_STEPS };
        let mut watch = self.watch.take();
        let mut damping = run.damping;
        let reached = self.with_joint(map, options, run, moves, |mut problem| {
            let ended = minimize(&mut problem, &mut damping, &limits, watch.as_deref_mut())?;
            tracing::debug!(?ended, damping = damping.value(), "descent");
            Ok(problem.map)
        });
        run.damping = damping;
        self.watch = watch;
        reached
    }

    /// Mean time of a trial of a step from a map in the space last fitted in, without that of factorization and of the step of the
    /// coefficients: equations, parameters that follow, energies. For benchmarks.
    ///
    /// # Errors
    /// Those of a fit; [`Error::Minimization`] if the equations are singular.
    #[doc(hidden)]
    pub fn time_trials(&mut self, map: &SplineMap<D>, options: &JointOptions, trials: u32) -> Result<Duration, Error> {
        self.prepare(map, options)?;
        let (space, weights) = (map.space().clone(), vec![1.0; self.fit.points().len()]);
        let mut run = Run { system: self.take_system(&space)?, weights, damping: Damping::new(DAMPING) };
        let mut moves = Moves::default();
        self.with_joint(map.clone(), options, &mut run, &mut moves, |mut problem| {
            problem.freeze()?;
            let reduced = problem.reduced(DAMPING.first)?;
            let singular = || Error::Minimization { reason: "the step is singular".into() };
            let stepped = problem.coefficient_step(&reduced)?.ok_or_else(singular)?;
            let clock = Instant::now();
            for _ in 0..trials {
                std::hint::black_box(problem.reduced(DAMPING.first)?);
                std::hint::black_box(problem.judged(stepped.clone(), DAMPING.first)?);
            }
            Ok(clock.elapsed() / trials.max(1))
        })
    }

    /// Does something with the minimization from a map.
    fn with_joint<T>(
        &mut self,
        map: SplineMap<D>,
        options: &JointOptions,
        run: &mut Run,
        moves: &mut Moves,
        act: impl FnOnce(Joint<'_, D>) -> Result<T, Error>,
    ) -> Result<T, Error> {
        let space = map.space().clone();
        let constraints = self.constraints();
        let may_fold = self.may_fold(options);
        let mut smoothing = self.smoothing(&space)?;
        let mut lost_area = may_fold.then(|| LostArea::new(space.degree(), options, self.options.tolerance));
        let mut centres = match &self.rim {
            Some(rim) if options.between > 0.0 => {
                TriangleCentres::new(&self.centres, rim, space.as_ref(), self.fit.points(), options.between)?
            }
            _ => None,
        };
        let Self { fit, springs, terms: further, triangles, .. } = self;
        let mut data = Data;
        // The order of the summands.
        let mut terms: Vec<&mut dyn Term<D>> = vec![&mut data];
        terms.extend(springs.as_mut().map(|term| term as &mut dyn Term<D>));
        terms.push(&mut smoothing);
        terms.extend(centres.as_mut().map(|term| term as &mut dyn Term<D>));
        terms.extend(lost_area.as_mut().map(|term| term as &mut dyn Term<D>));
        terms.extend(further.iter_mut().map(|term| &mut **term as &mut dyn Term<D>));
        act(Joint {
            equations: Equations::new(run.system.pattern().clone()),
            objective: Objective::new(terms),
            system: &mut run.system,
            triangles: triangles.as_ref(),
            flipping: None,
            constraints: &constraints,
            weights: &run.weights,
            tolerance: self.options.tolerance,
            polish: FootPointOptions { start: Start::Present, max_steps: options.polish, ..self.options.foot_points },
            start: Snapshot::default(),
            active: Vec::new(),
            fit,
            map,
            moves,
        })
    }
}

/// The minimization by coefficients and parameters: the state is a map and the parameters of the sorted points.
struct Joint<'a, const D: usize> {
    fit: &'a mut LeastSquares<D>,
    map: SplineMap<D>,
    objective: Objective<'a, D, HierarchicalSpace<D>>,
    system: &'a mut StepSystem,
    triangles: Option<&'a Triangles>,
    /// What keeps them from flipping in the present step.
    flipping: Option<FlippingTriangles<'a>>,
    constraints: &'a Constraints<D>,
    /// By index.
    weights: &'a [f64],
    tolerance: f64,
    /// Newton steps towards the foot point, after each step.
    polish: FootPointOptions,
    moves: &'a mut Moves,
    /// The start of the present step.
    start: Snapshot<D>,
    equations: Equations<D>,
    /// The penalties of each term that are active there.
    active: Vec<Vec<u32>>,
}

/// A map, and the parameters that follow it.
type JointTrial<const D: usize> = (SplineMap<D>, FootPoints<D>);

impl<const D: usize> StepProblem for Joint<'_, D> {
    type Trial = JointTrial<D>;

    fn freeze(&mut self) -> Result<Option<f64>, Error> {
        self.start.take(&self.map, self.fit.points(), |index| self.weights[index])?;
        let is_met = |(distance, weight): (&f64, &f64)| *distance <= self.tolerance || *weight == 0.0;
        if self.start.distances.iter().zip(&self.start.weights).all(is_met) {
            return Ok(None);
        }
        let start = self.start.start(&self.map, self.fit.points());
        self.flipping = self.triangles.map(|triangles| FlippingTriangles::new(triangles, &start.state));
        self.objective.freeze(&start, &mut self.equations)?;
        self.active = self.equations.active();
        self.objective.energy(&start.state).map(Some)
    }

    fn trial(&mut self, damping: f64) -> Result<Option<(Self::Trial, f64)>, Error> {
        let reduced = self.reduced(damping)?;
        self.coefficient_step(&reduced)?.map_or(Ok(None), |map| self.judged(map, damping))
    }

    fn accept(&mut self, (map, found): Self::Trial) -> Result<(), Error> {
        self.moves.count(&found.report);
        self.fit.relocate(&found.parameters, &found.cells)?;
        self.map = map;
        Ok(())
    }
}

impl<const D: usize> Joint<'_, D> {
    /// The equations of the coefficients, once the parameters are eliminated.
    fn reduced(&self, damping: f64) -> Result<BlockEquations, Error> {
        self.equations.reduced(self.map.space().as_ref(), self.fit.points(), self.constraints, damping, &[])
    }

    /// The map after the step that solves the equations, with all penalties active that it activates, as the safeguards leave it. `None`
    /// if the equations are singular, or a safeguard refuses the step.
    fn coefficient_step(&mut self, reduced: &BlockEquations) -> Result<Option<SplineMap<D>>, Error> {
        let Self { fit, map, objective, system, start, equations, active, .. } = self;
        let (space, points) = (map.space(), fit.points());
        let start = start.start(map, points);
        let none = Vec::new();
        let mut active = active.clone();
        let mut extensions = 0;
        let mut step = loop {
            objective.linearize(&start, &active, equations)?;
            let solved = system.step(reduced, 0.0, &none, |matrix, right| equations.add_cells(matrix, right))?;
            let Some(step) = solved else { return Ok(None) };
            let stepped = SplineMap::new(space.clone(), &map.coefficients() + &step)?;
            if !objective.extend(&stepped, &mut active) || extensions == EXTENSIONS {
                break CoefficientStep { from: map, step, map: stepped };
            }
            extensions += 1;
        };
        for safeguard in objective.safeguards() {
            if safeguard.admit_coefficients(&mut step)? == Admission::Refused {
                tracing::trace!(safeguard = safeguard.name(), "step refused");
                return Ok(None);
            }
        }
        Ok(Some(step.map))
    }

    /// Where a step of the coefficients leads once the parameters follow, and the objective there.
    fn judged(&mut self, map: SplineMap<D>, damping: f64) -> Result<Option<(JointTrial<D>, f64)>, Error> {
        let Some(found) = self.follow(&map, damping)? else { return Ok(None) };
        let start = self.start.start(&self.map, self.fit.points()).state;
        let trial = State { map: &map, parameters: &found.parameters, distances: &found.distances, ..start };
        let energy = self.objective.energy(&trial)?;
        Ok(Some(((map, found), energy)))
    }

    /// The parameters that belong to a step of the coefficients: eliminated ones, then a few steps towards the foot point. `None` if a
    /// safeguard refuses them.
    fn follow(&mut self, trial: &SplineMap<D>, damping: f64) -> Result<Option<FootPoints<D>>, Error> {
        let points = self.fit.points();
        let from = self.start.start(&self.map, points).state;
        let safeguards: Vec<&dyn Safeguard<D>> = self.flipping.iter().map(|f| f as &dyn Safeguard<D>).collect();
        let mut moved = self.eliminated(trial, damping)?;
        match admit_all(&safeguards, &from, trial, &mut moved)? {
            Admission::Unchanged => (),
            Admission::Changed(held) => self.moves.held += held,
            Admission::Refused => return Ok(None),
        }
        let blocks = &self.equations.points;
        let mut found = foot_points_from(trial, points, Some(&moved), blocks, self.constraints, &self.polish)?;
        if self.polish.max_steps == 0 {
            return Ok(Some(found));
        }
        let mut polished = Parameters { values: found.parameters, cells: found.cells };
        let admission = admit_all(&safeguards, &from, trial, &mut polished)?;
        if let Admission::Changed(held) = admission {
            self.moves.held += held;
            let still = FootPointOptions { max_steps: 0, ..self.polish };
            let there = foot_points_from(trial, points, Some(&polished), blocks, self.constraints, &still)?;
            found.distances = there.distances;
        }
        (found.parameters, found.cells) = (polished.values, polished.cells);
        Ok((admission != Admission::Refused).then_some(found))
    }

    /// The parameters that the equations have eliminated, moved by a cell at most.
    fn eliminated(&self, trial: &SplineMap<D>, damping: f64) -> Result<Parameters<D>, Error> {
        let (points, space) = (self.fit.points(), trial.space().as_ref());
        let mut moved = Parameters { values: vec![[0.0; D]; points.len()], cells: vec![0; points.len()] };
        let places = moved.values.par_chunks_mut(CHUNK).zip(moved.cells.par_chunks_mut(CHUNK)).enumerate();
        // Of several errors the first, whichever thread is faster.
        let failed = places.find_map_first(|(chunk, (values, cells))| {
            let (blocks, constraints, first) = (&self.equations.points[..], self.constraints, chunk * CHUNK);
            let map = trial.bezier();
            let chunk = Chunk { map, space, points, blocks, constraints, damping, first, values, cells };
            pulp::Arch::new().dispatch(chunk).err()
        });
        failed.map_or(Ok(moved), Err)
    }
}

/// Points whose parameters follow a step of the coefficients.
struct Chunk<'a, const D: usize> {
    map: &'a BezierMap<D>,
    space: &'a HierarchicalSpace<D>,
    points: &'a SortedPoints<D>,
    blocks: &'a [PointBlock<D>],
    constraints: &'a Constraints<D>,
    damping: f64,
    first: usize,
    values: &'a mut [[f64; D]],
    cells: &'a mut [u32],
}

impl<const D: usize> WithSimd for Chunk<'_, D> {
    type Output = Result<(), Error>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> Self::Output {
        let Self { map, space, points, blocks, constraints, damping, first, values, cells } = self;
        let mut around = PatchOfPlace::new(map, points, first);
        for (i, (value, number)) in values.iter_mut().zip(cells).enumerate() {
            let at = first + i;
            let from = points.parameter(at);
            let patch = around.at(at);
            let residual = difference(&patch.value(from), &point(points, at));
            let free = constraints.free(points.order()[at] as usize);
            let step = blocks[at].parameter_step(&residual, damping, free);
            let cell = space.cell(patch.cell());
            let size = cell.size();
            let longest = (0..D).map(|d| (step[d] / size[d]).abs()).fold(1.0, f64::max);
            let u = space.to_domain(std::array::from_fn(|d| from[d] + step[d] / longest));
            let stays = (0..D).all(|d| cell.lower[d] <= u[d] && u[d] < cell.upper[d]);
            *value = u;
            *number = if stays { patch.cell() as u32 } else { space.locate_cell(u)? as u32 };
        }
        Ok(())
    }
}
