//! A surface under gross outliers, fitted by least squares and robustly:
//! `cargo run --release -p fit-ls --example outliers`.
//!
//! The surface is function (3.13) of Imperatore 2024, with three cusps. Every fifth point is moved by up to 0.9 in z.

use std::error::Error;
use std::ops::ControlFlow;
use std::sync::Arc;

use adaptive::{Iteration, Outcome, run};
use fit_ls::{Lambda, Loss, Options, Reweighted, Reweighting, Robust};
use ndarray::Array2;
use thb_core::{HierarchicalSpace, Kind, KnotVector, Refinement};

const POINTS: usize = 8000;
const TOLERANCE: f64 = 6e-3;

fn height(x: f64, y: f64) -> f64 {
    [-3.0, 0.0, 3.0].iter().map(|c| 2.0 / 3.0 * (-(10.0 * x - c).hypot(10.0 * y - c)).exp()).sum()
}

#[expect(clippy::print_stdout, reason = "an example shows its result")]
fn main() -> Result<(), Box<dyn Error>> {
    // The fractional parts of multiples of two irrational numbers fill the square evenly.
    let parameters =
        Array2::from_shape_fn((POINTS, 2), |(i, d)| ((i + 1) as f64 * [0.754_877_666_2, 0.569_840_291][d]).fract());
    let clean = Array2::from_shape_fn((POINTS, 3), |(i, k)| {
        let (x, y) = (2.0 * parameters[[i, 0]] - 1.0, 2.0 * parameters[[i, 1]] - 1.0);
        [x, y, height(x, y)][k]
    });
    let is_outlier = |i: usize| (i * i + 3 * i) % 47 < 9;
    let mut points = clean.clone();
    for i in (0..POINTS).filter(|&i| is_outlier(i)) {
        let size = 0.05 + 0.85 * (i as f64 * 0.618_033_988_7).fract();
        points[[i, 2]] += if i % 3 == 0 { -size } else { size };
    }

    let fits = [
        ("clean points, least squares", &clean, None),
        ("least squares", &points, None),
        ("Huber", &points, Some(Loss::Huber)),
        ("Tukey", &points, Some(Loss::Tukey)),
        ("Geman–McClure", &points, Some(Loss::GemanMcClure)),
        ("l1.2", &points, Some(Loss::Power(1.2))),
    ];
    for (name, points, loss) in fits {
        let robust = loss.map(|loss| Robust { max_set_aside: 0.3, ..Robust::adaptive::<2>(loss, TOLERANCE) });
        let rules = Reweighting { robust, ..Reweighting::default() };
        let options = Options { lambda: Lambda::Auto { tolerance: TOLERANCE }, ..Options::default() };
        let mut method = Reweighted::<2>::new(parameters.view(), points.view(), None, options, &rules)?;
        let knots = KnotVector::uniform(3, 8)?;
        let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots])?);
        let limits = adaptive::Options {
            tolerance: TOLERANCE,
            refinement: Refinement { extension: [2; 2], max_levels: 6, ..Refinement::default() },
            max_dofs: POINTS,
            ..adaptive::Options::default()
        };
        let mut observer = |_: &Iteration| ControlFlow::Continue(());
        let Outcome { map, history, .. } = run(&mut method, space, &limits, &mut observer)?;
        // The error at the points that are no outliers.
        let image = map.eval_batch(parameters.view())?;
        let squares = |i: usize| (0..3).map(|k| (image[[i, k]] - clean[[i, k]]).powi(2)).sum::<f64>();
        let sound: Vec<usize> = (0..POINTS).filter(|&i| !is_outlier(i)).collect();
        let rmse = (sound.iter().map(|&i| squares(i)).sum::<f64>() / sound.len() as f64).sqrt();
        let gross = method.weights().gross();
        let (all, wrong) = (gross.iter().filter(|g| **g).count(), sound.iter().filter(|&&i| gross[i]).count());
        let dofs = history.last().map_or(0, |last| last.dofs);
        println!(
            "{name}: error at sound points {rmse:.2e}, {dofs} functions, {all} points set aside, {wrong} of them sound"
        );
    }
    Ok(())
}
