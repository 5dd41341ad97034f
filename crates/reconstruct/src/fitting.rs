//! The adaptive loop with the method asked for.

use std::cmp::Reverse;
use std::ops::ControlFlow;
use std::sync::Arc;

use adaptive::{Iteration, Observer, Outcome, Stop, run};
use deviation::{Verdict, creases, tilted};
use fit_ls::{LeastSquares, LocalSmoothing, Weighted};
use moving_param::{Blend, Distance, JointOptions, Moves, MovingFit, Schedule};
use ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis};
use param_classic::triangulate_parameters;
use point_cloud::{BoundingBox, LocalFrames};
use thb_core::{CellSpace, HierarchicalSpace, Refinement, SplineMap};

use crate::densify::{area_weights, area_weights_of_cloud, densify, spacing_weights};
use crate::judge::{Judge, Judged, Judgement};
use crate::options::{BlendChoice, LambdaChoice, Method, Samples};
use crate::quasi::{self, QuasiReport};
use crate::reweighting::{self, ReweightingReport};
use crate::{Error, Event, FitOptions, Watch};

/// Distance between surface and points, as a share of the diagonal, from which on the user is warned. Gaps between
/// the points of a scan are smaller.
pub(crate) const FAR: f64 = 0.07;

/// The joint method with parameters that need not move as their neighbours do: they tear the map of some scans, on others they need far fewer
/// control points.
const FREE: JointOptions = JointOptions { cohesion: 0.0, ..JointOptions::DEFAULT };

/// Share of the automatic smoothing weight that is tried where moving parameters miss the tolerance: the weight is judged at
/// fixed parameters, whose errors call for more smoothing.
const SOFTER: f64 = 0.1;

/// Share of neighbouring samples between which the normal may turn by more than a right angle where moving parameters are
/// needed to reach the tolerance.
const CREASED: f64 = 5e-4;

/// What they may add to that share of fixed parameters where those reach the tolerance, too. Of the scans looked at, a head with
/// 1.4e-4 shows no more lines than with fixed parameters, and three cusps with 1.7e-4 show creases between them.
const CREASED_MORE: f64 = 1.5e-4;

/// What parameters that move freely may add to the share of the area that lies across the points, and the factor by which it may
/// grow besides: with few points their normals are rough, and all surfaces lie across some.
const SCARRED_MORE: (f64, f64) = (2e-4, 1.25);

/// Beyond this share the normals of the points are no good: points on distant lines have neighbours on their own line only.
const SCARRED_MOST: f64 = 0.05;

/// Share of the control points of a fit with fixed parameters that one whose parameters move alike may need at most: that one
/// leaves out fewer points.
const WORTHWHILE: f64 = 0.95;

/// Share of the control points of what was found before that a fit whose parameters move freely may need at most: what is gained must
/// be worth less even isolines.
const FREELY_WORTHWHILE: f64 = 0.8;

/// How much further than fixed parameters moving ones may leave the points, where points far from each other leave the surface
/// room between them.
const FURTHER: f64 = 1.1;

/// Share of the points left out that moving parameters may leave out, so 1 % where 5 % are: points move to where the surface
/// meets them, and those that are left gather in the finest relief, which is then lost.
const LEFT_OUT: f64 = 0.2;

/// Control points that a fit with moving parameters may have, as a share of the points, if it is to be better than one that
/// missed the tolerance: with as many as points it follows any noise.
const MOST: f64 = 0.9;

/// Distance of the middle of the box from the origin, in diagonals, up to which points are fitted as they are. Limit: coefficients that
/// few points determine carry the round-off of the coordinates times the condition of the equations, some 10⁹; that is to stay
/// below 10⁻⁴ of the diagonal.
const MAX_OFFSET_PER_DIAGONAL: f64 = 1e3;

/// Samples per direction and cell among which creases are sought.
const CREASE_SAMPLES: usize = 8;

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
    /// The places of the points that count; `None` if all do.
    pub(crate) fn kept(&self) -> Option<Vec<usize>> {
        self.counted.as_ref().map(|counted| (0..counted.len()).filter(|&i| counted[i]).collect())
    }
}

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
    /// Share of the points within the tolerance.
    fn within(&self) -> f64 {
        self.fitted.history.last().map_or(0.0, |last| last.deviation.within)
    }

    /// Better is the better verdict, then what stays near the points without creases, then what has the asked share of the points
    /// within the tolerance, then what comes closest to that.
    fn rank(&self, far: f64, creased: f64, asked: f64) -> Rank {
        Rank {
            verdict: Reverse(self.judgement.verdict()),
            is_smooth: self.farthest() <= far && self.creases <= creased && self.judgement.is_sound(),
            within: self.within().min(asked),
        }
    }

    /// Largest distance between surface and scan, either way.
    fn farthest(&self) -> f64 {
        self.judgement.deviation.farthest.max(self.judgement.deviation.scan_to_surface.max)
    }

    /// Markers of type I that are not met.
    fn missed_markers(&self) -> usize {
        self.fitted.reweighting.as_ref().map_or(0, |found| found.markers - found.markers_met)
    }

    fn dofs(&self) -> usize {
        self.fitted.map.space().n_functions()
    }
}

/// How good an attempt is beside others: the first that differs decides.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
struct Rank {
    verdict: Reverse<Verdict>,
    is_smooth: bool,
    within: f64,
}

/// Points that are ready to be fitted.
pub(crate) struct Problem<'a> {
    pub(crate) points: ArrayView2<'a, f64>,
    pub(crate) parameters: ArrayView2<'a, f64>,
    /// The confidence in each point, if it is given.
    pub(crate) weights: Option<ArrayView1<'a, f64>>,
    /// Row of each point in the file.
    pub(crate) rows: &'a [u32],
    /// Triangles over the points that may not turn over in the parameter plane.
    pub(crate) triangles: &'a [[u32; 3]],
    /// Whether they are the scan, and not spanned over its points.
    pub(crate) is_mesh: bool,
    /// Whether the parameters are the user's: then the errors of points are those at their parameters.
    pub(crate) is_given: bool,
    pub(crate) tolerance: f64,
    /// Diagonal of the bounding box of the points.
    pub(crate) diagonal: f64,
}

/// Fits adaptively, from a space, the points of positive weight. Points far from the origin are moved to it meanwhile.
pub(crate) fn fit(
    problem: &Problem<'_>,
    space: &Arc<HierarchicalSpace<2>>,
    options: &FitOptions,
    watch: &mut Watch<'_>,
) -> Result<Attempt, Error> {
    let BoundingBox { lower, upper } = BoundingBox::of(problem.points)?;
    let middle: Array1<f64> = lower.iter().zip(&upper).map(|(low, high)| 0.5 * (low + high)).collect();
    if middle.iter().all(|x| x.abs() <= MAX_OFFSET_PER_DIAGONAL * problem.diagonal) {
        return fit_counted(problem, space, options, watch);
    }
    let points = &problem.points - &middle;
    let mut found = fit_counted(&Problem { points: points.view(), ..*problem }, space, options, watch)?;
    // The functions sum to 1: what is added to all coefficients moves the surface.
    let coefficients = &found.fitted.map.coefficients() + &middle;
    found.fitted.map = SplineMap::new(found.fitted.map.space().clone(), coefficients)?;
    let judgement = found.judgement.moved(std::array::from_fn(|k| middle[k]));
    Ok(Attempt { judgement, ..found })
}

/// The points of positive weight; all of them where weights follow the errors.
fn fit_counted(
    problem: &Problem<'_>,
    space: &Arc<HierarchicalSpace<2>>,
    options: &FitOptions,
    watch: &mut Watch<'_>,
) -> Result<Attempt, Error> {
    match Heard::among(problem) {
        // Weights that follow the errors have their own rule for what counts.
        Some(heard) if !options.reweighting.is_asked_for() => {
            let found = fit_scan(&heard.problem(problem), space, options, watch)?;
            Ok(Attempt { fitted: heard.spread(found.fitted, problem)?, ..found })
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
) -> Result<Attempt, Error> {
    let places = rows_of(problem.points);
    let judge =
        Judge::new(&places, problem.triangles, problem.is_mesh, problem.parameters, problem.tolerance, options.within)?;
    let by_points = problem.is_given || options.samples == Samples::Vertices || options.reweighting.is_asked_for();
    let dense = judge
        .scan()
        .curved()
        .filter(|_| !by_points)
        .and_then(|curved| densify(curved, problem.parameters, space.periodic()));
    let m = problem.points.nrows();
    let judges_loop = !by_points;
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
        let task = Task { problem: &weighted, judge: &judge, judges_loop, softens, space };
        return fit_all(&task, options, watch);
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
        triangles: &dense.triangles,
        ..*problem
    };
    // No more control points than points of the scan.
    let most = Some(options.max_dofs.unwrap_or(m));
    let task = Task { problem: &denser, judge: &judge, judges_loop, softens, space };
    let found = fit_all(&task, &FitOptions { max_dofs: most, ..options.clone() }, watch)?;
    let fitted = Fitted {
        parameters: found.fitted.parameters.slice_axis(Axis(0), (..m).into()).to_owned(),
        errors: found.fitted.errors.slice_axis(Axis(0), (..m).into()).to_owned(),
        ..found.fitted
    };
    Ok(Attempt { fitted, ..found })
}

/// Weights, multiplied by those that points have already.
fn weighted(weights: Array1<f64>, given: Option<ArrayView1<'_, f64>>) -> Array1<f64> {
    match given {
        Some(given) => weights * given,
        None => weights,
    }
}

/// Points in space as plain arrays.
fn rows_of(points: ArrayView2<'_, f64>) -> Vec<[f64; 3]> {
    points.outer_iter().map(|row| std::array::from_fn(|k| row[k])).collect()
}

/// What is to be fitted, the same in all attempts.
struct Task<'a> {
    problem: &'a Problem<'a>,
    judge: &'a Judge<'a>,
    /// Whether the loop ends by what the judge says, or by the errors of the points at their parameters.
    judges_loop: bool,
    /// Whether the smoothing weight is ours to change.
    softens: bool,
    /// The space to begin with.
    space: &'a Arc<HierarchicalSpace<2>>,
}

impl<'a> Task<'a> {
    fn judged<S>(&self, method: S, within: f64) -> Judged<'a, S> {
        Judged::new(method, self.judges_loop.then_some(self.judge), within, self.softens)
    }
}

/// Fits all points. Where the method is left to us, parameters move where that spares control points and does no harm.
fn fit_all(task: &Task<'_>, options: &FitOptions, watch: &mut Watch<'_>) -> Result<Attempt, Error> {
    let Task { problem, space, .. } = *task;
    let _ = watch(Event::Step("fitting"));
    let attempt = |method, joint: &JointOptions, options: &FitOptions, watch: &mut Watch<'_>| {
        attempt(method, joint, task, options, watch)
    };
    if options.method != Method::Auto {
        return attempt(options.method, &JointOptions::DEFAULT, options, watch);
    }
    let fixed = attempt(Method::Ls, &JointOptions::DEFAULT, options, watch)?;
    // What swings out, folds or passes through itself is no result to be better than.
    let reached = fixed.fitted.stop == Stop::ToleranceReached && fixed.judgement.is_sound();
    let coarsest = fixed.dofs() == space.n_functions() && reached;
    if coarsest || fixed.fitted.stop == Stop::Interrupted {
        return Ok(fixed);
    }
    let enough = match reached {
        true => Some((WORTHWHILE * fixed.dofs() as f64) as usize),
        false => options.max_dofs.or(Some((MOST * problem.points.nrows() as f64) as usize)),
    };
    let within = 1.0 - LEFT_OUT * (1.0 - options.within);
    let lambda = LambdaChoice::Fixed(fixed.fitted.lambda);
    let moving = FitOptions { lambda, within, max_dofs: enough, ..options.clone() };
    let softer = FitOptions { lambda: LambdaChoice::Fixed(SOFTER * fixed.fitted.lambda), ..moving.clone() };
    let may_be_softer = options.lambda == LambdaChoice::Auto && !reached;
    let tries = [(&moving, "fitting with moving parameters"), (&softer, "fitting with less smoothing")];
    let creased = if reached { fixed.creases + CREASED_MORE } else { CREASED };
    let far = (FAR * problem.diagonal).max(if reached { FURTHER * fixed.farthest() } else { 0.0 });
    let missed = fixed.missed_markers();
    let rank = |attempt: &Attempt| {
        let rank = attempt.rank(far, creased, options.within);
        Rank { is_smooth: rank.is_smooth && attempt.missed_markers() <= missed, ..rank }
    };
    // What is as close as asked of moving parameters; it needs fewer control points than what was found before.
    let is_close = |attempt: &Attempt| rank(attempt).is_smooth && attempt.fitted.stop == Stop::ToleranceReached;
    let mut best = fixed;
    for (moving, step) in tries.into_iter().take(1 + usize::from(may_be_softer)) {
        let _ = watch(Event::Step(step));
        let other = attempt(Method::Joint, &JointOptions::DEFAULT, moving, watch)?;
        let (before, now) = (rank(&best), rank(&other));
        tracing::info!(?before, ?now, within = other.within(), dofs = other.dofs(), "near and smooth, within");
        tracing::debug!(reasons = ?other.judgement.reasons, farthest = other.farthest(), creases = other.creases, "judged");
        let close = is_close(&other);
        if close || now > before {
            best = other;
        }
        if close || best.fitted.stop == Stop::Interrupted {
            break;
        }
    }
    if best.fitted.stop != Stop::Interrupted && options.within < 1.0 {
        // Parameters that need not move alike may do with far fewer control points, or get there where others do not.
        let _ = watch(Event::Step("fitting with parameters that move freely"));
        let there = best.within() >= options.within && best.judgement.is_sound();
        let fewer = enough
            .map(|enough| if there { enough.min((FREELY_WORTHWHILE * best.dofs() as f64) as usize) } else { enough });
        let freely = FitOptions { max_dofs: fewer, ..moving };
        let other = attempt(Method::Joint, &FREE, &freely, watch)?;
        let (before, now) = (rank(&best), rank(&other));
        tracing::info!(?before, ?now, within = other.within(), dofs = other.dofs(), "near and smooth, within");
        if is_close(&other) || now > before {
            let sides = Sides::new(problem.points);
            let (before, now) = (sides.scarred(&best.fitted.map)?, sides.scarred(&other.fitted.map)?);
            tracing::info!(before, now, "area that lies across the points");
            if !there || before > SCARRED_MOST || now <= SCARRED_MORE.0 + SCARRED_MORE.1 * before {
                best = other;
            }
        }
    }
    if best.within() >= options.within && best.fitted.stop != Stop::Interrupted {
        best.fitted.stop = Stop::ToleranceReached;
    }
    Ok(best)
}

/// Which way the points lie, which tells scars of surfaces over them.
struct Sides<'a> {
    points: ArrayView2<'a, f64>,
    /// Unit normals at the points; `None` where there are too few points for any.
    normals: Option<Array2<f64>>,
}

impl<'a> Sides<'a> {
    fn new(points: ArrayView2<'a, f64>) -> Self {
        Self { points, normals: LocalFrames::estimate(points).ok().map(|frames| frames.normals) }
    }

    /// Share of the area of a surface that lies across the points around it.
    fn scarred(&self, map: &SplineMap<2>) -> Result<f64, Error> {
        let Some(normals) = &self.normals else { return Ok(0.0) };
        Ok(tilted(map, self.points, normals.view(), CREASE_SAMPLES)?)
    }
}

/// Fits by one method, the joint one as given, and measures what comes out.
fn attempt(
    method: Method,
    joint: &JointOptions,
    task: &Task<'_>,
    options: &FitOptions,
    watch: &mut Watch<'_>,
) -> Result<Attempt, Error> {
    let Task { problem, judge, space, .. } = *task;
    let rules = loop_options(options, problem.tolerance, problem.points.nrows());
    let mut observer = |record: &Iteration| -> ControlFlow<()> { watch(Event::Iteration(record)) };
    let fitted = match (method, moving_method(method, joint, problem, options)?) {
        (Method::Qi | Method::AQi, _) => quasi::fit(method, problem, space, options, &rules, &mut observer)?,
        (_, moving) if options.reweighting.is_asked_for() => {
            let moving = moving.map(|moving| moving_fit(moving, problem, options)).transpose()?;
            reweighting::fit(moving, problem, space, options, &rules, &mut observer)?
        }
        (_, Some(moving)) => moving_parameters(moving, task, options, &rules, &mut observer)?,
        (_, None) => fixed_parameters(task, options, &rules, &mut observer)?,
    };
    let _ = watch(Event::Step("measuring the surface"));
    // The surface need not come near points that count for nothing.
    let kept = fitted.kept();
    let creases = creases(&fitted.map, CREASE_SAMPLES)?;
    let judgement = judgement(problem, judge, kept.as_deref(), &fitted, options.within)?;
    Ok(Attempt { method, fitted, creases, judgement })
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
    let among = triangles_among(problem.triangles, kept, problem.points.nrows());
    let parameters = fitted.parameters.select(Axis(0), kept);
    Judge::new(&places, &among, problem.is_mesh, parameters.view(), problem.tolerance, within)?
        .judge(&fitted.map, Some(parameters.view()))
}

/// The triangles of which all corners are among some points, by their places there.
fn triangles_among(triangles: &[[u32; 3]], kept: &[usize], points: usize) -> Vec<[u32; 3]> {
    let mut place = vec![None; points];
    kept.iter().enumerate().for_each(|(at, &i)| place[i] = Some(at as u32));
    let among = |t: &[u32; 3]| Some([place[t[0] as usize]?, place[t[1] as usize]?, place[t[2] as usize]?]);
    triangles.iter().filter_map(among).collect()
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
            ..*whole
        }
    }

    /// A fit of these points as one of all: the others are where they were laid out.
    fn spread(&self, fitted: Fitted, whole: &Problem<'_>) -> Result<Fitted, Error> {
        let mut parameters = whole.parameters.to_owned();
        for (&i, uv) in self.kept.iter().zip(fitted.parameters.rows()) {
            parameters.row_mut(i).assign(&uv);
        }
        let errors = errors_at(&fitted.map, &parameters, whole.points)?;
        let mut counted = vec![false; whole.points.nrows()];
        self.kept.iter().for_each(|&i| counted[i] = true);
        Ok(Fitted { parameters, errors, counted: Some(counted), ..fitted })
    }
}

pub(crate) fn least_squares_options(problem: &Problem<'_>, options: &FitOptions) -> fit_ls::Options<2> {
    fit_ls::Options {
        lambda: options.lambda.resolve(problem.tolerance, problem.diagonal),
        quadrature: options.energy.quadrature(),
        ..fit_ls::Options::default()
    }
}

fn fixed_parameters(
    task: &Task<'_>,
    options: &FitOptions,
    rules: &adaptive::Options<2>,
    observer: &mut dyn Observer,
) -> Result<Fitted, Error> {
    let problem = task.problem;
    let fitting = least_squares_options(problem, options);
    let solver = LeastSquares::new(problem.parameters, problem.points, problem.weights, fitting)?;
    let mut judged = task.judged(solver, rules.within);
    let Outcome { map, stop, failure, history, .. } = run(&mut judged, task.space.clone(), rules, observer)?;
    let mut solver = judged.method;
    let sorted = solver.distances(&map)?.to_vec();
    Ok(Fitted {
        errors: solver.points().as_given(&sorted).into(),
        lambda: solver.lambda().unwrap_or(0.0),
        local_smoothing: solver.local_smoothing().to_vec(),
        parameters: problem.parameters.to_owned(),
        failure: failure.map(|error| error.to_string()),
        moves: Vec::new(),
        quasi: Vec::new(),
        reweighting: None,
        counted: None,
        map,
        stop,
        history,
    })
}

/// A fit whose parameters move, before it begins.
fn moving_fit(
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

fn moving_parameters(
    method: moving_param::Method,
    task: &Task<'_>,
    options: &FitOptions,
    rules: &adaptive::Options<2>,
    observer: &mut dyn Observer,
) -> Result<Fitted, Error> {
    let problem = task.problem;
    let mut judged = task.judged(moving_fit(method, problem, options)?, rules.within);
    let Outcome { map, stop, failure, history, .. } = run(&mut judged, task.space.clone(), rules, observer)?;
    let solver = judged.method;
    let parameters = solver.parameters();
    Ok(Fitted {
        errors: errors_at(&map, &parameters, problem.points)?,
        lambda: solver.lambda().unwrap_or(0.0),
        local_smoothing: solver.least_squares().local_smoothing().to_vec(),
        moves: solver.reports().to_vec(),
        quasi: Vec::new(),
        reweighting: None,
        counted: None,
        failure: failure.map(|error| error.to_string()),
        parameters,
        map,
        stop,
        history,
    })
}

/// The method with moving parameters that is asked for, if any.
fn moving_method(
    method: Method,
    joint: &JointOptions,
    problem: &Problem<'_>,
    options: &FitOptions,
) -> Result<Option<moving_param::Method>, Error> {
    let alternating = |distance| moving_param::Method::Alternating { distance, corrections: options.corrections };
    Ok(Some(match method {
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

/// Distances of points to the surface at their parameters.
pub(crate) fn errors_at(
    map: &SplineMap<2>,
    parameters: &Array2<f64>,
    points: ArrayView2<'_, f64>,
) -> Result<Array1<f64>, Error> {
    let image = map.eval_batch(parameters.view())?;
    Ok((&image - &points).mapv(|x| x * x).sum_axis(Axis(1)).mapv(f64::sqrt))
}

/// The principal curvature of largest magnitude at each point.
fn largest_curvatures(points: ArrayView2<'_, f64>) -> Result<Vec<f64>, Error> {
    let frames = LocalFrames::estimate(points)?;
    Ok(frames.curvatures.outer_iter().map(|k| if k[0].abs() > k[1].abs() { k[0] } else { k[1] }).collect())
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
