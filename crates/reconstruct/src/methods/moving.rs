//! Methods that move parameters.

use adaptive::{Observer, run};
use fit_ls::Weighted;
use moving_param::{Blend, Distance, JointOptions, MovingFit, Schedule};
use ndarray::ArrayView2;
use param_classic::triangulate_parameters;
use point_cloud::LocalFrames;

use super::task::{Fitted, Task, least_squares_options};
use crate::options::{BlendChoice, Method};
use crate::problem::{Problem, errors_at};
use crate::{Error, FitOptions};

/// A fit whose parameters move, before it begins.
pub(super) fn solver(
    method: moving_param::Method,
    problem: &Problem<'_>,
    options: &FitOptions,
) -> Result<MovingFit<2>, Error> {
    // The weight is chosen at the first parameters, as for a fit that keeps them.
    let fitting = least_squares_options(problem, options);
    let settings = moving_param::Options {
        method,
        boundary: options.boundary.constraint(),
        tolerance: problem.tolerance,
        ..moving_param::Options::default()
    };
    let mut solver = MovingFit::new(problem.parameters, problem.points, problem.weights, fitting, settings)?;
    if !problem.triangles.is_empty() {
        solver = solver.with_triangles(problem.triangles)?;
    } else if let Ok(triangles) = triangulate_parameters(problem.parameters) {
        // No triangles of the scan, whose folding would mean something; but they hold the surface.
        solver = solver.with_centres(&triangles);
    }
    Ok(solver)
}

/// Fits adaptively by a method that moves parameters.
pub(super) fn fit(
    method: moving_param::Method,
    task: &Task<'_>,
    options: &FitOptions,
    rules: &adaptive::Options<2>,
    observer: &mut dyn Observer,
) -> Result<Fitted, Error> {
    let problem = task.problem;
    let mut judged = task.judged(solver(method, problem, options)?, rules.within);
    let outcome = run(&mut judged, task.space.clone(), rules, observer)?;
    let solver = judged.method;
    let parameters = solver.parameters();
    let errors = errors_at(&outcome.map, &parameters, problem.points)?;
    Ok(Fitted {
        lambda: solver.lambda().unwrap_or(0.0),
        local_smoothing: solver.least_squares().local_smoothing().to_vec(),
        moves: solver.reports().to_vec(),
        ..Fitted::of(outcome, parameters, errors)
    })
}

/// The method with moving parameters that is asked for, if any.
pub(super) fn method(
    joint: &JointOptions,
    problem: &Problem<'_>,
    options: &FitOptions,
) -> Result<Option<moving_param::Method>, Error> {
    let alternating = |distance| moving_param::Method::Alternating { distance, corrections: options.corrections };
    Ok(Some(match options.method {
        Method::Ls | Method::Qi | Method::AQi => return Ok(None),
        Method::APdm => alternating(Distance::Point),
        Method::ATdm => alternating(Distance::Tangent { damping: options.damping }),
        Method::AHdm => alternating(Distance::Hybrid(match options.blend {
            BlendChoice::Error => Blend::ErrorDriven,
            BlendChoice::Curvature => Blend::CurvatureDriven(largest_curvatures(problem.points)?),
            BlendChoice::Constant(gamma) => Blend::Constant(gamma),
        })),
        Method::JPdm => moving_param::Method::JointLbfgs(Schedule::B),
        Method::Auto | Method::Joint => {
            // Who asks for all points gets more weight on the last few that are outside, and no springs to the neighbours: the last
            // few have parameters unlike theirs.
            let all = options.within >= 1.0;
            moving_param::Method::Joint(JointOptions {
                emphasis: if all { joint.emphasis } else { 0 },
                cohesion: if all { 0.0 } else { joint.cohesion },
                ..*joint
            })
        }
    }))
}

/// The principal curvature of largest magnitude at each point.
fn largest_curvatures(points: ArrayView2<'_, f64>) -> Result<Vec<f64>, Error> {
    let frames = LocalFrames::estimate(points)?;
    Ok(frames.curvatures.outer_iter().map(|k| if k[0].abs() > k[1].abs() { k[0] } else { k[1] }).collect())
}
