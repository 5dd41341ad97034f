//! What a fit writes, and what its report says.

use std::collections::BTreeSet;

use serde_json::Value;

use crate::lab::Lab;
use crate::scans;

fn keys(value: &Value) -> BTreeSet<&str> {
    value.as_object().unwrap().keys().map(String::as_str).collect()
}

/// The report has these keys; later versions may add others.
fn has(value: &Value, expected: &[&str]) {
    let missing: Vec<&&str> = expected.iter().filter(|key| !keys(value).contains(**key)).collect();
    assert!(missing.is_empty(), "{missing:?} missing in {value}");
}

#[test]
fn every_format_is_written() {
    let lab = Lab::with("scan.off", scans::mesh());
    let starts = [
        ("part.step", "ISO-10303-21;"),
        ("part.stp", "ISO-10303-21;"),
        ("part.xml", "<?xml"),
        ("part.json", "{"),
        ("part.obj", ""),
        ("part.ply", "ply"),
        ("part.vtk", "# vtk DataFile"),
    ];
    let outputs: Vec<String> = starts.iter().map(|(name, _)| format!("-o {name}")).collect();
    lab.succeeds(&format!("fit scan.off {} --report new/part.report.json", outputs.join(" ")));
    for (name, start) in starts {
        let bytes = lab.bytes(name);
        assert!(bytes.len() > 500 && bytes.starts_with(start.as_bytes()), "{name}: {} bytes", bytes.len());
    }
    assert_eq!(lab.files().len(), starts.len() + 2);
    // Meshes can be read again, models too.
    for mesh in ["part.obj", "part.ply"] {
        let info = lab.prints_json(&format!("info {mesh}"));
        assert!(info["kind"] == "scan" && info["triangles"].as_u64().unwrap() > 1000, "{info}");
    }
    let (json, xml) = (lab.prints_json("info part.json"), lab.prints_json("info part.xml"));
    for key in ["dofs", "levels", "cells", "degree", "domain"] {
        assert_eq!(json[key], xml[key], "{key}");
    }
}

#[test]
fn the_report_keeps_its_layout() {
    let lab = Lab::with("scan.off", scans::mesh());
    lab.succeeds("fit scan.off -o part.json --report report.json");
    let report = lab.json("report.json");
    has(&report, &["schema", "input", "options", "result", "history", "warnings"]);
    assert_eq!(report["schema"], 1);
    let input = &report["input"];
    has(input, &["file", "format", "points", "triangles", "fitted_points", "diagonal", "parameterization", "corners"]);
    assert_eq!((&input["points"], &input["triangles"]), (&169.into(), &288.into()));
    assert_eq!((&input["file"], &input["parameterization"]), (&"scan.off".into(), &"mean-value".into()));
    let options = ["method", "param", "degree", "mesh", "lambda", "tol", "within", "levels", "mark", "extension"];
    has(&report["options"], &options);
    assert_eq!((&report["options"]["tol"], &report["options"]["lambda"]), (&"auto".into(), &"auto".into()));
    let result = &report["result"];
    has(result, &["dofs", "levels", "max", "mse", "rmse", "within", "dhd", "seconds", "stop", "sides"]);
    assert_eq!(result["stop"], "tolerance");
    let number = |value: &Value, key: &str| value[key].as_f64().unwrap_or_else(|| panic!("{key} in {value}"));
    assert!(number(result, "within") >= 0.95);
    assert!((number(result, "rmse").powi(2) / number(result, "mse") - 1.0).abs() < 1e-12);
    let max = number(result, "max") * (1.0 + 1e-6);
    assert!(number(result, "dhd") <= max && number(result, "rmse") <= max, "{result}");
    assert!(report["warnings"].as_array().is_some());

    let history = report["history"].as_array().unwrap();
    for (k, iteration) in history.iter().enumerate() {
        has(iteration, &["iteration", "dofs", "levels", "max", "mse", "within", "seconds"]);
        has(&iteration["seconds"], &["assemble", "solve", "estimate", "refine"]);
        assert_eq!(iteration["iteration"], k);
    }
    let last = history.last().unwrap();
    for key in ["dofs", "levels", "max", "mse", "within"] {
        assert_eq!(last[key], result[key], "{key}");
    }
    // The model has what the report says.
    let info = lab.prints_json("info part.json");
    assert_eq!((&info["dofs"], &info["levels"]), (&result["dofs"], &result["levels"]));
}

#[test]
fn a_tolerance_that_is_not_reached_is_exit_code_3() {
    let lab = Lab::with("scan.off", scans::mesh());
    let run = lab
        .thb("fit scan.off -o part.step -o part.json --report report.json --summary all.jsonl --levels 1 --tol 1e-6%");
    assert_eq!(run.code, 3, "{run:?}");
    assert_eq!(lab.files().len(), 5, "{:?}", lab.files());
    let result = &lab.json("report.json")["result"];
    assert_eq!((&result["stop"], &result["reached"], &result["levels"]), (&"levels".into(), &false.into(), &1.into()));
    let summary: Value = serde_json::from_str(lab.text("all.jsonl").trim_end()).unwrap();
    assert_eq!(
        (&summary["status"], &summary["reached"], &summary["stop"]),
        (&"fitted".into(), &false.into(), &"levels".into())
    );
    // The limit on control points is the other reason.
    let run = lab.thb("fit scan.off -o part.step --report report.json --max-dofs 60 --tol 1e-6%");
    assert_eq!(run.code, 3, "{run:?}");
    let result = &lab.json("report.json")["result"];
    assert_eq!(result["stop"], "max-dofs");
    assert!(result["dofs"].as_u64().unwrap() <= 60);
}

#[test]
fn results_do_not_depend_on_the_run_or_the_threads() {
    for (name, scan) in [("scan.off", scans::mesh()), ("scan.csv", scans::gridded())] {
        let lab = Lab::with(name, scan);
        for (output, threads) in [("a", 1), ("b", 1), ("c", 2), ("d", 5)] {
            let run = lab.thb(&format!("fit {name} -o {output}.json -o {output}.xml --tol 0.001% --threads {threads}"));
            assert!([0, 3].contains(&run.code), "{run:?}");
        }
        for other in ["b", "c", "d"] {
            for format in ["json", "xml"] {
                let (first, second) = (lab.bytes(&format!("a.{format}")), lab.bytes(&format!("{other}.{format}")));
                assert!(first == second, "{name}: {format} files a and {other} differ");
            }
        }
        assert!(lab.prints_json("info a.json")["levels"].as_u64().unwrap() > 1, "the fit should be adaptive");
    }
}

#[test]
fn a_model_written_over_another_replaces_it() {
    let lab = Lab::with("scan.off", scans::mesh());
    lab.put("part.json", "old");
    lab.succeeds("fit scan.off -o part.json");
    assert_eq!(lab.files().len(), 2);
    assert_eq!(lab.prints_json("info part.json")["kind"], "model");
}
