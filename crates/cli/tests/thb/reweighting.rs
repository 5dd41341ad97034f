//! Robust losses, markers, confidence, and the rules for the smoothing weight.

use crate::lab::Lab;
use crate::scans;

/// Points per direction.
const SIDE: usize = 24;

/// Whether a point of [`scan`] is spoiled: about a fifth are, without order.
fn spoiled(row: usize) -> bool {
    let step = |state: u64| state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (0..=row + 10).fold(1, |state, _| step(state)) >> 32 & 0xFF < 51
}

/// A surface with parameters, as CSV with the columns u, v, x, y, z, sure: every fifth point is off by up to 0.5 in z, if
/// asked for, and 0 in the last column.
fn scan(outliers: bool) -> String {
    let mut text = String::from("u,v,x,y,z,sure\n");
    for row in 0..SIDE * SIDE {
        let [u, v] = [row % SIDE, row / SIDE].map(|i| i as f64 / (SIDE - 1) as f64);
        let off = if outliers && spoiled(row) { 0.1 + 0.4 * (row as f64 * 0.618).fract() } else { 0.0 };
        let z = 0.2 * (3.0 * u + 0.5).sin() * (2.0 * v).cos() + off;
        text += &format!("{u},{v},{u},{v},{z},{}\n", if spoiled(row) { 0 } else { 2 });
    }
    text
}

fn count_spoiled() -> usize {
    (0..SIDE * SIDE).filter(|&row| spoiled(row)).count()
}

/// Largest distance of the model in `part.json` to the clean points.
fn error(lab: &Lab) -> f64 {
    lab.prints_json("compare part.json clean.csv")["max_at_parameters"].as_f64().unwrap()
}

fn lab() -> Lab {
    let lab = Lab::with("scan.csv", scan(true));
    lab.put("clean.csv", scan(false));
    lab
}

#[test]
fn a_robust_loss_sets_outliers_aside_and_says_which() {
    let lab = lab();
    let plain = lab.thb("fit scan.csv -o part.json");
    assert!([0, 3].contains(&plain.code));
    assert!(error(&lab) > 0.05);
    for loss in ["huber", "tukey", "geman-mcclure", "lp:1.2"] {
        lab.succeeds(&format!(
            "fit scan.csv --robust {loss} --max-set-aside 0.3 -o part.json --report r.json --summary s.jsonl"
        ));
        assert!(error(&lab) < 0.005, "{loss}: {}", error(&lab));
        let report = lab.json("r.json");
        let found = &report["result"]["reweighting"];
        let rows: Vec<usize> =
            found["ignored_rows"].as_array().unwrap().iter().map(|row| row.as_u64().unwrap() as usize).collect();
        assert_eq!(rows, (0..SIDE * SIDE).filter(|&row| spoiled(row)).collect::<Vec<_>>(), "{loss}");
        assert_eq!((&found["ignored"], &report["options"]["robust"]), (&rows.len().into(), &loss.into()));
        assert!(found["scale"].as_f64().unwrap() > 0.0 && found["counted"] == SIDE * SIDE - rows.len());
        assert!(report["warnings"].to_string().contains("set aside"), "{}", report["warnings"]);
        let summary: serde_json::Value = serde_json::from_str(&lab.text("s.jsonl")).unwrap();
        assert_eq!(summary["reweighting"]["ignored"], rows.len());
        assert_eq!(summary["lambda"], report["result"]["lambda"]);
    }
}

#[test]
fn a_robust_loss_goes_with_parameters_that_move() {
    let lab = lab();
    for method in ["auto", "a-pdm", "a-hdm", "j-pdm", "joint"] {
        let options = format!("--robust tukey --max-set-aside 0.3 --method {method}");
        let run = lab.thb(&format!("fit scan.csv {options} --tol 0.1% -o part.json --report r.json"));
        assert!([0, 3].contains(&run.code), "{method}: {}", run.stderr);
        let found = &lab.json("r.json")["result"]["reweighting"];
        // All that are spoiled, and hardly any other.
        let (ignored, spoiled) = (found["ignored"].as_u64().unwrap() as usize, count_spoiled());
        assert!((spoiled..=spoiled + 5).contains(&ignored), "{method}: {found}");
        let dhd = lab.prints_json("compare part.json clean.csv")["dhd"].as_f64().unwrap();
        // Outliers are 0.1 to 0.5 off.
        assert!(dhd < 0.02, "{method}: {dhd}");
    }
}

#[test]
fn no_more_points_are_set_aside_than_may_be_and_the_user_is_told() {
    let lab = lab();
    for (loss, most, capped) in
        [("tukey", "0.1", true), ("huber", "0.05", true), ("tukey", "0.3", false), ("lp:2", "0.1", false)]
    {
        let run = lab.thb(&format!("fit scan.csv --robust {loss} --max-set-aside {most} -o part.json --report r.json"));
        assert!([0, 3].contains(&run.code), "{}", run.stderr);
        let report = lab.json("r.json");
        let found = &report["result"]["reweighting"];
        let share = found["ignored"].as_f64().unwrap() / (SIDE * SIDE) as f64;
        assert!(share <= most.parse().unwrap(), "{loss}, {most}: {share}");
        assert_eq!(found["capped"], capped, "{loss}, {most}");
        assert_eq!(report["warnings"].to_string().contains("--max-set-aside"), capped, "{}", report["warnings"]);
    }
}

#[test]
fn few_points_get_no_more_control_points_than_points() {
    // A saddle on lattices of few points, exactly, with and without a loss.
    for (columns, rows) in [(6, 3), (4, 4), (5, 5), (8, 5)] {
        let mut text = String::from("u,v,x,y,z\n");
        for (i, j) in (0..columns).flat_map(|i| (0..rows).map(move |j| (i, j))) {
            let (u, v) = (i as f64 / (columns - 1) as f64, j as f64 / (rows - 1) as f64);
            text += &format!("{u},{v},{u},{v},{}\n", u * v);
        }
        let lab = Lab::with("saddle.csv", text);
        for loss in ["", "--robust tukey", "--robust lp:1.5"] {
            lab.succeeds(&format!("fit saddle.csv {loss} -o part.json --report r.json"));
            let result = &lab.json("r.json")["result"];
            assert!(result["dofs"].as_u64().unwrap() <= columns * rows, "{loss}: {result}");
            assert!(result["dhd"].as_f64() < Some(1e-3), "{loss}: {result}");
        }
    }
}

#[test]
fn an_offset_of_the_coordinates_changes_nothing() {
    let shifted = |offset: f64| {
        let mut text = String::new();
        for row in 0..400 {
            let [u, v] = [row % 20, row / 20].map(|i| i as f64 / 19.0);
            let off = if row % 37 == 5 { 0.3 } else { 0.0 };
            let z = 0.2 * (3.0 * u).sin() * v + off;
            text += &format!("{:.6} {:.6} {:.6}\n", offset + u, offset + v, offset + z);
        }
        let lab = Lab::with("scan.xyz", text);
        lab.thb("fit scan.xyz --robust tukey --tol 0.002 -o part.json --report r.json");
        let result = lab.json("r.json")["result"].clone();
        (result["dofs"].clone(), result["reweighting"]["ignored_rows"].clone(), result["rmse"].as_f64().unwrap())
    };
    let near = shifted(0.0);
    for offset in [1e6, 1e9] {
        let far = shifted(offset);
        assert_eq!((&far.0, &far.1), (&near.0, &near.1), "{offset:e}");
        assert!((far.2 / near.2 - 1.0).abs() < 0.05, "{offset:e}: {} for {}", far.2, near.2);
    }
}

#[test]
fn a_stray_point_does_not_loosen_a_tolerance_in_percent() {
    let lab = Lab::with("stray.csv", scan(false).replacen("0,0,0,0,", "0,0,0,0,1000", 1));
    for (loss, diagonal) in [("", 1.4..1.5), ("--robust tukey", 1.4..1.5)] {
        let run = lab.thb(&format!("fit stray.csv {loss} -o part.json --report r.json"));
        assert!([0, 3].contains(&run.code), "{}", run.stderr);
        let found = lab.json("r.json")["input"]["diagonal"].as_f64().unwrap();
        assert!(diagonal.contains(&found), "{loss}: {found}");
    }
}

#[test]
fn a_confidence_of_zero_leaves_a_point_out() {
    let lab = lab();
    lab.succeeds("fit scan.csv --weights sure -o part.json --report r.json");
    assert!(error(&lab) < 0.005);
    assert_eq!(lab.json("r.json")["options"]["weights"], "sure");
    // By other methods, too.
    for method in ["ls", "a-pdm", "joint", "qi", "a-qi"] {
        lab.succeeds(&format!("fit scan.csv --weights 6 --method {method} -o part.json --report r.json"));
        assert!(error(&lab) < 0.005, "{method}: {}", error(&lab));
        let result = &lab.json("r.json")["result"];
        assert!(result["dhd"].as_f64() < Some(0.005), "{method}: {result}");
    }
    lab.fails("fit scan.csv --weights trust -o part.json", 1, &["no column named trust"]);
    lab.put("negative.csv", "x,y,z,w\n0,0,0,1\n1,0,0,-2\n0,1,0,1\n1,1,0,1\n");
    lab.fails("fit negative.csv --height-field --weights w -o part.json", 1, &["line 3", "-2", "negative"]);
    lab.put("mesh.off", scans::mesh());
    lab.fails("fit mesh.off --weights w -o part.json", 1, &["weights", "CSV", "OFF"]);
}

#[test]
fn markers_of_a_file_are_met_and_ignored() {
    let lab = lab();
    let mut markers = String::from("row,type\n");
    (0..SIDE * SIDE).filter(|&row| spoiled(row)).for_each(|row| markers += &format!("{row},II\n"));
    let met: Vec<usize> = (0..SIDE * SIDE).filter(|&row| !spoiled(row)).step_by(40).collect();
    met.iter().for_each(|row| markers += &format!("{row},I # corner\n"));
    lab.put("marks.csv", &markers);
    for update in ["1.25", "error"] {
        lab.succeeds(&format!(
            "fit scan.csv --markers marks.csv --marker-tol 0.05% --marker-update {update} -o part.json --report r.json"
        ));
        assert!(error(&lab) < 0.005);
        let report = lab.json("r.json");
        let found = &report["result"]["reweighting"];
        assert_eq!((&found["markers"], &found["markers_met"]), (&met.len().into(), &met.len().into()), "{found}");
        assert_eq!(found["markers_to_ignore"], count_spoiled());
        assert_eq!(found["markers_ignored"], count_spoiled());
        assert_eq!(found["ignored"], 0);
        assert!(found["scale"].is_null() && found["markers_missed_rows"].as_array().unwrap().is_empty());
    }
    lab.put("wrong.csv", "3,I\n4,III\n");
    lab.fails("fit scan.csv --markers wrong.csv -o part.json", 1, &["wrong.csv", "line 2", "III"]);
    lab.put("far.csv", "99999 I\n");
    lab.fails("fit scan.csv --markers far.csv -o part.json", 1, &["--markers", "99999"]);
    lab.put("twice.csv", "5 I\n5 II\n");
    lab.fails("fit scan.csv --markers twice.csv -o part.json", 1, &["marked twice"]);
    lab.fails("fit scan.csv --markers missing.csv -o part.json", 1, &["missing.csv"]);
}

#[test]
fn markers_are_found() {
    let lab = lab();
    lab.succeeds("fit scan.csv --markers auto --max-set-aside 0.3 -o part.json --report r.json");
    assert!(error(&lab) < 0.005);
    let found = lab.json("r.json")["result"]["reweighting"].clone();
    // A few sound points may be among them.
    let marked = found["markers_to_ignore"].as_u64().unwrap() as usize;
    assert!((count_spoiled()..count_spoiled() + 10).contains(&marked), "{found}");
}

#[test]
fn rules_for_the_smoothing_weight_are_reported() {
    let lab = lab();
    for lambda in ["gcv", "discrepancy:0.01", "discrepancy:0.5%"] {
        lab.succeeds(&format!("fit clean.csv --lambda {lambda} --tol 2% -o part.json --report r.json"));
        let report = lab.json("r.json");
        assert_eq!(report["options"]["lambda"], lambda);
        assert!(report["result"]["lambda"].as_f64().unwrap() > 0.0);
    }
}

#[test]
fn options_that_do_not_go_together_are_wrong_usage() {
    let lab = lab();
    for (options, texts) in [
        ("--robust tukey --method a-qi", ["--robust", "a-qi"]),
        ("--robust tukey --max-set-aside 1.5", ["--max-set-aside", "1.5"]),
        ("--markers auto --method qi", ["--markers", "qi"]),
        ("--lambda gcv --method a-pdm", ["--lambda gcv", "a-pdm"]),
        ("--robust cauchy", ["cauchy", "huber"]),
        ("--robust lp:1", ["--robust", "lp:1"]),
        ("--lambda discrepancy:0", ["--lambda", "noise"]),
        ("--marker-update 0.5", ["--marker-update", "above 1"]),
        ("--marker-tol=-1", ["positive", "-1"]),
    ] {
        lab.fails(&format!("fit scan.csv {options} -o part.json"), 2, &texts);
    }
}
