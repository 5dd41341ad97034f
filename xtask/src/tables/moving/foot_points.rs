//! Foot points: against brute force, and Newton's method against methods of first order (the role of Table 5.1).

use std::cell::Cell;
use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, Result};
use argmin::core::{
    CostFunction, Error as MinimizerError, Executor, Gradient, IterState, KV, Problem, Solver, State,
    TerminationReason, TerminationStatus,
};
use argmin::solver::gradientdescent::SteepestDescent;
use argmin::solver::linesearch::MoreThuenteLineSearch;
use argmin::solver::quasinewton::LBFGS;
// For its feature `vec`: vector operations on `Vec<f64>`.
use argmin_math as _;
use moving_param::{Boundary, Descent, Distance, FootPointOptions, Method, Start, project};
use ndarray::Array2;
use rand::RngExt;
use thb_core::{HierarchicalSpace, Kind, KnotVector, Refinement, SplineMap};

use super::super::markdown::{figure, table};
use super::asked::Asked;
use super::run::{Cloud, Run, Settings};
use crate::process::Clock;

/// Seed of surfaces and queries; its number means nothing.
const SEED: u64 = 51;

/// Queries of a surface: both together are 10⁵.
const QUERIES: usize = 50_000;

/// Queries of the comparison of methods.
const FEW: usize = 10_000;

/// Times that our own methods are run: once takes less than the clock can tell.
const REPEATED: usize = 10;

/// Elements of the surfaces per direction, before one region is refined.
const ELEMENTS: usize = 8;

/// Samples of brute force per direction and cell.
const SAMPLES: usize = 24;

/// Steps of the refinement after brute force, in parameters: the first is that of the samples, the last round-off.
const LAST_STEP: f64 = 1e-12;

/// Distances are equal up to this share of the diagonal.
const EQUAL: f64 = 1e-9;

/// Samples per direction among whose pairs the reach is sought.
const REACHED: usize = 100;

/// Share of the reach within which queries lie.
const WITHIN_REACH: f64 = 0.9;

/// Share of warm starts, in percent, that should come as near as brute force.
const LEAST_WARM: f64 = 99.9;

/// The start that is too far away for that to be asked.
const AWAY: &str = "warm, 100 %";

/// A surface with the distance up to which foot points are unique, about.
struct Surface {
    name: &'static str,
    map: SplineMap<2>,
    diagonal: f64,
    reach: f64,
}

impl Surface {
    /// A height field with waves of random heights.
    fn waves() -> Result<Self> {
        let mut random = param_nn::stream(SEED, 0);
        Self::new("waves", |u, v| [u, v, 0.12 * (random.random::<f64>() - 0.5)])
    }

    /// A sheet rolled up by one and a half turns, whose layers come near each other.
    fn roll() -> Result<Self> {
        let gap = 0.15; // of the control points' layers
        Self::new("roll", |u, v| {
            let (angle, radius) = (1.5 * std::f64::consts::TAU * u, 0.3 + 1.5 * gap * u);
            [radius * angle.cos(), radius * angle.sin(), 0.8 * v]
        })
    }

    /// The bicubic surface with control points over the Greville sites.
    fn new(name: &'static str, mut control_point: impl FnMut(f64, f64) -> [f64; 3]) -> Result<Self> {
        let knots = KnotVector::uniform(3, ELEMENTS)?;
        let sites = knots.greville();
        let coarse = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots])?);
        let n = sites.len();
        let mut coefficients = Array2::zeros((n * n, 3));
        for (j, mut row) in coefficients.outer_iter_mut().enumerate() {
            row.iter_mut().zip(control_point(sites[j % n], sites[j / n])).for_each(|(c, x)| *c = x);
        }
        let map = SplineMap::new(coarse.clone(), coefficients)?;
        let middle = coarse.locate_cell([0.4, 0.6])?;
        let space = Arc::new(coarse.refine(&[middle], &Refinement { extension: [2; 2], ..Refinement::default() })?);
        let coefficients = thb_core::transfer(&map, &space)?;
        let map = SplineMap::new(space, coefficients)?;
        let box_of = point_cloud::BoundingBox::of(map.coefficients())?;
        let reach = reach(&map)?;
        Ok(Self { name, map, diagonal: box_of.diagonal(), reach })
    }

    /// Points off the surface in the direction of its normal, within its reach, and the parameters they stand over.
    fn queries(&self, count: usize, stream: u64) -> Result<(Array2<f64>, Array2<f64>)> {
        let mut random = param_nn::stream(SEED, stream);
        let parameters = Array2::from_shape_simple_fn((count, 2), || random.random::<f64>());
        let mut points = self.map.eval_batch(parameters.view())?;
        let tangents = [[1, 0], [0, 1]].map(|order| self.map.derivative_batch(parameters.view(), order));
        let [along, across] = tangents;
        let (along, across) = (along?, across?);
        for (i, mut point) in points.outer_iter_mut().enumerate() {
            let normal = unit(cross(&row(&along, i), &row(&across, i)));
            let height = WITHIN_REACH * self.reach * (2.0 * random.random::<f64>() - 1.0);
            (0..3).for_each(|k| point[k] += height * normal[k]);
        }
        Ok((parameters, points))
    }
}

/// The reach of a surface, over samples of its interior: the infimum of `|q − p|² / (2 |n_p · (q − p)|)` over pairs of its points
/// (Federer 1959, Theorem 4.18). It holds curvature (near pairs) and layers that come near each other (far ones).
fn reach(map: &SplineMap<2>) -> Result<f64> {
    let u = Array2::from_shape_fn((REACHED * REACHED, 2), |(i, d)| {
        ([i % REACHED, i / REACHED][d] as f64 + 0.5) / REACHED as f64
    });
    let points = map.eval_batch(u.view())?;
    let (along, across) = (map.derivative_batch(u.view(), [1, 0])?, map.derivative_batch(u.view(), [0, 1])?);
    let points: Vec<[f64; 3]> = (0..u.nrows()).map(|i| row(&points, i)).collect();
    let mut reach = f64::INFINITY;
    for (i, p) in points.iter().enumerate() {
        let normal = unit(cross(&row(&along, i), &row(&across, i)));
        for q in &points {
            let way = [q[0] - p[0], q[1] - p[1], q[2] - p[2]];
            let height = dot(&normal, &way).abs();
            // The point itself has none.
            reach = if height > 0.0 { reach.min(0.5 * dot(&way, &way) / height) } else { reach };
        }
    }
    Ok(reach)
}

fn row(x: &Array2<f64>, i: usize) -> [f64; 3] {
    [x[[i, 0]], x[[i, 1]], x[[i, 2]]]
}

fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: &[f64; 3], b: &[f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(v: [f64; 3]) -> [f64; 3] {
    let length = dot(&v, &v).sqrt();
    v.map(|x| x / length)
}

fn squared(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    let d = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    dot(&d, &d)
}

/// All samples of a surface, cell by cell.
struct BruteForce<'a> {
    map: &'a SplineMap<2>,
    cells: Vec<Vec<([f64; 2], [f64; 3])>>,
    /// Largest distance between neighbouring samples.
    spacing: f64,
}

impl<'a> BruteForce<'a> {
    fn new(map: &'a SplineMap<2>) -> Result<Self> {
        let bezier = map.bezier();
        let mut spacing = 0.0_f64;
        let mut cells = Vec::with_capacity(bezier.n_cells());
        for cell in 0..bezier.n_cells() {
            let (lower, upper) = bezier.cell_box(cell);
            let mut samples = Vec::with_capacity(SAMPLES * SAMPLES);
            for i in 0..SAMPLES * SAMPLES {
                let share = [i % SAMPLES, i / SAMPLES].map(|k| k as f64 / (SAMPLES - 1) as f64);
                let u = [0, 1].map(|d| lower[d] + share[d] * (upper[d] - lower[d]));
                let mut image = [0.0; 3];
                bezier.derivative(cell, u, [0; 2], &mut image);
                samples.push((u, image));
            }
            for (i, (_, image)) in samples.iter().enumerate() {
                for j in [i + 1, i + SAMPLES] {
                    let is_beside = j < samples.len() && (j != i + 1 || j % SAMPLES != 0);
                    spacing = if is_beside { spacing.max(squared(image, &samples[j].1).sqrt()) } else { spacing };
                }
            }
            cells.push(samples);
        }
        Ok(Self { map, cells, spacing })
    }

    /// The smallest distance to all samples, refined by a search over shrinking neighbourhoods from the best sample of each
    /// cell that could hold a nearer point. No derivatives: independent of what is tested.
    fn distance(&self, point: &[f64; 3]) -> Result<f64> {
        let nearest: Vec<([f64; 2], f64)> = self
            .cells
            .iter()
            .map(|samples| {
                let (at, least) = samples.iter().enumerate().fold((0, f64::INFINITY), |best, (i, (_, image))| {
                    let d = squared(image, point);
                    if d < best.1 { (i, d) } else { best }
                });
                (samples[at].0, least.sqrt())
            })
            .collect();
        let least = nearest.iter().map(|(_, d)| *d).fold(f64::INFINITY, f64::min);
        // Any point of a cell lies within a spacing of a sample.
        let candidates = nearest.iter().filter(|(_, d)| *d <= least + self.spacing);
        candidates.map(|(u, _)| self.refined(*u, point)).try_fold(f64::INFINITY, |best, d| Ok(d?.min(best)))
    }

    fn refined(&self, start: [f64; 2], point: &[f64; 3]) -> Result<f64> {
        let at = |u: [f64; 2]| -> Result<f64> {
            let mut image = [0.0; 3];
            self.map.bezier().derivative(self.map.space().locate_cell(u)?, u, [0; 2], &mut image);
            Ok(squared(&image, point))
        };
        let (mut u, mut best) = (start, at(start)?);
        let mut step = 1.0 / (ELEMENTS * SAMPLES) as f64;
        while step > LAST_STEP {
            let mut moved = false;
            for (du, dv) in [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)] {
                let trial = [u[0] + step * f64::from(du), u[1] + step * f64::from(dv)].map(|x| x.clamp(0.0, 1.0));
                let value = at(trial)?;
                if value < best {
                    (u, best, moved) = (trial, value, true);
                }
            }
            step = if moved { step } else { 0.5 * step };
        }
        Ok(best.sqrt())
    }
}

/// The section; the fits of a cloud need the folder with the data.
pub(super) fn section(data: Option<&Path>, asked: &mut Asked, log: &mut dyn FnMut(&str)) -> Result<String> {
    let surfaces = [Surface::waves()?, Surface::roll()?];
    let mut text = String::from(INTRODUCTION);
    let mut rows = Vec::new();
    for (stream, surface) in surfaces.iter().enumerate() {
        log(surface.name);
        rows.extend(against_brute_force(surface, stream as u64, asked)?);
    }
    text += &table(&["surface", "start", "queries", "as near, %", "too far at most", "steps", "µs each"], &rows);
    text += METHODS;
    let mut rows = Vec::new();
    for (stream, surface) in surfaces.iter().enumerate() {
        log("methods");
        rows.extend(methods(surface, 10 + stream as u64)?);
    }
    text += &table(&["surface", "method", "as near, %", "mean excess", "steps", "µs each"], &rows);
    if let Some(data) = data {
        log("methods in fits");
        text += FITS;
        text += &table(&["foot points by", "DOFs", "MAX", "MSE", "CPU-s"], &fits(data)?);
    }
    Ok(text)
}

fn as_near(found: &[f64], truth: &[f64], diagonal: f64) -> (f64, f64, f64) {
    let excess: Vec<f64> = found.iter().zip(truth).map(|(a, b)| (a - b) / diagonal).collect();
    let equal = excess.iter().filter(|e| **e <= EQUAL).count();
    let most = excess.iter().copied().fold(0.0, f64::max);
    let mean = excess.iter().map(|e| e.max(0.0)).sum::<f64>() / excess.len() as f64;
    (100.0 * equal as f64 / excess.len() as f64, most, mean)
}

/// Parameters moved by up to a share of an element in each direction.
fn moved(parameters: &Array2<f64>, share: f64, stream: u64) -> Array2<f64> {
    let mut random = param_nn::stream(SEED, 100 + stream);
    let most = share / ELEMENTS as f64;
    parameters.mapv(|u| (u + most * (2.0 * random.random::<f64>() - 1.0)).clamp(0.0, 1.0))
}

fn against_brute_force(surface: &Surface, stream: u64, asked: &mut Asked) -> Result<Vec<Vec<String>>> {
    let (parameters, points) = surface.queries(QUERIES, 1 + stream)?;
    let brute_force = BruteForce::new(&surface.map)?;
    let truth: Vec<f64> = (0..QUERIES).map(|i| brute_force.distance(&row(&points, i))).collect::<Result<_>>()?;
    let corner = Array2::zeros((QUERIES, 2));
    let starts = [
        ("warm, 5 % of an element away", moved(&parameters, 0.05, stream), Start::Present),
        ("warm, 25 %", moved(&parameters, 0.25, stream), Start::Present),
        (AWAY, moved(&parameters, 1.0, stream), Start::Present),
        ("nearest of 4 × 4 samples a cell", corner.clone(), Start::Sampled(4)),
        ("global, from a corner", corner, Start::Global),
    ];
    let mut rows = Vec::new();
    for (name, start, kind) in starts {
        let options = FootPointOptions { start: kind, ..FootPointOptions::default() };
        let clock = Clock::start();
        let (_, found, report) = project::<2>(&surface.map, start.view(), points.view(), Boundary::Free, &options)?;
        let micros = 1e6 * clock.seconds() / QUERIES as f64;
        let (equal, most, _) = as_near(&found, &truth, surface.diagonal);
        let bound = match kind {
            Start::Global => Some(100.0),
            Start::Present if name != AWAY => Some(LEAST_WARM),
            _ => None,
        };
        if let Some(bound) = bound {
            let what = format!("foot points, {}, {name}, % as near as brute force", surface.name);
            asked.add(&what, format!("≥ {bound}"), format!("{equal:.3}"), equal >= bound);
        }
        rows.push(vec![
            surface.name.into(),
            name.into(),
            QUERIES.to_string(),
            format!("{equal:.3}"),
            figure(most),
            format!("{:.1}", report.mean_steps),
            format!("{micros:.2}"),
        ]);
    }
    Ok(rows)
}

/// Half the squared distance of a point to a map, as a function of the parameter; beyond the domain it is that of the nearest
/// parameter within.
struct HalfSquared<'a> {
    map: &'a SplineMap<2>,
    point: [f64; 3],
    /// The least value so far: a line search that finds no step is an error, which would lose what was reached.
    least: &'a Cell<f64>,
}

impl HalfSquared<'_> {
    fn residual(&self, u: [f64; 2]) -> Result<[f64; 3], MinimizerError> {
        let value = self.map.eval(u)?;
        Ok([0, 1, 2].map(|k| value[k] - self.point[k]))
    }
}

impl CostFunction for HalfSquared<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, u: &Self::Param) -> Result<f64, MinimizerError> {
        let r = self.residual([u[0].clamp(0.0, 1.0), u[1].clamp(0.0, 1.0)])?;
        let half = 0.5 * dot(&r, &r);
        self.least.set(self.least.get().min(half));
        Ok(half)
    }
}

impl Gradient for HalfSquared<'_> {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;

    fn gradient(&self, u: &Self::Param) -> Result<Vec<f64>, MinimizerError> {
        let inside = [u[0].clamp(0.0, 1.0), u[1].clamp(0.0, 1.0)];
        let r = self.residual(inside)?;
        let mut gradient = vec![0.0; 2];
        for (d, order) in [[1, 0], [0, 1]].into_iter().enumerate() {
            let tangent = self.map.derivative(inside, order)?;
            let slope = (0..3).map(|k| tangent[k] * r[k]).sum();
            gradient[d] = if inside[d] == u[d] { slope } else { 0.0 };
        }
        Ok(gradient)
    }
}

/// Ends a solver of argmin where a step is shorter than a least one: the rule whose influence Table 5.1 shows.
struct LeastStep<S> {
    solver: S,
    least: f64,
}

type Iterate = IterState<Vec<f64>, Vec<f64>, (), (), (), f64>;

impl<'a, S: Solver<HalfSquared<'a>, Iterate>> Solver<HalfSquared<'a>, Iterate> for LeastStep<S> {
    fn name(&self) -> &str {
        self.solver.name()
    }

    fn init(
        &mut self,
        problem: &mut Problem<HalfSquared<'a>>,
        state: Iterate,
    ) -> Result<(Iterate, Option<KV>), MinimizerError> {
        self.solver.init(problem, state)
    }

    fn next_iter(
        &mut self,
        problem: &mut Problem<HalfSquared<'a>>,
        state: Iterate,
    ) -> Result<(Iterate, Option<KV>), MinimizerError> {
        self.solver.next_iter(problem, state)
    }

    fn terminate(&mut self, state: &Iterate) -> TerminationStatus {
        if let (Some(u), Some(before)) = (state.get_param(), state.get_prev_param()) {
            let step = (u[0] - before[0]).hypot(u[1] - before[1]);
            if state.get_iter() > 1 && step < self.least {
                return TerminationStatus::Terminated(TerminationReason::SolverConverged);
            }
        }
        self.solver.terminate(state)
    }
}

/// Foot points by a solver of argmin: distances, and mean steps, of those that end without an error.
fn by_argmin<S>(
    map: &SplineMap<2>,
    start: &Array2<f64>,
    points: &Array2<f64>,
    solver: impl Fn() -> Result<S>,
) -> Result<(Vec<f64>, f64)>
where
    S: for<'a> Solver<HalfSquared<'a>, Iterate>,
{
    let mut distances = Vec::with_capacity(start.nrows());
    let mut steps = 0;
    for i in 0..start.nrows() {
        let u = vec![start[[i, 0]], start[[i, 1]]];
        let least = Cell::new(f64::INFINITY);
        let problem = HalfSquared { map, point: row(points, i), least: &least };
        let configured = |state: Iterate| state.param(u).max_iters(MOST_STEPS).target_cost(0.0);
        let result = Executor::new(problem, solver()?).configure(configured).timer(false).ctrlc(false).run();
        steps += result.map_or(0, |result| result.state.get_iter());
        distances.push((2.0 * least.get()).sqrt());
    }
    Ok((distances, steps as f64 / start.nrows() as f64))
}

/// Most steps of a method.
const MOST_STEPS: u64 = 1000;

/// Corrections of the inverse Hessian that L-BFGS keeps: there are two unknowns.
const MEMORY: usize = 4;

fn methods(surface: &Surface, stream: u64) -> Result<Vec<Vec<String>>> {
    let (parameters, points) = surface.queries(FEW, stream)?;
    let start = moved(&parameters, 0.25, stream);
    // The reach makes the planted distances the true ones; the global search is what brute force has confirmed.
    let global = FootPointOptions { start: Start::Global, ..FootPointOptions::default() };
    let (_, truth, _) = project::<2>(&surface.map, parameters.view(), points.view(), Boundary::Free, &global)?;
    let mut rows = Vec::new();
    let mut report = |name: String, found: &[f64], steps: f64, seconds: f64| {
        let (equal, _, mean) = as_near(found, &truth, surface.diagonal);
        let micros = 1e6 * seconds / FEW as f64;
        rows.push(vec![
            surface.name.into(),
            name,
            format!("{equal:.2}"),
            figure(mean),
            format!("{steps:.1}"),
            format!("{micros:.1}"),
        ]);
    };
    for (name, descent) in descents() {
        let options = FootPointOptions { descent, max_steps: MOST_STEPS as usize, ..FootPointOptions::default() };
        let search = || project::<2>(&surface.map, start.view(), points.view(), Boundary::Free, &options);
        let clock = Clock::start();
        for _ in 1..REPEATED {
            search()?;
        }
        let (_, found, moves) = search()?;
        report(name, &found, moves.mean_steps, clock.seconds() / REPEATED as f64);
    }
    let search = || MoreThuenteLineSearch::new().with_c(1e-4, 0.9).map_err(|error| anyhow::anyhow!("{error}"));
    for least in [1e-6, 1e-12] {
        let clock = Clock::start();
        let solver = || Ok(LeastStep { solver: SteepestDescent::new(search()?), least });
        let (found, steps) = by_argmin(&surface.map, &start, &points, solver)?;
        report(format!("argmin: steepest descent, step ≥ {least:e}"), &found, steps, clock.seconds());
    }
    let clock = Clock::start();
    let (found, steps) = by_argmin(&surface.map, &start, &points, || {
        LBFGS::new(search()?, MEMORY)
            .with_tolerance_grad(1e-12)
            .and_then(|solver| solver.with_tolerance_cost(0.0))
            .map_err(|error| anyhow::anyhow!("{error}"))
            .map(|solver| LeastStep { solver, least: 1e-9 })
    })?;
    report("argmin: L-BFGS, step ≥ 1e-9".into(), &found, steps, clock.seconds());
    Ok(rows)
}

/// Our own methods, by name.
fn descents() -> Vec<(String, Descent)> {
    let mut all = vec![("Newton, trust region".to_owned(), Descent::Newton)];
    for min_step in [1e-3, 1e-6, 1e-9, 1e-12] {
        all.push((format!("gradient descent, step ≥ {min_step:e}"), Descent::Gradient { min_step }));
    }
    all.push(("quasi-Newton, step ≥ 1e-9".into(), Descent::QuasiNewton { min_step: 1e-9 }));
    all
}

/// The role of Table 5.1: one correction after each refinement by each method, on the hull from 16 × 16 elements.
fn fits(data: &Path) -> Result<Vec<Vec<String>>> {
    let cloud = Cloud::read(&data.join("thesis/shiphull_cen.xml")).context("the hull")?;
    let settings = Settings { max_iterations: 5, ..Settings::published([16, 16], 5e-5) };
    let row = |name: &str, run: &Run| {
        let deviation = run.deviation();
        let seconds = format!("{:.2}", run.seconds);
        vec![name.into(), run.dofs().to_string(), figure(deviation.max), figure(deviation.mse), seconds]
    };
    let mut rows = vec![row("none", &Run::of("none", &cloud, None, &settings)?)];
    for (name, descent) in descents() {
        let foot_points = FootPointOptions { descent, max_steps: MOST_STEPS as usize, ..FootPointOptions::default() };
        let method = Method::Alternating { distance: Distance::Point, corrections: 1 };
        rows.push(row(&name, &Run::of(&name, &cloud, Some(method), &Settings { foot_points, ..settings.clone() })?));
    }
    Ok(rows)
}

const INTRODUCTION: &str = "
## Foot points

Two bicubic surfaces of 8 × 8 elements, one of them refined: *waves*, a height field over the square with random heights, and *roll*, a
sheet rolled up by one and a half turns. Queries stand over random places of the surface along its normal, on both sides, up to nine
tenths of its reach (found among pairs of samples): up to there they have one foot point. Truth is brute force: all of
24 × 24 samples in each cell, then a search without derivatives over shrinking neighbourhoods, from the best sample of each cell that
could hold a nearer point. *As near*: not farther than that by more than 1e-9 of the diagonal; *too far at most* is in diagonals.

";

const METHODS: &str = "
Foot points by Newton's method with a trust region, against methods of first order (the role of Table 5.1): 10,000 queries of the same
kind, from parameters up to a quarter of an element away in each direction, at most 1000 steps. The smallest step is in parameters. Those of
argmin use the line search of Moré and Thuente with strong Wolfe conditions. They know no bounds: beyond the square the distance is that of
the nearest parameter, and a search that leaves the square can end there. Their times hold much that is not arithmetic. *Mean excess* is in
diagonals.

";

const FITS: &str = "
The same in a fit: A-PDM on the hull (`thesis/shiphull_cen.xml`) from 16 × 16 elements, one correction after each refinement, ε = 5e-5, at
most five iterations. Table 5.1 shows this on a part that is not public; its entries are lost in the text.

";
