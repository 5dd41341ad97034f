//! Largest errors of quasi-interpolants of a smooth function under uniform refinement, and their orders.
//!
//!     cargo run --release -p fit-qi --example convergence
//!
//! prints the table of the page on quasi-interpolation: `sin(3u + 2v)` on a grid of 512 × 512 points, no smoothing.

use std::sync::Arc;

use fit_qi::{LocalLambda, Options, QuasiInterpolation};
use ndarray::Array2;
use thb_core::{HierarchicalSpace, Kind, KnotVector};

/// Points per direction: eight in each cell of the finest space.
const POINTS: usize = 512;

/// Sites per direction at which errors are measured.
const SITES: usize = 301;

#[expect(clippy::print_stdout, reason = "an example prints its result")]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let parameters = Array2::from_shape_fn((POINTS * POINTS, 2), |(i, d)| {
        ([i % POINTS, i / POINTS][d] as f64 + 0.5) / POINTS as f64
    });
    let sites =
        Array2::from_shape_fn((SITES * SITES, 2), |(i, d)| [i % SITES, i / SITES][d] as f64 / (SITES - 1) as f64);
    let f =
        |uv: &Array2<f64>| Array2::from_shape_fn((uv.nrows(), 1), |(i, _)| (3.0 * uv[[i, 0]] + 2.0 * uv[[i, 1]]).sin());
    let (points, exact) = (f(&parameters), f(&sites));
    println!("| elements | d = 1 | order | d = 2 | order | d = 3 | order | d = 4 | order |");
    println!("|---:|---:|---:|---:|---:|---:|---:|---:|---:|");
    let mut before = [f64::NAN; 4];
    for elements in [4, 8, 16, 32, 64] {
        let mut row = format!("| {elements} × {elements} |");
        for (degree, before) in (1..=4).zip(&mut before) {
            let knots = KnotVector::uniform(degree, elements)?;
            let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots])?);
            let options = Options { lambda: LocalLambda::Constant(0.0), ..Options::default() };
            let mut method = QuasiInterpolation::new(parameters.view(), points.view(), None, options)?;
            let values = method.fit(&space)?.eval_batch(sites.view())?;
            let error = (&values - &exact).iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            let order = (*before / error).log2();
            let order = if order.is_nan() { String::new() } else { format!("{order:.2}") };
            row += &format!(" {error:.2e} | {order} |");
            *before = error;
        }
        println!("{row}");
    }
    Ok(())
}
