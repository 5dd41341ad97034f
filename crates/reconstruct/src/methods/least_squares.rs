//! Least squares with fixed parameters.

use adaptive::{Observer, run};
use fit_ls::LeastSquares;

use super::task::{Fitted, Task, least_squares_options};
use crate::{Error, FitOptions};

/// Fits adaptively by penalized least squares at the parameters of the problem.
pub(super) fn fit(
    task: &Task<'_>,
    options: &FitOptions,
    rules: &adaptive::Options<2>,
    observer: &mut dyn Observer,
) -> Result<Fitted, Error> {
    let problem = task.problem;
    let fitting = least_squares_options(problem, options);
    let solver = LeastSquares::new(problem.parameters, problem.points, problem.weights, fitting)?;
    let mut judged = task.judged(solver, rules.within);
    let outcome = run(&mut judged, task.space.clone(), rules, observer)?;
    let mut solver = judged.method;
    let sorted = solver.distances(&outcome.map)?.to_vec();
    let errors = solver.points().as_given(&sorted).into();
    Ok(Fitted {
        lambda: solver.lambda().unwrap_or(0.0),
        local_smoothing: solver.local_smoothing().to_vec(),
        ..Fitted::of(outcome, problem.parameters.to_owned(), errors)
    })
}
