//! Milliseconds that the embedded network takes for clouds of several sizes, read once and averaged:
//! `cargo run --release -p param-nn --example bidgcn_timing`.

#[path = "clock/mod.rs"]
mod clock;

use ndarray::Axis;
use param_nn::{Bidgcn, ControlPoints, NnError, Reading, ScatteredSpec, stream};

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
        let time = |network: &Bidgcn| {
            clock::milliseconds(|| network.predict(cloud.points.view(), &boundary, parameters.view()).map(|_| ()))
        };
        let ([once, once_wall], [averaged, averaged_wall]) = (time(&once)?, time(&averaged)?);
        println!(
            "{interior:6} interior points: {once:7.2} ms, {once_wall:7.2} by the clock; \
             averaged {averaged:7.2} ms, {averaged_wall:7.2} by the clock"
        );
    }
    Ok(())
}
