//! What is done to points before they are fitted, and undone afterwards.

use std::sync::Arc;

use deviation::CurvedTriangles;
use ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis};
use point_cloud::BoundingBox;
use thb_core::{HierarchicalSpace, SplineMap};

use crate::attempt::Attempt;
use crate::auto::{self, Chosen};
use crate::densify::{Denser, area_weights, area_weights_of_cloud, bridge, densify, spacing_weights};
use crate::judge::Judge;
use crate::methods::{Fitted, Task};
use crate::options::{LambdaChoice, Method, Samples};
use crate::problem::{Problem, errors_at, rows_of, triangles_among};
use crate::{Error, FitOptions, Watch};

/// Distance of the middle of the box from the origin, in diagonals, up to which points are fitted as they are. Limit: coefficients that
/// few points determine carry the round-off of the coordinates times the condition of the equations, some 10⁹; that is to stay
/// below 10⁻⁴ of the diagonal.
const MAX_OFFSET_PER_DIAGONAL: f64 = 1e3;

/// Fits adaptively, from a space, the points of positive weight. Points far from the origin are moved to it meanwhile.
pub(crate) fn fit(
    problem: &Problem<'_>,
    space: &Arc<HierarchicalSpace<2>>,
    options: &FitOptions,
    watch: &mut Watch<'_>,
) -> Result<Chosen, Error> {
    let BoundingBox { lower, upper } = BoundingBox::of(problem.points)?;
    let middle: Array1<f64> = lower.iter().zip(&upper).map(|(low, high)| 0.5 * (low + high)).collect();
    if middle.iter().all(|x| x.abs() <= MAX_OFFSET_PER_DIAGONAL * problem.diagonal) {
        return fit_counted(problem, space, options, watch);
    }
    let points = &problem.points - &middle;
    let mut found = fit_counted(&Problem { points: points.view(), ..*problem }, space, options, watch)?;
    // The functions sum to 1: what is added to all coefficients moves the surface.
    let Attempt { fitted, judgement, .. } = &mut found.attempt;
    let coefficients = &fitted.map.coefficients() + &middle;
    fitted.map = SplineMap::new(fitted.map.space().clone(), coefficients)?;
    judgement.move_by(std::array::from_fn(|k| middle[k]));
    Ok(found)
}

/// The points of positive weight; all of them where weights follow the errors.
fn fit_counted(
    problem: &Problem<'_>,
    space: &Arc<HierarchicalSpace<2>>,
    options: &FitOptions,
    watch: &mut Watch<'_>,
) -> Result<Chosen, Error> {
    match Heard::among(problem) {
        // Weights that follow the errors have their own rule for what counts.
        Some(heard) if !options.reweighting.is_asked_for() => {
            let mut found = fit_scan(&heard.problem(problem), space, options, watch)?;
            heard.spread(&mut found.attempt.fitted, problem)?;
            Ok(found)
        }
        _ => fit_scan(problem, space, options, watch),
    }
}

/// Fits what was scanned: of a mesh its area, by further points on long triangles and weights by area, unless the vertices alone are
/// asked for.
fn fit_scan(
    problem: &Problem<'_>,
    space: &Arc<HierarchicalSpace<2>>,
    options: &FitOptions,
    watch: &mut Watch<'_>,
) -> Result<Chosen, Error> {
    let places = rows_of(problem.points);
    let triangles = problem.all_triangles();
    let judge =
        Judge::new(&places, &triangles, problem.is_mesh, problem.parameters, problem.tolerance, options.within)?;
    let asks_for_points = options.samples == Samples::Vertices || options.reweighting.is_asked_for();
    let by_points = problem.is_given || asks_for_points;
    let m = problem.points.nrows();
    let dense = if by_points {
        None
    } else if let Some(curved) = judge.scan().curved() {
        // Points can only be added where parameters run on from corner to corner.
        let laid_out = || CurvedTriangles::new(places.clone(), problem.triangles.to_vec());
        let laid_out = (!problem.left_out.is_empty()).then(laid_out);
        densify(laid_out.as_ref().unwrap_or(curved), problem.parameters, space.periodic())
    } else {
        bridged(&judge, problem.parameters, space.periodic())
    };
    // Points on the triangles of a mesh are the scan; those that bridge a stretch without points are guesses.
    let counted = if problem.is_mesh { usize::MAX } else { m };
    // Published figures are those of single methods at given parameters.
    let judges_loop = !asks_for_points && (!problem.is_given || options.method == Method::Auto);
    let softens = options.lambda == LambdaChoice::Auto;
    let Some(dense) = dense else {
        let by_area = match judge.scan().weights() {
            _ if by_points => None,
            Some(weights) if problem.triangles.is_empty() => Some(spacing_weights(weights)),
            // A point away from the surface has a wide spacing, but no triangles.
            Some(weights) => Some(area_weights_of_cloud(&places, problem.triangles, weights)),
            None => Some(area_weights(&places, problem.triangles)),
        };
        let weights = by_area.map(|by_area| weighted(Array1::from(by_area), problem.weights));
        let weighted = Problem { weights: weights.as_ref().map_or(problem.weights, |w| Some(w.view())), ..*problem };
        let task = Task { problem: &weighted, judge: &judge, judges_loop, softens, counted, space: space.clone() };
        return auto::fit(&task, options, watch);
    };
    // An added point is as sure as the mean one.
    let confidence = problem.weights.map(|given| {
        let mean = given.mean().unwrap_or(1.0);
        Array1::from_shape_fn(dense.points.nrows(), |i| if i < m { given[i] } else { mean })
    });
    let weights = weighted(dense.weights, confidence.as_ref().map(|w| w.view()));
    let rows: Vec<u32> = (0..dense.points.nrows()).map(|i| problem.rows.get(i).copied().unwrap_or(u32::MAX)).collect();
    let denser = Problem {
        points: dense.points.view(),
        parameters: dense.parameters.view(),
        weights: Some(weights.view()),
        rows: &rows,
        triangles: if problem.is_mesh { &dense.triangles } else { problem.triangles },
        ..*problem
    };
    // No more control points than points of the scan.
    let most = Some(options.max_dofs.unwrap_or(m));
    let task = Task { problem: &denser, judge: &judge, judges_loop, softens, counted, space: space.clone() };
    let mut found = auto::fit(&task, &FitOptions { max_dofs: most, ..options.clone() }, watch)?;
    let Fitted { parameters, errors, .. } = &mut found.attempt.fitted;
    *parameters = parameters.slice_axis(Axis(0), (..m).into()).to_owned();
    *errors = errors.slice_axis(Axis(0), (..m).into()).to_owned();
    Ok(found)
}

/// A cloud in order with points in the stretches that it leaves out; nothing if there are none, or its neighbours are not known.
fn bridged(judge: &Judge<'_>, parameters: ArrayView2<'_, f64>, periodic: [bool; 2]) -> Option<Denser> {
    let mut denser = bridge(judge.scan().spanned()?, parameters, periodic)?;
    // The others weigh what they did.
    if let Some(weights) = judge.scan().weights() {
        denser.weights.iter_mut().zip(spacing_weights(weights)).for_each(|(weight, spacing)| *weight = spacing);
    }
    Some(denser)
}

/// Weights, multiplied by those that points have already.
fn weighted(weights: Array1<f64>, given: Option<ArrayView1<'_, f64>>) -> Array1<f64> {
    match given {
        Some(given) => weights * given,
        None => weights,
    }
}

/// The points that count where others have no confidence at all: those neither pull the surface nor ask for refinement.
struct Heard {
    /// Their places, increasing.
    kept: Vec<usize>,
    points: Array2<f64>,
    parameters: Array2<f64>,
    weights: Array1<f64>,
    rows: Vec<u32>,
    /// The triangles of which all vertices count.
    triangles: Vec<[u32; 3]>,
    /// Likewise of those that were not laid out.
    left_out: Vec<[u32; 3]>,
}

impl Heard {
    /// `None` if all points count.
    fn among(problem: &Problem<'_>) -> Option<Self> {
        let weights = problem.weights?;
        let kept: Vec<usize> = (0..weights.len()).filter(|&i| weights[i] > 0.0).collect();
        if kept.len() == weights.len() {
            return None;
        }
        Some(Self {
            points: problem.points.select(Axis(0), &kept),
            parameters: problem.parameters.select(Axis(0), &kept),
            weights: weights.select(Axis(0), &kept),
            rows: kept.iter().map(|&i| problem.rows[i]).collect(),
            triangles: triangles_among(problem.triangles, &kept, weights.len()),
            left_out: triangles_among(problem.left_out, &kept, weights.len()),
            kept,
        })
    }

    fn problem(&self, whole: &Problem<'_>) -> Problem<'_> {
        Problem {
            points: self.points.view(),
            parameters: self.parameters.view(),
            weights: Some(self.weights.view()),
            rows: &self.rows,
            triangles: &self.triangles,
            left_out: &self.left_out,
            ..*whole
        }
    }

    /// Makes a fit of these points one of all: the others are where they were laid out.
    fn spread(&self, fitted: &mut Fitted, whole: &Problem<'_>) -> Result<(), Error> {
        let mut parameters = whole.parameters.to_owned();
        for (&i, uv) in self.kept.iter().zip(fitted.parameters.rows()) {
            parameters.row_mut(i).assign(&uv);
        }
        fitted.errors = errors_at(&fitted.map, &parameters, whole.points)?;
        fitted.parameters = parameters;
        let mut counted = vec![false; whole.points.nrows()];
        self.kept.iter().for_each(|&i| counted[i] = true);
        fitted.counted = Some(counted);
        Ok(())
    }
}
