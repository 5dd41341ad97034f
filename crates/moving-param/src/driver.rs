//! The one loop that takes, refuses and damps steps, and decides when to stop.

use std::fmt::Debug;
use std::ops::ControlFlow;

use crate::Error;
use crate::damping::Damping;

/// A minimization by damped steps. It knows the state it is at.
pub(crate) trait StepProblem {
    /// What a step leads to.
    type Trial;

    /// Prepares a step from the present state: the objective there, or `None` if there is nothing left to do.
    fn freeze(&mut self) -> Result<Option<f64>, Error>;

    /// Where a step with some damping leads, and the objective there; `None` if it leads nowhere.
    fn trial(&mut self, damping: f64) -> Result<Option<(Self::Trial, f64)>, Error>;

    /// Goes there.
    fn accept(&mut self, trial: Self::Trial) -> Result<(), Error>;
}

/// When to stop.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits {
    /// Largest number of steps.
    pub(crate) steps: usize,
    /// A step is slow if it lowers the objective by less than this share.
    pub(crate) decrease: f64,
    /// So many slow steps in a row are the last ones.
    pub(crate) slow_steps: usize,
}

/// A step that was taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Steps taken so far in this minimization, with this one.
    pub number: usize,
    /// The objective before it.
    pub before: f64,
    /// And after it, with what the terms held constant.
    pub after: f64,
    /// The damping it was computed with.
    pub damping: f64,
    /// Steps that were refused before it, each damped more.
    pub refused: usize,
}

/// Is told of each step: for budgets and progress.
pub trait StepWatch: Debug + Send + Sync {
    /// A step was taken; the minimization ends here if asked to break.
    fn stepped(&mut self, step: &Step) -> ControlFlow<()>;
}

/// Why a minimization ended. The state is the best one in any case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ended {
    /// Nothing is left to do.
    Met,
    /// Steps lower the objective too little.
    Slow,
    /// No step lowers it, however strongly it is damped.
    Stuck,
    /// All steps that were allowed are taken.
    OutOfSteps,
    /// The watch said so.
    Stopped,
}

/// Minimizes by damped steps: each lowers the objective, or is damped more.
pub(crate) fn minimize<P: StepProblem>(
    problem: &mut P,
    damping: &mut Damping,
    limits: &Limits,
    watch: Option<&mut (dyn StepWatch + 'static)>,
) -> Result<Ended, Error> {
    let mut watch = watch;
    let mut slow = 0;
    damping.rest();
    for number in 1..=limits.steps {
        let Some(before) = problem.freeze()? else { return Ok(Ended::Met) };
        let mut refused = 0;
        let (trial, after) = loop {
            match problem.trial(damping.value())? {
                Some((trial, after)) if after < before => break (trial, after),
                _ => refused += 1,
            }
            if !damping.refused() {
                return Ok(Ended::Stuck);
            }
        };
        problem.accept(trial)?;
        let step = Step { number, before, after, damping: damping.value(), refused };
        damping.accepted();
        tracing::trace!(?step, "step");
        if watch.as_mut().is_some_and(|watch| watch.stepped(&step).is_break()) {
            return Ok(Ended::Stopped);
        }
        slow = if (before - after) / before < limits.decrease { slow + 1 } else { 0 };
        if slow == limits.slow_steps {
            return Ok(Ended::Slow);
        }
    }
    Ok(Ended::OutOfSteps)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::damping::DampingRule;

    /// `x²`, whose steps `−x / (¼ + μ)` lead too far without damping: from 1 to −3.
    #[derive(Debug)]
    struct Parabola {
        x: f64,
    }

    impl StepProblem for Parabola {
        type Trial = f64;

        fn freeze(&mut self) -> Result<Option<f64>, Error> {
            Ok((self.x.abs() > 1e-3).then_some(self.x * self.x))
        }

        fn trial(&mut self, damping: f64) -> Result<Option<(f64, f64)>, Error> {
            let x = self.x - self.x / (0.25 + damping);
            Ok(Some((x, x * x)))
        }

        fn accept(&mut self, trial: f64) -> Result<(), Error> {
            self.x = trial;
            Ok(())
        }
    }

    fn damping(first: f64, most: f64) -> Damping {
        Damping::new(DampingRule { first, least: 1e-9, most, accept: 1.0, refuse: 10.0, pause: 0 })
    }

    /// Breaks at a step.
    #[derive(Debug)]
    struct Until(usize, Vec<Step>);

    impl StepWatch for Until {
        fn stepped(&mut self, step: &Step) -> ControlFlow<()> {
            self.1.push(*step);
            if step.number == self.0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        }
    }

    #[test]
    fn each_end_is_reached_and_named() {
        let limits = Limits { steps: 50, decrease: 0.0, slow_steps: 1 };
        let run = |first: f64, most: f64, limits: &Limits, watch: &mut Until| {
            let mut problem = Parabola { x: 1.0 };
            let ended = minimize(&mut problem, &mut damping(first, most), limits, Some(watch)).unwrap();
            (ended, problem.x)
        };
        let mut watch = Until(0, Vec::new());
        let (ended, x) = run(1e-3, 10.0, &limits, &mut watch);
        assert!(ended == Ended::Met && x.abs() <= 1e-3, "{ended:?} at {x}");
        // Of 0.001, 0.01, 0.1 and 1 the last is the first that does not lead too far: from 1 to 0.2.
        let Step { number, before, after, damping, refused } = watch.1[0];
        assert_eq!((number, before, refused), (1, 1.0, 3));
        assert!((damping - 1.0).abs() < 1e-12 && (after - 0.04).abs() < 1e-12);
        let mut watch = Until(2, Vec::new());
        assert_eq!(run(1.0, 10.0, &limits, &mut watch).0, Ended::Stopped);
        assert_eq!(watch.1.iter().map(|step| step.number).collect::<Vec<_>>(), [1, 2]);
        let mut never = Until(0, Vec::new());
        assert_eq!(run(1e-3, 1e-2, &limits, &mut never), (Ended::Stuck, 1.0));
        assert_eq!(run(9.0, 10.0, &Limits { steps: 3, ..limits }, &mut never).0, Ended::OutOfSteps);
        let slow = Limits { decrease: 0.9, slow_steps: 2, ..limits };
        let mut counted = Until(0, Vec::new());
        assert_eq!(run(9.0, 10.0, &slow, &mut counted).0, Ended::Slow);
        assert_eq!(counted.1.len(), 2);
    }
}
