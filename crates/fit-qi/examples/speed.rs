//! Adaptive quasi-interpolation of a million points over six levels: time, and work per iteration.
//!
//!     cargo run --release -p fit-qi --example speed [degree] [points]
//!
//! Fits `f(x, y) = ⅔ (e^{−|(10x−3, 10y−3)|} + e^{−|(10x+3, 10y+3)|} + e^{−|(10x, 10y)|})` with its three cusps at random
//! points of [−1, 1]².

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use adaptive::{Iteration, run};
use fit_qi::{LocalLambda, Options, QuasiInterpolation};
use ndarray::Array2;
use thb_core::{HierarchicalSpace, Kind, KnotVector, Refinement};

#[expect(clippy::print_stdout, reason = "an example prints its result")]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1).map(|text| text.parse::<usize>());
    let degree = arguments.next().unwrap_or(Ok(2))?;
    let m = arguments.next().unwrap_or(Ok(1_000_000))?;
    let mut state = 1_u64;
    let parameters = Array2::from_shape_simple_fn((m, 2), || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    });
    let points = Array2::from_shape_fn((m, 3), |(i, k)| {
        let (x, y) = (2.0 * parameters[[i, 0]] - 1.0, 2.0 * parameters[[i, 1]] - 1.0);
        let cusp = |shift: f64| (-(10.0 * x + shift).hypot(10.0 * y + shift)).exp();
        [x, y, 2.0 / 3.0 * (cusp(-3.0) + cusp(3.0) + cusp(0.0))][k]
    });
    let knots = KnotVector::uniform(degree, 16)?;
    let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots])?);
    let start = Instant::now();
    let options = Options { lambda: LocalLambda::Constant(1e-9), ..Options::default() };
    let mut method = QuasiInterpolation::new(parameters.view(), points.view(), None, options)?;
    let rules = adaptive::Options {
        tolerance: 1e-5,
        within: 1.0,
        refinement: Refinement { extension: [0; 2], max_levels: 6, ..Refinement::default() },
        ..adaptive::Options::default()
    };
    let mut go_on = |_: &Iteration| ControlFlow::Continue(());
    let outcome = run(&mut method, space, &rules, &mut go_on)?;
    let all = start.elapsed().as_secs_f64();
    println!(
        "{:>7} {:>7} {:>9} {:>11} {:>11} {:>8} {:>8} {:>8} {:>8}",
        "dofs", "solved", "summed", "max", "mse", "sort", "solve", "errors", "refine"
    );
    for (work, i) in method.work().iter().zip(&outcome.history) {
        let (d, s) = (i.deviation, i.seconds);
        println!(
            "{:7} {:7} {:9} {:11.4e} {:11.4e} {:8.4} {:8.4} {:8.4} {:8.4}",
            i.dofs, work.solved, work.summed, d.max, d.mse, s.assemble, s.solve, s.estimate, s.refine
        );
    }
    println!("{} levels, {}, {all:.3} s", outcome.map.space().n_levels(), outcome.stop.name());
    Ok(())
}
