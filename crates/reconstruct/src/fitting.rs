//! The adaptive loop with the method asked for.

use std::ops::ControlFlow;
use std::sync::Arc;

use adaptive::{Iteration, Outcome, Stop, run};
use fit_ls::LeastSquares;
use moving_param::{Blend, Distance, JointOptions, Moves, MovingFit, Schedule};
use ndarray::{Array1, Array2, ArrayView2};
use point_cloud::LocalFrames;
use thb_core::{HierarchicalSpace, Refinement, SplineMap};

use crate::options::{BlendChoice, Method};
use crate::{Error, Event, FitOptions, Watch};

/// What the loop left.
pub(crate) struct Fitted {
    pub(crate) map: SplineMap<2>,
    pub(crate) stop: Stop,
    /// Why the last refinement could not be solved.
    pub(crate) failure: Option<String>,
    pub(crate) history: Vec<Iteration>,
    /// What happened to the parameters in each iteration; empty where they are fixed.
    pub(crate) moves: Vec<Moves>,
    /// Final parameters, `(m, 2)`.
    pub(crate) parameters: Array2<f64>,
    /// Distance of each point to the surface at its parameters.
    pub(crate) errors: Array1<f64>,
    pub(crate) lambda: f64,
}

/// Points that are ready to be fitted.
pub(crate) struct Problem<'a> {
    pub(crate) points: ArrayView2<'a, f64>,
    pub(crate) parameters: ArrayView2<'a, f64>,
    /// Triangles over the points that may not turn over in the parameter plane.
    pub(crate) triangles: &'a [[u32; 3]],
    pub(crate) tolerance: f64,
}

/// Fits adaptively from a space.
pub(crate) fn fit(
    problem: &Problem<'_>,
    space: Arc<HierarchicalSpace<2>>,
    options: &FitOptions,
    watch: &mut Watch<'_>,
) -> Result<Fitted, Error> {
    let fitting = fit_ls::Options {
        lambda: options.lambda.resolve(problem.tolerance),
        quadrature: options.energy.quadrature(),
        ..fit_ls::Options::default()
    };
    let rules = loop_options(options, problem.tolerance, problem.points.nrows());
    let mut observer = |record: &Iteration| -> ControlFlow<()> { watch(Event::Iteration(record)) };
    let Some(moving) = moving_method(problem, options)? else {
        let mut method = LeastSquares::new(problem.parameters, problem.points, None, fitting)?;
        let Outcome { map, stop, failure, history, .. } = run(&mut method, space, &rules, &mut observer)?;
        let sorted = method.distances(&map)?.to_vec();
        return Ok(Fitted {
            errors: in_order_of_points(method.points().order(), &sorted),
            lambda: method.lambda().unwrap_or(0.0),
            parameters: problem.parameters.to_owned(),
            failure: failure.map(|error| error.to_string()),
            moves: Vec::new(),
            map,
            stop,
            history,
        });
    };
    // The weight is chosen at the first parameters, as for a fit that keeps them.
    let settings = moving_param::Options {
        method: moving,
        boundary: options.boundary.constraint(),
        tolerance: problem.tolerance,
        ..moving_param::Options::default()
    };
    let mut method = MovingFit::new(problem.parameters, problem.points, None, fitting, settings)?;
    if !problem.triangles.is_empty() {
        method = method.with_triangles(problem.triangles)?;
    }
    let Outcome { map, stop, failure, history, .. } = run(&mut method, space, &rules, &mut observer)?;
    let parameters = method.parameters();
    let image = map.eval_batch(parameters.view())?;
    let errors = (&image - &problem.points).mapv(|x| x * x).sum_axis(ndarray::Axis(1)).mapv(f64::sqrt);
    Ok(Fitted {
        errors,
        lambda: method.lambda().unwrap_or(0.0),
        moves: method.reports().to_vec(),
        failure: failure.map(|error| error.to_string()),
        parameters,
        map,
        stop,
        history,
    })
}

/// The method with moving parameters that is asked for, if any.
fn moving_method(problem: &Problem<'_>, options: &FitOptions) -> Result<Option<moving_param::Method>, Error> {
    let alternating = |distance| moving_param::Method::Alternating { distance, corrections: options.corrections };
    Ok(Some(match options.method {
        Method::Ls => return Ok(None),
        Method::APdm => alternating(Distance::Point),
        Method::ATdm => alternating(Distance::Tangent { damping: options.damping }),
        Method::AHdm => alternating(Distance::Hybrid(match options.blend {
            BlendChoice::Error => Blend::ErrorDriven,
            BlendChoice::Curvature => Blend::CurvatureDriven(largest_curvatures(problem.points)?),
            BlendChoice::Constant(gamma) => Blend::Constant(gamma),
        })),
        Method::JPdm => moving_param::Method::JointLbfgs(Schedule::B),
        Method::Joint => {
            let usual = JointOptions::default();
            // More weight on the last few points outside the tolerance is for those who ask for all of them.
            let emphasis = if options.within < 1.0 { 0 } else { usual.emphasis };
            moving_param::Method::Joint(JointOptions { emphasis, ..usual })
        }
    }))
}

/// The principal curvature of largest magnitude at each point.
fn largest_curvatures(points: ArrayView2<'_, f64>) -> Result<Vec<f64>, Error> {
    let frames = LocalFrames::estimate(points)?;
    Ok(frames.curvatures.outer_iter().map(|k| if k[0].abs() > k[1].abs() { k[0] } else { k[1] }).collect())
}

fn in_order_of_points(order: &[u32], sorted: &[f64]) -> Array1<f64> {
    let mut values = Array1::zeros(sorted.len());
    order.iter().zip(sorted).for_each(|(&i, &value)| values[i as usize] = value);
    values
}

fn loop_options(options: &FitOptions, tolerance: f64, points: usize) -> adaptive::Options<2> {
    adaptive::Options {
        tolerance,
        within: options.within,
        marking: options.mark.0,
        refinement: Refinement {
            extension: options.extension.0,
            admissible: options.admissible,
            max_levels: options.levels,
        },
        max_dofs: options.max_dofs.unwrap_or(points),
        ..adaptive::Options::default()
    }
}
