//! Warm-started foot points of a million points beside a bicubic (and a biquadratic) surface, on one thread and on two.

use std::hint::black_box;
use std::sync::Arc;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion, Throughput};
use fit_ls::SortedPoints;
use moving_param::{Boundary, Constraints, FootPointOptions, foot_points};
use ndarray::Array2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use thb_core::{CellSpace, HierarchicalSpace, Kind, KnotVector, SplineMap};
use workspace_benches::problem::Failure;

const POINTS: usize = 1_000_000;

/// Elements per direction.
const ELEMENTS: usize = 32;

/// How far the points stand off the surface, whose bumps are 20 times as high.
const OFF: f64 = 1e-3;

/// How far parameters are from the foot point at most, in elements.
const AWAY: f64 = 0.05;

fn main() -> Result<(), Failure> {
    let mut criterion = Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(5))
        .configure_from_args();
    let mut group = criterion.benchmark_group("foot points");
    group.throughput(Throughput::Elements(POINTS as u64));
    for degree in [2, 3] {
        let (map, points, constraints) = problem(degree)?;
        for threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
            let id = BenchmarkId::new(format!("degree {degree}"), format!("{threads} threads"));
            group.bench_function(id, |bencher| {
                let options = FootPointOptions::default();
                bencher.iter(|| pool.install(|| black_box(foot_points(&map, &points, &constraints, &options)).is_ok()));
            });
        }
    }
    group.finish();
    criterion.final_summary();
    Ok(())
}

type Problem = (SplineMap<2>, SortedPoints<2>, Constraints<2>);

/// A bumpy sheet, and points beside it that start near their foot points.
fn problem(degree: usize) -> Result<Problem, Failure> {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let knots = KnotVector::uniform(degree, ELEMENTS)?;
    let count = knots.n_functions();
    let space = HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots])?;
    let coefficients = Array2::from_shape_fn((space.n_functions(), 3), |(i, k)| match k {
        0 => (i % count) as f64 / count as f64,
        1 => (i / count) as f64 / count as f64,
        _ => 20.0 * OFF * random.random::<f64>(),
    });
    let map = SplineMap::new(Arc::new(space), coefficients)?;
    let exact = Array2::from_shape_simple_fn((POINTS, 2), || random.random::<f64>());
    let points = map.eval_batch(exact.view())?.mapv(|x| x + OFF * (random.random::<f64>() - 0.5));
    let most = 2.0 * AWAY / ELEMENTS as f64;
    let start = exact.mapv(|u| (u + most * (random.random::<f64>() - 0.5)).clamp(0.0, 1.0));
    let mut sorted = SortedPoints::new(start.view(), points.view(), None)?;
    sorted.sort_refined(map.space(), None)?;
    let constraints = Constraints::new(start.view(), map.space().domain(), Boundary::Kept);
    Ok((map, sorted, constraints))
}
