//! Milliseconds that the embedded network takes for clouds of several sizes, read once and averaged:
//! `cargo run --release -p param-nn --example bidgcn_timing`.

use std::time::Instant;

use ndarray::Axis;
use param_nn::{Bidgcn, ControlPoints, NnError, Reading, ScatteredSpec, stream};

/// Runs of each size; the fastest counts, since other programs only make them slower.
const RUNS: usize = 15;

#[expect(clippy::print_stdout, reason = "an example reports to its user")]
fn main() -> Result<(), NnError> {
    let once = Bidgcn::embedded()?;
    let averaged = once.clone().read_as(Reading::BEST);
    for interior in [200, 500, 1000, 2000, 5000, 9000] {
        let spec = ScatteredSpec { control_points: ControlPoints::Jittered, degree: 2, interior, noise: 0.0 };
        let cloud = spec.sample(&mut stream(1, 0))?;
        let rows: Vec<usize> = (interior..cloud.points.nrows()).collect();
        let boundary: Vec<u32> = rows.iter().map(|&row| row as u32).collect();
        let parameters = cloud.parameters.select(Axis(0), &rows);
        let mut fastest = [f64::INFINITY; 2];
        for _ in 0..RUNS {
            for (network, fastest) in [&once, &averaged].into_iter().zip(&mut fastest) {
                let start = Instant::now();
                network.predict(cloud.points.view(), &boundary, parameters.view())?;
                *fastest = fastest.min(start.elapsed().as_secs_f64() * 1e3);
            }
        }
        let [once, averaged] = fastest;
        println!("{interior:6} interior points: {once:8.2} ms, averaged {averaged:8.2} ms");
    }
    Ok(())
}
