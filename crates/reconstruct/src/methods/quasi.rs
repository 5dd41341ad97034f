//! Quasi-interpolation: its part of the report, and the loop with it.

use std::sync::Arc;

use adaptive::{Observer, run};
use fit_qi::{LocalLambda, QuasiInterpolation};
use moving_param::MovingQuasi;
use thb_core::HierarchicalSpace;

use super::quasi_report::QuasiReport;
use super::task::Fitted;
use crate::options::Method;
use crate::problem::{Problem, errors_at};
use crate::{Error, FitOptions};

/// Fits adaptively by quasi-interpolation, with fixed or with moving parameters.
pub(crate) fn fit(
    method: Method,
    problem: &Problem<'_>,
    space: &Arc<HierarchicalSpace<2>>,
    options: &FitOptions,
    rules: &adaptive::Options<2>,
    observer: &mut dyn Observer,
) -> Result<Fitted, Error> {
    let local = options.quasi.resolve(options.lambda, problem.tolerance);
    let moving = moving_param::QuasiOptions {
        corrections: if method == Method::AQi { options.corrections } else { 0 },
        boundary: options.boundary.constraint(),
        tolerance: problem.tolerance,
        ..moving_param::QuasiOptions::default()
    };
    let mut solver = MovingQuasi::new(problem.parameters, problem.points, problem.weights, local, moving)?;
    let outcome = run(&mut solver, space.clone(), rules, observer)?;
    let parameters = solver.parameters();
    let errors = errors_at(&outcome.map, &parameters, problem.points)?;
    let quasi: &QuasiInterpolation<2> = solver.quasi_interpolation();
    let reports = solver.reports().to_vec();
    Ok(Fitted {
        lambda: quasi.lambda().and_then(LocalLambda::number).unwrap_or(0.0),
        quasi: solver.work().into_iter().map(QuasiReport::of).collect(),
        moves: if method == Method::AQi { reports } else { Vec::new() },
        ..Fitted::of(outcome, parameters, errors)
    })
}
