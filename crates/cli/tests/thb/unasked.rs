//! What is recognized in a cloud without being asked: two layers, rows, tubes.

use std::f64::consts::{PI, TAU};
use std::fmt::Write;

use crate::lab::Lab;

/// Places of the unit square that fill it evenly in any order (Roberts' sequence).
fn places(count: usize) -> impl Iterator<Item = [f64; 2]> {
    (1..=count).map(|k| [0.754_877_666_246_693, 0.569_840_290_998_053].map(|a| (a * k as f64).fract()))
}

fn text(points: impl IntoIterator<Item = [f64; 3]>) -> String {
    let mut text = String::new();
    for [x, y, z] in points {
        writeln!(text, "{x} {y} {z}").unwrap();
    }
    text
}

fn warns(report: &serde_json::Value, what: &str) -> bool {
    report["warnings"].as_array().unwrap().iter().any(|w| w.as_str().unwrap().contains(what))
}

/// A third of a cylinder of radius 30 + `offset` over `range` of its angle.
fn patch(range: [f64; 2], offset: f64, count: usize) -> Vec<[f64; 3]> {
    let angle = |t: f64| PI / 3.0 * (range[0] + t * (range[1] - range[0]));
    let place = |[t, y]: [f64; 2]| [(30.0 + offset) * angle(t).cos(), 40.0 * y, (30.0 + offset) * angle(t).sin()];
    places(count).map(place).collect()
}

#[test]
fn two_layers_are_fitted_by_their_middle_and_told() {
    let lab = Lab::new();
    for (gap, ranges) in
        [(0.15, [[0.0, 1.0], [0.0, 1.0]]), (0.2, [[0.0, 0.7], [0.3, 1.0]]), (0.4, [[0.0, 0.8], [0.2, 1.0]])]
    {
        let mut points = patch(ranges[0], -0.5 * gap, 1200);
        // Another sequence, so that no point has a partner.
        points.extend(patch(ranges[1], 0.5 * gap, 2300).split_off(1100));
        lab.put("scan.xyz", text(points));
        lab.succeeds("fit scan.xyz --tol 0.1 -o t.json -o t.obj --report r.json");
        let report = lab.json("r.json");
        let layers = &report["parameterization"]["layers"];
        let distance = layers["distance"].as_f64().unwrap();
        assert!((distance / gap - 1.0).abs() < 0.15 && warns(&report, "two layers"), "{gap}: {layers}");
        let dofs = report["result"]["dofs"].as_u64().unwrap();
        assert!(dofs <= 150, "{gap}: {dofs} control points");
        for vertex in lab.text("t.obj").lines().filter_map(|line| line.strip_prefix("v ")) {
            let x: Vec<f64> = vertex.split_whitespace().map(|x| x.parse().unwrap()).collect();
            let off = x[0].hypot(x[2]) - 30.0;
            assert!(off.abs() < 0.5 * gap + 0.05, "{gap}: {off} off the middle");
        }
    }
    lab.put("scan.xyz", text(patch([0.0, 1.0], 0.0, 2400)));
    lab.succeeds("fit scan.xyz --tol 0.1 -o t.json --report r.json");
    assert!(lab.json("r.json")["parameterization"]["layers"].is_null());
}

#[test]
fn rows_far_apart_are_fitted() {
    let height = |x: f64, y: f64| 5.0 * (x / 35.0).sin() * (y / 30.0).cos();
    let lab = Lab::new();
    // Straight and bent rows in some directions, even and shaken along the row.
    for (ratio, turn, bend, jitter) in
        [(5.0, 0.0, 0.0, 0.3), (30.0, 0.5, 0.0, 0.0), (45.0, 1.2, 0.004, 0.3), (100.0, 2.0, -0.004, 0.2)]
    {
        let (lines, across) = (11, 8.0);
        let count = (90.0 * ratio / across) as usize;
        let mut points = Vec::new();
        for (line, k) in (0..lines).flat_map(|line| (0..count).map(move |k| (line, k))) {
            let shake = jitter * (((line * count + k) as f64 * 12.9898).sin() * 43758.5453).fract();
            let (s, t) = ((k as f64 + shake) * across / ratio - 45.0, line as f64 * across);
            let (x, y) = (f64::cos(turn) * s - f64::sin(turn) * t, f64::sin(turn) * s + f64::cos(turn) * t);
            let (x, y) = (x - bend * f64::sin(turn) * s * s, y + bend * f64::cos(turn) * s * s);
            points.push([x, y, height(x, y)]);
        }
        let given = points.len();
        lab.put("rows.xyz", text(points));
        lab.succeeds("fit rows.xyz --tol 0.1 -o t.json -o t.obj --report r.json");
        let report = lab.json("r.json");
        assert_eq!(report["input"]["fitted_points"], given, "ratio {ratio}: {}", report["warnings"]);
        assert_eq!(warns(&report, "the points lie in rows"), ratio > 28.0, "ratio {ratio}: {}", report["warnings"]);
        for vertex in lab.text("t.obj").lines().filter_map(|line| line.strip_prefix("v ")) {
            let x: Vec<f64> = vertex.split_whitespace().map(|x| x.parse().unwrap()).collect();
            let off = x[2] - height(x[0], x[1]);
            assert!(off.abs() < 0.25, "ratio {ratio}: {off} off at {x:?}");
        }
    }
}

#[test]
fn tubes_close_and_sheets_with_a_hole_do_not() {
    let lab = Lab::new();
    let tube = |length: f64, taper: f64| {
        places(1500).map(move |[u, v]| {
            let radius = 10.0 * (1.0 - taper * v);
            [radius * (TAU * u).cos(), radius * (TAU * u).sin(), length * v]
        })
    };
    let rings = (0..15 * 60).map(|k| {
        let (angle, ring) = (TAU * (k % 60) as f64 / 60.0, k / 60);
        [10.0 * angle.cos() + 0.1 * ring as f64, 10.0 * angle.sin(), 7.5 * ring as f64]
    });
    for (points, what) in [
        (tube(30.0, 0.0).collect::<Vec<_>>(), "cylinder"),
        (tube(12.0, 0.4).collect(), "cone"),
        (tube(80.0, 0.0).collect(), "pipe"),
        (rings.collect(), "rings far apart"),
    ] {
        lab.put("tube.xyz", text(points));
        lab.succeeds("param tube.xyz -o p.csv --report r.json");
        let report = lab.json("r.json");
        assert!(warns(&report, "a tube by its shape"), "{what}: {}", report["warnings"]);
        assert!(!report["parameterization"]["seam"].is_null(), "{what}");
        lab.succeeds("param tube.xyz --closed u -o q.csv --report s.json");
        // Where a mesh over all points came out torn only what was not asked for tries again with rows squeezed.
        assert!(what == "rings far apart" || lab.text("p.csv") == lab.text("q.csv"), "{what}");
    }
    lab.succeeds("fit tube.xyz --tol 0.5% -o t.json --report r.json");
    assert_eq!(lab.json("r.json")["options"]["closed"], "auto");
    assert!(lab.json("r.json")["result"]["sides"]["u_min"].is_null());
    // A plate and a bowl with a round hole of 0.2 to 0.85 of their radius.
    let polar = |[u, v]: [f64; 2], hole: f64| {
        let r = (hole * hole + (1.0 - hole * hole) * v).sqrt();
        [r * (TAU * u).cos(), r * (TAU * u).sin()]
    };
    for (hole, bulge) in [(0.2, 0.0), (0.5, 0.0), (0.85, 0.0), (0.5, 3.0), (0.7, 2.0)] {
        let sheet = places(2500).map(|place| {
            let [x, y] = polar(place, hole);
            [10.0 * x, 10.0 * y, bulge * (1.0 - x * x - y * y)]
        });
        lab.put("sheet.xyz", text(sheet));
        lab.succeeds("param sheet.xyz -o p.csv --report r.json");
        let report = lab.json("r.json");
        assert!(!warns(&report, "a tube") && report["parameterization"]["seam"].is_null(), "{hole} {bulge}");
    }
}
