//! Surfaces that close on themselves.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::fmt::Write;

use crate::lab::{Lab, table};

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

/// A place on a tube that swells and turns, of length 3.
fn on_tube(u: f64, v: f64) -> [f64; 3] {
    let angle = TAU * u;
    let radius = 1.0 - 0.4 * v + 0.2 * (2.0 * angle + v).cos();
    [radius * angle.cos() + 0.3 * v * v, radius * angle.sin(), 3.0 * v]
}

/// Points of the tube without order: both ends, and evenly scattered between them.
fn tube_cloud() -> String {
    let ends = (0..96).map(|k| [f64::from(k % 48) / 48.0, f64::from(k / 48)]);
    let inner = (0..1100).map(|k| [f64::from(k) * 0.754_877_666_246_693 % 1.0, (f64::from(k) + 0.5) / 1100.0]);
    let mut places: Vec<[f64; 2]> = ends.chain(inner).collect();
    places.sort_by_key(|[u, v]| ((u * 7919.0 + v * 104_729.0).fract() * 1e9) as u64);
    let mut xyz = String::new();
    for [x, y, z] in places.into_iter().map(|[u, v]| on_tube(u, v)) {
        writeln!(xyz, "{x} {y} {z}").unwrap();
    }
    xyz
}

/// A mesh of the tube, without the cells that `open` names.
fn tube_mesh(open: impl Fn(usize, usize) -> bool) -> String {
    let (around, along) = (40, 24);
    let mut obj = String::new();
    for (i, j) in (0..around).flat_map(|i| (0..=along).map(move |j| (i, j))) {
        let [x, y, z] = on_tube(i as f64 / around as f64, j as f64 / along as f64);
        writeln!(obj, "v {x} {y} {z}").unwrap();
    }
    let at = |i: usize, j: usize| (i % around) * (along + 1) + j + 1;
    for (i, j) in (0..around).flat_map(|i| (0..along).map(move |j| (i, j))).filter(|&(i, j)| !open(i, j)) {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        writeln!(obj, "f {a} {b} {c}\nf {a} {c} {d}").unwrap();
    }
    obj
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
    for (input, method) in
        [("rings", "ls"), ("repeated", "ls"), ("rings", "joint"), ("rings", "qi"), ("repeated", "a-qi")]
    {
        lab.succeeds(&format!(
            "fit {input}.csv --closed u --method {method} --tol 0.1% -o t.json -o t.step -o t.obj -o t.xml --report r.json"
        ));
        let report = lab.json("r.json");
        assert_eq!((&report["options"]["closed"], &report["input"]["fitted_points"]), (&"u".into(), &720.into()));
        let sides: Vec<&String> = report["result"]["sides"].as_object().unwrap().keys().collect();
        assert_eq!(sides, ["v_max", "v_min"]);
        lab.put("uv.csv", "u,v\n0,0.3\n1,0.3\n0,0.9\n1,0.9\n");
        let values = table(&lab.thb("eval t.json uv.csv").stdout);
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
fn clouds_and_meshes_of_tubes_are_laid_out_round() {
    let lab = Lab::with("cloud.xyz", tube_cloud());
    lab.put("mesh.obj", tube_mesh(|_, _| false));
    lab.put("uv.csv", "u,v\n0,0.3\n1,0.3\n0.999999,0.3\n0.000001,0.3\n0.5,0\n0.5,1\n");
    for (input, method) in [("cloud.xyz", "ls"), ("cloud.xyz", "a-qi"), ("mesh.obj", "joint"), ("mesh.obj", "qi")] {
        lab.succeeds(&format!(
            "fit {input} --closed u --method {method} --tol 0.5% -o t.json -o t.step -o t.obj --report r.json"
        ));
        let report = lab.json("r.json");
        let layout = &report["parameterization"];
        assert_eq!((&layout["folded"], &layout["collapsed"]), (&0.into(), &0.into()));
        // One point of the cloud is nearly equal to another one.
        assert!(layout["left_out"].as_u64().unwrap() <= 1, "{layout}");
        assert!(layout["method"].as_str().unwrap().contains("periodic"), "{layout}");
        let sides: Vec<&String> = report["result"]["sides"].as_object().unwrap().keys().collect();
        assert_eq!(sides, ["v_max", "v_min"]);
        // The wider end is v = 0; the seam ends on both.
        let ends = &layout["seam"]["points"];
        assert_eq!((ends[0][2].as_f64(), ends[1][2].as_f64()), (Some(0.0), Some(3.0)), "{ends}");
        let rows = table(&lab.thb("eval t.json uv.csv").stdout);
        for k in 2..5 {
            assert!((rows[0][k] - rows[1][k]).abs() < 1e-12);
            // The same slope on both sides.
            assert!((rows[3][k] - 2.0 * rows[0][k] + rows[2][k]).abs() < 1e-9, "{rows:?}");
        }
        assert!(rows[4][4] < 0.1 && rows[5][4] > 2.9);
        assert!(lab.text("t.step").contains("OPEN_SHELL"));
    }
    // The inside of a tube is known: u runs so that the normal points outward.
    lab.succeeds("fit cloud.xyz --closed u --method ls --tol 0.5% -o t.json -o t.obj");
    let obj = lab.text("t.obj");
    let numbers = |line: &str| -> Vec<f64> { line.split(' ').skip(1).map(|x| x.parse().unwrap()).collect() };
    let vertices: Vec<Vec<f64>> = obj.lines().filter(|line| line.starts_with("v ")).map(numbers).collect();
    let volume: f64 = obj
        .lines()
        .filter(|line| line.starts_with("f "))
        .map(|line| {
            let [a, b, c] = [0, 1, 2].map(|k| &vertices[numbers(line)[k] as usize - 1]);
            (a[0] * (b[1] * c[2] - b[2] * c[1])
                + a[1] * (b[2] * c[0] - b[0] * c[2])
                + a[2] * (b[0] * c[1] - b[1] * c[0]))
                / 6.0
        })
        .sum();
    assert!(volume > 0.0, "{volume}");
}

#[test]
fn tubes_close_in_v_as_well_and_parameters_wrap() {
    let lab = Lab::with("mesh.obj", tube_mesh(|_, _| false));
    lab.succeeds("param mesh.obj --closed v -o p.csv -o p.svg --report r.json");
    let report = lab.json("r.json");
    assert_eq!(report["parameterization"]["folded"], 0);
    let rows = table(&lab.text("p.csv"));
    assert_eq!(rows.len(), 40 * 25);
    assert!(rows.iter().all(|row| (0.0..=1.0).contains(&row[4]) && (0.0..1.0).contains(&row[5])));
    // u = 0 at the wide end below, 1 at the other.
    assert!(rows.iter().all(|row| (row[3] == 0.0) == (row[4] == 0.0) && (row[3] == 3.0) == (row[4] == 1.0)));
    lab.succeeds("fit mesh.obj --closed v --tol 0.5% -o t.json --report r.json");
    let report = lab.json("r.json");
    let sides: Vec<&String> = report["result"]["sides"].as_object().unwrap().keys().collect();
    assert_eq!(sides, ["u_max", "u_min"]);
}

#[test]
fn holes_are_trimmed_on_request() {
    let lab = Lab::with("tube.obj", tube_mesh(|i, j| (15..22).contains(&i) && (8..15).contains(&j)));
    let mut cloud = String::from("u,v,x,y,z\n");
    for k in 0..1600 {
        let [u, v] = [(f64::from(k % 40) + 0.5) / 40.0, (f64::from(k / 40) + 0.5) / 40.0];
        if (u - 0.4).hypot(v - 0.5) > 0.2 {
            writeln!(cloud, "{u},{v},{},{},{}", 10.0 * u, 10.0 * v, (3.0 * u).sin() * v).unwrap();
        }
    }
    lab.put("sheet.csv", cloud);
    for input in ["tube.obj --closed u", "tube.obj --closed u --method joint", "sheet.csv"] {
        lab.succeeds(&format!("fit {input} --tol 0.5% -o whole.step --report r.json"));
        assert!(lab.json("r.json")["result"]["trimmed"].is_null());
        lab.succeeds(&format!("fit {input} --tol 0.5% --trim-holes -o cut.step --report r.json"));
        let report = lab.json("r.json");
        assert_eq!(report["result"]["trimmed"], 1, "{input}: {}", report["warnings"]);
        let bounds = |name: &str| lab.text(name).matches("=FACE_BOUND(").count();
        assert_eq!((bounds("whole.step"), bounds("cut.step")), (0, 1));
    }
}

#[test]
fn what_cannot_close_is_told() {
    let lab = Lab::with("rings.csv", tube_grid(false));
    lab.put("cloud.xyz", "0 0 0\n1 0 0\n1 1 0\n0 1 0\n0.5 0.5 1\n");
    lab.put("torus.csv", torus_points());
    lab.put("tube.obj", tube_mesh(|_, _| false));
    lab.put("slit.obj", tube_mesh(|i, _| i == 7));
    lab.fails("fit cloud.xyz --closed u -o t.step", 1, &["5 points", "at least 16"]);
    lab.fails("fit slit.obj --closed u -o t.step", 1, &["1 boundary loop", "two ends"]);
    lab.fails("fit tube.obj --closed uv -o t.step", 1, &["--closed uv needs a grid", "tubes"]);
    lab.fails("fit tube.obj --closed u --param lpsp -o t.step", 1, &["--closed u needs a grid", "mean-value"]);
    lab.fails("fit tube.obj --closed u --corners 0,1,2,3 -o t.step", 1, &["--corners", "none with --closed"]);
    lab.fails("fit rings.csv --closed u --mesh 3 -o t.step", 1, &["3 elements", "at least 4"]);
    lab.fails("fit torus.csv --closed u --domain data -o t.step", 2, &["--closed"]);
    lab.fails("fit rings.csv --closed w -o t.step", 2, &["none, u, v or uv"]);
}

#[test]
fn a_tube_that_is_fitted_as_a_sheet_is_told_to_be_one() {
    let lab = Lab::with("tube.xyz", tube_cloud());
    let run = lab.thb("fit tube.xyz --closed none --method ls --tol 2% -o t.json --report r.json");
    assert!([0, 3].contains(&run.code), "{run:?}");
    let report = lab.json("r.json");
    let warnings: Vec<&str> = report["warnings"].as_array().unwrap().iter().map(|w| w.as_str().unwrap()).collect();
    assert!(warnings.iter().any(|w| w.contains("leaves the points") && w.contains("--closed u")), "{warnings:?}");
}
