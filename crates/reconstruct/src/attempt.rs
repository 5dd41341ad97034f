//! One fit by one method, and what was measured of it.

use std::ops::ControlFlow;

use adaptive::Iteration;
use deviation::creases;
use moving_param::JointOptions;
use ndarray::Axis;
use thb_core::CellSpace;

use crate::judge::{Judge, Judgement};
use crate::methods::{self, Fitted, Task};
use crate::options::Method;
use crate::problem::{Problem, rows_of, triangles_among};
use crate::{Error, Event, FitOptions, Watch};

/// Samples per direction and cell among which creases are sought.
pub(crate) const CREASE_SAMPLES: usize = 8;

/// What a method left, measured.
pub(crate) struct Attempt {
    /// The method; never [`Method::Auto`].
    pub(crate) method: Method,
    pub(crate) fitted: Fitted,
    /// Share of neighbouring samples of the surface between which its normal turns by more than a right angle.
    pub(crate) creases: f64,
    /// How the surface lies on the scan.
    pub(crate) judgement: Judgement,
}

impl Attempt {
    /// Measures what a method left.
    pub(crate) fn of(method: Method, fitted: Fitted, task: &Task<'_>, within: f64) -> Result<Self, Error> {
        // The surface need not come near points that count for nothing.
        let kept = fitted.kept();
        let creases = creases(&fitted.map, CREASE_SAMPLES)?;
        let judgement = judgement(task.problem, task.judge, kept.as_deref(), &fitted, within)?;
        Ok(Self { method, fitted, creases, judgement })
    }

    /// Control points.
    pub(crate) fn control_points(&self) -> usize {
        self.fitted.map.space().n_functions()
    }

    /// Largest distance between surface and scan, either way.
    pub(crate) fn farthest(&self) -> f64 {
        self.judgement.deviation.farthest.max(self.judgement.deviation.scan_to_surface.max)
    }

    /// Markers of type I that are not met.
    pub(crate) fn missed_markers(&self) -> usize {
        self.fitted.reweighting.as_ref().map_or(0, |found| found.markers - found.markers_met)
    }
}

/// Fits by the method of the options, the joint one as given, and measures what comes out.
pub(crate) fn attempt(
    joint: &JointOptions,
    task: &Task<'_>,
    options: &FitOptions,
    watch: &mut Watch<'_>,
) -> Result<Attempt, Error> {
    let mut observer = |record: &Iteration| -> ControlFlow<()> { watch(Event::Iteration(record)) };
    let fitted = methods::fit(joint, task, options, &mut observer)?;
    let _ = watch(Event::Step("measuring the surface"));
    Attempt::of(options.method, fitted, task, options.within)
}

/// How a surface lies on what counts of the scan.
fn judgement(
    problem: &Problem<'_>,
    judge: &Judge<'_>,
    kept: Option<&[usize]>,
    fitted: &Fitted,
    within: f64,
) -> Result<Judgement, Error> {
    let Some(kept) = kept.filter(|kept| kept.len() < problem.points.nrows()) else {
        return judge.judge(&fitted.map, Some(fitted.parameters.slice_axis(Axis(0), (..judge.scan().len()).into())));
    };
    let places = rows_of(problem.points.select(Axis(0), kept).view());
    let among = triangles_among(&problem.all_triangles(), kept, problem.points.nrows());
    let parameters = fitted.parameters.select(Axis(0), kept);
    Judge::new(&places, &among, problem.is_mesh, parameters.view(), problem.tolerance, within)?
        .judge(&fitted.map, Some(parameters.view()))
}
