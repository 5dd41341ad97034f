//! What methods are given and what they leave.

use std::fmt::Display;
use std::sync::Arc;

use adaptive::{Iteration, Outcome, Stop};
use fit_ls::LocalSmoothing;
use moving_param::Moves;
use ndarray::{Array1, Array2};
use thb_core::{HierarchicalSpace, SplineMap};

use super::quasi_report::QuasiReport;
use super::reweighting_report::ReweightingReport;
use crate::FitOptions;
use crate::judge::{Judge, Judged};
use crate::problem::Problem;

/// What is to be fitted, the same in all attempts.
#[derive(Clone)]
pub(crate) struct Task<'a> {
    pub(crate) problem: &'a Problem<'a>,
    pub(crate) judge: &'a Judge<'a>,
    /// Whether the loop ends by what the judge says, or by the errors of the points at their parameters.
    pub(crate) judges_loop: bool,
    /// Whether the smoothing weight is ours to change.
    pub(crate) softens: bool,
    /// Points from this one on guide the surface where the scan has none; their errors do not count.
    pub(crate) counted: usize,
    /// The space to begin with.
    pub(crate) space: Arc<HierarchicalSpace<2>>,
}

impl<'a> Task<'a> {
    pub(super) fn judged<S>(&self, method: S, within: f64) -> Judged<'a, S> {
        Judged::new(method, self.judges_loop.then_some(self.judge), within, self.counted, self.softens)
    }
}

/// What the loop left.
pub(crate) struct Fitted {
    pub(crate) map: SplineMap<2>,
    pub(crate) stop: Stop,
    /// Why the last refinement could not be solved.
    pub(crate) failure: Option<String>,
    pub(crate) history: Vec<Iteration>,
    /// What happened to the parameters in each iteration; empty where they are fixed.
    pub(crate) moves: Vec<Moves>,
    /// The local problems of each iteration; empty where there are none.
    pub(crate) quasi: Vec<QuasiReport>,
    /// What came of weights that follow the errors.
    pub(crate) reweighting: Option<ReweightingReport>,
    /// Whether each point counts for the errors; `None` if all do.
    pub(crate) counted: Option<Vec<bool>>,
    /// Final parameters, `(m, 2)`.
    pub(crate) parameters: Array2<f64>,
    /// Distance of each point to the surface at its parameters.
    pub(crate) errors: Array1<f64>,
    pub(crate) lambda: f64,
    /// Where the smoothing weight is another one.
    pub(crate) local_smoothing: Vec<LocalSmoothing<2>>,
}

impl Fitted {
    /// What a loop left at some parameters, where there is nothing more to tell.
    pub(super) fn of<E: Display>(outcome: Outcome<2, E>, parameters: Array2<f64>, errors: Array1<f64>) -> Self {
        let Outcome { map, stop, failure, history } = outcome;
        Self {
            map,
            stop,
            failure: failure.map(|error| error.to_string()),
            history,
            moves: Vec::new(),
            quasi: Vec::new(),
            reweighting: None,
            counted: None,
            parameters,
            errors,
            lambda: 0.0,
            local_smoothing: Vec::new(),
        }
    }

    /// The places of the points that count; `None` if all do.
    pub(crate) fn kept(&self) -> Option<Vec<usize>> {
        self.counted.as_ref().map(|counted| (0..counted.len()).filter(|&i| counted[i]).collect())
    }
}

pub(crate) fn least_squares_options(problem: &Problem<'_>, options: &FitOptions) -> fit_ls::Options<2> {
    fit_ls::Options {
        lambda: options.lambda.resolve(problem.tolerance, problem.diagonal),
        quadrature: options.energy.quadrature(),
        ..fit_ls::Options::default()
    }
}
