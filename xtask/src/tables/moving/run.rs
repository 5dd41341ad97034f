//! Clouds with parameters, and fits of them.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use adaptive::{Deviation, Iteration, Outcome, Solve, run};
use anyhow::{Context, Result};
use deviation::creases;
use fit_ls::{Lambda, LeastSquares};
use moving_param::{Boundary, FootPointOptions, Method, MovingFit, Options, project};
use ndarray::Array2;
use param_classic::triangulate_parameters;
use point_cloud::LocalFrames;
use reconstruct::{Domain, ParameterOptions, parameterize_file};
use thb_core::{HierarchicalSpace, Kind, KnotVector, Quadrature, Refinement, SplineMap};

use crate::process::Clock;

/// Samples per direction and cell among which creases are sought.
const CREASE_SAMPLES: usize = 8;

/// Points with parameters in the unit square.
pub(super) struct Cloud {
    pub(super) points: Array2<f64>,
    pub(super) parameters: Array2<f64>,
}

impl Cloud {
    /// A file with parameters, moved to the unit square.
    pub(super) fn read(path: &Path) -> Result<Self> {
        let options = ParameterOptions { domain: Domain::Data, ..ParameterOptions::default() };
        let read = parameterize_file(path, &options, &mut |_| ControlFlow::Continue(()))
            .with_context(|| format!("cannot read {}", path.display()))?;
        let mut parameters = read.parameters;
        for mut column in parameters.columns_mut() {
            let (low, high) = column.iter().fold((f64::MAX, f64::MIN), |(a, b), &u| (a.min(u), b.max(u)));
            column.mapv_inplace(|u| ((u - low) / (high - low)).clamp(0.0, 1.0));
        }
        Ok(Self { points: read.points, parameters })
    }

    /// The principal curvature of largest magnitude at each point.
    pub(super) fn curvatures(&self) -> Result<Vec<f64>> {
        let frames = LocalFrames::estimate(self.points.view())?;
        Ok(frames.curvatures.outer_iter().map(|k| if k[0].abs() > k[1].abs() { k[0] } else { k[1] }).collect())
    }
}

/// How a cloud is fitted.
#[derive(Clone, Debug)]
pub(super) struct Settings {
    pub(super) degree: usize,
    pub(super) elements: [usize; 2],
    pub(super) lambda: f64,
    /// Cells of the next level by which the region around a point is extended.
    pub(super) extension: usize,
    pub(super) tolerance: f64,
    /// Share of the points that must be met.
    pub(super) within: f64,
    pub(super) max_dofs: usize,
    pub(super) max_iterations: usize,
    pub(super) boundary: Boundary,
    /// Whether corrections that do harm are undone.
    pub(super) guard: bool,
    pub(super) foot_points: FootPointOptions,
}

impl Settings {
    /// Biquadratic, λ = 1e-7, all points to be met, boundary kept, without guard: as the text describes its fits.
    pub(super) fn published(elements: [usize; 2], tolerance: f64) -> Self {
        Self {
            degree: 2,
            elements,
            lambda: 1e-7,
            extension: 1,
            tolerance,
            within: 1.0,
            max_dofs: 20_000,
            max_iterations: 20,
            boundary: Boundary::Kept,
            guard: false,
            foot_points: FootPointOptions::default(),
        }
    }

    pub(super) fn space(&self) -> Result<Arc<HierarchicalSpace<2>>> {
        let [u, v] = self.elements;
        let knots = [KnotVector::uniform(self.degree, u)?, KnotVector::uniform(self.degree, v)?];
        Ok(Arc::new(HierarchicalSpace::new(Kind::Thb, knots)?))
    }

    fn rules(&self) -> adaptive::Options<2> {
        adaptive::Options {
            tolerance: self.tolerance,
            within: self.within,
            max_dofs: self.max_dofs,
            max_iterations: self.max_iterations,
            refinement: Refinement { extension: [self.extension; 2], max_levels: 16, ..Refinement::default() },
            ..adaptive::Options::default()
        }
    }

    /// The energy is integrated as G+Smo does.
    fn fitting(&self) -> fit_ls::Options<2> {
        let lambda = Lambda::Fixed(self.lambda);
        fit_ls::Options { lambda, quadrature: Quadrature::GaussP, ..fit_ls::Options::default() }
    }
}

/// A fit.
pub(super) struct Run {
    pub(super) name: String,
    pub(super) history: Vec<Iteration>,
    /// CPU time, over all threads.
    pub(super) seconds: f64,
    pub(super) stop: &'static str,
    pub(super) map: SplineMap<2>,
    /// Share of neighbouring samples of the surface between which its normal turns by more than a right angle.
    pub(super) creases: f64,
}

impl Run {
    /// A fit with fixed (`None`) or moving parameters.
    pub(super) fn of(name: &str, cloud: &Cloud, method: Option<Method>, settings: &Settings) -> Result<Self> {
        let (parameters, points) = (cloud.parameters.view(), cloud.points.view());
        let clock = Clock::start();
        let outcome = match method {
            None => looped(LeastSquares::new(parameters, points, None, settings.fitting())?, settings)?,
            Some(method) => looped(moving(cloud, method, settings)?, settings)?,
        };
        let seconds = clock.seconds();
        let (map, history, stop) = outcome;
        let creases = creases(&map, CREASE_SAMPLES)?;
        Ok(Self { name: name.into(), history, seconds, stop, map, creases })
    }

    pub(super) fn deviation(&self) -> Deviation {
        self.history
            .last()
            .map_or(Deviation { points: 0, max: f64::NAN, mse: f64::NAN, within: f64::NAN }, |last| last.deviation)
    }

    pub(super) fn dofs(&self) -> usize {
        self.history.last().map_or(0, |last| last.dofs)
    }

    pub(super) fn reached(&self) -> bool {
        self.stop == adaptive::Stop::ToleranceReached.name()
    }
}

/// The method for a cloud, whose surface is held between the points where the method asks for that.
fn moving(cloud: &Cloud, method: Method, settings: &Settings) -> Result<MovingFit<2>> {
    let Settings { tolerance, boundary, guard, foot_points, .. } = *settings;
    let held = matches!(&method, Method::Joint(joint) if joint.between > 0.0 || joint.cohesion > 0.0);
    let options = Options { method, boundary, foot_points, tolerance, guard };
    let fit = MovingFit::new(cloud.parameters.view(), cloud.points.view(), None, settings.fitting(), options)?;
    Ok(if held { fit.with_centres(&triangulate_parameters(cloud.parameters.view())?) } else { fit })
}

type Looped = (SplineMap<2>, Vec<Iteration>, &'static str);

fn looped<S: Solve<2>>(mut method: S, settings: &Settings) -> Result<Looped>
where
    S::Error: Send + Sync + 'static,
{
    let Outcome { map, history, stop, .. } =
        run(&mut method, settings.space()?, &settings.rules(), &mut |_: &Iteration| ControlFlow::Continue(()))?;
    Ok((map, history, stop.name()))
}

/// The deviation in the first space after the corrections or steps that the method says, at the foot points of the points: after a
/// step of tangent distances parameters are no foot points, and distances at them hold errors along the surface.
pub(super) fn in_first_space(cloud: &Cloud, method: Method, settings: &Settings) -> Result<Deviation> {
    let mut fit = moving(cloud, method, settings)?;
    let map = fit.solve(&settings.space()?, None)?.map;
    let parameters = fit.parameters();
    let (_, distances, _) =
        project(&map, parameters.view(), cloud.points.view(), settings.boundary, &settings.foot_points)?;
    Ok(Deviation::new(&distances, settings.tolerance))
}
