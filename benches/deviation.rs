//! Measuring a surface against a scan, as the last step of a fit does: 10⁴, 10⁵ and 10⁶ points, as a mesh and as a cloud.
//!
//! `RAYON_NUM_THREADS=1 cargo bench -p workspace-benches --bench deviation`. Throughput is in points and triangles: at most
//! 0.1 s + 4 µs each is asked for on one thread.

use std::hint::black_box;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use deviation::{Scan, Thresholds, measure};
use fit_ls::{Lambda, LeastSquares, Options};
use ndarray::Array2;
use std::sync::Arc;
use thb_core::{HierarchicalSpace, Kind, KnotVector, SplineMap};

/// Elements per direction of the surface that is measured.
const ELEMENTS: usize = 24;

/// Points per side of the grids.
const SIDES: [usize; 3] = [100, 316, 1000];

/// Share of the diagonal that the tolerance is.
const TOLERANCE: f64 = 1e-3;

fn place(u: f64, v: f64) -> [f64; 3] {
    [u, v, 0.08 * ((9.0 * u).sin() + (7.0 * v + 2.0 * u).cos())]
}

/// Parameters and points of a grid, moved a little off the surface.
fn grid(side: usize) -> (Array2<f64>, Vec<[f64; 3]>) {
    let at = |i: usize| i as f64 / (side - 1) as f64;
    let parameters = Array2::from_shape_fn((side * side, 2), |(i, d)| at([i % side, i / side][d]));
    let noise = |i: usize| 1e-4 * ((i.wrapping_mul(2_654_435_761) % 1000) as f64 / 500.0 - 1.0);
    let points = (0..side * side)
        .map(|i| {
            let [x, y, z] = place(parameters[[i, 0]], parameters[[i, 1]]);
            [x, y, z + noise(i)]
        })
        .collect();
    (parameters, points)
}

fn triangles(side: usize) -> Vec<[u32; 3]> {
    let cell = |k: usize| {
        let i = (k / (side - 1) * side + k % (side - 1)) as u32;
        let up = side as u32;
        [[i, i + 1, i + up], [i + up, i + 1, i + up + 1]]
    };
    (0..(side - 1) * (side - 1)).flat_map(cell).collect()
}

fn surface() -> SplineMap<2> {
    let (parameters, points) = grid(100);
    let points = Array2::from_shape_fn((points.len(), 3), |(i, k)| points[i][k]);
    let knots = KnotVector::uniform(3, ELEMENTS).unwrap();
    let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap());
    let options = Options { lambda: Lambda::Fixed(1e-9), ..Options::default() };
    LeastSquares::new(parameters.view(), points.view(), None, options).unwrap().fit(&space).unwrap()
}

fn measures(criterion: &mut Criterion) {
    let map = surface();
    let thresholds = Thresholds::default();
    let mut group = criterion.benchmark_group("deviation");
    group.sample_size(10).warm_up_time(Duration::from_millis(200));
    for side in SIDES {
        let (parameters, points) = grid(side);
        let of_mesh = triangles(side);
        for (name, triangles) in [("mesh", &of_mesh[..]), ("cloud", &[][..])] {
            group.throughput(Throughput::Elements((points.len() + triangles.len()) as u64));
            group.bench_function(BenchmarkId::new(name, points.len()), |bencher| {
                bencher.iter(|| {
                    let scan = match triangles.is_empty() {
                        true => Scan::cloud(&points),
                        false => Scan::mesh(&points, triangles),
                    };
                    measure(&map, &black_box(scan.unwrap()), Some(parameters.view()), TOLERANCE, &thresholds).unwrap()
                });
            });
        }
    }
    group.finish();
}

criterion_group!(benches, measures);
criterion_main!(benches);
