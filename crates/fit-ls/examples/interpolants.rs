//! A weighted least-squares fit taken apart into interpolants: the worked example of Imperatore 2024, §3.1.5.
//!
//! `cargo run -p fit-ls --example interpolants`
#![expect(clippy::print_stdout, reason = "an example shows its results")]

use std::error::Error;
use std::sync::Arc;

use fit_ls::{Lambda, LeastSquares, Options, schoenberg_whitney, wls_as_interpolants, wls_limit};
use ndarray::{Array1, array};
use thb_core::{CellSpace, HierarchicalSpace, Kind, KnotVector};

fn main() -> Result<(), Box<dyn Error>> {
    let sites = array![[-4.5], [-3.5], [-2.2], [-1.2], [0.8], [2.2], [4.0]];
    let values = array![[-2.0], [0.0], [-1.0], [2.8], [2.9], [0.5], [-2.0]];
    // Weights spread over (0, 1).
    let weights = Array1::from_shape_fn(7, |i| (0.618_033_988_749_895 * (i + 1) as f64).fract());

    let polynomials = KnotVector::uniform(2, 1)?.on_interval(-5.0, 5.0)?;
    let splines = KnotVector::new(2, vec![-5.0, -5.0, -5.0, -5.0 / 3.0, 5.0 / 3.0, 5.0, 5.0, 5.0])?;
    for (name, knots) in [("quadratic polynomials", polynomials), ("quadratic splines", splines)] {
        let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone()])?);
        let sum = wls_as_interpolants(&space, sites.view(), values.view(), Some(weights.view()))?;
        let combined = sum.map()?;
        let options = Options { lambda: Lambda::Fixed(0.0), ..Options::default() };
        let solved = LeastSquares::new(sites.view(), values.view(), Some(weights.view()), options)?.fit(&space)?;
        let mut largest = 0.0_f64;
        for k in 0..=1000 {
            let u = [-5.0 + 10.0 * f64::from(k) / 1000.0];
            let difference = combined.eval(u)?[0] - solved.eval(u)?[0];
            largest = largest.max(difference.abs());
            let [low, high] = sum.derivative_bounds(u, [1])?[0];
            let slope = solved.derivative(u, [1])?[0];
            assert!(low - 1e-9 <= slope && slope <= high + 1e-9, "(3.11) is violated at {}", u[0]);
        }
        println!("{name}, {} functions:", space.n_functions());
        println!("  {} subsets of the 7 points, {} interpolants", sum.n_subsets(), sum.interpolants().len());
        println!("  combination against normal equations: {largest:.1e}; slopes within the bounds (3.11)");

        let subset: Vec<f64> = (0..5).map(|i| sites[[i, 0]]).collect();
        println!("  first five points meet the nesting condition: {}", schoenberg_whitney(&knots, &subset));
        let limit = wls_limit(&space, sites.view(), values.view(), Some(weights.view()), &[3])?.map()?;
        println!("  limit of infinite weight at point 4: {:+.1e} off it", limit.eval([-1.2])?[0] - 2.8);
    }
    Ok(())
}
