//! From raw clouds to parameters.

use crate::lab::{Lab, table};
use crate::scans::{gridded, rows, scattered};

/// Rows of the points nearest to the corners of the square, in the order in which they become (0,0), (1,0), (1,1), (0,1).
fn corner_rows(places: &[([f64; 2], bool)]) -> Vec<usize> {
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    corners.iter().map(|c| places.iter().position(|(p, _)| p == c).unwrap()).collect()
}

fn csv(lab: &Lab, name: &str) -> Vec<Vec<f64>> {
    let text = lab.text(name);
    assert!(text.starts_with("row,x,y,z,u,v,boundary\n"));
    table(&text)
}

#[test]
fn a_raw_cloud_gets_parameters_a_picture_and_a_verdict() {
    let places = scattered(20, 500);
    let lab = Lab::with("raw.xyz", rows(&places));
    let report = lab.prints_json("param raw.xyz -o uv.csv -o uv.svg");
    let quality = &report["parameterization"];
    assert_eq!((&quality["folded"], &quality["left_out"]), (&0.into(), &0.into()));
    assert_eq!(quality["verdict"], "even");
    let mut corners: Vec<u64> = quality["corners"].as_array().unwrap().iter().map(|c| c.as_u64().unwrap()).collect();
    let mut expected: Vec<u64> = corner_rows(&places).iter().map(|&row| row as u64).collect();
    corners.sort_unstable();
    expected.sort_unstable();
    assert_eq!(corners, expected);
    // All points have parameters in the square, the outline on its sides.
    let table = csv(&lab, "uv.csv");
    assert_eq!(table.len(), places.len());
    for line in &table {
        let (u, v, on_boundary) = (line[4], line[5], line[6] == 1.0);
        assert!((0.0..=1.0).contains(&u) && (0.0..=1.0).contains(&v));
        assert_eq!(on_boundary, places[line[0] as usize].1);
        assert_eq!(on_boundary, [u, v].iter().any(|x| *x == 0.0 || *x == 1.0));
    }
    let picture = lab.text("uv.svg");
    assert!(picture.starts_with("<svg") && picture.ends_with("</svg>\n"));
    assert_eq!(picture.matches("<path").count() as u64, quality["triangles"].as_u64().unwrap());
    // The parameters go into a fit.
    lab.succeeds("fit uv.csv --tol 0.2% -o part.json --report r.json");
    assert_eq!(lab.json("r.json")["parameterization"]["method"], "given");
}

#[test]
fn a_large_cloud_goes_through_a_subset() {
    let places = scattered(60, 4000);
    let lab = Lab::with("raw.xyz", rows(&places));
    lab.succeeds("fit raw.xyz --subset 800 --tol 0.1% -o part.json --report r.json");
    let report = lab.json("r.json");
    let quality = &report["parameterization"];
    let subset = quality["subset"].as_u64().unwrap();
    assert!((400..=800).contains(&subset), "{subset}");
    assert_eq!(report["input"]["fitted_points"], places.len());
    assert!(quality["distance_correlation"].as_f64().unwrap() > 0.9, "{quality}");
    assert_eq!(quality["folded"], 0);
}

#[test]
fn points_that_stand_alone_are_set_aside_and_stay_on_request() {
    let places = scattered(20, 500);
    let mut text = rows(&places);
    let stray = ["0.5 0.5 3\n", "0.2 0.4 -3\n", "2.5 0.1 0\n"];
    stray.iter().for_each(|line| text += line);
    let lab = Lab::with("raw.xyz", text);
    let told = lab.prints_json("param raw.xyz");
    assert_eq!(told["points"], places.len());
    let cleaning = &told["parameterization"]["cleaning"];
    assert_eq!((&cleaning["outliers"], &cleaning["sentinels"]), (&0.into(), &stray.len().into()), "{cleaning}");
    assert_eq!(cleaning["sentinel_rows"][2], places.len() + 2);
    assert!(told["warnings"].to_string().contains("--clean none"), "{told}");
    for clean in ["outliers", "stray", "outliers,stray"] {
        let report = lab.prints_json(&format!("param raw.xyz --clean {clean}"));
        assert_eq!(report["points"], places.len());
        assert_eq!(report["parameterization"]["left_out"], stray.len());
    }
    let all = lab.prints_json("param raw.xyz --clean none");
    assert_eq!(all["parameterization"]["cleaning"]["sentinels"], 0);
    let thinned = lab.prints_json("param raw.xyz --clean stray --thin 300");
    assert!((200..=300).contains(&thinned["points"].as_u64().unwrap()));
    lab.fails("param raw.xyz --clean none,stray", 2, &["--clean", "none, or some of"]);
}

#[test]
fn corners_and_boundary_can_be_given() {
    let places = scattered(20, 500);
    let lab = Lab::with("raw.xyz", rows(&places));
    let corners = corner_rows(&places);
    let turned: Vec<String> = (0..4).map(|k| corners[(k + 1) % 4].to_string()).collect();
    let report = lab.prints_json(&format!("param raw.xyz --corners {} -o uv.csv", turned.join(",")));
    let first = &csv(&lab, "uv.csv")[corners[1]];
    assert_eq!((first[4], first[5]), (0.0, 0.0), "{report}");

    // The boundary as a list without order, and as a column.
    let outline: Vec<usize> = (0..places.len()).filter(|&i| places[i].1).collect();
    let list: String = outline.iter().map(|row| format!("{row} # a comment\n")).collect();
    lab.put("outline.txt", list);
    let by_file = lab.prints_json("param raw.xyz --outline outline.txt -o file.csv");
    assert_eq!(by_file["parameterization"]["method"], "lpsp, corrected");
    assert_eq!(by_file["parameterization"]["boundary_points"], outline.len());
    let lines = rows(&places);
    let labelled =
        lines.lines().zip(&places).map(|(line, (_, on))| format!("{},{}\n", line.replace(' ', ","), u8::from(*on)));
    lab.put("labelled.csv", String::from("x,y,z,boundary\n") + &labelled.collect::<String>());
    lab.prints_json("param labelled.csv -o column.csv");
    assert_eq!(lab.text("file.csv"), lab.text("column.csv"));

    for (arguments, told) in [
        ("--corners 0,1,2,99999", "row 99999"),
        ("--outline missing.txt", "missing.txt"),
        ("--outline words.txt", "line 2"),
        ("--outline twice.txt", "twice"),
    ] {
        lab.put("words.txt", "1 2 3\n4 five\n");
        lab.put("twice.txt", "1 2 3 4 1\n");
        let run = lab.thb(&format!("param raw.xyz {arguments}"));
        assert!(run.code == 1 && run.stderr.contains(told), "{arguments}: {run:?}");
    }
    let inside = (0..places.len()).find(|&i| !places[i].1).unwrap();
    let run = lab.thb(&format!("param raw.xyz --corners {inside},{},{},{}", corners[1], corners[2], corners[3]));
    assert!(run.code == 1, "{run:?}");
}

#[test]
fn every_way_of_laying_out_a_cloud_works() {
    let lab = Lab::with("raw.xyz", rows(&scattered(20, 500)));
    for (way, method) in [
        ("--param uniform", "uniform"),
        ("--param recd --radius auto", "recd"),
        ("--param lpsp --radius 0.2 --side-rule centripetal", "lpsp"),
        ("--param mean-value --refine on", "spanned mesh, mean-value, refined"),
        ("--param mean-value --refine off", "spanned mesh, mean-value"),
    ] {
        let report = lab.prints_json(&format!("param raw.xyz {way}"));
        assert_eq!(report["parameterization"]["method"], method);
        assert_eq!(report["parameterization"]["folded"], 0, "{way}");
    }
}

#[test]
fn height_fields_are_cropped_and_masked() {
    let grid = |value: &dyn Fn(usize, usize) -> f64| {
        let mut text = String::from("ncols 30\nnrows 20\nxllcorner 0\nyllcorner 0\ncellsize 1\nNODATA_value -9999\n");
        for j in 0..20 {
            text += &((0..30).map(|i| value(i, j).to_string()).collect::<Vec<_>>().join(" ") + "\n");
        }
        text
    };
    let lab = Lab::with("land.asc", grid(&|i, j| 5.0 + (0.2 * i as f64).sin() + (0.3 * j as f64).cos()));
    lab.put("mask.asc", grid(&|i, _| if i < 12 { 1.0 } else { 0.0 }));
    let cropped = lab.prints_json("param land.asc --crop 0,10,0,20 -o crop.csv");
    assert_eq!(cropped["points"], 200);
    let u = csv(&lab, "crop.csv").iter().map(|line| line[4]).fold(0.0, f64::max);
    assert_eq!(u, 1.0);
    assert_eq!(lab.prints_json("param land.asc --mask mask.asc")["points"], 240);
    // Cells longer than wide; one with data stands alone, the northern line has none.
    lab.put(
        "long.asc",
        "ncols 5\nnrows 2\nxllcorner 0\nyllcorner 0\ndx 4\ndy 10\nNODATA_value 0\n0 0 0 0 0\n1 0 0 1 1\n",
    );
    assert_eq!(lab.prints_json("param land.asc --mask long.asc")["points"], 10 * (4 + 8));
    lab.put("cells.xyz", "0 0 1\n1 0 1\n");
    lab.fails("param land.asc --mask cells.xyz", 1, &["cells.xyz", "grid file"]);
    let run = lab.thb("param land.asc --crop 100,110,0,20");
    assert!(run.code == 1 && run.stderr.contains("--crop leaves none"), "{run:?}");
}

#[test]
fn rows_far_apart_are_not_stray() {
    let points = (0..360).map(|k| format!("{} {} 0\n", 0.1 * f64::from(k % 60), 10.0 * f64::from(k / 60)));
    let lab = Lab::with("rows.xyz", points.collect::<String>());
    lab.fails("param rows.xyz --clean stray", 1, &["60 of 360", "not stray"]);
    // A few points beside a patch are, however many of the others are kept.
    let places = scattered(20, 500);
    let beside = (0..40).map(|k| format!("{} 9 0\n", 9.0 + 0.01 * f64::from(k)));
    lab.put("patch.xyz", rows(&places) + &beside.collect::<String>());
    let report = lab.prints_json("param patch.xyz --thin 60");
    assert!(report["warnings"].to_string().contains("--clean stray removes them"), "{report}");
}

#[test]
fn rows_are_those_of_the_file_whatever_was_sorted_or_left_out() {
    let sorted = gridded();
    let mut lines: Vec<&str> = sorted.lines().skip(1).collect();
    lines.reverse();
    let lab = Lab::with("grid.csv", format!("i,j,x,y,z\n{}\n", lines.join("\n")));
    lab.prints_json("param grid.csv -o uv.csv");
    let written = csv(&lab, "uv.csv");
    assert_eq!(written.len(), lines.len());
    for line in written {
        let in_file: Vec<f64> = lines[line[0] as usize].split(',').skip(2).map(|x| x.parse().unwrap()).collect();
        assert_eq!(line[1..4], in_file, "row {}", line[0]);
    }
    // What an option names is found by those rows, and errors give them back, through a subset too.
    let places = scattered(40, 1600);
    let corners = corner_rows(&places);
    let inside = places.iter().rposition(|(_, on_boundary)| !on_boundary).unwrap();
    let blind = 3;
    let nan = "nan nan nan\n".repeat(blind);
    let count = places.len() + blind;
    let header = format!(
        "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {count}\nHEIGHT 1\nPOINTS {count}\nDATA ascii\n"
    );
    lab.put("raw.pcd", header + &nan + &rows(&places));
    let named: Vec<usize> = corners.iter().map(|row| row + blind).collect();
    let given = |first: usize| format!("--corners {first},{},{},{}", named[1], named[2], named[3]);
    let found = lab.prints_json(&format!("param raw.pcd {}", given(named[0])));
    assert_eq!(found["parameterization"]["corners"], serde_json::json!(named));
    let wrong = format!("row {}", inside + blind);
    for subset in ["", "--subset 500"] {
        lab.fails(&format!("param raw.pcd --param lpsp {subset} {}", given(inside + blind)), 1, &[&wrong]);
    }
    lab.fails("param raw.pcd --corners 0,1,2,3", 1, &["row 0", "left out"]);
}

#[test]
fn outputs_of_parameters_are_checked_before_anything_is_read() {
    let lab = Lab::with("raw.csv", "x,y,z\n");
    for (arguments, code) in [("-o uv.txt", 2), ("-o raw.csv", 2), ("-o a.csv -o a.csv", 2), ("--subset 3", 2)] {
        let run = lab.thb(&format!("param raw.csv {arguments}"));
        assert_eq!(run.code, code, "{arguments}: {run:?}");
    }
    assert_eq!(lab.files().len(), 1);
}

#[test]
fn networks_parameterize_grids_and_clouds() {
    let lab = Lab::with("grid.csv", gridded());
    let learned = lab.prints_json("param grid.csv --param parcnn -o uv.csv");
    assert_eq!(
        (&learned["parameterization"]["method"], &learned["parameterization"]["folded"]),
        (&"parcnn".into(), &0.into())
    );
    lab.put("raw.xyz", rows(&scattered(20, 500)));
    let learned = lab.prints_json("param raw.xyz --param bidgcn -o uv.csv");
    let quality = &learned["parameterization"];
    assert_eq!((&quality["method"], &quality["left_out"]), (&"bidgcn".into(), &0.into()));
    // Few of the triangles over the points turn over, and the parameters follow the surface.
    assert!(quality["folded"].as_u64().unwrap() * 50 < quality["triangles"].as_u64().unwrap(), "{quality}");
    lab.fails("param raw.xyz --param parcnn -o uv.csv", 1, &["grid order"]);
    let weighted = lab.prints_json("param raw.xyz --param pargcn -o uv.csv");
    let quality = &weighted["parameterization"];
    assert_eq!((&quality["method"], &quality["folded"]), (&"pargcn".into(), &0.into()), "{quality}");
}

#[test]
fn networks_are_asked_beside_the_map_of_a_cloud_where_told_to() {
    let lab = Lab::with("raw.xyz", rows(&scattered(20, 500)));
    let asked = lab.prints_json("param raw.xyz --networks on -o on.csv");
    let network = &asked["parameterization"]["network"];
    assert!(network["taken"].is_boolean() && !network["reason"].as_str().unwrap().is_empty(), "{asked}");
    let alone = lab.prints_json("param raw.xyz -o off.csv");
    assert!(alone["parameterization"]["network"].is_null(), "{alone}");
    // What is not taken leaves no trace.
    assert_eq!(lab.text("on.csv") == lab.text("off.csv"), network["taken"] == false);
    lab.put("grid.csv", gridded());
    assert!(lab.prints_json("param grid.csv --networks on -o uv.csv")["parameterization"]["network"].is_null());
}
