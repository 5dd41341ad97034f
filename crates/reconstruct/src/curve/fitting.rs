//! The pipeline of curves: read, prepare, fit, report.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use adaptive::{Deviation, Iteration, Outcome, Stop};
use deviation::{Verdict, directed_hausdorff, map_to_points};
use fit_ls::{Lambda, LeastSquares, schoenberg_whitney};
use geom_io::{GRAPH, Model};
use moving_param::{Blend, Distance, JointOptions, Schedule};
use ndarray::{Array1, Array2, ArrayView2, Axis, concatenate};
use point_cloud::BoundingBox;
use thb_core::{CellSpace, HierarchicalSpace, Kind, SplineMap};

use super::choices::KnotChoice;
use super::method::{CurveMethod, Goal};
use super::options::CurveOptions;
use super::report::{CurveInput, CurveIteration, CurveReport, CurveResult};
use super::sequence::{self, Closing, Given, Sequence};
use super::start::start_knots;
use super::support::{Frame, Support, polygon_of};
use super::verdict::{CurveLimits, Judgement, Subject, judge};
use crate::{BlendChoice, Error, Method, units};

/// Samples per piece for the distance from the curve to the points.
const SAMPLES: usize = 4;

/// A fitted curve with its report and its data.
#[derive(Clone, Debug)]
pub struct CurveFit {
    /// The curve; of a graph its first coordinate is its parameter.
    pub model: Model,
    /// How good it is.
    pub report: CurveReport,
    /// Points that were fitted, in the order of the curve, `(m, N)`.
    pub points: Array2<f64>,
    /// Their parameters, `(m,)`.
    pub parameters: Array1<f64>,
    /// Their distances to the curve at their parameters.
    pub errors: Array1<f64>,
}

impl CurveFit {
    /// Whether the curve can be used: near its points everywhere, and nowhere else.
    pub fn verdict(&self) -> Verdict {
        self.report.result.verdict
    }

    /// Whether the asked share of points is within the tolerance.
    pub fn reached(&self) -> bool {
        self.report.result.reached
    }

    /// The curve.
    pub fn curve(&self) -> &SplineMap<1> {
        match &self.model.geometry {
            geom_io::Geometry::Curve(map) => map,
            geom_io::Geometry::Surface(_) => unreachable!("a curve fit makes a curve"),
        }
    }
}

/// Reads a sequence of points, as the options say, and fits it.
///
/// # Errors
/// [`Error`].
pub fn fit_curve_file(path: &Path, options: &CurveOptions) -> Result<CurveFit, Error> {
    options.check()?;
    fit(sequence::read(path, &options.read)?, &path.display().to_string(), options)
}

/// Fits points `(m, N)` in the order of the curve, N from 1 to 3 (with [`CurveOptions::graph`] x and up to 3 values); `name`
/// stands in the report.
///
/// # Errors
/// [`Error`]. A tolerance that is not reached is no error: the report says why the fit ended.
pub fn fit_sequence(points: ArrayView2<'_, f64>, name: &str, options: &CurveOptions) -> Result<CurveFit, Error> {
    options.check()?;
    let points = points.to_owned();
    let given = Given { points, parameters: None, notes: Vec::new(), format: "", unit: None, columns: Vec::new() };
    fit(given, name, options)
}

fn fit(given: Given, name: &str, options: &CurveOptions) -> Result<CurveFit, Error> {
    let start = Instant::now();
    let span = tracing::info_span!("fit_curve", name);
    let _guard = span.enter();
    let (rows, format, of_file) = (given.points.nrows(), given.format, given.unit);
    let columns = given.columns.clone();
    let sequence = sequence::prepare(given, options)?;
    let (m, dimension) = sequence.points.dim();
    if !(1..=3).contains(&dimension) {
        return Err(Error::CurveDimension { given: dimension });
    }
    let diagonal = BoundingBox::of(sequence.points.view())?.diagonal();
    let tolerance = options.tol.resolve(diagonal);
    let problem = Problem { sequence: &sequence, options, tolerance, diagonal };
    let mut warnings = sequence.notes.clone();
    let unit = units::resolve(options.units, of_file);
    // Points in memory are in the unit of whoever gives them.
    if !problem.is_function() && !options.graph && !format.is_empty() {
        warnings.extend(units::hint(options.units, of_file, diagonal));
    }
    let attempt = problem.best(&mut warnings)?;
    let Attempt { map, parameters, errors, history, judgement, .. } = &attempt;
    let deviation = Deviation::new(&errors.to_vec(), tolerance);
    let sites = parameters.view().insert_axis(Axis(1));
    let is_function = problem.is_function();
    let dhd = if is_function { deviation.max } else { directed_hausdorff(map, sites, sequence.points.view())? };
    // Nothing is between the values of a function.
    let hsd = if is_function { dhd } else { dhd.max(map_to_points(map, sequence.points.view(), SAMPLES)?) };
    let knots = map.space().knots(0, 0)?;
    warnings.extend(attempt.warnings.iter().cloned());
    let report = CurveReport {
        schema: 1,
        input: CurveInput {
            file: name.to_owned(),
            format,
            points: rows,
            columns,
            fitted_points: m,
            dimension,
            diagonal,
            closed: sequence.closing.name(),
            corners: sequence.corner_rows.clone(),
            parameterization: sequence.method,
        },
        options: CurveOptions { units: Some(unit), ..options.clone() },
        result: CurveResult {
            control_points: map.space().n_functions(),
            spans: map.space().n_cells(),
            degree: options.degree,
            periodic: sequence.closing == Closing::Periodic,
            knots: if knots.is_periodic() { knots.breaks() } else { knots.knots() }.to_vec(),
            max: deviation.max,
            mse: deviation.mse,
            rmse: deviation.rmse(),
            within: deviation.within,
            tolerance,
            lambda: attempt.lambda,
            dhd,
            hsd,
            seconds: start.elapsed().as_secs_f64(),
            stop: attempt.stop,
            reached: deviation.within >= options.within,
            verdict: judgement.verdict(),
            reasons: judgement.reasons.clone(),
            limits: CurveLimits::default(),
            share: judgement.share,
            swing: judgement.swing,
            box_ratio: judgement.box_ratio,
            crossings: judgement.crossings,
            support_points: attempt.support_points,
        },
        history: history.clone(),
        warnings,
    };
    let mut model = Model::curve(if options.graph { graph_of(map)? } else { map.clone() }, unit);
    model.metadata.insert("source".into(), name.into());
    if options.graph {
        model.metadata.insert(GRAPH.into(), true.into());
    }
    let Attempt { parameters, errors, .. } = attempt;
    let points = fitted_points(&sequence, options)?;
    Ok(CurveFit { model, report, points, parameters, errors })
}

/// What is to be fitted.
struct Problem<'a> {
    sequence: &'a Sequence,
    options: &'a CurveOptions,
    tolerance: f64,
    diagonal: f64,
}

/// A fit with its judgement.
struct Attempt {
    map: SplineMap<1>,
    /// Of the points.
    parameters: Array1<f64>,
    /// Distances of the points at their parameters.
    errors: Array1<f64>,
    lambda: f64,
    stop: &'static str,
    history: Vec<CurveIteration>,
    warnings: Vec<String>,
    judgement: Judgement,
    support_points: usize,
}

impl Attempt {
    /// Whether it is better than one with further points: by the verdict, else by how far both swing out.
    fn is_better_than(&self, next: &Self) -> bool {
        let (own, others) = (self.judgement.verdict(), next.judgement.verdict());
        own < others || own == others && self.judgement.swing < next.judgement.swing
    }

    /// Whether it is worse than another one: by its verdict, else by the two-sided distance where that is beyond the tolerance.
    fn is_worse(&self, other: &Self, tolerance: f64) -> bool {
        let (own, others) = (self.judgement.verdict(), other.judgement.verdict());
        own > others || own == others && self.judgement.two_sided > other.judgement.two_sided.max(tolerance)
    }
}

/// How often a curve with fixed parameters is fitted again because it swings out or crosses itself; with moving parameters once.
///
/// Limit: each time further stretches get points, and points at crossings are met twice as closely, 16 times at last.
const MAX_SUPPORT_ROUNDS: usize = 4;

impl Problem<'_> {
    /// Whether the values are a function of the parameter.
    fn is_function(&self) -> bool {
        self.options.graph || self.sequence.points.ncols() == 1
    }

    /// The fit by the method of the options, or the one with fixed parameters where moving them has made it worse.
    fn best(&self, warnings: &mut Vec<String>) -> Result<Attempt, Error> {
        let method = self.options.method;
        let moves = moving_options(self.options, self.tolerance).is_some();
        if !moves {
            return self.supported(method);
        }
        let moved = self.supported(method);
        match (self.supported(Method::Ls), moved) {
            (Err(_), moved) => moved,
            (Ok(fixed), Err(error)) => {
                warnings.push(format!("{method} failed ({error}); the parameters were kept"));
                Ok(fixed)
            }
            (Ok(fixed), Ok(moved)) if moved.is_worse(&fixed, self.tolerance) => {
                warnings.push(format!(
                    "{method} ended worse than fixed parameters ({}, {:.4e} from points to curve or back, against {}, {:.4e}); \
                     the parameters were kept",
                    moved.judgement.verdict(),
                    moved.judgement.two_sided,
                    fixed.judgement.verdict(),
                    fixed.judgement.two_sided
                ));
                Ok(fixed)
            }
            (Ok(_), Ok(moved)) => Ok(moved),
        }
    }

    /// A fit that is repeated with points over the stretches where it swings out, and nearer to the points where it crosses itself.
    fn supported(&self, method: Method) -> Result<Attempt, Error> {
        let sequence = self.sequence;
        let mut support = Support::none(sequence);
        let mut best = self.attempt(method, &support)?;
        // Parameters that go to and fro say nothing about what is between two rows.
        if !sequence.parameters.iter().is_sorted() {
            return Ok(best);
        }
        let rounds = if method == Method::Ls { MAX_SUPPORT_ROUNDS } else { 1 };
        let frame = Frame::new(sequence, self.is_function());
        let polygon = polygon_of(sequence, &frame);
        let (mut swings, mut crossed) = (best.judgement.swings.clone(), best.judgement.crossed.clone());
        for _ in 0..rounds {
            let further = support.with(sequence, &frame, &polygon, &swings);
            support = match further {
                // Where it swings out it may cross itself too.
                Some(further) => further,
                None if crossed.is_empty() => break,
                None => support.demanding(&crossed),
            };
            let Ok(mut next) = self.attempt(method, &support) else { break };
            swings.clone_from(&next.judgement.swings);
            crossed.clone_from(&next.judgement.crossed);
            if support.stretches() > 0 {
                next.warnings.push(format!(
                    "between {} pairs of neighbouring points the curve swung out, and is held by {} further points there",
                    support.stretches(),
                    support.len()
                ));
            }
            if support.is_demanding() {
                next.warnings.push("the curve crossed itself, and is nearer to the points there than asked".to_owned());
            }
            if !best.is_better_than(&next) {
                best = next;
            }
        }
        Ok(best)
    }

    fn attempt(&self, method: Method, support: &Support) -> Result<Attempt, Error> {
        let Self { sequence, options, tolerance, diagonal } = *self;
        let m = sequence.points.nrows();
        let all = m + support.len();
        let (parameters, points) = support.beside(sequence);
        let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [start_knots(sequence, options)?])?);
        let length = sequence.domain.1 - sequence.domain.0;
        let mut warnings = Vec::new();
        let mut fitting = fit_ls::Options {
            lambda: options.lambda.resolve(tolerance, diagonal),
            lengths: [1.0 / length],
            ..fit_ls::Options::default()
        };
        if fitting.lambda == Lambda::Fixed(0.0) && !schoenberg_whitney(space.knots(0, 0)?, &parameters.to_vec()) {
            let lambda = least_lambda(&parameters, &points, &space, &fitting)?;
            warnings.push(format!(
                "between corners or knots there are too few points to determine the curve; it is drawn calm there by the \
                 smoothing weight {lambda:.1e}"
            ));
            fitting.lambda = Lambda::Fixed(lambda);
        }
        let shortest = length * 0.5_f64.powi(options.halvings as i32);
        let with_method = CurveOptions { method, ..options.clone() };
        let moving = moving_options(&with_method, tolerance);
        // Of all points as many may be beyond the tolerance as of those of the sequence.
        let within = 1.0 - (1.0 - options.within) * m as f64 / all as f64;
        let goal = Goal { tolerance, within, marking: options.mark.0, shortest };
        let mut method = CurveMethod::new(sequence, support, fitting, moving, goal)?;
        let adapts = options.knots == KnotChoice::Adaptive;
        let rules = adaptive::Options {
            tolerance,
            within,
            marking: options.mark.0,
            max_dofs: options.max_dofs.unwrap_or(all),
            // Marking a share inserts few knots at a time.
            max_iterations: if adapts { all.max(50) } else { 1 },
            ..adaptive::Options::default()
        };
        let mut observer = |_: &Iteration| ControlFlow::Continue(());
        let Outcome { map, stop, failure, history, .. } = adaptive::run(&mut method, space, &rules, &mut observer)?;
        if let Some(failure) = failure {
            warnings.push(format!("the last knots that were inserted could not be solved for: {failure}"));
        }
        let (parameters, errors) = (method.parameters(), method.errors(&map)?);
        let judgement = judge(&Subject {
            map: &map,
            sequence,
            parameters: &parameters,
            errors: &errors,
            tolerance,
            within: options.within,
            is_function: self.is_function(),
        })?;
        let moves = method.moves();
        Ok(Attempt {
            parameters,
            errors,
            lambda: method.lambda(),
            stop: if !adapts && stop == Stop::Iterations { "fixed-knots" } else { stop.name() },
            history: history.iter().enumerate().map(|(k, record)| CurveIteration::new(record, moves.get(k))).collect(),
            warnings,
            judgement,
            support_points: support.len(),
            map,
        })
    }
}

/// The smallest power of ten, times the number of points, with which a fit in the first space stays near its points.
fn least_lambda(
    parameters: &Array1<f64>,
    points: &Array2<f64>,
    space: &Arc<HierarchicalSpace<1>>,
    fitting: &fit_ls::Options<1>,
) -> Result<f64, Error> {
    let bounds = BoundingBox::of(points.view())?;
    let limit = FAR * bounds.diagonal();
    let (parameters, points) = (parameters.view().insert_axis(Axis(1)), points.view());
    let mut failure = fit_ls::Error::NoPoints;
    for exponent in LEAST_EXPONENTS {
        let lambda = 10.0_f64.powi(exponent) * points.nrows() as f64;
        let options = fit_ls::Options { lambda: Lambda::Fixed(lambda), ..fitting.clone() };
        match LeastSquares::new(parameters, points, None, options)?.fit(space) {
            Ok(map) => {
                let beyond = |k: usize, c: f64| c < bounds.lower[k] - limit || c > bounds.upper[k] + limit;
                if !map.coefficients().indexed_iter().any(|((_, k), &c)| beyond(k, c)) {
                    return Ok(lambda);
                }
            }
            Err(error) => failure = error,
        }
    }
    Err(failure.into())
}

/// Exponents that are tried; below, the weight is lost in round-off.
const LEAST_EXPONENTS: std::ops::RangeInclusive<i32> = -15..=-5;

/// Distance, in diagonals of the points, beyond which control points are a sign of an undetermined curve.
const FAR: f64 = 1.0;

/// The curve `(u, s(u))`: Greville abscissae are the coefficients of the identity.
fn graph_of(map: &SplineMap<1>) -> Result<SplineMap<1>, Error> {
    let identity = Array1::from(map.space().knots(0, 0)?.greville()).insert_axis(Axis(1));
    Ok(SplineMap::new(map.space().clone(), beside(identity.view(), map.coefficients())?)?)
}

fn fitted_points(sequence: &Sequence, options: &CurveOptions) -> Result<Array2<f64>, Error> {
    if !options.graph {
        return Ok(sequence.points.clone());
    }
    beside(sequence.parameters.view().insert_axis(Axis(1)), sequence.points.view())
}

fn beside(first: ArrayView2<'_, f64>, second: ArrayView2<'_, f64>) -> Result<Array2<f64>, Error> {
    let shape =
        |_| fit_ls::Error::Shape { what: "rows of coordinates", given: second.nrows(), expected: first.nrows() };
    Ok(concatenate(Axis(1), &[first, second]).map_err(shape)?)
}

/// The method with moving parameters that is asked for, if any.
fn moving_options(options: &CurveOptions, tolerance: f64) -> Option<moving_param::Options> {
    let alternating = |distance| moving_param::Method::Alternating { distance, corrections: options.corrections };
    let method = match options.method {
        Method::APdm => alternating(Distance::Point),
        Method::ATdm => alternating(Distance::Tangent { damping: options.damping }),
        Method::AHdm => alternating(Distance::Hybrid(match options.blend {
            BlendChoice::Constant(gamma) => Blend::Constant(gamma),
            BlendChoice::Error | BlendChoice::Curvature => Blend::ErrorDriven,
        })),
        Method::JPdm => moving_param::Method::JointLbfgs(Schedule::B),
        Method::Joint => moving_param::Method::Joint(JointOptions::WITHOUT_SPRINGS),
        Method::Auto | Method::Ls | Method::Qi | Method::AQi => return None,
    };
    Some(moving_param::Options { method, tolerance, ..moving_param::Options::default() })
}
