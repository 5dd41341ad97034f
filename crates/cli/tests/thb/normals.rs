//! Normals of a scan tell the outside of the surface.

use crate::lab::Lab;

/// Points of a bent sheet with upward normals, each turned over or tilted as `turn` says for its row.
fn cloud(turn: impl Fn(usize) -> [f64; 3]) -> String {
    let mut text = String::from("x,y,z,nx,ny,nz\n");
    for row in 0..14 * 11 {
        let (x, y) = ((row % 14) as f64, (row / 14) as f64);
        let z = 2.0 * (0.3 * x).sin() + 0.05 * y * y;
        let [a, b] = [-0.6 * (0.3 * x).cos(), -0.1 * y];
        let sides = turn(row);
        let normal: Vec<String> = [a, b, 1.0].iter().zip(sides).map(|(n, s)| format!("{:.6}", n * s)).collect();
        text += &format!("{x},{y},{z:.6},{}\n", normal.join(","));
    }
    text
}

/// Share of the triangles of an OBJ file that look up.
fn upward(obj: &str) -> f64 {
    let numbers = |line: &str| -> Vec<f64> {
        line.split_whitespace().skip(1).map(|n| n.split('/').next().unwrap().parse().unwrap()).collect()
    };
    let vertices: Vec<Vec<f64>> = obj.lines().filter(|line| line.starts_with("v ")).map(numbers).collect();
    let faces: Vec<Vec<f64>> = obj.lines().filter(|line| line.starts_with("f ")).map(numbers).collect();
    let is_up = |face: &&Vec<f64>| {
        let [a, b, c] = [0, 1, 2].map(|k| &vertices[face[k] as usize - 1]);
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0.0
    };
    faces.iter().filter(is_up).count() as f64 / faces.len() as f64
}

#[test]
fn the_majority_tells_the_outside() {
    for (sign, options) in [(1.0, ""), (-1.0, ""), (1.0, "--flip")] {
        let lab = Lab::with("scan.csv", cloud(|_| [sign; 3]));
        lab.succeeds(&format!("fit scan.csv -o part.obj --report report.json {options}"));
        let is_up = (sign > 0.0) != (options == "--flip");
        assert_eq!(upward(&lab.text("part.obj")), if is_up { 1.0 } else { 0.0 }, "{sign} {options}");
        let report = lab.json("report.json");
        assert_eq!(report["result"]["normals"]["agreeing"], 1.0);
        assert_eq!(report["input"]["columns"][3], serde_json::json!({"number": 4, "name": "nx", "as": "normal x"}));
        assert!(!report["warnings"].to_string().contains("--flip"), "{}", report["warnings"]);
    }
}

#[test]
fn noisy_normals_agree_and_others_are_told() {
    // Turned by up to 80 degrees, every way.
    let noisy = cloud(|row| [1.0 + 2.0 * ((7 * row) as f64).sin(), 1.0 + 1.5 * ((5 * row) as f64).cos(), 1.0]);
    let few = cloud(|row| if row % 20 == 3 { [-1.0; 3] } else { [1.0; 3] });
    let third = cloud(|row| if row % 3 == 0 { [1.0; 3] } else { [-1.0; 3] });
    let half = cloud(|row| if row % 2 == 0 { [1.0; 3] } else { [-1.0; 3] });
    for (text, up, warned) in
        [(noisy, Some(1.0), false), (few, Some(1.0), false), (third, Some(0.0), true), (half, None, true)]
    {
        let lab = Lab::with("scan.csv", text);
        lab.succeeds("fit scan.csv -o part.obj --report report.json");
        let share = upward(&lab.text("part.obj"));
        assert!(up.is_none_or(|up| up == share), "{share}");
        let report = lab.json("report.json");
        let warnings = report["warnings"].to_string();
        assert_eq!(warnings.contains("% of the") && warnings.contains("--flip"), warned, "{warnings}");
    }
    // Without normals the cloud tells nothing.
    let lab = Lab::with("scan.csv", cloud(|_| [1.0; 3]));
    lab.succeeds("fit scan.csv -o part.obj --report report.json --normals none");
    let report = lab.json("report.json");
    assert!(report["warnings"].to_string().contains("--flip") && report["result"]["normals"].is_null());
}
