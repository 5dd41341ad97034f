//! Normal equations and error evaluation of a million sorted points, beside their floors, on one thread and on two.
//!
//! Criterion keeps each figure; the ratios printed at the end come from runs of floor and code in turn, so that a
//! change of the machine's speed meets both.

use std::hint::black_box;
use std::time::{Duration, Instant};

use criterion::{Criterion, Throughput};
use fit_ls::{LeastSquares, NormalEquations, SortedPoints};
use rayon::ThreadPool;
use thb_core::SymmetricPattern;
use workspace_benches::floor::{self, Assembly, Columns};
use workspace_benches::problem::{self, Failure};

const POINTS: usize = 1_000_000;

/// The loop stops at the first space with so many functions.
const DOFS: usize = 3000;

/// Runs of each kernel for the table of ratios; the fastest counts.
const ROUNDS: usize = 15;

/// Largest difference between floor and code in the distances, relative to the largest coordinate (1).
const AGREEMENT: f64 = 1e-13;

type Kernel<'a> = (&'static str, Box<dyn FnMut() + Send + 'a>);

#[expect(clippy::print_stdout, reason = "a benchmark prints its result")]
fn main() -> Result<(), Failure> {
    let mut criterion = Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(2))
        .configure_from_args();
    let mut table = Vec::new();
    for degree in [2, 3] {
        measure(degree, &mut criterion, &mut table)?;
    }
    criterion.final_summary();
    table.iter().for_each(|line| println!("{line}"));
    Ok(())
}

fn measure(degree: usize, criterion: &mut Criterion, table: &mut Vec<String>) -> Result<(), Failure> {
    let (parameters, points) = problem::points(POINTS);
    let mut method = LeastSquares::new(parameters.view(), points.view(), None, problem::fitting())?;
    let map = problem::adapt(&mut method, degree, DOFS)?.map;
    let (space, bezier) = (map.space(), map.bezier());
    let mut sorted = SortedPoints::new(parameters.view(), points.view(), None)?;
    sorted.sort_refined(space, None)?;
    let pattern = SymmetricPattern::new(space.as_ref());
    let cells = bezier.n_cells();
    let columns = Columns::new(&sorted, points.view(), (0..cells).map(|cell| bezier.cell_box(cell)).collect());
    let coefficients: Vec<f64> = (0..cells).flat_map(|cell| bezier.cell_coefficients(cell).to_vec()).collect();
    let mut distances = vec![0.0; POINTS];

    floor::evaluate(&columns, degree, &coefficients, &mut distances);
    let pairs = distances.iter().zip(method.distances(&map)?);
    let difference = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    if difference > AGREEMENT {
        return Err(format!("floor and code differ by {difference:e} in the distances").into());
    }

    table.push(format!("degree {degree}, {} functions, {cells} cells, {POINTS} points", pattern.n()));
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
        let (columns, coefficients) = (&columns, &coefficients);
        let direct = || floor::assemble(columns, degree, Assembly::Direct);
        let moments = || floor::assemble(columns, degree, Assembly::Moments);
        let assembly = || {
            black_box(NormalEquations::new(space.as_ref(), &pattern, &sorted).is_ok());
        };
        let mut kernels: [Kernel<'_>; 5] = [
            ("assembly, floor of direct sums", Box::new(direct)),
            ("assembly, floor of moments", Box::new(moments)),
            ("assembly, NormalEquations::new", Box::new(assembly)),
            (
                "errors, floor",
                Box::new(|| {
                    floor::evaluate(columns, degree, coefficients, &mut distances);
                    black_box(&distances);
                }),
            ),
            (
                "errors, LeastSquares::distances",
                Box::new(|| {
                    black_box(method.distances(&map).is_ok());
                }),
            ),
        ];
        let mut group = criterion.benchmark_group(format!("degree {degree}, {threads} thread(s)"));
        group.throughput(Throughput::Elements(POINTS as u64));
        for (name, kernel) in &mut kernels {
            group.bench_function(*name, |bencher| pool.install(|| bencher.iter(&mut *kernel)));
        }
        group.finish();
        table.extend(ratios(&pool, &mut kernels));
    }
    Ok(())
}

/// Million points a second of each kernel, and of the code the time relative to its floors.
fn ratios(pool: &ThreadPool, kernels: &mut [Kernel<'_>; 5]) -> Vec<String> {
    let mut best = [f64::INFINITY; 5];
    for _ in 0..ROUNDS {
        for ((_, kernel), best) in kernels.iter_mut().zip(&mut best) {
            let seconds = pool.install(|| {
                let start = Instant::now();
                kernel();
                start.elapsed().as_secs_f64()
            });
            *best = best.min(seconds);
        }
    }
    let threads = pool.current_num_threads();
    let line = |i: usize, ratio: String| {
        format!("  {:32} {threads} thread(s) {:7.1} M points/s{ratio}", kernels[i].0, 1e-6 * POINTS as f64 / best[i])
    };
    let assembly = format!("   {:.2} × direct, {:.2} × moments", best[2] / best[0], best[2] / best[1]);
    let errors = format!("   {:.2} × floor", best[4] / best[3]);
    [String::new(), String::new(), assembly, String::new(), errors]
        .into_iter()
        .enumerate()
        .map(|(i, ratio)| line(i, ratio))
        .collect()
}
