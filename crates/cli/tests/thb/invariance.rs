//! The same part in another order, turned, mirrored, moved or scaled gets as good a surface with about as many control points.

use std::fmt::Write;

use crate::lab::Lab;

/// Places of the unit square that fill it evenly in any order (Roberts' sequence).
fn places(count: usize) -> impl Iterator<Item = [f64; 2]> {
    (1..=count).map(|k| [0.754_877_666_246_693, 0.569_840_290_998_053].map(|a| (a * k as f64).fract()))
}

/// What a fit of points by a tolerance came to: control points, and root mean square and 95th percentile of the distances in tolerances.
fn fitted(lab: &Lab, points: &[[f64; 3]], tolerance: f64) -> [f64; 3] {
    let mut text = String::new();
    for [x, y, z] in points {
        writeln!(text, "{x} {y} {z}").unwrap();
    }
    lab.put("scan.xyz", text);
    lab.succeeds(&format!("fit scan.xyz --method ls --tol {tolerance} -o part.json --report report.json"));
    let result = &lab.json("report.json")["result"];
    let distances = &result["deviation"]["scan_to_surface"];
    let in_tolerances = |key: &str| distances[key].as_f64().unwrap() / tolerance;
    [result["dofs"].as_f64().unwrap(), in_tolerances("rms"), in_tolerances("p95")]
}

/// The point of a part at a place of the unit square.
type Part = fn(f64, f64) -> [f64; 3];

#[test]
fn order_place_and_size_do_not_matter() {
    let lab = Lab::new();
    let parts: [(&str, Part); 2] = [
        ("bump", |u, v| [1.3 * u, v, 0.3 * (-20.0 * ((u - 0.3).powi(2) + (v - 0.6).powi(2))).exp() + 0.1 * u * v]),
        ("wave", |u, v| [u, 0.7 * v, 0.1 * (5.0 * u + 2.0 * v).sin() + 0.05 * (7.0 * v).cos()]),
    ];
    for (name, part) in parts {
        let points: Vec<[f64; 3]> = places(700).map(|[u, v]| part(u, v)).collect();
        let tolerance = 2e-3;
        let plain = fitted(&lab, &points, tolerance);
        let of = |change: &dyn Fn([f64; 3]) -> [f64; 3]| points.iter().map(|&p| change(p)).collect::<Vec<_>>();
        let shuffled: Vec<[f64; 3]> = (0..700).map(|k| points[k % 7 * 100 + k / 7]).collect();
        let (s, c) = 0.7_f64.sin_cos();
        let turned = of(&|[x, y, z]| [c * x - s * z, y, s * x + c * z]);
        let mirrored = of(&|[x, y, z]| [-x, y, z]);
        let moved = of(&|[x, y, z]| [x + 1e6, y - 2e6, z + 5e5]);
        let scaled = |size: f64| of(&|p| p.map(|x| size * x));
        // Turned and mirrored parts may have other corners at the origin of their parameters, so cells are refined in another order.
        for (change, points, tolerance, allowed) in [
            ("another order", shuffled, tolerance, 0.02),
            ("turned", turned, tolerance, 0.3),
            ("mirrored", mirrored, tolerance, 0.3),
            ("moved", moved, tolerance, 0.02),
            ("small", scaled(1e-3), 1e-3 * tolerance, 0.02),
            ("large", scaled(1e6), 1e6 * tolerance, 0.02),
        ] {
            let found = fitted(&lab, &points, tolerance);
            let place = &lab.json("report.json")["result"]["deviation"]["scan_to_surface"]["place"];
            let is_place =
                |p: &[f64; 3]| (0..3).all(|k| (place[k].as_f64().unwrap() - p[k]).abs() <= 1e-9 * p[k].abs());
            assert!(points.iter().any(is_place), "{name}, {change}: {place} is no point of the scan");
            assert!(
                (found[0] - plain[0]).abs() <= (0.05 * plain[0]).max(12.0),
                "{name}, {change}: {found:?} {plain:?}"
            );
            for k in [1, 2] {
                assert!((found[k] - plain[k]).abs() <= allowed * plain[k], "{name}, {change}: {found:?} {plain:?}");
            }
        }
    }
}
