//! Surfaces that close on themselves.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::fmt::Write;

use crate::lab::Lab;

/// Rings round the z axis, `i` round them; the last point of each is its first one again if `repeat`.
fn tube_grid(repeat: bool) -> String {
    let (around, along) = (48 + usize::from(repeat), 15);
    let mut csv = String::from("i,j,x,y,z\n");
    for (i, j) in (0..around).flat_map(|i| (0..along).map(move |j| (i, j))) {
        let (angle, v) = (TAU * (i % 48) as f64 / 48.0, j as f64 / (along - 1) as f64);
        let radius = 1.0 + 0.2 * (2.0 * angle + v).cos();
        writeln!(csv, "{i},{j},{},{},{}", radius * angle.cos(), radius * angle.sin(), 3.0 * v).unwrap();
    }
    csv
}

/// Points of a torus with parameters that do not keep to the unit square.
fn torus_points() -> String {
    let mut csv = String::from("u,v,x,y,z\n");
    for k in 0..1500 {
        let (u, v) = (k as f64 * 0.618_033_988_749_895 - 3.0, k as f64 * 0.754_877_666_246_693);
        let (a, b) = (TAU * u, TAU * v);
        let radius = 3.0 + b.cos();
        writeln!(csv, "{u},{v},{},{},{}", radius * a.cos(), radius * a.sin(), b.sin()).unwrap();
    }
    csv
}

/// Number of edges of the triangles of an OBJ file that have one triangle only.
fn open_edges(obj: &str) -> usize {
    let mut uses: BTreeMap<(u32, u32), usize> = BTreeMap::new();
    for face in obj.lines().filter_map(|line| line.strip_prefix("f ")) {
        let corners: Vec<u32> = face.split(' ').map(|v| v.parse().unwrap()).collect();
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            *uses.entry((a.min(b), a.max(b))).or_default() += 1;
        }
    }
    uses.values().filter(|uses| **uses == 1).count()
}

#[test]
fn a_grid_of_rings_becomes_a_tube() {
    let lab = Lab::with("rings.csv", tube_grid(false));
    lab.put("repeated.csv", tube_grid(true));
    for (input, method) in [("rings", "ls"), ("repeated", "ls"), ("rings", "joint")] {
        lab.succeeds(&format!(
            "fit {input}.csv --closed u --method {method} --tol 0.1% -o t.json -o t.step -o t.obj -o t.xml --report r.json"
        ));
        let report = lab.json("r.json");
        assert_eq!((&report["options"]["closed"], &report["input"]["fitted_points"]), (&"u".into(), &720.into()));
        let sides: Vec<&String> = report["result"]["sides"].as_object().unwrap().keys().collect();
        assert_eq!(sides, ["v_max", "v_min"]);
        lab.put("uv.csv", "u,v\n0,0.3\n1,0.3\n0,0.9\n1,0.9\n");
        let values: Vec<Vec<f64>> = lab
            .thb("eval t.json uv.csv")
            .stdout
            .lines()
            .skip(1)
            .map(|line| line.split(',').map(|x| x.parse().unwrap()).collect())
            .collect();
        for pair in values.chunks(2) {
            assert!((2..5).all(|k| (pair[0][k] - pair[1][k]).abs() < 1e-12), "{pair:?}");
        }
        // Rims at both ends, nothing open between them.
        let obj = lab.text("t.obj");
        let rim = obj.lines().filter(|line| line.starts_with("v ") && line.ends_with(" 0.0")).count();
        assert_eq!(open_edges(&obj) % 2, 0);
        assert!(rim == 0 || open_edges(&obj) == 2 * rim, "{} open edges, {rim} on a rim", open_edges(&obj));
        assert!(lab.text("t.step").contains("OPEN_SHELL"));
    }
}

#[test]
fn parameters_wrap_round_a_torus() {
    let lab = Lab::with("torus.csv", torus_points());
    lab.succeeds("fit torus.csv --closed uv --mesh 6x5 --tol 0.1% -o t.json -o t.step -o t.obj --report r.json");
    assert_eq!(lab.json("r.json")["result"]["sides"].as_object().unwrap().len(), 0);
    assert_eq!(open_edges(&lab.text("t.obj")), 0);
    assert!(lab.text("t.step").contains("CLOSED_SHELL"));
    let compared = lab.prints_json("compare t.json torus.csv --tol 0.1%");
    assert!(compared["within"].as_f64().unwrap() >= 0.95, "{compared}");
}

#[test]
fn what_cannot_close_is_told() {
    let lab = Lab::with("rings.csv", tube_grid(false));
    lab.put("cloud.xyz", "0 0 0\n1 0 0\n1 1 0\n0 1 0\n0.5 0.5 1\n");
    lab.put("torus.csv", torus_points());
    lab.fails("fit cloud.xyz --closed u -o t.step", 1, &["--closed u needs a grid"]);
    lab.fails("fit rings.csv --closed u --mesh 3 -o t.step", 1, &["3 elements", "at least 4"]);
    lab.fails("fit torus.csv --closed u --domain data -o t.step", 2, &["--closed"]);
    lab.fails("fit rings.csv --closed w -o t.step", 2, &["none, u, v or uv"]);
}
