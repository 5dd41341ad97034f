//! Whole parts: a mesh and a layout become one solid.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use crate::lab::Lab;

/// Quads along a side of a face of the cube.
const N: u32 = 8;

/// A point of a face of the cube from −1 to 1; `u × v` points outward.
fn on_cube(face: usize, u: [f64; 2]) -> [f64; 3] {
    let (axis, sign) = (face % 3, if face < 3 { 1.0 } else { -1.0 });
    let [s, t] = u.map(|x| 2.0 * x - 1.0);
    let mut p = [0.0; 3];
    p[axis] = sign;
    (p[(axis + 1) % 3], p[(axis + 2) % 3]) = if face < 3 { (s, t) } else { (t, s) };
    p
}

/// The cube's faces under a map of space, as a mesh (.off) and as a layout of six patches in the coordinates of the mesh.
fn part(faces: usize, place: impl Fn([f64; 3]) -> [f64; 3]) -> (String, Value) {
    let (mut vertices, mut number): (Vec<[f64; 3]>, BTreeMap<[i64; 3], u32>) = (Vec::new(), BTreeMap::new());
    let (mut triangles, mut quads, mut corners) = (Vec::new(), Vec::new(), Vec::new());
    for face in 0..faces {
        let mut at = |i: u32, j: u32| {
            let p = on_cube(face, [i, j].map(|k| f64::from(k) / f64::from(N)));
            *number.entry(p.map(|x| (x * 1e6).round() as i64)).or_insert_with(|| {
                vertices.push(place(p));
                vertices.len() as u32 - 1
            })
        };
        let (mut vid, mut uv, mut tri) = (Vec::new(), Vec::new(), Vec::new());
        for (i, j) in (0..=N).flat_map(|j| (0..=N).map(move |i| (i, j))) {
            vid.push(at(i, j));
            uv.push([i, j].map(|k| f64::from(k) / f64::from(N)));
        }
        for (i, j) in (0..N).flat_map(|j| (0..N).map(move |i| (i, j))) {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            tri.extend([[a, b, c], [a, c, d]]);
        }
        let paths: [Vec<u32>; 4] = [
            (0..=N).map(|k| at(k, 0)).collect(),
            (0..=N).map(|k| at(N, k)).collect(),
            (0..=N).map(|k| at(N - k, N)).collect(),
            (0..=N).map(|k| at(0, N - k)).collect(),
        ];
        let of_quad = [0, 1, 2, 3].map(|side: usize| {
            let vertex = paths[side][0];
            let known = corners.iter().position(|&corner| corner == vertex);
            known.unwrap_or_else(|| {
                corners.push(vertex);
                corners.len() - 1
            })
        });
        quads.push(json!({ "corners": of_quad, "paths": paths, "tri": tri, "vid": vid, "uv": uv }));
        triangles.extend(tri);
    }
    let mut off = format!("OFF\n{} {} 0\n", vertices.len(), triangles.len());
    vertices.iter().for_each(|[x, y, z]| off += &format!("{x} {y} {z}\n"));
    triangles.iter().for_each(|[a, b, c]: &[u32; 3]| off += &format!("3 {a} {b} {c}\n"));
    (off, json!({ "meta": { "made": "by a test" }, "vertices": vertices, "corners": corners, "quads": quads }))
}

/// An ellipsoid with half axes of 30, 24 and 18.
fn round(p: [f64; 3]) -> [f64; 3] {
    let length = p.iter().map(|x| x * x).sum::<f64>().sqrt();
    [30.0 * p[0] / length, 24.0 * p[1] / length, 18.0 * p[2] / length]
}

fn lab(faces: usize, place: impl Fn([f64; 3]) -> [f64; 3]) -> Lab {
    let (off, layout) = part(faces, place);
    let lab = Lab::with("part.off", off);
    lab.put("layout.json", layout.to_string());
    lab
}

/// Runs `thb`, which writes what it has and says why that is not what was asked for.
fn falls_short(lab: &Lab, arguments: &str, texts: &[&str]) {
    let run = lab.thb(arguments);
    assert!(run.code == 3 && run.stdout.is_empty(), "{arguments}: {run:?}");
    assert!(texts.iter().all(|text| run.stderr.contains(text)), "{arguments}: {run:?}");
}

fn count(lab: &Lab, file: &str, entity: &str) -> usize {
    lab.text(file).matches(&format!("={entity}(")).count()
}

#[test]
fn a_round_part_is_a_smooth_solid() {
    let lab = lab(6, round);
    lab.succeeds("fit part.off --layout layout.json -o part.step --report part.json");
    let entities = ["MANIFOLD_SOLID_BREP", "CLOSED_SHELL", "ADVANCED_FACE", "EDGE_CURVE", "VERTEX_POINT"];
    assert_eq!(entities.map(|entity| count(&lab, "part.step", entity)), [1, 1, 6, 12, 8]);
    let report = lab.json("part.json");
    assert_eq!(report["reasons"], json!([]));
    assert_eq!(report["layout"]["genus"], 0);
    assert_eq!(report["layout"]["sharp_arcs"], 0);
    assert_eq!(report["layout"]["valences"], json!({ "3": 8 }));
    assert_eq!(report["folded_places"], 0);
    // V + E (n + p − 2) + F (n + p − 2)² for n = 4 elements of degree p = 3.
    assert_eq!(report["functions"], 8 + 12 * 5 + 6 * 25);
    let angles = &report["angles"];
    assert!(angles["max"].as_f64().unwrap() < 0.3 && angles["p99"].as_f64().unwrap() < 0.15, "{angles}");
    let volume = report["volume"]["surface"].as_f64().unwrap();
    let exact = 4.0 / 3.0 * std::f64::consts::PI * 30.0 * 24.0 * 18.0;
    assert!((volume / exact - 1.0).abs() < 2e-3, "{volume} {exact}");
    assert!(report["mesh_to_surface"]["rms"].as_f64().unwrap() < 5e-4 * report["diagonal"].as_f64().unwrap());
}

#[test]
fn a_cube_keeps_its_edges() {
    let lab = lab(6, |p| p.map(|x| 10.0 * x));
    lab.succeeds("fit part.off --layout layout.json --mesh 2 -o part.step --report part.json");
    let report = lab.json("part.json");
    assert_eq!(report["layout"]["sharp_arcs"], 12);
    assert_eq!(report["angles"]["arcs"], 0);
    assert!(report["surface_to_mesh"]["max"].as_f64().unwrap() < 1e-6);
    assert!((report["volume"]["surface"].as_f64().unwrap() - 8000.0).abs() < 1e-4);
    // Told that nothing is sharp, it is rounded.
    falls_short(
        &lab,
        "fit part.off --layout layout.json --sharp off --tol 0.05% -o round.step --report round.json",
        &["within the tolerance"],
    );
    let rounded = lab.json("round.json");
    assert_eq!(rounded["layout"]["sharp_arcs"], 0);
    let (angle, farthest) = (&rounded["angles"]["max"], &rounded["mesh_to_surface"]["max"]);
    assert!(angle.as_f64().unwrap() < 15.0 && farthest.as_f64().unwrap() > 0.3, "{angle} {farthest}");
    assert_eq!(count(&lab, "round.step", "MANIFOLD_SOLID_BREP"), 1);
}

#[test]
fn a_closed_mesh_becomes_a_solid_by_itself() {
    let lab = lab(6, |p| p.map(|x| 10.0 * x));
    lab.succeeds("fit part.off -o part.step --report part.json");
    let report = lab.json("part.json");
    let faces = report["layout"]["faces"].as_u64().unwrap() as usize;
    let entities = ["MANIFOLD_SOLID_BREP", "CLOSED_SHELL", "ADVANCED_FACE"];
    assert_eq!(entities.map(|entity| count(&lab, "part.step", entity)), [1, 1, faces]);
    assert_eq!((&report["reasons"], &report["layout"]["genus"]), (&json!([]), &json!(0)));
    assert!(report["layout"]["sharp_arcs"].as_u64().unwrap() >= 12, "{}", report["layout"]);
    assert!((report["volume"]["surface"].as_f64().unwrap() - 8000.0).abs() < 1.0, "{}", report["volume"]);
    lab.fails("fit part.off --layout one -o one.step", 1, &["part.off", "closed"]);
}

/// A file without its name, which is that of the product, too.
fn without_name(step: &str) -> String {
    let is_name = |line: &&str| line.starts_with("FILE_NAME") || line.contains("=PRODUCT(");
    step.lines().filter(|line| !is_name(line)).collect::<Vec<_>>().join("\n")
}

#[test]
fn closed_meshes_of_a_batch_become_solids_and_others_sheets() {
    let lab = lab(6, |p| p.map(|x| 10.0 * x));
    lab.put("open.off", crate::scans::mesh());
    lab.put("manifest.csv", "input,name,layout\npart.off,with_layout,layout.json\nopen.off,,\n");
    let run = lab.thb("fit part.off open.off -o out/ --summary all.jsonl");
    assert_eq!(run.code, 0, "{run:?}");
    let files: Vec<String> = lab.files().into_iter().filter(|name| name.starts_with("out/part.")).collect();
    assert_eq!(files, ["out/part.html", "out/part.report.json", "out/part.step"]);
    lab.succeeds("fit part.off -o alone.step --report alone.json");
    assert!(without_name(&lab.text("out/part.step")) == without_name(&lab.text("alone.step")));
    let (report, alone) = (lab.json("out/part.report.json"), lab.json("alone.json"));
    assert_eq!((&report["mesh_to_surface"], &report["functions"]), (&alone["mesh_to_surface"], &alone["functions"]));
    let summary: Vec<Value> = lab.text("all.jsonl").lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(summary[0]["solid"]["faces"], report["layout"]["faces"]);
    assert_eq!((&summary[0]["dofs"], &summary[0]["verdict"]), (&report["functions"], &json!("good")));
    assert!(summary[1]["solid"].is_null() && lab.path("out/open.json").is_file());
    // It is done again from its report, and needs not be with --resume.
    lab.succeeds("fit --config out/part.report.json -o again.step");
    assert!(without_name(&lab.text("again.step")) == without_name(&lab.text("alone.step")));
    lab.succeeds("fit part.off open.off -o out/ --summary all.jsonl --resume");
    assert_eq!(lab.text("all.jsonl").matches("\"kept\":true").count(), 2);
    // A layout of its own for one of them.
    lab.succeeds("fit --manifest manifest.csv -o out/");
    assert_eq!(count(&lab, "out/with_layout.step", "ADVANCED_FACE"), 6);
}

#[test]
fn an_open_mesh_has_no_layout_of_our_own() {
    let lab = lab(5, round);
    lab.fails("fit part.off --layout patches -o part.step", 1, &["part.off", "open"]);
}

#[test]
fn an_open_part_is_a_shell() {
    let lab = lab(5, round);
    lab.succeeds("fit part.off --layout layout.json -o part.step --report part.json");
    let entities = ["MANIFOLD_SOLID_BREP", "OPEN_SHELL", "ADVANCED_FACE", "EDGE_CURVE"];
    assert_eq!(entities.map(|entity| count(&lab, "part.step", entity)), [0, 1, 5, 12]);
    let report = lab.json("part.json");
    assert_eq!((&report["volume"], &report["layout"]["genus"]), (&Value::Null, &Value::Null));
}

#[test]
fn layouts_may_be_centred_and_of_size_one() {
    let lab = lab(6, |p| round(p).map(|x| x + 500.0));
    let (_, mut layout) = part(6, round);
    let diagonal = 2.0 * (30.0_f64.powi(2) + 24.0_f64.powi(2) + 18.0_f64.powi(2)).sqrt();
    for vertex in layout["vertices"].as_array_mut().unwrap() {
        vertex.as_array_mut().unwrap().iter_mut().for_each(|x| *x = json!(x.as_f64().unwrap() / diagonal));
    }
    // As Python writes what is no number.
    lab.put("unit.json", layout.to_string().replace("\"by a test\"", "NaN"));
    lab.succeeds("fit part.off --layout unit.json -o part.step --report unit.report.json");
    lab.succeeds("fit part.off --layout layout.json -o part.step --report own.report.json");
    let rms = |name: &str| lab.json(name)["mesh_to_surface"]["rms"].as_f64().unwrap();
    assert!((rms("unit.report.json") / rms("own.report.json") - 1.0).abs() < 1e-3);
}

#[test]
fn a_tolerance_that_is_not_reached_is_told_and_written() {
    let lab = lab(6, round);
    falls_short(
        &lab,
        "fit part.off --layout layout.json --mesh 1 --tol 1e-4 -o part.step",
        &["within the tolerance", "--mesh"],
    );
    assert_eq!(count(&lab, "part.step", "MANIFOLD_SOLID_BREP"), 1);
}

#[test]
fn threads_change_nothing() {
    let lab = lab(6, round);
    lab.succeeds("fit part.off --layout layout.json --threads 1 -o part.step");
    let one = lab.bytes("part.step");
    lab.succeeds("fit part.off --layout layout.json --threads 3 -o part.step");
    assert!(one == lab.bytes("part.step"));
}

#[test]
fn what_goes_not_together_is_refused() {
    let lab = lab(6, round);
    let (_, foreign) = part(6, |p| round(p).map(|x| 7.0 * x));
    lab.put("foreign.json", foreign.to_string());
    lab.put("cut.json", &foreign.to_string()[..900]);
    lab.put("cloud.xyz", "0 0 0\n1 0 0\n0 1 0\n1 1 0\n");
    for (arguments, code, text) in [
        ("fit part.off --layout layout.json -o part.obj", 2, ".step"),
        ("fit part.off part.off --layout layout.json -o part.step", 2, "directory"),
        ("fit part.off --layout layout.json --mesh 4x3 -o part.step", 2, "--mesh"),
        ("fit part.off --layout layout.json --degree 1 -o part.step", 2, "--degree"),
        ("fit part.off --layout one --smoothness 3 -o part.step", 2, "--layout"),
        ("fit part.off --layout layout.json --smoothness -1 -o part.step", 2, "smoothness"),
        ("fit part.off --layout foreign.json -o part.step", 1, "box"),
        ("fit part.off --layout cut.json -o part.step", 1, "cut.json"),
        ("fit part.off --layout none.json -o part.step", 1, "none.json"),
        ("fit cloud.xyz --layout layout.json -o part.step", 1, "mesh"),
    ] {
        lab.fails(arguments, code, &[text]);
    }
}
