//! Broken and degenerate inputs: what is wrong is said, nothing is written.

use crate::lab::Lab;
use crate::scans;

/// Fits a file that cannot be fitted; the message names it and says the given things.
fn rejects(name: &str, content: impl AsRef<[u8]>, texts: &[&str]) {
    let lab = Lab::with(name, content);
    let mut all = vec![name];
    all.extend(texts);
    lab.fails(&format!("fit {name} -o part.step -o part.json --report part.report.json"), 1, &all);
}

#[test]
fn coordinates_that_are_not_finite() {
    let text = scans::cloud(1.0);
    let lines: Vec<&str> = text.lines().collect();
    for bad in ["nan", "NaN", "inf", "-inf"] {
        let row = format!("{bad},0.5,0.5,0.5,0.5");
        let mut changed = lines.clone();
        changed[7] = &row;
        let lab = Lab::with("scan.csv", changed.join("\n"));
        lab.succeeds("fit scan.csv -o part.json --report report.json");
        let report = lab.json("report.json");
        assert_eq!(report["input"]["points"], lines.len() - 2);
        let warnings = report["warnings"].to_string();
        assert!(warnings.contains("1 of ") && warnings.contains("line 8"), "{warnings}");
    }
    // Of meshes and scanners such a point is what was not seen.
    let lab = Lab::with("scan.off", scans::mesh().replacen("\n1 1 ", "\nnan 1 ", 1));
    assert!(lab.prints_json("info scan.off")["notes"].to_string().contains("1 points are not a number"));
}

#[test]
fn empty_files() {
    for name in ["scan.ply", "scan.csv", "scan.off", "scan.obj", "scan.xyz"] {
        rejects(name, "", &["empty"]);
    }
    rejects("scan.csv", "x,y,z,u,v\n", &["no points"]);
}

#[test]
fn binary_files_that_are_cut_off() {
    rejects("scan.ply", scans::binary_ply(2), &["cut off", "4 records of vertex", "2 are there"]);
    let whole = scans::binary_ply(4);
    rejects("scan.ply", &whole[..whole.len() - 1], &["cut off", "2 records of face", "1 are there"]);
    Lab::with("scan.ply", whole).succeeds("fit scan.ply -o part.step");
}

#[test]
fn clouds_without_extent() {
    rejects("scan.csv", scans::cloud_of(&[[0.0; 3], [1.0; 3]]), &["2 points", "at least 4"]);
    rejects("scan.csv", scans::cloud_of(&[[1.0, 2.0, 3.0]; 20]), &["all 20 points are equal"]);
    let line: Vec<[f64; 3]> = (0..20).map(|i| [f64::from(i), 2.0 * f64::from(i), 1.0]).collect();
    rejects("scan.csv", scans::cloud_of(&line), &["all 20 points lie on a line", "curve"]);
}

#[test]
fn parameters_on_a_line() {
    let points = "x,y,z,u,v\n0,0,0,0,0.5\n1,0,0,0.3,0.5\n1,1,0,0.6,0.5\n0,1,0,1,0.5\n0.5,0.5,0,0.5,0.5\n";
    rejects("scan.csv", points, &["all parameters of direction 1 are 0.5"]);
}

#[test]
fn meshes_that_are_no_disk() {
    rejects("scan.off", scans::two_pieces(), &["2 pieces", "[18, 8]", "--clean stray", "--piece"]);
    rejects("scan.off", scans::closed_mesh(), &["closed", "4 triangles"]);
    rejects("scan.off", "OFF\n3 0 0\n0 0 0\n1 0 0\n0 1 0\n", &[]);
}

#[test]
fn clouds_without_order() {
    let raw: String = scans::gridded()
        .lines()
        .skip(1)
        .fold(String::new(), |text, line| text + &line.splitn(3, ',').nth(2).unwrap().replace(',', " ") + "\n");
    let lab = Lab::with("scan.xyz", raw);
    lab.succeeds("fit scan.xyz -o part.step --report report.json");
    let report = lab.json("report.json");
    assert_eq!(report["input"]["parameterization"], "spanned mesh, mean-value");
    assert!(report["warnings"].to_string().contains("--flip"));
    lab.fails("fit scan.xyz -o other.step --param chord", 1, &["--param chord", "grid"]);
    let lab = Lab::with("scan.off", scans::mesh());
    lab.fails("fit scan.off -o part.step --param given", 1, &["--param given", "parameters u, v"]);
    lab.fails("fit scan.off -o part.step --param chord", 1, &["--param chord", "grid"]);
}

#[test]
fn files_that_are_not_there_or_of_no_known_kind() {
    let lab = Lab::with("scan.abc", scans::mesh());
    lab.fails("fit scan.abc -o part.step", 1, &["scan.abc", "abc", ".ply"]);
    lab.fails("fit missing.off -o part.step", 1, &["missing.off", "cannot be read"]);
    lab.fails("fit . -o part.step", 1, &[]);
}

#[test]
fn parameters_outside_the_unit_square_need_a_domain() {
    let lab = Lab::with("scan.csv", scans::cloud(2.5));
    lab.fails("fit scan.csv -o part.json", 1, &["scan.csv", "outside [0, 1]", "--domain data"]);
    lab.succeeds("fit scan.csv -o part.json --domain data --report report.json");
    assert_eq!(lab.json("report.json")["options"]["domain"], "data");
    let info = lab.prints_json("info part.json");
    assert_eq!(info["domain"], serde_json::json!([[0.0, 0.0], [2.5, 2.5]]));
}

#[test]
fn equal_points_are_a_warning() {
    let text = scans::cloud(1.0);
    let last = text.lines().last().unwrap();
    let lab = Lab::with("scan.csv", format!("{text}{last}\n{last}\n"));
    lab.put("soup.off", scans::triangle_soup());
    let collapsed = scans::mesh().replacen(" 288 0", " 289 0", 1) + "3 5 5 6\n";
    lab.put("flat.off", collapsed);
    for (scan, words) in [
        ("scan.csv", "2 points are equal"),
        ("soup.off", "695 equal vertices were merged"),
        ("flat.off", "1 triangles with a vertex twice"),
    ] {
        lab.succeeds(&format!("fit {scan} -o part.json --report report.json"));
        let report = lab.json("report.json");
        let warnings = report["warnings"].as_array().unwrap();
        assert!(warnings.iter().any(|w| w.as_str().unwrap().contains(words)), "{warnings:?}");
    }
    // All points are kept, equal vertices are one.
    lab.succeeds("fit scan.csv -o part.json --report report.json");
    assert_eq!(lab.json("report.json")["input"]["fitted_points"], 171);
    lab.succeeds("fit soup.off -o part.json --report report.json");
    assert_eq!(lab.json("report.json")["input"]["fitted_points"], 169);
}

#[test]
fn what_a_file_leaves_open_is_said_by_options() {
    // Heights over x and y, in columns of other names and under an extension that tells nothing.
    let mut text = String::from("id;easting;northing;height\n");
    for (i, j) in (0..12).flat_map(|i| (0..12).map(move |j| (i, j))) {
        let (x, y) = (f64::from(i) / 11.0, f64::from(j) / 11.0);
        text += &format!("7;{x};{y};{}\n", 0.3 * x * y);
    }
    let lab = Lab::with("scan.tab", &text);
    lab.fails("info scan.tab", 1, &["tab", "--format"]);
    let named = lab.prints_json("info scan.tab --format csv");
    assert!(named["notes"].to_string().contains("columns easting, northing, height were taken as x, y, z"), "{named}");
    assert_eq!(named["columns"][0], serde_json::json!({"number": 2, "name": "easting", "as": "x"}));
    lab.put("other.tab", text.replace("northing", "breadth"));
    lab.fails("info other.tab --format csv", 1, &["no column named y", "--columns"]);
    lab.fails("info scan.tab --format tab", 2, &["--format", "xyz"]);
    lab.fails("info scan.tab --class 300", 2, &["--class"]);
    lab.fails("info -", 1, &["standard input", "--format"]);
    let read = "--format csv --columns easting,northing,height --height-field";
    assert_eq!(lab.prints_json(&format!("info scan.tab {read}"))["parameters"], true);
    lab.succeeds(&format!("fit scan.tab {read} -o part.json --report report.json"));
    let report = lab.json("report.json");
    assert_eq!(report["input"]["parameterization"], "given");
    assert_eq!(report["options"]["columns"], serde_json::json!(["easting", "northing", "height"]));
    assert_eq!(report["options"]["format"], "csv");
    assert!(lab.prints_json(&format!("compare part.json scan.tab {read}"))["dhd"].as_f64().unwrap() < 1e-3);
    lab.succeeds(&format!("fit - {read} -o out/ < scan.tab"));
    assert!(lab.files().contains("out/stdin.report.json"), "{:?}", lab.files());
}
