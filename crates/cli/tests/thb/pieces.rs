//! Meshes of several pieces, and length units.

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
        for wrong in ["0", "all", "-1"] {
            lab.fails(&format!("fit a.off -o a.step --piece={wrong}"), 2, &["--piece", "1 for the largest"]);
        }
        lab.succeeds("fit a.off -o a.step --piece 2 --levels 2 --within 0");
    }
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
