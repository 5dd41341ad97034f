//! Milliseconds of processor time that the embedded networks take for sequences and grids of several sizes:
//! `cargo run --release -p param-nn --example parcnn_timing`.

#[path = "clock/mod.rs"]
mod clock;

use ndarray::Array3;
use param_nn::{GriddedSpec, NnError, Parcnn, Shape, SplineSpace, stream};

#[expect(clippy::print_stdout, reason = "an example reports to its user")]
fn main() -> Result<(), NnError> {
    let space = SplineSpace::polynomials(3);
    for dimension in [2, 3] {
        let network = Parcnn::embedded(dimension, 1)?;
        for count in [20, 100, 1000] {
            let spec = GriddedSpec { shape: Shape::Curve { degree: 3, dimension }, size: [count, 1], noise: 0.0 };
            let points = spec.sample(&mut stream(1, 0))?.points;
            let [time, _] = clock::milliseconds(|| network.predict_sequence(points.view(), space).map(|_| ()))?;
            println!("{count:5} points, dimension {dimension}: {time:8.2} ms");
        }
    }
    let network = Parcnn::embedded(3, 2)?;
    for count in [12, 33, 55, 100] {
        let spec = GriddedSpec { shape: Shape::Surface { degree: 3 }, size: [count, count], noise: 0.0 };
        let points = spec.sample(&mut stream(1, 0))?.points;
        let grid = Array3::from_shape_fn((count, count, 3), |(i, j, k)| points[[i * count + j, k]]);
        let [time, _] = clock::milliseconds(|| network.predict_grid(grid.view(), space).map(|_| ()))?;
        println!("{count:3} × {count:3} points: {time:8.2} ms");
    }
    Ok(())
}
