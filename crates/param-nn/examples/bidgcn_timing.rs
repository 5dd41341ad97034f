//! Milliseconds that the embedded network takes for clouds of several sizes:
//! `cargo run --release -p param-nn --example bidgcn_timing`.

use std::time::Instant;

use ndarray::Axis;
use param_nn::{Bidgcn, ControlPoints, NnError, ScatteredSpec, stream};

/// Runs of each size; the fastest counts, since other programs only make them slower.
const RUNS: usize = 7;

#[expect(clippy::print_stdout, reason = "an example reports to its user")]
fn main() -> Result<(), NnError> {
    let network = Bidgcn::embedded()?;
    for interior in [200, 500, 1000, 2000, 5000, 9000] {
        let spec = ScatteredSpec { control_points: ControlPoints::Jittered, degree: 2, interior, noise: 0.0 };
        let cloud = spec.sample(&mut stream(1, 0))?;
        let rows: Vec<usize> = (interior..cloud.points.nrows()).collect();
        let boundary: Vec<u32> = rows.iter().map(|&row| row as u32).collect();
        let parameters = cloud.parameters.select(Axis(0), &rows);
        let mut fastest = f64::INFINITY;
        for _ in 0..RUNS {
            let start = Instant::now();
            network.predict(cloud.points.view(), &boundary, parameters.view())?;
            fastest = fastest.min(start.elapsed().as_secs_f64() * 1e3);
        }
        println!("{interior:6} interior points: {fastest:8.2} ms");
    }
    Ok(())
}
