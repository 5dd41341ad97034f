//! The method that is chosen where that is left to us: candidates are fitted, the cheapest first, each under a budget, and the best is kept.

mod budget;
mod candidate;
mod policy;

use std::ops::ControlFlow;
use std::time::Instant;

use adaptive::{Iteration, Stop};
use deviation::{Verdict, tilted};
use ndarray::{Array2, ArrayView2};
use point_cloud::LocalFrames;
use serde::Serialize;
use thb_core::{CellSpace, SplineMap};

use crate::attempt::{Attempt, CREASE_SAMPLES, attempt};
use crate::methods::{self, JOINT, Task};
use crate::options::{LambdaChoice, Method};
use crate::{Error, Event, FitOptions, Watch};
use budget::Budget;
use candidate::Measured;
use policy::choose;

pub use budget::GaveUp;
pub use candidate::Candidate;
pub use policy::{Defect, Policy, Reason};

/// A candidate that was tried, and what became of it.
#[derive(Clone, Debug, Serialize)]
pub struct Tried {
    /// What was tried.
    pub candidate: Candidate,
    /// Control points when it ended.
    pub control_points: usize,
    /// Its verdict; absent if it was given up or failed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub verdict: Option<Verdict>,
    /// Share of the scan's area within the tolerance; of a candidate that was given up that of the points.
    pub within: f64,
    /// Why it was given up, if it was.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gave_up: Option<GaveUp>,
    /// Why it was kept or not, if it came to that.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<Reason>,
    /// The error that ended it, if one did.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
    /// Seconds that it took.
    pub seconds: f64,
}

/// The attempt that is kept.
pub(crate) struct Chosen {
    pub(crate) attempt: Attempt,
    /// What was tried, this one included, where the method was left to us.
    pub(crate) tried: Vec<Tried>,
}

/// Fits by the method asked for; where that is left to us, by the best of the candidates.
pub(crate) fn fit(task: &Task<'_>, options: &FitOptions, watch: &mut Watch<'_>) -> Result<Chosen, Error> {
    if options.method != Method::Auto {
        let _ = watch(Event::Step(Candidate::Fixed.step()));
        return Ok(Chosen { attempt: attempt(&JOINT, task, options, watch)?, tried: Vec::new() });
    }
    let mut trials = Trials::new(*task, options);
    trials.run(Candidate::Fixed, watch)?;
    if !trials.is_coarsest() {
        // Who asks for all points gets parameters that move freely in any case.
        let count = if options.within >= 1.0 { 2 } else { 3 };
        for &candidate in &Candidate::ALL[1..count] {
            if !trials.is_interrupted() {
                trials.run(candidate, watch)?;
            }
        }
    }
    Ok(trials.into_best())
}

/// What was tried so far.
struct Trials<'a, 'o> {
    task: Task<'a>,
    options: &'o FitOptions,
    /// Those that ended by themselves.
    attempts: Vec<Attempt>,
    measured: Vec<Measured>,
    tried: Vec<Tried>,
    /// Places in `tried` of those that ended by themselves.
    places: Vec<usize>,
    sides: Option<Sides<'a>>,
}

impl<'a, 'o> Trials<'a, 'o> {
    fn new(task: Task<'a>, options: &'o FitOptions) -> Self {
        Self {
            task,
            options,
            attempts: Vec::new(),
            measured: Vec::new(),
            tried: Vec::new(),
            places: Vec::new(),
            sides: None,
        }
    }

    /// The place of the best so far.
    fn best(&self) -> usize {
        choose(&self.measured, &self.options.policy).0
    }

    fn is_interrupted(&self) -> bool {
        self.attempts.iter().any(|attempt| attempt.fitted.stop == Stop::Interrupted)
    }

    /// Whether fixed parameters did it in the space that everything begins with.
    fn is_coarsest(&self) -> bool {
        let fixed = &self.measured[0];
        !self.options.exhaustive
            && fixed.verdict == Verdict::Good
            && fixed.control_points == self.task.space.n_functions()
    }

    /// The options of a candidate after fixed parameters: their smoothing weight, and a limit of control points if nothing reached the
    /// tolerance.
    fn options_of(&self, candidate: Candidate) -> FitOptions {
        let method = candidate.method();
        let Some(fixed) = self.attempts.first() else { return FitOptions { method, ..self.options.clone() } };
        let lambda = LambdaChoice::Fixed(fixed.fitted.lambda);
        let points = self.task.problem.points.nrows() as f64;
        let most = (self.options.policy.most_per_point * points) as usize;
        FitOptions { method, lambda, max_dofs: self.options.max_dofs.or(Some(most)), ..self.options.clone() }
    }

    /// Fits a candidate until it ends or is given up. Only the first may fail: errors of the others are told.
    fn run(&mut self, candidate: Candidate, watch: &mut Watch<'_>) -> Result<(), Error> {
        let _ = watch(Event::Step(candidate.step()));
        let (start, options) = (Instant::now(), self.options_of(candidate));
        let mut tried = Tried {
            candidate,
            control_points: 0,
            verdict: None,
            within: 0.0,
            gave_up: None,
            reason: None,
            error: None,
            seconds: 0.0,
        };
        match self.attempt(candidate, &options, &mut tried, watch) {
            Ok(Some(attempt)) => {
                tried.verdict = Some(attempt.judgement.verdict());
                tried.within = attempt.judgement.deviation.scan_to_surface.within;
                self.places.push(self.tried.len());
                let (diagonal, asked) = (self.task.problem.diagonal, self.options.within);
                self.measured.push(Measured::of(candidate, &attempt, diagonal, asked));
                self.attempts.push(attempt);
                self.look_across(candidate)?;
            }
            Ok(None) => (),
            Err(error) if self.attempts.is_empty() => return Err(error),
            Err(error) => tried.error = Some(error.to_string()),
        }
        tried.seconds = start.elapsed().as_secs_f64();
        tracing::info!(?tried, "tried");
        self.tried.push(tried);
        Ok(())
    }

    /// The candidate's surface, measured; nothing if it was given up.
    fn attempt(
        &self,
        candidate: Candidate,
        options: &FitOptions,
        tried: &mut Tried,
        watch: &mut Watch<'_>,
    ) -> Result<Option<Attempt>, Error> {
        let policy = &self.options.policy;
        let best = (!self.attempts.is_empty()).then(|| self.best());
        // What is usable only may be replaced by something good with more control points.
        let rival = best.filter(|&best| !self.options.exhaustive && self.measured[best].verdict == Verdict::Good);
        let most = rival.map(|best| (policy.most_control_points * self.measured[best].control_points as f64) as usize);
        let iterations = rival.map(|best| self.attempts[best].fitted.history.as_slice());
        let mut budget = Budget::new(iterations, most.unwrap_or(usize::MAX), policy);
        let mut observer = |record: &Iteration| -> ControlFlow<()> {
            (tried.control_points, tried.within) = (record.dofs, record.deviation.within);
            watch(Event::Iteration(record))?;
            budget.after(record)
        };
        let fitted = methods::fit(&candidate.joint(), &self.task, options, &mut observer)?;
        tried.gave_up = budget.gave_up();
        if tried.gave_up.is_some() {
            return Ok(None);
        }
        let _ = watch(Event::Step("measuring the surface"));
        Attempt::of(options.method, fitted, &self.task, self.options.within).map(Some)
    }

    /// Parameters that move freely may tear the map: if they would be taken, the area across the points tells.
    fn look_across(&mut self, candidate: Candidate) -> Result<(), Error> {
        let last = self.measured.len() - 1;
        if candidate != Candidate::MovingFreely || self.best() != last {
            return Ok(());
        }
        let before = choose(&self.measured[..last], &self.options.policy).0;
        let sides = self.sides.get_or_insert_with(|| Sides::new(self.task.problem.points));
        for at in [before, last] {
            self.measured[at].across = Some(sides.share_of_area_across_normals(&self.attempts[at].fitted.map)?);
        }
        Ok(())
    }

    fn into_best(mut self) -> Chosen {
        let (best, reasons) = choose(&self.measured, &self.options.policy);
        for (&place, reason) in self.places.iter().zip(reasons) {
            self.tried[place].reason = Some(reason);
        }
        Chosen { attempt: self.attempts.swap_remove(best), tried: self.tried }
    }
}

/// Which way the points lie, which tells where a surface over them is torn.
struct Sides<'a> {
    points: ArrayView2<'a, f64>,
    /// Unit normals at the points; `None` where there are too few points for any.
    normals: Option<Array2<f64>>,
}

impl<'a> Sides<'a> {
    fn new(points: ArrayView2<'a, f64>) -> Self {
        Self { points, normals: LocalFrames::estimate(points).ok().map(|frames| frames.normals) }
    }

    /// Share of the area of a surface that lies across the points around it.
    fn share_of_area_across_normals(&self, map: &SplineMap<2>) -> Result<f64, Error> {
        let Some(normals) = &self.normals else { return Ok(0.0) };
        Ok(tilted(map, self.points, normals.view(), CREASE_SAMPLES)?)
    }
}
