//! The same part in another order, turned, mirrored, moved and scaled gets as good a surface with as many control points.

use std::fmt::Write;
use std::path::PathBuf;

use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};

use crate::lab::Lab;

/// Differences allowed: control points (as a share, or so many), root mean square and 95th percentile of the distances, the largest.
const CONTROL_POINTS: (f64, f64) = (0.05, 12.0);
const TYPICAL: f64 = 0.1;
const LARGEST: f64 = 0.25;

/// The same where one point was added or all were doubled.
const CONTROL_POINTS_OF_MORE: (f64, f64) = (0.15, 12.0);
const TYPICAL_OF_MORE: f64 = 0.15;
const LARGEST_OF_MORE: f64 = 0.35;

/// Cases of each part.
const CASES: u32 = 3;

/// Points of a generated part.
const POINTS: usize = 700;

/// A tolerance in percent of the diagonal that all parts can be fitted to.
const PERCENT: f64 = 0.5;

/// A scan as a table: what stands before and after the coordinates of each point, and triangles.
#[derive(Clone)]
struct Scan {
    header: String,
    points: Vec<([f64; 3], String)>,
    triangles: Vec<[usize; 3]>,
}

impl Scan {
    fn cloud(points: impl IntoIterator<Item = [f64; 3]>) -> Self {
        let points = points.into_iter().map(|p| (p, String::new())).collect();
        Self { header: "x,y,z".into(), points, triangles: Vec::new() }
    }

    /// A fixture: a mesh as OFF or as ASCII PLY, or a table whose last columns are x, y, z.
    fn fixture(name: &str) -> Self {
        let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../fixtures").join(name);
        let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{name}: {error}"));
        let numbers = |line: &str| -> Vec<f64> {
            line.split([' ', ',']).filter(|word| !word.is_empty()).map(|word| word.parse().unwrap()).collect()
        };
        let coordinates = |line: &str| <[f64; 3]>::try_from(&numbers(line)[..3]).unwrap();
        let corners = |line: &str| {
            <[usize; 3]>::try_from(&numbers(line).iter().map(|&x| x as usize).collect::<Vec<_>>()[1..4]).unwrap()
        };
        let lines: Vec<&str> = text.lines().filter(|line| !line.starts_with('#')).collect();
        if name.ends_with(".csv") {
            let (before, _) = lines[0].split_once(",x,y,z").unwrap();
            let count = before.split(',').count();
            let points = lines[1..].iter().map(|line| {
                let words: Vec<&str> = line.split(',').collect();
                (coordinates(&words[count..].join(",")), words[..count].join(","))
            });
            return Self { header: lines[0].into(), points: points.collect(), triangles: Vec::new() };
        }
        let (vertices, first) = match name.ends_with(".off") {
            true => (numbers(lines[1])[0] as usize, 2),
            false => {
                let count = lines.iter().find_map(|line| line.strip_prefix("element vertex ")).unwrap();
                (count.parse().unwrap(), 1 + lines.iter().position(|line| *line == "end_header").unwrap())
            }
        };
        let body = &lines[first..];
        let mut scan = Self::cloud(body[..vertices].iter().map(|line| coordinates(line)));
        scan.triangles = body[vertices..].iter().map(|line| corners(line)).collect();
        scan
    }

    fn without_triangles(&self) -> Self {
        Self { triangles: Vec::new(), ..self.clone() }
    }

    fn diagonal(&self) -> f64 {
        let extent = |k: usize| {
            let range =
                self.points.iter().fold((f64::MAX, f64::MIN), |(low, high), (p, _)| (low.min(p[k]), high.max(p[k])));
            range.1 - range.0
        };
        (0..3).map(extent).map(|e| e * e).sum::<f64>().sqrt()
    }

    fn changed(&self, change: &Change) -> Self {
        let m = self.points.len();
        let mut order: Vec<usize> = (0..m).collect();
        let mut state = change.seed;
        let mut random = move |below: usize| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as usize % below
        };
        (1..m).rev().for_each(|i| order.swap(i, random(i + 1)));
        let mut place = vec![0; m];
        order.iter().enumerate().for_each(|(at, &i)| place[i] = at);
        let moved = |p: [f64; 3]| change.of(p, self.diagonal());
        Self {
            header: self.header.clone(),
            points: order.iter().map(|&i| (moved(self.points[i].0), self.points[i].1.clone())).collect(),
            triangles: (0..self.triangles.len())
                .rev()
                .map(|t| {
                    let [a, b, c] = self.triangles[t].map(|i| place[i]);
                    // A mirrored part has its outside outside.
                    if change.mirrors { [b, a, c] } else { [b, c, a] }
                })
                .collect(),
        }
    }

    /// Fits the scan: control points, and root mean square, 95th percentile and largest of the distances in tolerances.
    fn fitted(&self, lab: &Lab, method: &str, tolerance: f64) -> [f64; 4] {
        let mut text = String::new();
        let name = if self.triangles.is_empty() { "scan.csv" } else { "scan.off" };
        if self.triangles.is_empty() {
            writeln!(text, "{}", self.header).unwrap();
            for ([x, y, z], before) in &self.points {
                let comma = if before.is_empty() { "" } else { "," };
                writeln!(text, "{before}{comma}{x:e},{y:e},{z:e}").unwrap();
            }
        } else {
            writeln!(text, "OFF\n{} {} 0", self.points.len(), self.triangles.len()).unwrap();
            self.points.iter().for_each(|([x, y, z], _)| writeln!(text, "{x:e} {y:e} {z:e}").unwrap());
            self.triangles.iter().for_each(|[a, b, c]| writeln!(text, "3 {a} {b} {c}").unwrap());
        }
        lab.put(name, text);
        lab.succeeds(&format!("fit {name} --method {method} --tol {tolerance:e} -o part.json --report report.json"));
        let result = &lab.json("report.json")["result"];
        let distances = &result["deviation"]["scan_to_surface"];
        let in_tolerances = |key: &str| distances[key].as_f64().unwrap() / tolerance;
        [result["dofs"].as_f64().unwrap(), in_tolerances("rms"), in_tolerances("p95"), in_tolerances("max")]
    }
}

/// A change that leaves a part the same part.
#[derive(Clone, Debug)]
struct Change {
    /// Of the order of the points.
    seed: u64,
    /// Axis and angle.
    axis: [f64; 3],
    angle: f64,
    mirrors: bool,
    /// In diagonals.
    offset: [f64; 3],
    size: f64,
}

impl Change {
    fn of(&self, [x, y, z]: [f64; 3], diagonal: f64) -> [f64; 3] {
        let p = [if self.mirrors { -x } else { x }, y, z];
        // Rodrigues' formula.
        let length = self.axis.iter().map(|a| a * a).sum::<f64>().sqrt();
        let n = self.axis.map(|a| a / length);
        let (sin, cos) = self.angle.sin_cos();
        let along = (0..3).map(|k| n[k] * p[k]).sum::<f64>();
        let across = [n[1] * p[2] - n[2] * p[1], n[2] * p[0] - n[0] * p[2], n[0] * p[1] - n[1] * p[0]];
        std::array::from_fn(|k| {
            let turned = cos * p[k] + sin * across[k] + (1.0 - cos) * along * n[k];
            self.size * (turned + self.offset[k] * diagonal)
        })
    }
}

fn changes() -> impl Strategy<Value = Change> {
    let offset = prop_oneof![Just([0.0; 3]), prop::array::uniform3(-1e6..1e6)];
    let axis = prop::array::uniform3(0.1..1.0);
    (any::<u64>(), axis, -3.0..3.0, any::<bool>(), offset, -3..=6).prop_map(
        |(seed, axis, angle, mirrors, offset, decades)| Change {
            seed,
            axis,
            angle,
            mirrors,
            offset,
            size: 10_f64.powi(decades),
        },
    )
}

fn assert_alike(name: &str, found: [f64; 4], plain: [f64; 4], (share, count): (f64, f64), typical: f64, largest: f64) {
    let is_about = |k: usize, limit: f64| (found[k] - plain[k]).abs() <= limit;
    assert!(is_about(0, (share * plain[0]).max(count)), "{name}: {found:?}, {plain:?}");
    // Below a thousandth of the tolerance is round-off.
    for (k, limit) in [(1, typical), (2, typical), (3, largest)] {
        assert!(is_about(k, limit * plain[k] + 1e-3), "{name}: {found:?}, {plain:?}");
    }
}

/// Fits a part, changed in several ways, by a method.
fn assert_invariant(name: &str, scan: &Scan, method: &str) {
    let lab = Lab::new();
    let tolerance = 0.01 * PERCENT * scan.diagonal();
    let plain = scan.fitted(&lab, method, tolerance);
    let mut runner = TestRunner::new_with_rng(
        Config { cases: CASES, failure_persistence: None, ..Config::default() },
        proptest::test_runner::TestRng::deterministic_rng(proptest::test_runner::RngAlgorithm::ChaCha),
    );
    let held = runner.run(&changes(), |change| {
        let changed = scan.changed(&change);
        let found = changed.fitted(&lab, method, change.size * tolerance);
        assert_alike(name, found, plain, CONTROL_POINTS, TYPICAL, LARGEST);
        let place = &lab.json("report.json")["result"]["deviation"]["scan_to_surface"]["place"];
        let near = changed
            .points
            .iter()
            .map(|(p, _)| (0..3).map(|k| (place[k].as_f64().unwrap() - p[k]).powi(2)).sum::<f64>().sqrt());
        let nearest = near.fold(f64::MAX, f64::min);
        prop_assert!(nearest <= change.size * scan.diagonal(), "{name}: the worst place is not on the part");
        Ok(())
    });
    held.unwrap_or_else(|error| panic!("{name}: {error}"));
}

/// The point of a part at a place of the unit square.
type Part = fn(f64, f64) -> [f64; 3];

/// Parts without symmetry.
const PARTS: [(&str, Part); 6] = [
    ("bump", |u, v| [1.3 * u, v, 0.3 * (-20.0 * ((u - 0.3).powi(2) + (v - 0.6).powi(2))).exp() + 0.1 * u * v]),
    ("wave", |u, v| [u, 0.7 * v, 0.1 * (5.0 * u + 2.0 * v).sin() + 0.05 * (7.0 * v).cos()]),
    ("bent sheet", |u, v| [(1.7 * u).cos(), (1.7 * u).sin() * (1.0 + 0.2 * v), 1.2 * v + 0.1 * (4.0 * u).sin()]),
    ("twisted strip", |u, v| {
        let (sin, cos) = (1.5 * u).sin_cos();
        [2.0 * u, (0.2 + v) * cos, (0.2 + v) * sin + 0.1 * u * u]
    }),
    ("part of a torus", |u, v| {
        let ((s, c), (t, d)) = ((0.3 + 2.0 * u).sin_cos(), (0.4 + 1.9 * v).sin_cos());
        [(2.0 + (0.8 + 0.1 * u) * d) * c, (2.0 + 0.8 * d) * s, 0.7 * t]
    }),
    ("dented dome", |u, v| {
        let (x, y) = (2.0 * u - 1.0, 1.6 * v - 0.8);
        let dent = 0.15 * (-30.0 * ((x - 0.2).powi(2) + (y + 0.1).powi(2))).exp();
        [x, y, (3.0 - x * x - y * y).sqrt() - dent + 0.05 * x * y * y]
    }),
];

fn part(of: Part) -> Scan {
    // Roberts' sequence fills the square evenly, in any order.
    let place = |k: usize| [0.754_877_666_246_693, 0.569_840_290_998_053].map(|a| (a * k as f64).fract());
    Scan::cloud((1..=POINTS).map(place).map(|[u, v]| of(u, v)))
}

#[test]
fn generated_parts_do_not_depend_on_order_place_and_size() {
    for (name, of) in PARTS {
        assert_invariant(name, &part(of), "ls");
    }
    assert_invariant("dented dome by default", &part(PARTS[5].1), "auto");
}

#[test]
fn fixtures_do_not_depend_on_order_place_and_size() {
    for name in ["bonnet_1600.ply", "bonnet_1600_noise.ply", "blade_1600.ply", "nefertiti_299.off", "wigley_900.off"] {
        let scan = Scan::fixture(name);
        assert_invariant(name, &scan, "ls");
        // The two sides of the blade are nearer to each other than its points.
        if !name.starts_with("blade") {
            assert_invariant(&format!("{name} without triangles"), &scan.without_triangles(), "ls");
        }
    }
    for name in ["peaks_4k.csv", "peaks_grid.csv", "wigley_grid.csv"] {
        assert_invariant(name, &Scan::fixture(name), "ls");
    }
    // A blade many times longer than wide.
    assert_invariant("iea15_blade_grid.csv", &Scan::fixture("iea15_blade_grid.csv"), "ls --mesh 8x4");
    assert_invariant("nefertiti_299.off by default", &Scan::fixture("nefertiti_299.off"), "auto");
}

#[test]
fn a_point_more_or_all_twice_change_little() {
    for (name, of) in PARTS {
        let lab = Lab::new();
        let scan = part(of);
        let tolerance = 0.01 * PERCENT * scan.diagonal();
        let plain = scan.fitted(&lab, "ls", tolerance);
        let mut twice = scan.clone();
        twice.points.extend_from_within(..);
        let mut far = scan.clone();
        far.points.push(([3.0, -2.0, 4.0], String::new()));
        for (change, scan) in [("all points twice", twice), ("one point far off", far)] {
            let found = scan.fitted(&lab, "ls", tolerance);
            let name = format!("{name}, {change}");
            assert_alike(&name, found, plain, CONTROL_POINTS_OF_MORE, TYPICAL_OF_MORE, LARGEST_OF_MORE);
        }
    }
}
