//! `thb fit-curve`.

use std::fmt::Write as _;

use crate::lab::Lab;

/// A closed section with a sharp tail, in the form of airfoil files.
fn airfoil() -> String {
    let mut text = "WING SECTION 7\n".to_owned();
    for k in 0..=120 {
        let t = std::f64::consts::PI * f64::from(k) / 120.0;
        let (x, y) = (0.5 + 0.5 * (2.0 * t).cos(), 0.12 * (2.0 * t).sin() * t.sin().abs());
        let _ = writeln!(text, " {x:.8}  {y:.8}");
    }
    text
}

fn step() -> String {
    let mut text = "temperature,property\n".to_owned();
    for k in 0..80 {
        let x = 500.0 + 5.0 * f64::from(k);
        let _ = writeln!(text, "{x},{}", 0.6 + (-((x - 700.0) / 30.0).powi(2)).exp());
    }
    text
}

#[test]
fn a_section_goes_to_all_formats() {
    let lab = Lab::with("wing.dat", airfoil());
    let run = lab.thb("fit-curve wing.dat -o w.step -o w.svg -o w.dxf -o w.json -o w.xml --report r.json --units m");
    assert!(run.code == 0 && run.stderr == "thb: note: line 1 is not a point and was skipped\n", "{run:?}");
    assert!(lab.thb("fit-curve wing.dat --quiet").stderr.is_empty());
    assert!(
        run.stdout.ends_with("good\n")
            && run.stdout.contains("at a corner, corner at row 0")
            && run.stdout.contains("(tolerance)"),
        "{run:?}"
    );
    let report = lab.json("r.json");
    let control_points = report["result"]["control_points"].as_u64().unwrap();
    assert!(control_points < 30 && report["result"]["max"].as_f64() < report["result"]["tolerance"].as_f64());
    // Control points and knots stand in the drawing.
    let dxf = lab.text("w.dxf");
    let count = |code: &str| {
        let lines: Vec<&str> = dxf.lines().collect();
        let start = lines.iter().position(|&line| line == "AcDbSpline").unwrap();
        let end = lines[start..].iter().position(|&line| line == "ENDSEC").unwrap() + start;
        lines[start + 1..end].chunks(2).filter(|pair| pair[0] == code).count() as u64
    };
    assert_eq!((count("10"), count("40")), (control_points, control_points + 4));
    assert!(lab.text("w.svg").starts_with("<svg") && lab.text("w.step").contains("GEOMETRIC_CURVE_SET"));
    // The model reads back, and goes to the same drawing.
    assert_eq!(lab.prints_json("info w.json")["dofs"].as_u64(), Some(control_points));
    lab.succeeds("convert w.json -o again.dxf");
    assert_eq!(lab.text("again.dxf"), dxf);
    // It begins and ends at the tail.
    lab.put("ends.csv", "u\n0\n1\n");
    let run = lab.thb("eval w.json ends.csv");
    let ends: Vec<&str> = run.stdout.lines().skip(1).map(|line| line.split_once(',').unwrap().1).collect();
    assert_eq!(ends[0], ends[1]);
}

#[test]
fn a_graph_has_x_as_its_parameter() {
    let lab = Lab::with("heat.csv", step());
    let run = lab.thb("fit-curve heat.csv --graph --tol 0.5% -o heat.json");
    assert!(run.code == 0 && run.stderr.contains("temperature, property were taken"), "{run:?}");
    lab.put("at.csv", "u\n500\n700\n812.5\n895\n");
    let run = lab.thb("eval heat.json at.csv");
    for line in run.stdout.lines().skip(1) {
        let numbers: Vec<f64> = line.split(',').map(|x| x.parse().unwrap()).collect();
        assert!((numbers[0] - numbers[1]).abs() < 1e-9, "{line}");
        assert!((numbers[2] - 0.6 - (-((numbers[0] - 700.0) / 30.0).powi(2)).exp()).abs() < 0.01, "{line}");
    }
}

#[test]
fn an_unreached_tolerance_is_told_by_the_exit_code() {
    let lab = Lab::with("heat.csv", step());
    let run = lab.thb("fit-curve heat.csv --graph --knots 2 --report r.json");
    assert!(run.code == 3 && run.stdout.contains("fixed-knots") && run.stdout.ends_with("failed\n"), "{run:?}");
    // Standard error has the words of the report.
    let result = &lab.json("r.json")["result"];
    assert_eq!((result["verdict"].as_str(), result["reasons"][0]["code"].as_str()), (Some("failed"), Some("share")));
    let text = result["reasons"][0]["text"].as_str().unwrap();
    assert!(run.stderr.contains(text) && text.contains("weighed by their spacing"), "{run:?}");
    assert_eq!(lab.json("r.json")["result"]["control_points"], 6);
    assert_eq!(lab.json("r.json")["options"]["knots"], "2");
}

#[test]
fn wrong_usage_is_told_before_anything_is_read() {
    let lab = Lab::with("heat.csv", step());
    for (arguments, code, tells) in [
        ("fit-curve none.csv -o a.ply", 2, ".dxf"),
        ("fit-curve none.csv --method qi", 2, "--method"),
        ("fit-curve none.csv --graph --method joint", 2, "--graph"),
        ("fit-curve heat.csv -o heat.csv.json -o heat.csv.json", 2, "two outputs"),
        ("fit-curve heat.csv -o a.json -o ./a.json", 2, "two outputs"),
        ("fit-curve heat.csv --report ./heat.csv", 2, "input"),
        ("fit-curve none.csv", 1, "none.csv"),
        ("fit-curve heat.csv --corners 100", 1, "row 100"),
        ("fit-curve heat.csv --param given", 1, "column u"),
        ("fit heat.csv -o heat.dxf", 2, "extension"),
    ] {
        let run = lab.thb(arguments);
        assert!(run.code == code && run.stderr.contains(tells), "{arguments}: {run:?}");
    }
    assert_eq!(lab.files().len(), 1);
}
