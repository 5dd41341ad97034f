//! Tests of normals, curvatures and noise.

use super::*;

#[test]
fn normals_and_curvatures_of_a_sphere_and_a_cylinder() {
    // Fibonacci points on a sphere of radius 2: the normals all point inwards or all outwards, both curvatures ±1/2.
    let m = 2000;
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let sphere = Array2::from_shape_fn((m, 3), |(i, k)| {
        let z = 1.0 - (2 * i + 1) as f64 / m as f64;
        let (r, t) = ((1.0 - z * z).sqrt(), golden * i as f64);
        2.0 * [r * t.cos(), r * t.sin(), z][k]
    });
    let frames = LocalFrames::estimate(sphere.view()).unwrap();
    let radial: Vec<f64> = (0..m).map(|i| frames.normals.row(i).dot(&sphere.row(i)) / 2.0).collect();
    assert!(radial.iter().all(|r| r.signum() == radial[0].signum() && r.abs() > 0.999));
    assert!(frames.curvatures.iter().all(|k| (k * -radial[0].signum() - 0.5).abs() < 0.03));
    assert!(frames.noise < 1e-4);

    let half_cylinder = Array2::from_shape_fn((1250, 3), |(i, k)| {
        let t = std::f64::consts::PI * (i / 25) as f64 / 49.0;
        [t.cos(), t.sin(), (i % 25) as f64 * 0.06][k]
    });
    let frames = LocalFrames::estimate(half_cylinder.view()).unwrap();
    let curvature: Vec<f64> = frames.curvatures.rows().into_iter().map(|c| c[0].abs().max(c[1].abs())).collect();
    assert!((median(curvature) - 1.0).abs() < 0.02);
    assert!(frames.curvatures.rows().into_iter().all(|c| c[0].abs().min(c[1].abs()) < 0.05));
}

#[test]
fn the_noise_of_a_bumpy_sheet_is_measured_below_and_above_its_spacing() {
    let side = 50;
    for sigma in [0.002, 0.01, 0.03] {
        let mut state = 1u64;
        let mut uniform = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        let sheet: Vec<f64> = (0..side * side)
            .flat_map(|i| {
                let (x, y) = ((i / side) as f64 / side as f64, (i % side) as f64 / side as f64);
                // The sum of twelve uniform numbers is close to normal.
                let noise = (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
                [x, y, 0.1 * (3.0 * x).sin() * (2.0 * y).cos() + sigma * noise]
            })
            .collect();
        let points = Array2::from_shape_vec((side * side, 3), sheet).unwrap();
        let noise = LocalFrames::estimate(points.view()).unwrap().noise;
        assert!((noise / sigma - 1.0).abs() < 0.2, "{noise} for {sigma}");
    }
}

#[test]
fn a_line_is_refused() {
    let line = Array2::from_shape_fn((50, 3), |(i, k)| (i * (k + 1)) as f64);
    assert!(matches!(LocalFrames::estimate(line.view()), Err(CloudError::Collinear { .. })));
}
