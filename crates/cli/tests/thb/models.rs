//! Questions about models: eval, convert, compare, info.

use std::collections::BTreeSet;

use serde_json::Value;

use crate::lab::{Lab, table};
use crate::scans;

/// A lab with a scan, a refined model of it and its report.
fn fitted() -> Lab {
    let lab = Lab::with("scan.off", scans::mesh());
    // Vertices alone tell less than the tolerance of the area between them.
    let run = lab.thb("fit scan.off -o part.json --report report.json --tol 0.005% --method ls --samples vertices");
    assert!([0, 3].contains(&run.code), "{run:?}");
    assert!(lab.prints_json("info part.json")["levels"].as_u64().unwrap() > 1);
    lab
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

#[test]
fn eval_gives_the_corners_that_the_report_names() {
    let lab = fitted();
    lab.put("corners.csv", "u,v\n0,0\n1,0\n0,1\n1,1\n");
    let run = lab.thb("eval part.json corners.csv");
    assert!(run.code == 0 && run.stderr.is_empty() && run.stdout.starts_with("u,v,x,y,z\n"), "{run:?}");
    let rows = table(&run.stdout);
    let point = |u: f64, v: f64| rows.iter().find(|row| row[0] == u && row[1] == v).unwrap()[2..].to_vec();
    let report = lab.json("report.json");
    let sides = &report["result"]["sides"];
    let ends = [
        ("u_min", [0.0, 0.0], [0.0, 1.0]),
        ("u_max", [1.0, 0.0], [1.0, 1.0]),
        ("v_min", [0.0, 0.0], [1.0, 0.0]),
        ("v_max", [0.0, 1.0], [1.0, 1.0]),
    ];
    // To the last bit: the model file keeps every bit, and both evaluate alike.
    for (side, from, to) in ends {
        assert_eq!(numbers(&sides[side]["from"]), point(from[0], from[1]), "{side}");
        assert_eq!(numbers(&sides[side]["to"]), point(to[0], to[1]), "{side}");
    }
}

#[test]
fn eval_names_the_coordinates_of_a_planar_surface() {
    let knots = r#"<KnotVector degree="1">0 0 1 1</KnotVector>"#;
    let basis = |k: usize| format!(r#"<Basis type="BSplineBasis" index="{k}">{knots}</Basis>"#);
    let lab = Lab::with(
        "plane.xml",
        format!(
            r#"<xml><Geometry type="TensorBSpline2" id="0"><Basis type="TensorBSplineBasis2">{}{}</Basis>
            <coefs geoDim="2">0 0 2 0 0 3 2 3</coefs></Geometry></xml>"#,
            basis(0),
            basis(1)
        ),
    );
    lab.put("uv.csv", "u,v\n0.5,1\n");
    assert_eq!(lab.thb("eval plane.xml uv.csv").stdout, "u,v,x,y\n0.5,1,1,3\n");
}

#[test]
fn eval_says_which_parameter_is_outside() {
    let lab = fitted();
    lab.put("outside.csv", "u,v\n0,0\n0.5,1.25\n");
    lab.fails("eval part.json outside.csv", 1, &["outside.csv: line 3: ", " = 1.25 ", "[0, 1]"]);
    assert_eq!(lab.thb("eval part.json outside.csv").stderr.matches("1.25").count(), 1);
    // Within round-off it is the boundary.
    lab.put("rounded.csv", "u,v\n1.0000000000001,0.5\n0.5,-1e-15\n");
    lab.put("boundary.csv", "u,v\n1,0.5\n0.5,0\n");
    assert_eq!(lab.thb("eval part.json rounded.csv").stdout, lab.thb("eval part.json boundary.csv").stdout);
    // However they are written; two columns without names are u and v, three are not.
    for same in ["1,0.5\n0.5,0\n", "v;u\n0,5;1\n0;0,5\n", "\u{feff}U V\n\n1 0.5\n0.5 0\n", "# u v\n1\t0.5\n0.5\t0\n"] {
        lab.put("same.csv", same);
        assert_eq!(lab.thb("eval part.json same.csv").stdout, lab.thb("eval part.json boundary.csv").stdout, "{same}");
    }
    lab.put("three.csv", "1,0.5,7\n0.5,0,8\n");
    lab.fails("eval part.json three.csv", 1, &["three.csv", "no line names the columns"]);
    lab.put("names.csv", "a,b\n0,0\n");
    lab.fails("eval part.json names.csv", 1, &["names.csv", "u"]);
    lab.fails("eval missing.json outside.csv", 1, &["missing.json"]);
    lab.fails("eval scan.off outside.csv", 1, &["scan.off"]);
}

#[test]
fn conversion_to_xml_and_back_keeps_the_surface() {
    let lab = fitted();
    lab.succeeds("convert part.json -o part.xml");
    lab.succeeds("convert part.xml -o back.json");
    let (before, after) = (lab.json("part.json"), lab.json("back.json"));
    for key in ["dimension", "kind", "degrees", "knots"] {
        assert_eq!(before[key], after[key], "{key}");
    }
    let rows = |model: &Value| model["coefficients"].as_array().unwrap().iter().map(numbers).collect::<Vec<_>>();
    let (before, after) = (rows(&before), rows(&after));
    assert_eq!(before.len(), after.len());
    for (k, (a, b)) in before.iter().flatten().zip(after.iter().flatten()).enumerate() {
        assert!((a - b).abs() <= 1e-15 * a.abs(), "coefficient {k}: {a} and {b}");
    }
    let mut sites = String::from("u,v\n");
    (0..100).for_each(|k| sites += &format!("{},{}\n", f64::from(k) / 99.0, f64::from(k * 37 % 100) / 99.0));
    lab.put("sites.csv", sites);
    let (before, after) = (lab.thb("eval part.json sites.csv"), lab.thb("eval back.json sites.csv"));
    for (a, b) in table(&before.stdout).iter().flatten().zip(table(&after.stdout).iter().flatten()) {
        assert!((a - b).abs() <= 1e-15, "{a} and {b}");
    }
}

#[test]
fn conversion_writes_every_format_and_rejects_others() {
    let lab = fitted();
    for name in ["new.step", "new.stp", "new.xml", "new.json", "new.obj", "new.ply", "new.vtk"] {
        lab.succeeds(&format!("convert part.json -o {name}"));
        assert!(lab.bytes(name).len() > 500, "{name}");
    }
    lab.fails("convert part.json -o new.iges", 2, &["new.iges", ".step"]);
    lab.fails("convert scan.off -o other.step", 1, &["scan.off"]);
    lab.fails("convert part.json -o scan.off/new.step", 1, &["new.step"]);
    lab.put("cut.json", &lab.bytes("part.json")[..400]);
    lab.fails("convert cut.json -o other.step", 1, &["cut.json", "line"]);
}

#[test]
fn compare_agrees_with_the_report() {
    let lab = fitted();
    let comparison = lab.prints_json("compare part.json scan.off --tol 0.005%");
    let keys: BTreeSet<&str> = comparison.as_object().unwrap().keys().map(String::as_str).collect();
    let expected = ["points", "dhd", "hsd", "mean", "mse", "rmse", "tolerance", "within", "max_at_parameters"];
    assert!(expected.iter().all(|key| keys.contains(key)), "{keys:?}");
    let result = &lab.json("report.json")["result"];
    let number = |value: &Value, key: &str| value[key].as_f64().unwrap();
    assert_eq!(comparison["points"], 169);
    assert_eq!(number(&comparison, "tolerance"), number(result, "tolerance"));
    // Distances to the closest point are at most those at the parameters.
    let (dhd, of_report) = (number(&comparison, "dhd"), number(result, "dhd"));
    assert!((dhd - of_report).abs() <= 1e-9 * of_report, "{dhd} and {of_report}");
    assert!(number(&comparison, "rmse") <= number(result, "rmse") * (1.0 + 1e-9));
    assert!(number(&comparison, "within") >= number(result, "within"));
    // The same measures of the same mesh, whether searches begin at parameters or not.
    for side in ["scan_to_surface", "surface_to_scan", "facets_to_surface", "surface_to_facets"] {
        for figure in ["within", "mean", "rms", "p95", "max"] {
            let of = |value: &Value| value["deviation"][side][figure].as_f64().unwrap();
            let (a, b) = (of(&comparison), of(result));
            assert!((a - b).abs() <= 1e-3 * b, "{side} {figure}: {a} and {b}");
        }
    }
    assert!(number(&comparison, "hsd") >= dhd && number(&comparison, "mean") <= number(&comparison, "rmse"));
    for tol in ["nan", "-1", "-1%", "0"] {
        lab.fails(&format!("compare part.json scan.off --tol {tol}"), 2, &["--tol"]);
    }
    lab.fails("compare part.json missing.off", 1, &["missing.off"]);
    lab.fails("compare scan.off scan.off", 1, &["scan.off"]);
}

#[test]
fn compare_uses_the_parameters_of_a_cloud() {
    let lab = Lab::with("scan.csv", scans::cloud(1.0));
    lab.succeeds("fit scan.csv --method ls -o part.json --report report.json");
    let comparison = lab.prints_json("compare part.json scan.csv");
    let largest = comparison["max_at_parameters"].as_f64().unwrap();
    let expected = lab.json("report.json")["result"]["max"].as_f64().unwrap();
    assert!((largest - expected).abs() <= 1e-12, "{largest} and {expected}");
}

#[test]
fn info_tells_models_from_scans() {
    let lab = fitted();
    lab.put("grid.csv", scans::gridded());
    lab.put("cloud.csv", scans::cloud(1.0));
    let info = lab.prints_json("info part.json");
    assert_eq!(info["kind"], "model");
    assert_eq!((&info["parameters"], &info["dimension"]), (&2.into(), &3.into()));
    assert_eq!(info["degree"], serde_json::json!([3, 3]));
    let per_level: u64 = info["dofs_per_level"].as_array().unwrap().iter().map(|n| n.as_u64().unwrap()).sum();
    assert_eq!(info["dofs"], per_level);
    assert_eq!((&info["cells"].is_u64(), &info["unit"].is_string()), (&true, &true));

    let info = lab.prints_json("info scan.off");
    assert_eq!((&info["kind"], &info["points"], &info["triangles"]), (&"scan".into(), &169.into(), &288.into()));
    assert_eq!((&info["parameters"], &info["grid"]), (&false.into(), &Value::Null));
    assert_eq!(info["bounds"].as_array().unwrap().len(), 2);
    assert_eq!(lab.prints_json("info grid.csv")["grid"], serde_json::json!([13, 13]));
    assert_eq!(lab.prints_json("info cloud.csv")["parameters"], true);
    lab.fails("info missing.off", 1, &["missing.off"]);
    lab.fails("info missing.json", 1, &["missing.json"]);
}

#[test]
fn step_files_name_their_part_and_their_program() {
    let lab = Lab::with("scan.off", scans::mesh());
    lab.succeeds("fit scan.off --tol 1% -o face.step -o face.json --report face.report.json");
    let step = lab.text("face.step");
    assert!(
        step.contains("PRODUCT('face','face'") && step.contains("FILE_SCHEMA(('AUTOMOTIVE_DESIGN"),
        "{}",
        &step[..900]
    );
    let system = format!("'thb {}'", env!("CARGO_PKG_VERSION"));
    assert!(
        step.contains("FILE_NAME('face.step','2000-02-29T00:00:00+00:00',") && step.contains(&system),
        "{}",
        &step[..500]
    );
    // Poles are more than control points: they are those of the tensor product.
    let report = lab.json("face.report.json");
    let points = step.matches("B_SPLINE_SURFACE_WITH_KNOTS").count();
    assert_eq!((&report["step"]["faces"], points), (&1.into(), 1));
    assert!(report["step"]["poles"].as_u64() >= report["result"]["dofs"].as_u64(), "{}", report["step"]);
    assert!(!lab.text("face.json").contains("\"name\""));

    lab.succeeds("fit scan.off --tol 1% --name Deckel --schema ap242 -o out/");
    let step = lab.text("out/Deckel.step");
    assert!(step.contains("PRODUCT('Deckel'") && step.contains("FILE_SCHEMA(('AP242_MANAGED"), "{}", &step[..900]);
    // The model keeps its name.
    lab.succeeds("convert out/Deckel.json -o other.step");
    assert!(lab.text("other.step").contains("PRODUCT('Deckel'"));
    lab.succeeds("convert out/Deckel.json -o other.step --name Lid --schema ap242");
    let step = lab.text("other.step");
    assert!(step.contains("PRODUCT('Lid'") && step.contains("AP242") && step.contains(&system));
    lab.fails("fit scan.off scan.off --name Deckel -o out/", 2, &["--name", "2"]);
    lab.fails("fit scan.off --schema ap203 -o a.step", 2, &["ap203", "ap214"]);
}

#[test]
fn a_comparison_is_a_gate() {
    let lab = Lab::with("scan.off", scans::mesh());
    lab.succeeds("fit scan.off --tol 1% -o part.json");
    let found = lab.prints_json("compare part.json scan.off --points points.csv");
    let of_area = |key: &str| found["deviation"]["scan_to_surface"][key].as_f64().unwrap();
    let diagonal = found["diagonal"].as_f64().unwrap();
    for (key, value) in [("max", of_area("max")), ("p95", of_area("p95"))] {
        for (factor, code) in [(1.01, 0), (0.99, 3)] {
            for limit in [format!("{}", factor * value), format!("{}%", 100.0 * factor * value / diagonal)] {
                let run = lab.thb(&format!("compare part.json scan.off --{key} {limit}"));
                assert_eq!(
                    (run.code, run.stderr.contains(&format!("more than --{key}"))),
                    (code, code == 3),
                    "{run:?}"
                );
                assert!(run.stdout.contains("\"dhd\""));
            }
        }
    }
    // A row a point, in the order of the file, and the figures of all.
    let rows = table(&lab.text("points.csv"));
    assert_eq!(rows.len() as u64, found["points"].as_u64().unwrap());
    assert!(lab.text("points.csv").starts_with("row,x,y,z,distance,closest_x,closest_y,closest_z,u,v\n"));
    let first: Vec<f64> = scans::mesh().lines().nth(2).unwrap().split(' ').map(|x| x.parse().unwrap()).collect();
    assert_eq!(rows[0][1..4], first);
    let mut largest = 0.0_f64;
    for (k, row) in rows.iter().enumerate() {
        assert_eq!(row[0], k as f64);
        let apart = (0..3).map(|d| (row[1 + d] - row[5 + d]).powi(2)).sum::<f64>().sqrt();
        assert!((apart - row[4]).abs() < 1e-12, "{row:?}");
        largest = largest.max(row[4]);
    }
    assert_eq!(largest, found["dhd"].as_f64().unwrap());
    lab.fails("compare part.json scan.off --max 0", 2, &["--max", "positive"]);
    lab.fails("compare part.json scan.off --points scan.off", 2, &["scan.off", "input"]);
}
