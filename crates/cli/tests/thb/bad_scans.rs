//! Scans with fill values, outliers, copies, and of very few points: families of them, made by formulas.

use serde_json::Value;

use crate::lab::Lab;

/// Numbers in [0, 1) by a multiplicative congruential generator (Knuth's MMIX).
fn random(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed.wrapping_mul(2_654_435_761).wrapping_add(12_345);
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    }
}

fn height(x: f64, y: f64) -> f64 {
    4.0 * (0.11 * x + 0.3).sin() * (0.07 * y).cos()
}

/// Points of a sheet of 50 by 40 over a lattice.
fn lattice(n: usize) -> Vec<[f64; 3]> {
    let at = |i: usize, side: f64| side * i as f64 / (n - 1) as f64;
    (0..n * n).map(|k| [at(k / n, 50.0), at(k % n, 40.0)]).map(|[x, y]| [x, y, height(x, y)]).collect()
}

/// The same at random places.
fn scattered(m: usize, seed: u64) -> Vec<[f64; 3]> {
    let mut random = random(seed);
    (0..m).map(|_| [50.0 * random(), 40.0 * random()]).map(|[x, y]| [x, y, height(x, y)]).collect()
}

fn xyz(points: &[[f64; 3]]) -> String {
    points.iter().map(|[x, y, z]| format!("{x} {y} {z}\n")).collect()
}

fn off(n: usize, points: &[[f64; 3]]) -> String {
    let cells = (0..(n - 1) * (n - 1)).map(|c| c / (n - 1) * n + c % (n - 1));
    let triangles: Vec<[usize; 3]> = cells.flat_map(|a| [[a, a + n, a + n + 1], [a, a + n + 1, a + 1]]).collect();
    let faces: String = triangles.iter().map(|[a, b, c]| format!("3 {a} {b} {c}\n")).collect();
    format!("OFF\n{} {} 0\n{}{faces}", points.len(), triangles.len(), xyz(points))
}

/// Fits a file and checks that the surface is as good as one of the sheet alone.
fn good_fit(lab: &Lab, file: &str, options: &str, what: &str) -> Value {
    lab.succeeds(&format!("fit {file} {options} --tol 0.2% -o part.json --report report.json"));
    let report = lab.json("report.json");
    let diagonal = report["input"]["diagonal"].as_f64().unwrap();
    assert!((60.0..70.0).contains(&diagonal), "{what}: {diagonal}");
    let result = &report["result"];
    let p99 = result["deviation"]["scan_to_surface"]["p99"].as_f64().unwrap();
    assert!(p99 < 0.3 && result["reached"] == true, "{what}: {result}");
    assert!(result["dofs"].as_u64().unwrap() <= 250, "{what}: {result}");
    report
}

#[test]
fn fill_values_are_set_aside_on_every_path() {
    let lab = Lab::new();
    for (n, fill) in [(12, -9999.0), (20, 1e6), (26, -3.4e38)] {
        let mut points = lattice(n);
        // One alone and, where there are enough points, a clump.
        let clump = n * n / 60;
        let mut rows: Vec<usize> =
            (0..clump).map(|k| n * (n / 2) + n / 3 + k % 4 + n * (k / 4)).chain([n + 3]).collect();
        rows.sort_unstable();
        rows.iter().for_each(|&row| points[row][2] = fill);
        let count = rows.len();
        let uv = |k: usize| [(k / n) as f64 / (n - 1) as f64, (k % n) as f64 / (n - 1) as f64];
        let line = |k: usize| points[k].map(|x| x.to_string()).join(",");
        lab.put("scan.xyz", xyz(&points));
        let given = (0..n * n).map(|k| format!("{},{},{}\n", line(k), uv(k)[0], uv(k)[1]));
        lab.put("given.csv", format!("x,y,z,u,v\n{}", given.collect::<String>()));
        let grid = (0..n * n).map(|k| format!("{},{},{}\n", k / n, k % n, line(k)));
        lab.put("grid.csv", format!("i,j,x,y,z\n{}", grid.collect::<String>()));
        lab.put("mesh.off", off(n, &points));
        for (file, options, method) in [
            ("scan.xyz", "", "spanned mesh"),
            ("scan.xyz", "--height-field", "given"),
            ("given.csv", "", "given"),
            ("grid.csv", "", "chord"),
            ("mesh.off", "", "mean-value"),
        ] {
            let what = format!("{file} {options} {n} {fill}");
            let report = good_fit(&lab, file, options, &what);
            let parameterization = &report["parameterization"];
            assert!(parameterization["method"].as_str().unwrap().starts_with(method), "{what}");
            let cleaning = &parameterization["cleaning"];
            assert_eq!(cleaning["sentinels"], count, "{what}");
            assert_eq!(cleaning["sentinel_rows"], Value::from(rows.clone()), "{what}");
            assert_eq!(report["input"]["fitted_points"], n * n - count, "{what}");
            assert!(report["warnings"].to_string().contains("far beyond the rest"), "{what}");
        }
        // A percentage means the same to the comparison.
        let compared = lab.prints_json("compare part.json mesh.off --tol 0.2%");
        assert!(compared["tolerance"].as_f64().unwrap() < 0.14, "{compared}");
    }
}

#[test]
fn a_place_far_away_does_not_squeeze_a_height_field() {
    let lab = Lab::new();
    for far in [1e6, -3.4e38] {
        let mut points = lattice(15);
        points[40][0] = far;
        lab.put("scan.xyz", xyz(&points));
        let report = good_fit(&lab, "scan.xyz", "--height-field", &far.to_string());
        assert_eq!(report["parameterization"]["cleaning"]["sentinel_rows"], Value::from(vec![40]));
    }
}

#[test]
fn outliers_are_set_aside_before_a_subset_is_drawn() {
    let lab = Lab::new();
    for (m, seed) in [(1000, 1), (6000, 2), (40_000, 3)] {
        let mut points = scattered(m, seed);
        let mut random = random(seed + 10);
        points.extend((0..m / 100).map(|_| [50.0 * random(), 40.0 * random(), 44.0 * random() - 22.0]));
        lab.put("scan.xyz", xyz(&points));
        lab.succeeds("fit scan.xyz --method ls --tol 0.5% --subset 2000 -o part.json --report report.json");
        let report = lab.json("report.json");
        let cleaning = &report["parameterization"]["cleaning"];
        let outliers = cleaning["outliers"].as_u64().unwrap() as usize;
        assert!(outliers >= m / 200 && outliers <= m / 90, "{m}: {cleaning}");
        assert!(cleaning["outlier_rows"].as_array().unwrap().iter().all(|row| row.as_u64().unwrap() >= m as u64));
        assert!(report["result"]["within"].as_f64().unwrap() > 0.95, "{m}: {}", report["result"]);
        // The sheet itself is met.
        lab.put("sheet.xyz", xyz(&points[..m]));
        let compared = lab.prints_json("compare part.json sheet.xyz --tol 0.5%");
        assert!(compared["within"].as_f64().unwrap() > 0.97, "{m}: {compared}");
    }
}

#[test]
fn copies_change_little() {
    let lab = Lab::new();
    for (m, seed) in [(300, 1), (700, 2)] {
        let points = scattered(m, seed);
        lab.put("scan.xyz", xyz(&points));
        let alone = good_fit(&lab, "scan.xyz", "", "alone");
        let figure = |report: &Value, key: &str| report["result"][key].as_f64().unwrap();
        let rounded = |digits: i32| {
            let step = 10f64.powi(-digits);
            points.iter().map(|p| p.map(|x| (x / step).round() * step)).collect::<Vec<_>>()
        };
        let mut random = random(seed);
        let shifted = points.iter().map(|p| p.map(|x| x + 2e-6 * random() - 1e-6)).collect::<Vec<_>>();
        for (what, copy) in [
            ("equal", points.clone()),
            ("shifted", shifted),
            ("rounded", rounded(3)),
            ("some", points[..m / 3].to_vec()),
        ] {
            let mut all = points.clone();
            all.extend_from_slice(&copy);
            lab.put("scan.xyz", xyz(&all));
            let report = good_fit(&lab, "scan.xyz", "", what);
            let merged = report["parameterization"]["cleaning"]["merged"].as_u64().unwrap() as usize;
            assert!(merged >= copy.len() - m / 50 && merged <= copy.len() + m / 50, "{what} {m}: {merged}");
            assert_eq!(report["parameterization"]["folded"], 0, "{what} {m}");
            for (key, share) in [("dofs", 0.15), ("rmse", 0.15), ("max", 0.35)] {
                let (one, two) = (figure(&alone, key), figure(&report, key));
                assert!(
                    (two - one).abs() <= share * one + if key == "dofs" { 12.0 } else { 0.0 },
                    "{what} {m} {key}: {one} {two}"
                );
            }
        }
    }
}

#[test]
fn triangles_written_one_by_one_with_jitter_are_welded() {
    let lab = Lab::new();
    for (n, jitter, scale) in [(9, 4e-6, 1.0), (15, 1e-6, 1e3), (12, 2e-8, 1e-3)] {
        let points = lattice(n);
        let mut random = random(n as u64);
        let mut stl = String::from("solid s\n");
        let cells = (0..(n - 1) * (n - 1)).map(|c| c / (n - 1) * n + c % (n - 1));
        for t in cells.flat_map(|a| [[a, a + n, a + n + 1], [a, a + n + 1, a + 1]]) {
            stl += "facet normal 0 0 1\nouter loop\n";
            for v in t {
                let [x, y, z] = points[v].map(|x| scale * x + (2.0 * random() - 1.0) * jitter * scale.max(1.0));
                stl += &format!("vertex {x} {y} {z}\n");
            }
            stl += "endloop\nendfacet\n";
        }
        stl += "endsolid s\n";
        lab.put("soup.stl", stl);
        lab.succeeds("fit soup.stl --tol 0.2% -o part.json --report report.json");
        let report = lab.json("report.json");
        assert_eq!(report["input"]["fitted_points"], n * n, "{n}");
        assert_eq!(report["parameterization"]["cleaning"]["merged"], 6 * (n - 1) * (n - 1) - n * n, "{n}");
        assert!(report["result"]["dofs"].as_u64().unwrap() <= 150, "{n}");
    }
}

#[test]
fn points_along_a_line_of_the_square_are_refused() {
    let lab = Lab::new();
    for (m, slope, offset) in [(20, 1.0, 0.0), (40, -1.0, 5.0), (300, 3.0, 1e4)] {
        let line: Vec<[f64; 3]> = (0..m).map(f64::from).map(|t| [t, offset + slope * t, 0.1 * t * t]).collect();
        lab.put("scan.xyz", xyz(&line));
        lab.fails(
            "fit scan.xyz --height-field -o part.json",
            1,
            &["lie on a line of the parameter domain", "fit-curve"],
        );
        lab.fails("fit scan.xyz -o part.json", 1, &["follow one curve", "fit-curve"]);
    }
}

#[test]
fn a_handful_of_points_makes_a_surface() {
    let lab = Lab::new();
    let corners = [[0.0, 0.0, 0.0], [10.0, 0.0, 1.0], [10.0, 8.0, 0.0], [0.0, 8.0, 2.0]];
    let nine: Vec<[f64; 3]> = (0..9).map(|k| [10.0 * f64::from(k % 3), 10.0 * f64::from(k / 3), 0.0]).collect();
    let tilted: Vec<[f64; 3]> = nine.iter().map(|&[x, y, _]| [x + 1e4, 0.8 * y - 0.3 * x, 0.6 * y + 0.1 * x]).collect();
    for (name, points) in [("corners", &corners[..]), ("nine", &nine), ("tilted", &tilted)] {
        lab.put("scan.xyz", xyz(points));
        lab.succeeds("fit scan.xyz --tol 2% -o part.json --report report.json");
        let report = lab.json("report.json");
        let result = &report["result"];
        assert!(result["dofs"].as_u64().unwrap() as usize <= points.len(), "{name}: {result}");
        assert_eq!(report["input"]["fitted_points"], points.len(), "{name}");
        // Planes are met exactly, a bilinear surface but for the smoothing.
        let plane = name == "nine" || name == "tilted";
        assert!(!plane || result["max"].as_f64().unwrap() < 1e-6, "{name}: {result}");
    }
    let grid: String =
        nine.iter().enumerate().map(|(k, [x, y, z])| format!("{},{},{x},{y},{z}\n", k % 3, k / 3)).collect();
    lab.put("grid.csv", format!("i,j,x,y,z\n{grid}"));
    lab.succeeds("fit grid.csv -o part.json --report report.json");
    let result = &lab.json("report.json")["result"];
    assert!(result["dofs"].as_u64().unwrap() <= 9 && result["max"].as_f64().unwrap() < 1e-6, "{result}");
}

#[test]
fn one_outlier_changes_little() {
    let lab = Lab::new();
    let points = scattered(800, 4);
    lab.put("scan.xyz", xyz(&points));
    lab.put("mesh.off", off(20, &lattice(20)));
    let clean = [good_fit(&lab, "scan.xyz", "", "cloud"), good_fit(&lab, "mesh.off", "", "mesh")];
    for off_by in [8.0, 30.0, 400.0] {
        let mut with = points.clone();
        with.push([20.0, 20.0, off_by]);
        lab.put("scan.xyz", xyz(&with));
        let report = good_fit(&lab, "scan.xyz", "", "cloud");
        let figure = |report: &Value, key: &str| report["result"][key].as_f64().unwrap();
        for (key, share) in [("dofs", 0.15), ("rmse", 0.15), ("max", 0.35)] {
            let (one, two) = (figure(&clean[0], key), figure(&report, key));
            assert!((two - one).abs() <= share * one, "{off_by} {key}: {one} {two}");
        }
    }
}
