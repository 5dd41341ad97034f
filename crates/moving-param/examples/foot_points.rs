//! Speed of warm-started foot points: a million points beside a bicubic surface on 32 × 32 elements.

use std::sync::Arc;
use std::time::Instant;

use moving_param::{Boundary, FootPointOptions, foot_points};
use ndarray::Array2;
use thb_core::{CellSpace, HierarchicalSpace, Kind, KnotVector, SplineMap};

#[expect(clippy::print_stdout, reason = "an example prints its result")]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    const POINTS: usize = 1_000_000;
    let mut state = 1_u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    for degree in [2, 3] {
        let knots = KnotVector::uniform(degree, 32)?;
        let count = knots.n_functions();
        let space = HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots])?;
        let coefficients = Array2::from_shape_fn((space.n_functions(), 3), |(i, k)| match k {
            0 => (i % count) as f64 / count as f64,
            1 => (i / count) as f64 / count as f64,
            _ => 0.02 * random(),
        });
        let map = SplineMap::new(Arc::new(space), coefficients)?;
        let exact = Array2::from_shape_simple_fn((POINTS, 2), &mut random);
        let points = map.eval_batch(exact.view())?.mapv(|x| x + 1e-3 * (random() - 0.5));
        // A twentieth of a cell.
        let start = exact.mapv(|u| (u + 0.1 / 32.0 * (random() - 0.5)).clamp(0.0, 1.0));
        let mut sorted = fit_ls::SortedPoints::new(start.view(), points.view(), None)?;
        sorted.sort_refined(map.space(), None)?;
        let constraints = moving_param::Constraints::new(start.view(), map.space().domain(), Boundary::Kept);
        let clock = Instant::now();
        let found = foot_points(&map, &sorted, &constraints, &FootPointOptions::default())?;
        let seconds = clock.elapsed().as_secs_f64();
        println!("degree {degree}: {:.2e} projections a second, {:?}", POINTS as f64 / seconds, found.report);
    }
    Ok(())
}
