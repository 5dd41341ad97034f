//! One trial of a joint step on a hundred thousand points, without factorization: equations, parameters that follow, energies. Degree 3, with
//! springs, cohesion and triangles; beside it the floor of the foot points alone, on one thread and on two.

use std::hint::black_box;
use std::sync::Arc;
use std::time::Duration;

use adaptive::Solve;
use criterion::{BenchmarkId, Criterion, Throughput};
use fit_ls::Lambda;
use moving_param::{Boundary, Constraints, FootPointOptions, JointOptions, Method, MovingFit, Options, foot_points};
use ndarray::Array2;
use thb_core::{HierarchicalSpace, Kind, KnotVector, SplineMap};
use workspace_benches::problem::Failure;

/// Points along each side.
const PER_SIDE: usize = 316;

/// Elements along each side.
const ELEMENTS: usize = 32;

const DEGREE: usize = 3;

/// How far parameters are from where they should be at most, in elements.
const AWAY: f64 = 0.1;

fn main() -> Result<(), Failure> {
    let mut criterion = Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(3))
        .configure_from_args();
    let (mut method, map) = problem()?;
    let mut group = criterion.benchmark_group("joint trial");
    group.throughput(Throughput::Elements((PER_SIDE * PER_SIDE) as u64));
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
        let options = JointOptions::default();
        // Criterion takes no errors: a failed trial counts as no time, and shows.
        group.bench_function(BenchmarkId::new("trial", format!("{threads} threads")), |bencher| {
            bencher.iter_custom(|trials| {
                let trials = trials.min(u64::from(u32::MAX)) as u32;
                let mean = pool.install(|| method.time_trials(&map, &options, trials));
                mean.map_or(Duration::ZERO, |mean| mean * trials)
            });
        });
        let floor = FootPointOptions { max_steps: options.polish, ..FootPointOptions::default() };
        let constraints = Constraints::in_space(method.parameters().view(), map.space().as_ref(), Boundary::Kept);
        group.bench_function(BenchmarkId::new("its foot points", format!("{threads} threads")), |bencher| {
            let search = || black_box(foot_points(&map, method.points(), &constraints, &floor)).is_ok();
            bencher.iter(|| pool.install(search));
        });
    }
    group.finish();
    criterion.final_summary();
    Ok(())
}

/// A bumpy sheet with triangles over its points, whose parameters are off, and the first fit to it.
fn problem() -> Result<(MovingFit<2>, SplineMap<2>), Failure> {
    let along = |i: usize| i as f64 / (PER_SIDE - 1) as f64;
    let uv = |i: usize| [along(i % PER_SIDE), along(i / PER_SIDE)];
    let off = |u: f64| u + AWAY / ELEMENTS as f64 * (40.0 * u).sin() * 4.0 * u * (1.0 - u);
    let parameters = Array2::from_shape_fn((PER_SIDE * PER_SIDE, 2), |(i, d)| off(uv(i)[d]));
    let points = Array2::from_shape_fn((PER_SIDE * PER_SIDE, 3), |(i, k)| {
        let [u, v] = uv(i);
        [u, v, 0.05 * (30.0 * u).sin() * (25.0 * v).cos()][k]
    });
    let row = PER_SIDE as u32;
    let triangles: Vec<[u32; 3]> = (0..row * (row - 1))
        .filter(|i| i % row != row - 1)
        .flat_map(|i| [[i, i + 1, i + row + 1], [i, i + row + 1, i + row]])
        .collect();
    let knots = KnotVector::uniform(DEGREE, ELEMENTS)?;
    let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots])?);
    let fitting = fit_ls::Options { lambda: Lambda::Fixed(1e-9), ..fit_ls::Options::default() };
    let joint = JointOptions { max_steps: 0, emphasis: 0, ..JointOptions::default() };
    let options = Options { method: Method::Joint(joint), guard: false, ..Options::default() };
    let method = MovingFit::new(parameters.view(), points.view(), None, fitting, options)?;
    let mut method = method.with_triangles(&triangles)?;
    let map = method.solve(&space, None)?.map;
    Ok((method, map))
}
