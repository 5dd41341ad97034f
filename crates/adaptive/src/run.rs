//! The loop itself.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use thb_core::{CellSpace, HierarchicalSpace, Mark, Refinement, SplineMap};

use crate::mark::in_vain;
use crate::{Deviation, Estimate, Marking, Missed, Solve, mark};

/// Iterations without progress after which the loop gives up.
const PATIENCE: usize = 4;

/// Progress is a decrease of the mean or largest error by this share at least: smaller ones are noise of the data.
const PROGRESS: f64 = 0.01;

/// Rules of the loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options<const D: usize> {
    /// Tolerance on the error of a point, in units of the points.
    pub tolerance: f64,
    /// The loop ends when this share of the points is within the tolerance; 1 asks for all of them.
    pub within: f64,
    /// How cells are marked, unless the method has its own rule.
    pub marking: Marking,
    /// How marked cells are refined, and the largest number of levels.
    pub refinement: Refinement<D>,
    /// Largest number of functions. Where refining all marked cells would exceed it, only the worst are refined.
    pub max_dofs: usize,
    /// Largest number of iterations.
    pub max_iterations: usize,
}

impl<const D: usize> Default for Options<D> {
    /// Tolerance 1e-3 for 95 % of the points, the worst marked, one surrounding ring.
    fn default() -> Self {
        Self {
            tolerance: 1e-3,
            within: 0.95,
            marking: Marking::Worst,
            refinement: Refinement { extension: [2; D], ..Refinement::default() },
            max_dofs: 200_000,
            max_iterations: 50,
        }
    }
}

/// Why the loop ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Stop {
    /// The asked share of the points is within the tolerance.
    ToleranceReached,
    /// Refinement is needed in cells of the finest allowed level only.
    Levels,
    /// The method's own rule allows no further refinement: where errors remain there are too few points.
    Data,
    /// No further cell can be refined within the allowed number of functions.
    Dofs,
    /// Several iterations brought no progress.
    Stagnation,
    /// The largest number of iterations was reached.
    Iterations,
    /// The observer asked to end.
    Interrupted,
    /// The method failed on a refined space; the result is that of the iteration before.
    Failed,
}

impl Stop {
    /// Whether the loop ended because refinement led, or would lead, no further.
    fn is_for_want_of_progress(self) -> bool {
        matches!(self, Self::Levels | Self::Data | Self::Dofs | Self::Stagnation)
    }

    /// A short name for reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::ToleranceReached => "tolerance",
            Self::Levels => "levels",
            Self::Data => "too-few-points",
            Self::Dofs => "max-dofs",
            Self::Stagnation => "stagnation",
            Self::Iterations => "iterations",
            Self::Interrupted => "interrupted",
            Self::Failed => "failed",
        }
    }
}

/// Seconds per phase of an iteration.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seconds {
    /// Setting up equations.
    pub assemble: f64,
    /// Solving them.
    pub solve: f64,
    /// Evaluating errors.
    pub estimate: f64,
    /// Marking and refining, to the space of the next iteration.
    pub refine: f64,
}

/// Record of one iteration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Iteration {
    /// Number of the iteration, from 0.
    pub iteration: usize,
    /// Number of functions.
    pub dofs: usize,
    /// Number of levels, level 0 included.
    pub levels: usize,
    /// Number of cells.
    pub cells: usize,
    /// Errors of the points.
    pub deviation: Deviation,
    /// Time per phase.
    pub seconds: Seconds,
}

/// Told of each iteration when its errors are known.
pub trait Observer {
    /// `Break` ends the loop with the present result.
    fn iteration(&mut self, record: &Iteration) -> ControlFlow<()>;
}

impl<F: FnMut(&Iteration) -> ControlFlow<()>> Observer for F {
    fn iteration(&mut self, record: &Iteration) -> ControlFlow<()> {
        self(record)
    }
}

/// Result of the loop.
#[derive(Debug)]
pub struct Outcome<const D: usize, E> {
    /// The map of the last iteration.
    pub map: SplineMap<D>,
    /// Why the loop ended.
    pub stop: Stop,
    /// The error behind [`Stop::Failed`].
    pub failure: Option<E>,
    /// One record per iteration.
    pub history: Vec<Iteration>,
}

/// Fits adaptively, starting from a space.
///
/// # Errors
/// The method's error in the first iteration. Later failures end the loop with [`Stop::Failed`] and keep what was reached.
pub fn run<const D: usize, S: Solve<D>>(
    method: &mut S,
    start: Arc<HierarchicalSpace<D>>,
    options: &Options<D>,
    observer: &mut dyn Observer,
) -> Result<Outcome<D, S::Error>, S::Error> {
    let mut space = start;
    let mut last: Option<SplineMap<D>> = None;
    let mut history: Vec<Iteration> = Vec::new();
    loop {
        let step = iterate(method, &space, last.as_ref(), options, &history);
        let Step { map, mut record, next } = match (step, last.take()) {
            (Ok(step), _) => step,
            (Err(error), Some(map)) => {
                return Ok(Outcome { map, stop: Stop::Failed, failure: Some(error), history });
            }
            (Err(error), None) => return Err(error),
        };
        let interrupted = observer.iteration(&record).is_break();
        tracing::debug!(iteration = record.iteration, dofs = record.dofs, max = record.deviation.max, "fitted");
        let refining = Instant::now();
        let next = match (next, stop_before_refining(&record, &history, options, interrupted)) {
            (Next::End, _) => Err(Stop::ToleranceReached),
            (_, Some(stop)) => Err(stop),
            (Next::Again, None) => Ok(space.clone()),
            (Next::Refine(marked), None) => refine(method, &space, &marked, options).map(Arc::new),
        };
        let next = match next {
            Err(stop) if stop.is_for_want_of_progress() => match method.is_to_solve_again(&map) {
                Ok(again) => again.then(|| space.clone()).ok_or(stop),
                Err(error) => {
                    history.push(record);
                    return Ok(Outcome { map, stop: Stop::Failed, failure: Some(error), history });
                }
            },
            next => next,
        };
        record.seconds.refine = refining.elapsed().as_secs_f64();
        history.push(record);
        match next {
            Ok(next) => space = next,
            Err(stop) => return Ok(Outcome { map, stop, failure: None, history }),
        }
        last = Some(map);
    }
}

/// Places with errors, worst first, and how many of them to refine.
struct Marked {
    places: Vec<Mark>,
    count: usize,
}

impl Marked {
    fn all(places: Vec<Mark>) -> Self {
        Self { count: places.len(), places }
    }

    /// By the rule of the options.
    fn new<const D: usize>(
        estimate: Estimate<'_>,
        deviation: &Deviation,
        options: &Options<D>,
        last: Option<&Iteration>,
    ) -> Self {
        let in_vain = last.is_some_and(|last| in_vain(last.deviation.within, deviation.within, options.within));
        let marking = if options.marking == Marking::Worst && in_vain { Marking::Threshold } else { options.marking };
        let threshold = marking.threshold(estimate.errors, options.tolerance, options.within);
        let marked = mark(estimate, options.tolerance);
        let count = marked.partition_point(|&(_, error)| error >= threshold);
        Self { places: marked.into_iter().map(|(place, _)| place).collect(), count }
    }
}

/// SOLVE, ESTIMATE and MARK.
fn iterate<const D: usize, S: Solve<D>>(
    method: &mut S,
    space: &Arc<HierarchicalSpace<D>>,
    previous: Option<&SplineMap<D>>,
    options: &Options<D>,
    history: &[Iteration],
) -> Result<Step<D>, S::Error> {
    let solution = method.solve(space, previous)?;
    let estimating = Instant::now();
    let estimate = method.estimate(&solution.map)?;
    let deviation = Deviation::new(estimate.errors, options.tolerance);
    let seconds = Seconds {
        assemble: solution.assemble_seconds,
        solve: solution.solve_seconds,
        estimate: estimating.elapsed().as_secs_f64(),
        refine: 0.0,
    };
    let by_rule = Marked::new(estimate, &deviation, options, history.last());
    let next = if deviation.within >= options.within {
        match method.missed(&solution.map)? {
            Missed::Nothing => Next::End,
            Missed::Places(places) => Next::Refine(Marked::all(places)),
            Missed::Again => Next::Again,
        }
    } else {
        Next::Refine(method.mark(&solution.map, options.tolerance).map_or(by_rule, Marked::all))
    };
    let record = Iteration {
        iteration: history.len(),
        dofs: space.n_functions(),
        levels: space.n_levels(),
        cells: space.n_cells(),
        deviation,
        seconds,
    };
    Ok(Step { map: solution.map, record, next })
}

/// What SOLVE, ESTIMATE and MARK made.
struct Step<const D: usize> {
    map: SplineMap<D>,
    record: Iteration,
    next: Next,
}

/// How the loop goes on.
enum Next {
    /// The asked share is within the tolerance and the method has nothing to add.
    End,
    Refine(Marked),
    /// On the same space.
    Again,
}

fn stop_before_refining<const D: usize>(
    record: &Iteration,
    history: &[Iteration],
    options: &Options<D>,
    interrupted: bool,
) -> Option<Stop> {
    if interrupted {
        Some(Stop::Interrupted)
    } else if record.iteration + 1 >= options.max_iterations {
        Some(Stop::Iterations)
    } else if stagnates(record, history) {
        Some(Stop::Stagnation)
    } else {
        None
    }
}

/// Whether neither the largest nor the mean error, nor the share of points within the tolerance, has improved over the
/// best before the last `PATIENCE` iterations.
fn stagnates(record: &Iteration, history: &[Iteration]) -> bool {
    let Some(before) = (history.len() + 1).checked_sub(PATIENCE).filter(|&n| n > 0) else {
        return false;
    };
    let best = |of: fn(&Deviation) -> f64, part: &[Iteration]| {
        part.iter().map(|i| of(&i.deviation)).fold(f64::INFINITY, f64::min)
    };
    let measures: [fn(&Deviation) -> f64; 3] = [|d| d.max, |d| d.rmse(), |d| 1.0 - d.within];
    let recent = &history[before..];
    measures
        .iter()
        .all(|&of| of(&record.deviation).min(best(of, recent)) > (1.0 - PROGRESS) * best(of, &history[..before]))
}

/// Refines the marked cells, worst first, as far as the limit on functions allows. Where none of those to refine can be,
/// all that have errors are.
fn refine<const D: usize, S: Solve<D>>(
    method: &S,
    space: &HierarchicalSpace<D>,
    marked: &Marked,
    options: &Options<D>,
) -> Result<HierarchicalSpace<D>, Stop> {
    if marked.places.is_empty() {
        return Err(Stop::Data);
    }
    // Indices of marked cells come from the space itself, so what remains of errors is the limit on levels.
    let of_worst =
        |count: usize| method.refine(space, &marked.places[..count], &options.refinement).map_err(|_| Stop::Levels);
    let mut count = marked.count;
    let mut best = of_worst(count)?;
    if best.n_cells() == space.n_cells() && count < marked.places.len() {
        count = marked.places.len();
        best = of_worst(count)?;
    }
    if best.n_cells() == space.n_cells() {
        return Err(Stop::Levels);
    }
    if best.n_functions() > options.max_dofs {
        // The number of functions grows with the number of cells: halve the interval that holds the last possible one.
        let (mut possible, mut excessive) = (0, count);
        best = space.clone();
        while excessive - possible > 1 {
            let middle = possible.midpoint(excessive);
            let candidate = of_worst(middle)?;
            if candidate.n_functions() > options.max_dofs {
                excessive = middle;
            } else {
                (possible, best) = (middle, candidate);
            }
        }
    }
    if best.n_cells() == space.n_cells() { Err(Stop::Dofs) } else { Ok(best) }
}
