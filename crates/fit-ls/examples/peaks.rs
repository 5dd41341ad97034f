//! Adaptive fitting of scattered data, iteration by iteration.
//!
//! Fits `f(x, y) = ⅔ (e^{−|(10x−3, 10y−3)|} + e^{−|(10x+3, 10y+3)|} + e^{−|(10x, 10y)|})` with its three cusps, from the
//! points of a CSV file with the columns u, v, x, y, z, or from a million random points if no file is named.

use std::ops::ControlFlow;
use std::sync::Arc;

use adaptive::{Iteration, Options, run};
use fit_ls::{Lambda, LeastSquares};
use ndarray::Array2;
use thb_core::{HierarchicalSpace, Kind, KnotVector, Quadrature};

#[expect(clippy::print_stdout, reason = "an example prints its result")]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (parameters, points) = match std::env::args().nth(1) {
        Some(file) => read(&std::fs::read_to_string(file)?)?,
        None => generate(1_000_000),
    };
    let knots = KnotVector::uniform(2, 8)?;
    let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots])?);
    let start = std::time::Instant::now();
    let fitting = fit_ls::Options { lambda: Lambda::Fixed(1e-7), quadrature: Quadrature::GaussP, lengths: [1.0; 2] };
    let mut method = LeastSquares::new(parameters.view(), points.view(), None, fitting)?;
    let options = Options { tolerance: 1e-4, within: 1.0, max_iterations: 7, ..Options::default() };
    println!("{:>5} {:>13} {:>13} {:>9} {:>9} {:>9}", "dofs", "max", "mse", "assemble", "solve", "estimate");
    let mut print = |i: &Iteration| {
        let (d, s) = (i.deviation, i.seconds);
        println!("{:5} {:13.6e} {:13.6e} {:9.4} {:9.4} {:9.4}", i.dofs, d.max, d.mse, s.assemble, s.solve, s.estimate);
        ControlFlow::Continue(())
    };
    let outcome = run(&mut method, space, &options, &mut print)?;
    let refine: f64 = outcome.history.iter().map(|i| i.seconds.refine).sum();
    println!("refine {refine:.4}, all {:.4} s", start.elapsed().as_secs_f64());
    Ok(())
}

fn read(text: &str) -> Result<(Array2<f64>, Array2<f64>), Box<dyn std::error::Error>> {
    let values =
        text.lines().skip(1).flat_map(|line| line.split(',')).map(str::parse).collect::<Result<Vec<f64>, _>>()?;
    let table = Array2::from_shape_vec((values.len() / 5, 5), values)?;
    let (parameters, points) = table.view().split_at(ndarray::Axis(1), 2);
    Ok((parameters.to_owned(), points.to_owned()))
}

fn generate(m: usize) -> (Array2<f64>, Array2<f64>) {
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
    (parameters, points)
}
