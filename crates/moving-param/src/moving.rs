//! The fitting method whose parameters move, for the adaptive loop.

use std::sync::Arc;
use std::time::Instant;

use adaptive::{Deviation, Estimate, Solution, Solve};
use fit_ls::{LeastSquares, SortedPoints, Weighted};
use ndarray::{Array2, ArrayView1, ArrayView2};
use thb_core::{HierarchicalSpace, ParameterBox, SplineMap};

use crate::driver::StepWatch;
use crate::methods::square::SquareMap;
use crate::points::constraint::Constraints;
use crate::points::foot_point::{FootPoints, foot_points};
use crate::points::place::placed;
use crate::safeguards::flipping_triangles::{FlippingTriangles, Triangles};
use crate::safeguards::stray_points::{Stray, StrayPoints};
use crate::safeguards::{Admission, Parameters, Safeguard, admit_all};
use crate::state::State;
use crate::step_system::StepSystem;
use crate::term::Term;
use crate::terms::rim_edges::RimEdge;
use crate::terms::smoothing::Smoothing;
use crate::terms::springs::Springs;
use crate::{Boundary, Error, FootPointReport, Method, Options};

/// What happened to the parameters in one space.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moves {
    /// Corrections, or steps of the joint method, that were taken.
    pub corrections: usize,
    /// Mean share of points whose distance fell at a correction.
    pub accepted: f64,
    /// Mean number of steps towards a foot point.
    pub mean_steps: f64,
    /// Mean length of a point's move in this space, in parameters.
    pub mean_move: f64,
    /// Largest length of a move.
    pub max_move: f64,
    /// Triangles of points with positive weight whose orientation differs from the one at the start; 0 without triangles.
    pub folds: usize,
    /// Moves that were shortened because a triangle would have flipped; with quasi-interpolation points whose moves were undone
    /// because they got farther away.
    pub held: usize,
    /// Whether the corrections were undone because they did harm.
    pub postponed: bool,
    /// Root mean squared distance before and after the corrections.
    pub rmse: [f64; 2],
    /// Points farther than the tolerance before and after the corrections.
    pub outside: [usize; 2],
}

/// Least squares on points whose parameters move, in one space after the other.
///
/// In each space the coefficients are fitted at the present parameters, then parameters are corrected; errors are those
/// after correction, so cells are refined only where moving the parameters was not enough.
#[derive(Debug)]
pub struct MovingFit<const D: usize> {
    pub(crate) fit: LeastSquares<D>,
    pub(crate) options: Options,
    pub(crate) constraints: Option<Constraints<D>>,
    pub(crate) triangles: Option<Triangles>,
    /// Triangles whose centres hold the surface, by indices of points.
    pub(crate) centres: Vec<[u32; 3]>,
    /// Their rim, once it is needed.
    pub(crate) rim: Option<Vec<RimEdge>>,
    pub(crate) springs: Option<Springs<D>>,
    /// Terms of the caller.
    pub(crate) terms: Vec<Box<dyn Term<D>>>,
    pub(crate) watch: Option<Box<dyn StepWatch>>,
    /// The map that moves all parameters, where one does.
    pub(crate) square: Option<SquareMap<D>>,
    pub(crate) system: Option<(Arc<HierarchicalSpace<D>>, StepSystem)>,
    /// Weights of the caller, in the order of the points.
    pub(crate) weights: Option<Vec<f64>>,
    pub(crate) start: Array2<f64>,
    reports: Vec<Moves>,
}

impl<const D: usize> MovingFit<D> {
    /// A problem with points `(m, N)`, N ≤ 3, starting from parameters `(m, D)`, with weights `(m)` if given.
    ///
    /// # Errors
    /// Those of [`LeastSquares::new`]; [`Error::Dimension`], [`Error::NoNormal`], [`Error::Option`].
    pub fn new(
        parameters: ArrayView2<'_, f64>,
        points: ArrayView2<'_, f64>,
        weights: Option<ArrayView1<'_, f64>>,
        fit: fit_ls::Options<D>,
        options: Options,
    ) -> Result<Self, Error> {
        let fit = LeastSquares::new(parameters, points, weights, fit)?;
        if points.ncols() > crate::points::vector::MAX_DIM {
            return Err(Error::Dimension { given: points.ncols(), limit: crate::points::vector::MAX_DIM });
        }
        options.check(D, points.ncols(), points.nrows())?;
        Ok(Self {
            fit,
            options,
            constraints: None,
            triangles: None,
            centres: Vec::new(),
            rim: None,
            springs: None,
            terms: Vec::new(),
            watch: None,
            square: None,
            system: None,
            weights: weights.map(|w| w.to_vec()),
            start: parameters.to_owned(),
            reports: Vec::new(),
        })
    }

    /// Adds a term to what the joint method minimizes, after its own ones. J-PDM and the methods in turn do not know it.
    pub fn with_term(mut self, term: Box<dyn Term<D>>) -> Self {
        self.terms.push(term);
        self
    }

    /// Tells a watch of each step of the joint method and of the square map; it may end the steps in a space.
    pub fn with_watch(mut self, watch: Box<dyn StepWatch>) -> Self {
        self.watch = Some(watch);
        self
    }

    /// What happened in each space, in the order of the calls.
    pub fn reports(&self) -> &[Moves] {
        &self.reports
    }

    /// The points, in the order of the cells of the last space.
    pub fn points(&self) -> &SortedPoints<D> {
        self.fit.points()
    }

    /// The smoothing weight in use; `None` as long as an automatic one is not chosen.
    pub fn lambda(&self) -> Option<f64> {
        self.fit.lambda()
    }

    /// The present parameters, `(m, D)`, in the order in which the points were given.
    pub fn parameters(&self) -> Array2<f64> {
        self.fit.points().parameters_as_given()
    }

    fn fit_in(&mut self, space: &Arc<HierarchicalSpace<D>>) -> Result<Solution<D>, Error> {
        if self.constraints.is_none() {
            let (domain, periodic) = (space.domain(), space.periodic());
            self.constraints = Some(Constraints::in_space(self.start.view(), space.as_ref(), self.options.boundary));
            if let Some(triangles) = &mut self.triangles {
                let period = |d: usize| if periodic[d] { domain.1[d] - domain.0[d] } else { f64::INFINITY };
                triangles.close([period(0), period(D - 1)], |i| [self.start[[i, 0]], self.start[[i, D - 1]]]);
            }
        }
        Ok(Solve::solve(&mut self.fit, space, None)?)
    }

    pub(crate) fn constraints(&self) -> Constraints<D> {
        self.constraints
            .clone()
            .unwrap_or_else(|| Constraints::new(self.start.view(), ([0.0; D], [1.0; D]), Boundary::Free))
    }

    /// The smoothing of now.
    pub(crate) fn smoothing(&mut self, space: &Arc<HierarchicalSpace<D>>) -> Result<Smoothing, Error> {
        Ok(Smoothing::new(self.fit.energy(space)?, self.fit.lambda().unwrap_or(0.0)))
    }

    /// The solver of coupled steps in a space.
    pub(crate) fn take_system(&mut self, space: &Arc<HierarchicalSpace<D>>) -> Result<StepSystem, Error> {
        match self.system.take() {
            Some((known, system)) if Arc::ptr_eq(&known, space) => Ok(system),
            _ => StepSystem::new(self.fit.energy(space)?.pattern(), self.fit.points().dim()),
        }
    }

    /// Moves points to foot points, as far as no triangle flips.
    pub(crate) fn correct(&mut self, map: &SplineMap<D>, moves: &mut Moves) -> Result<(), Error> {
        let found = foot_points(map, self.fit.points(), &self.constraints(), &self.options.foot_points)?;
        moves.count(&found.report);
        let FootPoints { parameters, cells, .. } = found;
        self.move_to(map, Parameters { values: parameters, cells }, None, moves)
    }

    /// Moves stray points to their foot points, sought anew, as far as no triangle flips.
    pub(crate) fn seek(&mut self, map: &SplineMap<D>, stray: Stray, moves: &mut Moves) -> Result<(), Error> {
        let constraints = self.constraints();
        let strays = StrayPoints { stray, constraints: &constraints, foot_points: self.options.foot_points };
        let points = self.fit.points();
        let values = (0..points.len()).map(|at| points.parameter(at)).collect();
        let mut cells = Vec::with_capacity(points.len());
        for (cell, ends) in points.offsets().windows(2).enumerate() {
            cells.resize(ends[1], cell as u32);
        }
        self.move_to(map, Parameters { values, cells }, Some(strays), moves)
    }

    /// Moves all points, as far as the safeguards admit.
    fn move_to(
        &mut self,
        map: &SplineMap<D>,
        mut moved: Parameters<D>,
        strays: Option<StrayPoints<'_, D>>,
        moves: &mut Moves,
    ) -> Result<(), Error> {
        let distances = if strays.is_some() { self.fit.distances(map)?.to_vec() } else { Vec::new() };
        let points = self.fit.points();
        let parameters: Vec<[f64; D]> = (0..points.len()).map(|at| points.parameter(at)).collect();
        let (places, weights) = (points.places(), points.weights().unwrap_or_default());
        let from = State { map, points, places: &places, parameters: &parameters, distances: &distances, weights };
        let flipping = self.triangles.as_ref().map(|triangles| FlippingTriangles::new(triangles, &from));
        if let Some(strays) = strays {
            strays.admit_parameters(&from, map, &mut moved)?;
        }
        let safeguards: Vec<&dyn Safeguard<D>> = flipping.iter().map(|f| f as &dyn Safeguard<D>).collect();
        if let Admission::Changed(held) = admit_all(&safeguards, &from, map, &mut moved)? {
            moves.held += held;
        }
        Ok(self.fit.relocate(&moved.values, &moved.cells)?)
    }

    /// Restores parameters given in the order of the points.
    pub(crate) fn restore(&mut self, parameters: &Array2<f64>, space: &HierarchicalSpace<D>) -> Result<(), Error> {
        let (placed, cells) = placed(self.fit.points(), parameters, space)?;
        Ok(self.fit.relocate(&placed, &cells)?)
    }

    /// Root mean squared and largest distance, and the points outside the tolerance, among those of positive weight.
    pub(crate) fn measure(&mut self, map: &SplineMap<D>) -> Result<Measure, Error> {
        let mut distances = self.fit.distances(map)?.to_vec();
        if let Some(weights) = self.fit.points().weights() {
            let mut weights = weights.iter();
            distances.retain(|_| weights.next().is_some_and(|w| *w > 0.0));
        }
        Ok(Measure::of(&distances, self.options.tolerance))
    }

    /// The guard against corrections that come too early: of the corrected map, the one before correction, and the one at
    /// the very first parameters, the one with the fewest points outside the tolerance, at equality the one that was
    /// corrected most. So what moving has gained so far is compared with not moving at all, in every space.
    fn guarded(
        &mut self,
        corrected: SplineMap<D>,
        (entering, entering_measure, entry): (SplineMap<D>, Measure, &Array2<f64>),
        moves: &mut Moves,
    ) -> Result<SplineMap<D>, Error> {
        let space = corrected.space().clone();
        let after = self.measure(&corrected)?;
        let reached = self.parameters();
        let mut best = (corrected, after.outside);
        let mut parameters = &reached;
        if entering_measure.outside < best.1 {
            best = (entering, entering_measure.outside);
            parameters = entry;
        }
        let start = self.start.clone();
        if *entry != start {
            self.restore(&start, &space)?;
            let unmoved = self.fit.fit(&space)?;
            let outside = self.measure(&unmoved)?.outside;
            if outside < best.1 {
                best = (unmoved, outside);
                parameters = &start;
            }
        }
        if *parameters != reached {
            moves.postponed = true;
            tracing::info!(?moves, "corrections did harm and are postponed");
        }
        self.restore(parameters, &space)?;
        Ok(best.0)
    }

    fn move_parameters(
        &mut self,
        map: SplineMap<D>,
        previous: Option<&SplineMap<D>>,
        moves: &mut Moves,
    ) -> Result<SplineMap<D>, Error> {
        match self.options.method.clone() {
            Method::Alternating { distance, corrections } => self.alternate(map, &distance, corrections, moves),
            Method::Joint(joint) => self.joint(map, previous, &joint, moves),
            Method::JointLbfgs(schedule) => self.joint_lbfgs(map, previous, schedule, moves),
            Method::SquareMap(square) => self.move_by_map(map, &square, moves),
        }
    }
}

impl MovingFit<2> {
    /// A triangulation of the points, by index: no move may flip the orientation of one of its triangles.
    ///
    /// # Errors
    /// [`Error::Triangle`].
    pub fn with_triangles(mut self, triangles: &[[u32; 3]]) -> Result<Self, Error> {
        let parameters: Vec<[f64; 2]> = self.start.outer_iter().map(|row| [row[0], row[1]]).collect();
        self.triangles = Some(Triangles::new(triangles, &parameters)?);
        Ok(self.with_centres(triangles))
    }

    /// Triangles over the points, by index, which may fold: in the joint method their centres hold the surface between the points
    /// ([`JointOptions::between`](crate::JointOptions::between)), and their sides join parameters that should move alike
    /// ([`JointOptions::cohesion`](crate::JointOptions::cohesion)). Those that name points that are not there are left out.
    pub fn with_centres(mut self, triangles: &[[u32; 3]]) -> Self {
        let points = self.start.nrows();
        let known = |t: &&[u32; 3]| t.iter().all(|&i| (i as usize) < points);
        self.centres = triangles.iter().filter(known).copied().collect();
        self.rim = None;
        self
    }
}

/// Distances in short.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Measure {
    pub(crate) rmse: f64,
    pub(crate) max: f64,
    pub(crate) outside: usize,
}

impl Measure {
    pub(crate) fn of(distances: &[f64], tolerance: f64) -> Self {
        let deviation = Deviation::new(distances, tolerance);
        let outside = distances.iter().filter(|d| **d > tolerance).count();
        Self { rmse: deviation.rmse(), max: deviation.max, outside }
    }
}

impl Moves {
    /// The report of a space, before anything moves.
    pub(crate) fn from(before: Measure) -> Self {
        Self { rmse: [before.rmse; 2], outside: [before.outside; 2], ..Self::default() }
    }

    /// Adds a search for foot points.
    pub(crate) fn count(&mut self, report: &FootPointReport) {
        let before = self.corrections as f64;
        self.corrections += 1;
        let mean = |sum: f64, next: f64| (sum * before + next) / (before + 1.0);
        self.accepted = mean(self.accepted, report.accepted);
        self.mean_steps = mean(self.mean_steps, report.mean_steps);
    }

    /// Sets what was reached.
    pub(crate) fn reach(&mut self, after: Measure) {
        (self.rmse[1], self.outside[1]) = (after.rmse, after.outside);
    }

    /// Adds the ways between the parameters `(m, D)` at the start and at the end.
    pub(crate) fn travel<const D: usize>(
        &mut self,
        space: &HierarchicalSpace<D>,
        entry: &Array2<f64>,
        moved: &Array2<f64>,
    ) {
        for (a, b) in entry.outer_iter().zip(moved.outer_iter()) {
            let way = space.way(std::array::from_fn(|d| a[d]), std::array::from_fn(|d| b[d]));
            let length = way.iter().map(|w| w * w).sum::<f64>().sqrt();
            self.mean_move += length / entry.nrows() as f64;
            self.max_move = self.max_move.max(length);
        }
    }
}

/// Points of weight 0 hold neither the surface nor the parameters of others, in no way; their own parameters follow the surface, so that
/// their distances say how far they are.
impl<const D: usize> Weighted<D> for MovingFit<D> {
    const GOES_ON: bool = true;

    fn least_squares(&self) -> &LeastSquares<D> {
        &self.fit
    }

    fn least_squares_mut(&mut self) -> &mut LeastSquares<D> {
        &mut self.fit
    }

    fn set_point_weights(&mut self, weights: &[f64]) -> Result<(), Error> {
        self.fit.set_point_weights(weights)?;
        let counted = |weights: &[f64]| weights.iter().map(|w| *w > 0.0).collect::<Vec<bool>>();
        let known = self.weights.as_deref().map_or_else(|| vec![true; weights.len()], counted);
        if known != counted(weights)
            && let Some(springs) = &mut self.springs
        {
            springs.join(&self.centres, self.fit.points());
        }
        self.weights = Some(weights.to_vec());
        Ok(())
    }
}

impl<const D: usize> Solve<D> for MovingFit<D> {
    type Error = Error;

    fn solve(
        &mut self,
        space: &Arc<HierarchicalSpace<D>>,
        previous: Option<&SplineMap<D>>,
    ) -> Result<Solution<D>, Error> {
        let Solution { map: fixed, assemble_seconds, solve_seconds } = self.fit_in(space)?;
        let clock = Instant::now();
        let entry = self.parameters();
        let before = self.measure(&fixed)?;
        let mut moves = Moves::from(before);
        let mut map = fixed.clone();
        if before.max > self.options.tolerance {
            map = self.move_parameters(fixed.clone(), previous, &mut moves)?;
            if self.options.guard {
                map = self.guarded(map, (fixed, before, &entry), &mut moves)?;
            }
            if self.fit.points().weights().is_some_and(|weights| weights.contains(&0.0)) {
                self.seek(&map, Stray::WithoutWeight, &mut moves)?;
            }
            moves.reach(self.measure(&map)?);
        }
        let moved = self.parameters();
        moves.travel(space, &entry, &moved);
        if let Some(triangles) = &self.triangles {
            let weights = self.weights.as_deref();
            let counts = |i: usize| weights.is_none_or(|weights| weights[i] > 0.0);
            moves.folds = triangles.count_flipped(|i| [moved[[i, 0]], moved[[i, D - 1]]], counts);
        }
        tracing::debug!(?moves, "parameters moved");
        self.reports.push(moves);
        let solve_seconds = solve_seconds + clock.elapsed().as_secs_f64();
        Ok(Solution { map, assemble_seconds, solve_seconds })
    }

    fn estimate(&mut self, map: &SplineMap<D>) -> Result<Estimate<'_>, Error> {
        Ok(Solve::estimate(&mut self.fit, map)?)
    }
}
