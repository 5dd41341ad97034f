//! The fitting methods, each in the adaptive loop.

mod least_squares;
mod moving;
mod quasi;
mod quasi_report;
mod reweighting;
mod reweighting_report;
mod task;

use adaptive::Observer;
use moving_param::JointOptions;
use thb_core::Refinement;

use crate::options::Method;
use crate::{Error, FitOptions};

pub use quasi_report::QuasiReport;
pub(crate) use reweighting::robust_diagonal;
pub use reweighting_report::ReweightingReport;
pub(crate) use task::{Fitted, Task};

/// Fits by the method of the options, the joint one as `joint` says.
pub(crate) fn fit(
    joint: &JointOptions,
    task: &Task<'_>,
    options: &FitOptions,
    observer: &mut dyn Observer,
) -> Result<Fitted, Error> {
    let (problem, space) = (task.problem, &task.space);
    let rules = loop_options(options, problem.tolerance, problem.points.nrows());
    match (options.method, moving::method(joint, problem, options)?) {
        (Method::Qi | Method::AQi, _) => quasi::fit(options.method, problem, space, options, &rules, observer),
        (_, moving) if options.reweighting.is_asked_for() => {
            let moving = moving.map(|moving| moving::solver(moving, problem, options)).transpose()?;
            reweighting::fit(moving, problem, space, options, &rules, observer)
        }
        (_, Some(moving)) => moving::fit(moving, task, options, &rules, observer),
        (_, None) => least_squares::fit(task, options, &rules, observer),
    }
}

fn loop_options(options: &FitOptions, tolerance: f64, points: usize) -> adaptive::Options<2> {
    adaptive::Options {
        tolerance,
        within: options.within,
        marking: options.mark.0,
        refinement: Refinement {
            extension: options.extension(),
            admissible: options.admissible,
            max_levels: options.levels,
        },
        max_dofs: options.max_dofs.unwrap_or(points),
        ..adaptive::Options::default()
    }
}
