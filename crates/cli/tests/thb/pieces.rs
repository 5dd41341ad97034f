//! Meshes of several pieces, and length units.

use serde_json::json;

use crate::lab::Lab;
use crate::scans;

/// Sheets of `sizes` quads a side, a hundred apart, as OFF; each triangle with its own corners where asked for.
fn sheets(sizes: &[usize], is_soup: bool) -> String {
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for (piece, &n) in sizes.iter().enumerate() {
        let place = |i: usize, j: usize| {
            let (x, y) = (20.0 * i as f64 / n as f64, 20.0 * j as f64 / n as f64);
            [x + 100.0 * piece as f64, y, (0.2 * x).sin() + 0.01 * x * y]
        };
        let base = vertices.len();
        let corner = |i: usize, j: usize| base + j * (n + 1) + i;
        if !is_soup {
            vertices.extend((0..(n + 1) * (n + 1)).map(|k| place(k % (n + 1), k / (n + 1))));
        }
        for (i, j) in (0..n * n).map(|k| (k % n, k / n)) {
            for triangle in [[(i, j), (i + 1, j), (i + 1, j + 1)], [(i, j), (i + 1, j + 1), (i, j + 1)]] {
                if is_soup {
                    faces.push([0, 1, 2].map(|k| vertices.len() + k));
                    vertices.extend(triangle.map(|(i, j)| place(i, j)));
                } else {
                    faces.push(triangle.map(|(i, j)| corner(i, j)));
                }
            }
        }
    }
    let mut text = format!("OFF\n{} {} 0\n", vertices.len(), faces.len());
    vertices.iter().for_each(|[x, y, z]| text += &format!("{x} {y} {z}\n"));
    faces.iter().for_each(|[a, b, c]| text += &format!("3 {a} {b} {c}\n"));
    text
}

#[test]
fn pieces_are_listed_and_fitted_one_by_one() {
    for is_soup in [false, true] {
        let lab = Lab::with("a.off", sheets(&[8, 10, 5], is_soup));
        let told = "3 pieces with [200, 128, 50] triangles";
        lab.fails("fit a.off -o a.step", 1, &["a.off", told, "--clean stray", "--piece 1"]);
        let notes = lab.prints_json("info a.off")["notes"].to_string();
        assert!(notes.contains(told), "{notes}");
        for (option, left) in [("--piece 1", 200), ("--piece 2", 128), ("--piece 3", 50), ("--clean stray", 200)] {
            let report = lab.prints_json(&format!("param a.off {option}"));
            let points = report["quality"]["points"].as_u64().or(report["points"].as_u64());
            let side = f64::from(left / 2).sqrt() as u64 + 1;
            assert!(points.is_none_or(|points| points == side * side), "{option}: {report}");
        }
        lab.fails("fit a.off -o a.step --piece 4", 1, &["--piece 4", told]);
        for wrong in ["0", "none", "-1"] {
            lab.fails(&format!("fit a.off -o a.step --piece={wrong}"), 2, &["--piece", "1 for the largest"]);
        }
        lab.succeeds("fit a.off -o a.step --piece 2 --levels 2 --within 0");
    }
}

/// Triangles of a binary STL file or lines of an OBJ file that begin with a letter.
fn count_of(lab: &Lab, name: &str, letter: &str) -> usize {
    lab.text(name).lines().filter(|line| line.starts_with(letter)).count()
}

#[test]
fn all_pieces_are_fitted_and_written_together() {
    for (sizes, is_soup) in [(&[8, 10, 5][..], false), (&[12, 6], true), (&[9], false), (&[6, 20, 7, 8, 1], false)] {
        let lab = Lab::with("a.off", sheets(sizes, is_soup));
        // One quad of 20² and more is stray.
        let fitted = sizes.iter().filter(|&&n| n > 1).count();
        lab.succeeds("fit a.off --piece all -o a.step -o a.json -o a.obj --report r.json --summary s.jsonl --levels 2 --within 0");
        let step = lab.text("a.step");
        for (entity, count) in [("OPEN_SHELL(", fitted), ("ADVANCED_FACE(", fitted), ("SHAPE_REPRESENTATION('',(", 1)] {
            assert_eq!(step.matches(entity).count(), count, "{entity} {sizes:?}");
        }
        let report = lab.json("r.json");
        let pieces = report["pieces"].as_array().unwrap();
        assert_eq!(pieces.len(), fitted);
        let mut largest_first = sizes.to_vec();
        largest_first.sort_unstable_by(|a, b| b.cmp(a));
        let (mut dofs, mut worst) = (0, 0);
        for (k, (piece, n)) in pieces.iter().zip(&largest_first).enumerate() {
            assert_eq!((&piece["piece"], &piece["size"]), (&json!(k + 1), &json!(2 * n * n)));
            assert_eq!(piece["report"]["input"]["fitted_points"], (n + 1) * (n + 1), "{piece}");
            dofs += piece["report"]["result"]["dofs"].as_u64().unwrap();
            let verdict = piece["report"]["result"]["verdict"].as_str().unwrap();
            worst = worst.max(["good", "usable", "failed"].iter().position(|&known| known == verdict).unwrap());
            // Each is the same as by its number, and its model can be read.
            let name = format!("a.piece-{}.json", k + 1);
            assert_eq!(lab.json(&name)["metadata"]["piece"], k + 1);
            lab.succeeds(&format!("fit a.off --piece {} -o one.step --report one.json --levels 2 --within 0", k + 1));
            let (alone, together) = (&lab.json("one.json")["result"], &piece["report"]["result"]);
            for key in ["dofs", "levels", "cells", "verdict", "stop", "method"] {
                assert_eq!(alone[key], together[key], "piece {}: {key}", k + 1);
            }
            // Sums over vertices begin elsewhere in a mesh without the others: the last digits differ.
            for key in ["max", "rmse", "tolerance", "lambda", "hsd"] {
                let [one, other] = [alone, together].map(|result| result[key].as_f64().unwrap());
                assert!((one - other).abs() <= 1e-6 * one.abs(), "piece {}: {key} is {one} and {other}", k + 1);
            }
            assert_eq!(lab.prints_json(&format!("info {name}"))["kind"], "model");
        }
        assert!(!lab.path(&format!("a.piece-{}.json", fitted + 1)).exists() && !lab.path("a.json").exists());
        assert_eq!(report["verdict"], ["good", "usable", "failed"][worst]);
        let line: serde_json::Value = serde_json::from_str(&lab.text("s.jsonl")).unwrap();
        assert_eq!((&line["pieces"], &line["dofs"]), (&json!(fitted), &json!(dofs)));
        assert_eq!(line["outputs"].as_array().unwrap().len(), 3 + fitted);
        assert_eq!(line["warnings"].to_string().contains("are stray"), fitted < sizes.len(), "{line}");
        // What is said of the file is said once.
        assert!(line["warnings"].to_string().matches("across, since the file tells no unit").count() <= 1, "{line}");
        // Triangles of all pieces, each where its piece is.
        let mesh = lab.prints_json("info a.obj");
        let most = 100.0 * (sizes.iter().rposition(|&n| n > 1).unwrap()) as f64 + 20.0;
        assert!((mesh["bounds"][1][0].as_f64().unwrap() - most).abs() < 0.5, "{mesh}");
        assert!(count_of(&lab, "a.obj", "f ") >= fitted * 3200);
    }
}

#[test]
fn a_piece_that_cannot_be_fitted_fails_the_whole_and_loses_no_other() {
    // A closed box beside a sheet.
    let mut text = sheets(&[10], false).replace("OFF\n121 200 0", "OFF\n129 212 0");
    let (vertices, faces) = text.split_at(text.find("3 0 ").unwrap());
    let corners: String =
        (0..8).map(|k| format!("{} {} {}\n", 500 + 9 * (k & 1), 9 * (k >> 1 & 1), 9 * (k >> 2))).collect();
    let boxes = [
        [0, 2, 3],
        [0, 3, 1],
        [4, 5, 7],
        [4, 7, 6],
        [0, 1, 5],
        [0, 5, 4],
        [2, 6, 7],
        [2, 7, 3],
        [0, 4, 6],
        [0, 6, 2],
        [1, 3, 7],
        [1, 7, 5],
    ];
    let closed: String = boxes.iter().map(|t| format!("3 {} {} {}\n", t[0] + 121, t[1] + 121, t[2] + 121)).collect();
    text = format!("{vertices}{corners}{faces}{closed}");
    let lab = Lab::with("a.off", text);
    let run = lab.thb("fit a.off --piece all -o a.step --report r.json --summary s.jsonl --levels 2 --within 0");
    assert_eq!(run.code, 1, "{run:?}");
    assert!(run.stderr.contains("a.off: piece 2 of 2 (12 triangles): "), "{run:?}");
    assert_eq!(lab.text("a.step").matches("OPEN_SHELL(").count(), 1);
    let report = lab.json("r.json");
    assert_eq!((&report["reached"], &report["verdict"]), (&json!(false), &json!("failed")));
    assert!(report["pieces"][0]["report"].is_object() && report["pieces"][0]["error"].is_null());
    assert!(report["pieces"][1]["error"].is_string() && report["pieces"][1]["report"].is_null());
    assert!(lab.text("s.jsonl").contains("\"status\":\"failed\""));
    // A tolerance that a piece misses.
    let lab = Lab::with("a.off", sheets(&[8, 8], false));
    let run = lab.thb("fit a.off --piece all -o a.step --levels 1 --tol 1e-6");
    assert_eq!(run.code, 3, "{run:?}");
    assert!(lab.text("a.step").matches("OPEN_SHELL(").count() == 2 && run.stderr.contains("piece 2: "), "{run:?}");
}

#[test]
fn files_of_pieces_overwrite_nothing_and_options_of_one_piece_are_refused() {
    let lab = Lab::with("a.off", sheets(&[8, 6], false));
    lab.put("b.off", sheets(&[7, 6], false));
    lab.put("rows.txt", "0 I\n");
    for option in ["--corners 0,1,2,3", "--outline rows.txt", "--markers rows.txt"] {
        lab.fails(&format!("fit a.off --piece all -o a.step {option}"), 2, &["--piece = all", "--corners"]);
    }
    for arguments in ["param a.off --piece all", "param a.off --piece all -o a.csv"] {
        lab.fails(arguments, 2, &["--piece = all"]);
    }
    // What is meant for another part is not written for a piece.
    lab.put("b.piece-1.off", sheets(&[7], false));
    let run = lab.thb("fit b.off b.piece-1.off --piece all -o out --levels 1 --within 0");
    assert!(run.code == 1 && run.stderr.contains("out/b.piece-1.json: this is an input or another output"), "{run:?}");
    assert!(lab.path("out/b.piece-1.step").is_file());
    assert!(!["b.step", "b.piece-1.json", "b.piece-2.json"].iter().any(|name| lab.path("out").join(name).exists()));
}

#[test]
fn units_are_those_asked_for_or_of_the_file() {
    let lab = Lab::with("a.off", scans::mesh());
    let text = |arguments: &str| {
        let run = lab.thb(&format!("fit a.off -o a.step --report r.json --levels 1 --within 0 {arguments}"));
        assert_eq!(run.code, 0, "{run:?}");
        (lab.text("a.step"), lab.json("r.json"), run.stderr)
    };
    for (units, name, step) in [
        ("um", "micrometre", "SI_UNIT(.MICRO.,.METRE.)"),
        ("mm", "millimetre", "SI_UNIT(.MILLI.,.METRE.)"),
        ("cm", "centimetre", "SI_UNIT(.CENTI.,.METRE.)"),
        ("m", "metre", "SI_UNIT($,.METRE.)"),
        ("inch", "inch", "CONVERSION_BASED_UNIT('INCH'"),
        ("ft", "foot", "CONVERSION_BASED_UNIT('FOOT'"),
    ] {
        let (written, report, said) = text(&format!("--units {units}"));
        assert!(written.contains(step), "{units}");
        assert_eq!(report["options"]["units"], name);
        assert!(!said.contains("--units"), "{said}");
    }
    let small = Lab::with("s.off", sheets(&[8], false).replace("\n20 ", "\n20.0 "));
    let notes = small.prints_json("info s.off")["notes"].to_string();
    assert!(!notes.contains("--units"), "{notes}");
    let tiny = Lab::with("t.xyz", "0 0 0\n1 0 0\n0 1 0\n1 1 0.5\n");
    let notes = tiny.prints_json("info t.xyz")["notes"].to_string();
    assert!(notes.contains("mm across") && notes.contains("--units"), "{notes}");
}
