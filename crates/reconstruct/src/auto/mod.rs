//! The method that is chosen where that is left to us: candidates are fitted, the cheapest first, each under a budget, and the best is kept.

mod budget;
mod candidate;
mod choice;

use std::ops::ControlFlow;
use std::time::Instant;

use adaptive::{Iteration, Stop};
use deviation::{Verdict, tilted};
use moving_param::JointOptions;
use point_cloud::LocalFrames;
use serde::Serialize;
use thb_core::CellSpace;

use crate::attempt::{Attempt, CREASE_SAMPLES, attempt};
use crate::methods::{self, Fitted, Task};
use crate::options::{LambdaChoice, Method};
use crate::{Error, Event, FitOptions, Watch};
use budget::{Budget, Limits};
use candidate::Measured;
use choice::choose;

pub use budget::GaveUp;
pub use candidate::Candidate;
pub use choice::{Defect, Reason};

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
    /// Whether it is the result.
    pub kept: bool,
    /// Why it replaced what was kept before or not, if it came to that.
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

impl Tried {
    fn new(candidate: Candidate) -> Self {
        Self {
            candidate,
            control_points: 0,
            verdict: None,
            within: 0.0,
            gave_up: None,
            kept: false,
            reason: None,
            error: None,
            seconds: 0.0,
        }
    }
}

/// Fits by the method asked for; where that is left to us, by the best of the candidates.
pub(crate) fn fit(task: &Task<'_>, options: &FitOptions, watch: &mut Watch<'_>) -> Result<Chosen, Error> {
    if options.method != Method::Auto {
        let _ = watch(Event::Step(Candidate::Fixed.step()));
        return Ok(Chosen { attempt: attempt(&JointOptions::DEFAULT, task, options, watch)?, tried: Vec::new() });
    }
    let mut trials = Trials::new(task.clone(), options);
    trials.run(Candidate::Fixed, watch)?;
    if trials.is_done() {
        return Ok(trials.into_best());
    }
    trials.run(Candidate::Moving, watch)?;
    if !trials.is_good() && !trials.is_interrupted() && trials.left.is_some() {
        trials.run(Candidate::Fixed, watch)?;
    }
    if !trials.is_good() && !trials.is_interrupted() && trials.gave_up(Candidate::Moving) {
        // What it was compared with did not end well.
        trials.run(Candidate::Moving, watch)?;
    }
    // Who asks for all points has parameters that move freely already.
    if options.within < 1.0 && !trials.is_interrupted() && !trials.is_least() {
        trials.run(Candidate::MovingFreely, watch)?;
    }
    Ok(trials.into_best())
}

/// What was tried so far.
struct Trials<'a, 'o> {
    task: Task<'a>,
    options: &'o FitOptions,
    /// Those that ended by themselves, of which the first has fixed parameters unless these were left.
    attempts: Vec<Attempt>,
    measured: Vec<Measured>,
    tried: Vec<Tried>,
    /// What fixed parameters came to when they were left.
    left: Option<Fitted>,
    /// The smoothing weight of fixed parameters.
    lambda: Option<f64>,
    /// Whether the points are heights over a plane, whose parameters are what they are meant to be.
    is_graph: bool,
}

impl<'a, 'o> Trials<'a, 'o> {
    fn new(task: Task<'a>, options: &'o FitOptions) -> Self {
        Self {
            is_graph: task.problem.is_graph(),
            task,
            options,
            attempts: Vec::new(),
            measured: Vec::new(),
            tried: Vec::new(),
            left: None,
            lambda: None,
        }
    }

    /// The place of the best so far, if anything has ended by itself.
    fn best(&self) -> Option<usize> {
        (!self.measured.is_empty()).then(|| choose(&self.measured, &self.options.policy).0)
    }

    fn is_good(&self) -> bool {
        self.best().is_some_and(|best| self.measured[best].verdict == Verdict::Good)
    }

    /// Whether a candidate was given up when it was tried last.
    fn gave_up(&self, candidate: Candidate) -> bool {
        self.tried.iter().rfind(|tried| tried.candidate == candidate).is_some_and(|tried| tried.gave_up.is_some())
    }

    fn is_interrupted(&self) -> bool {
        self.attempts.iter().any(|attempt| attempt.fitted.stop == Stop::Interrupted)
    }

    /// Whether the best so far is good with no more functions than everything begins with: nothing has fewer.
    fn is_least(&self) -> bool {
        let least = |best: usize| self.measured[best].control_points == self.task.space.n_functions();
        !self.options.exhaustive && self.is_good() && self.best().is_some_and(least)
    }

    /// Whether nothing is to be tried after fixed parameters: they did it in the space that everything begins with, or the points are
    /// heights.
    fn is_done(&self) -> bool {
        let ended = !self.measured.is_empty() && (self.is_least() || self.is_graph);
        !self.options.exhaustive && ended || self.is_interrupted()
    }

    /// Fixed parameters tell the smoothing weight; where they have not reached what was asked, the others are limited by the points.
    fn options_of(&self, candidate: Candidate) -> FitOptions {
        let mut options = FitOptions { method: candidate.method(), ..self.options.clone() };
        options.lambda = self.lambda.map_or(options.lambda, LambdaChoice::Fixed);
        if candidate != Candidate::Fixed {
            let points = self.task.problem.points.nrows() as f64;
            options.max_dofs.get_or_insert((self.options.policy.most_per_point * points) as usize);
        }
        options
    }

    /// How far a candidate may go.
    fn limits(&self, candidate: Candidate) -> Limits<'_> {
        let policy = &self.options.policy;
        if self.options.exhaustive {
            return Limits::NONE;
        }
        // What is usable only may be replaced by something good with more control points.
        let rival = self.best().filter(|&best| self.measured[best].verdict == Verdict::Good);
        let most = |best: usize| (policy.most_control_points * self.measured[best].control_points as f64) as usize;
        let history = |best: usize| self.attempts[best].fitted.history.as_slice();
        let left = self.left.as_ref().map_or(&[][..], |fitted| &fitted.history);
        match candidate {
            // Heights are left as they are, and what is taken up again is not left once more.
            Candidate::Fixed if self.is_graph || self.lambda.is_some() => Limits::NONE,
            Candidate::Fixed => Limits { spaces: policy.first_spaces as usize, ..Limits::NONE },
            Candidate::Moving => Limits {
                rival: rival.map_or(left, history),
                hopeless: policy.hopeless,
                most: rival.map_or(usize::MAX, most),
                ..Limits::NONE
            },
            Candidate::MovingFreely => Limits {
                rival: rival.map_or(&[], history),
                hopeless: policy.hopeless_freely,
                most: rival.map_or(usize::MAX, most),
                ..Limits::NONE
            },
        }
    }

    /// Fits a candidate until it ends or is given up; fixed parameters that were left go on from the space in which they were. An error
    /// is told in the report if there is something else.
    fn run(&mut self, candidate: Candidate, watch: &mut Watch<'_>) -> Result<(), Error> {
        let _ = watch(Event::Step(candidate.step()));
        let (start, options) = (Instant::now(), self.options_of(candidate));
        let left = self.left.take_if(|_| candidate == Candidate::Fixed);
        let space = left.as_ref().map_or(&self.task.space, |left| left.map.space()).clone();
        let task = Task { space, ..self.task.clone() };
        let mut tried = Tried::new(candidate);
        let mut budget = Budget::new(self.limits(candidate));
        let mut observer = |record: &Iteration| -> ControlFlow<()> {
            (tried.control_points, tried.within) = (record.dofs, record.deviation.within);
            watch(Event::Iteration(record))?;
            budget.after(record)
        };
        let fitted = methods::fit(&candidate.joint(), &task, &options, &mut observer);
        let gave_up = budget.gave_up();
        match fitted {
            Err(error) if candidate == Candidate::Fixed && self.measured.is_empty() => return Err(error),
            Err(error) => tried.error = Some(error.to_string()),
            Ok(mut fitted) => {
                if let Some(left) = left {
                    fitted.history = joined(left.history, fitted.history);
                }
                if candidate == Candidate::Fixed {
                    self.lambda.get_or_insert(fitted.lambda);
                }
                // A loop that reached what was asked has ended by itself, whatever it was told.
                tried.gave_up = gave_up.filter(|_| fitted.stop == Stop::Interrupted);
                match tried.gave_up {
                    None => self.measure(&mut tried, fitted, watch)?,
                    Some(_) if candidate == Candidate::Fixed => self.left = Some(fitted),
                    Some(_) => (),
                }
            }
        }
        tried.seconds = start.elapsed().as_secs_f64();
        tracing::info!(?tried, "tried");
        self.tried.push(tried);
        Ok(())
    }

    /// Measures what ended by itself and adds it to the candidates for the choice.
    fn measure(&mut self, tried: &mut Tried, fitted: Fitted, watch: &mut Watch<'_>) -> Result<(), Error> {
        let _ = watch(Event::Step("measuring the surface"));
        let candidate = tried.candidate;
        let attempt = Attempt::of(candidate.method(), fitted, &self.task, self.options.within)?;
        tried.verdict = Some(attempt.judgement.verdict());
        tried.within = attempt.judgement.deviation.scan_to_surface.within;
        let (diagonal, asked) = (self.task.problem.diagonal, self.options.within);
        let measured = Measured::of(candidate, &attempt, diagonal, asked);
        // Fixed parameters are what the others are compared with, whenever they end.
        let at = if candidate == Candidate::Fixed { 0 } else { self.measured.len() };
        self.measured.insert(at, measured);
        self.attempts.insert(at, attempt);
        self.look_across(candidate)
    }

    /// Parameters that move freely may tear the map: if they would be taken, the area across the points tells.
    fn look_across(&mut self, candidate: Candidate) -> Result<(), Error> {
        let last = self.measured.len() - 1;
        if candidate != Candidate::MovingFreely || last == 0 || self.best() != Some(last) {
            return Ok(());
        }
        let before = choose(&self.measured[..last], &self.options.policy).0;
        let points = self.task.problem.points;
        let normals = LocalFrames::estimate(points).ok().map(|frames| frames.normals);
        for at in [before, last] {
            let map = &self.attempts[at].fitted.map;
            // Too few points for normals tell nothing.
            let across =
                normals.as_ref().map(|normals| tilted(map, points, normals.view(), CREASE_SAMPLES)).transpose()?;
            self.measured[at].across = across;
        }
        Ok(())
    }

    /// The best attempt; something has ended by itself, since nothing limits fixed parameters that were taken up again.
    fn into_best(mut self) -> Chosen {
        let (best, reasons) = choose(&self.measured, &self.options.policy);
        for (at, reason) in reasons.into_iter().enumerate() {
            // A candidate is measured once.
            let is_it = |tried: &&mut Tried| tried.candidate == self.measured[at].candidate && tried.verdict.is_some();
            if let Some(tried) = self.tried.iter_mut().find(is_it) {
                (tried.reason, tried.kept) = (Some(reason), at == best);
            }
        }
        Chosen { attempt: self.attempts.swap_remove(best), tried: self.tried }
    }
}

/// The iterations of a loop and of the one that goes on where it ended, of which the first repeats the last one.
fn joined(mut first: Vec<Iteration>, again: Vec<Iteration>) -> Vec<Iteration> {
    for record in again.into_iter().skip(1) {
        first.push(Iteration { iteration: first.len(), ..record });
    }
    first
}
