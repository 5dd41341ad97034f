//! Fits of 20 to 120 points with random options, as they are typed.
//!
//! The first bytes of an input choose options, the next ones the shape, and all others change single points, so that options and
//! shapes are drawn alike often whatever libFuzzer keeps; [`Counts`] has how often each value came.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Mutex;
use std::time::Duration;

use clap::Parser;
use geom_io::model::{json, step};
use geom_io::{Format, Geometry, StepOptions, parse_scan};
use reconstruct::{Fit, fit_scan};

use super::models::{check_written, told, written};
use super::{files, messages};
use crate::args::{Cli, Command};
use crate::bounds::{self, Bounds, bounded};
use crate::random::Choices;

/// Bytes of an input that choose the options, and those that choose the shape.
const OF_OPTIONS: usize = 8;
const OF_SHAPE: usize = 8;

/// Most that a fit of so few points may take. Only reading is promised to take less. The methods without a system of their own need most
/// of the time. Of the memory, faer's product of dense matrices reserves 960 MiB once a thread, and writes to few pages of them.
const TIME: Duration = Duration::from_secs(20);
const MEMORY: usize = (960 + 512) << 20;

/// A value that stands for a file.
const FILE: &str = "FILE";

/// Share of the runs in which a value is typed, but for those of `--method`, of which one always is.
const SHARE_OF_VALUE: f64 = 0.016;

/// Options and their values; the first value of an option with `""` stands for the option alone.
pub const CHOICES: &[(&str, &[&str])] = &[
    ("--method", &["auto", "ls", "qi", "a-pdm", "a-tdm", "a-hdm", "a-qi", "j-pdm", "joint"]),
    (
        "--param",
        &[
            "auto",
            "given",
            "chord",
            "centripetal",
            "parcnn",
            "uniform",
            "mean-value",
            "recd",
            "lpsp",
            "pargcn",
            "bidgcn",
        ],
    ),
    ("--corrections", &["0", "1", "5"]),
    ("--blend", &["error", "curvature", "0", "0.5", "1"]),
    ("--damping", &["0", "0.1", "10"]),
    ("--boundary", &["kept", "free"]),
    ("--n-min", &["3", "12"]),
    ("--density", &["0", "0.3", "1"]),
    ("--local-lambda", &["constant", "points", "area"]),
    ("--degree", &["1", "2", "3", "4", "5", "8", "1,3"]),
    ("--mesh", &["1", "2", "3x2", "8", "16x1"]),
    ("--lambda", &["auto", "gcv", "discrepancy:0.01", "discrepancy:1%", "0", "1e-7", "1e3"]),
    ("--samples", &["area", "vertices"]),
    ("--energy", &["exact", "gauss-p"]),
    ("--robust", &["huber", "tukey", "geman-mcclure", "lp:1.2", "lp:2"]),
    ("--max-set-aside", &["0", "0.05", "1"]),
    ("--markers", &["auto", FILE]),
    ("--marker-tol", &["0.001", "1%"]),
    ("--ignore-tol", &["0.001", "1%"]),
    ("--marker-update", &["error", "2", "1e6"]),
    ("--tol", &["auto", "0.1%", "5%", "0.01", "1e-12"]),
    ("--within", &["0", "0.5", "1"]),
    ("--levels", &["1", "2", "3", "16"]),
    ("--max-dofs", &["1", "9", "50", "1000"]),
    ("--mark", &["worst", "threshold", "share:0.1", "share:1"]),
    ("--extension", &["0", "2", "1,3", "64"]),
    ("--admissible", &["2", "3"]),
    ("--n-loc", &["3", "20"]),
    ("--splits", &["1", "2", "2x3"]),
    ("--units", &["um", "mm", "cm", "m", "inch", "ft"]),
    ("--flip", &[""]),
    ("--max-step-control-points", &["1", "20", "100"]),
    ("--trim-holes", &[""]),
    ("--threads", &["1"]),
    ("--height-field", &[""]),
    ("--clean", &["none", "outliers", "stray", "outliers,stray"]),
    ("--piece", &["1", "2"]),
    ("--thin", &["4", "16", "60"]),
    ("--crop", &["-0.5,0.5,-0.5,0.5", "0,10,0,10"]),
    ("--mask", &[FILE]),
    ("--domain", &["unit", "data"]),
    ("--closed", &["auto", "none", "u", "v", "uv"]),
    ("--corners", &["0,3,12,15", "0,0,1,2", "5,4,3,2"]),
    ("--outline", &[FILE]),
    ("--side-rule", &["chord", "centripetal", "uniform"]),
    ("--radius", &["grow", "auto", "0.1", "100"]),
    ("--refine", &["auto", "on", "off"]),
    ("--networks", &["on", "off"]),
    ("--subset", &["500", "5000"]),
    ("--weights", &["weight"]),
    ("--columns", &["x,y,z", "z,y,x"]),
    ("--normals", &["none", "nx,ny,nz"]),
    ("--grid", &["none", "i,j"]),
    ("--decimal", &["point"]),
    ("--skip", &["1"]),
];

/// How often each value of [`CHOICES`] was typed.
#[derive(Clone, Debug)]
pub struct Counts {
    /// Runs.
    pub runs: usize,
    /// Of each option the runs with each value.
    pub of_values: Vec<Vec<usize>>,
}

impl Counts {
    /// None yet.
    pub fn new() -> Self {
        Self { runs: 0, of_values: CHOICES.iter().map(|(_, values)| vec![0; values.len()]).collect() }
    }

    /// Counts a run.
    pub fn add(&mut self, chosen: &[(usize, usize)]) {
        self.runs += 1;
        chosen.iter().for_each(|&(option, value)| self.of_values[option][value] += 1);
    }

    /// A line for all runs and for each value: option, value and count with tabs between them.
    pub fn to_text(&self) -> String {
        let mut text = format!("runs\t\t{}\n", self.runs);
        for ((option, values), counts) in CHOICES.iter().zip(&self.of_values) {
            for (value, count) in values.iter().zip(counts) {
                let _ = writeln!(text, "{option}\t{value}\t{count}");
            }
        }
        text
    }
}

impl Default for Counts {
    fn default() -> Self {
        Self::new()
    }
}

/// The variable of the environment that names a file for the counts of a process.
const COUNTS_FILE: &str = "THB_FUZZ_COUNTS";

/// Runs after which the file is written anew.
const WRITTEN_EVERY: usize = 50;

/// The options that an input stands for: indices of an option in [`CHOICES`], and of its value.
pub fn choices_of(bytes: &[u8]) -> Vec<(usize, usize)> {
    let mut choices = Choices::of(&bytes[..bytes.len().min(OF_OPTIONS)]);
    let mut chosen = Vec::new();
    for (option, (name, values)) in CHOICES.iter().enumerate() {
        if *name == "--method" || choices.with(SHARE_OF_VALUE * values.len() as f64) {
            chosen.push((option, choices.below(values.len())));
        }
    }
    chosen
}

/// Fits the points that the bytes stand for.
pub(super) fn run(bytes: &[u8]) {
    let chosen = choices_of(bytes);
    count(&chosen);
    let rest = bytes.get(OF_OPTIONS..).unwrap_or_default();
    let (of_shape, changes) = rest.split_at(rest.len().min(OF_SHAPE));
    let (text, format) = scan(&mut Choices::of(of_shape), changes);
    let (rows, mask) = (files::Temporary::new("txt", ROWS), files::Temporary::new("asc", MASK));
    let mut typed = vec!["thb".to_owned(), "fit".to_owned(), "scan".to_owned(), "-o".to_owned(), "out".to_owned()];
    for &(option, value) in &chosen {
        let (name, values) = CHOICES[option];
        let file = if name == "--mask" { mask.path() } else { rows.path() };
        match values[value] {
            "" => typed.push(name.to_owned()),
            FILE => typed.push(format!("{name}={}", file.display())),
            value => typed.push(format!("{name}={value}")),
        }
    }
    bounds::name_running(&typed.join(" "));
    let cli = Cli::try_parse_from(&typed).unwrap_or_else(|error| panic!("{typed:?}: {error}"));
    let Command::Fit(args) = cli.command else { panic!("the command is to fit") };
    let options = args.part.options(args.run.threads).surface;
    bounded(Bounds { memory: MEMORY, time: TIME }, || {
        let scan = match parse_scan(text.as_bytes(), format, &options.parameters.read) {
            Ok(scan) => scan,
            Err(error) => return messages::check(&error.to_string()),
        };
        match fit_scan(scan, "tiny", &options, &mut |_| ControlFlow::Continue(())) {
            Ok(fit) => check(&fit, options.max_step_control_points),
            Err(error) => messages::check(&error.to_string()),
        }
    });
}

/// Rows of an outline, and of markers where each has a type.
const ROWS: &[u8] = b"0 1\n3 2\n12 1\n15 2\n";

/// A mask over the middle of the shapes.
const MASK: &[u8] = b"ncols 2\nnrows 2\nxllcorner -1\nyllcorner -1\ncellsize 1\n1 1\n1 0\n";

fn count(chosen: &[(usize, usize)]) {
    static COUNTS: Mutex<Option<Counts>> = Mutex::new(None);
    let Some(path) = std::env::var_os(COUNTS_FILE) else { return };
    let mut counts = COUNTS.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    let counts = counts.get_or_insert_default();
    counts.add(chosen);
    if counts.runs.is_multiple_of(WRITTEN_EVERY) {
        std::fs::write(Path::new(&path), counts.to_text()).expect("the counts can be written");
    }
}

/// Checks that a fit is one, and can be written.
fn check(fit: &Fit, max_control_points: usize) {
    let Geometry::Surface(map) = &fit.model.geometry else { panic!("a fit is a surface") };
    assert!(map.coefficients().iter().all(|c| c.is_finite()), "a control point is not finite");
    assert!(fit.errors.iter().all(|e| e.is_finite()), "an error is not finite");
    assert!(fit.parameters.iter().all(|u| u.is_finite()), "a parameter is not finite");
    assert_eq!((fit.errors.len(), fit.parameters.nrows()), (fit.points.nrows(), fit.points.nrows()), "points");
    let report = serde_json::to_string(&fit.report).expect("a report can be written");
    assert!(!report.contains("\"max\":null"), "a distance of the report is no number");
    let model = written(|out| json::write_json(out, &fit.model));
    assert!(json::parse_json(model.as_bytes()).is_ok(), "the model cannot be read back");
    let options =
        StepOptions { max_control_points, holes: fit.holes.clone(), flip: fit.reversed, ..StepOptions::default() };
    if let Some(file) = told(step::StepFile::new(&fit.model, &options)) {
        check_written(&written(|out| file.write(out)));
    }
}

/// A small scan as a file: points in space, with what else a table may have of them.
fn scan(choices: &mut Choices, changes: &[u8]) -> (String, Format) {
    let columns = 4 + choices.below(9);
    let lines = (20_usize.div_ceil(columns)..=120 / columns).collect::<Vec<_>>();
    let lines = choices.one_of(&lines);
    let shape = choices.below(10);
    let scale = choices.one_of(&[1.0, 1.0, 1.0, 100.0, 1e-6, 1e9]);
    let offset = choices.one_of(&[0.0, 0.0, 0.0, 0.0, 1e3, 1e7]);
    let noise = choices.one_of(&[0.0, 0.0, 1e-3, 0.05]);
    let [a, b, c] = [(); 3].map(|()| choices.signed());
    let mut points: Vec<[f64; 3]> = (0..lines * columns)
        .map(|at| {
            let [u, v] = match shape {
                // Scattered, by shape.
                5..7 => [choices.signed(), choices.signed()],
                _ => [(at / columns, lines), (at % columns, columns)]
                    .map(|(k, n)| 2.0 * k as f64 / (n.max(2) - 1) as f64 - 1.0),
            };
            let place = match shape {
                // A tube, and one that closes.
                7 => [(v * TAU / 2.0).cos(), (v * TAU / 2.0).sin(), 2.0 * u],
                // A line, or a single point.
                8 => [u + v, 0.5 * (u + v), c * (u + v)],
                // No surface at all.
                9 => [(); 3].map(|()| choices.signed()),
                _ => [u, v, a * u * v + b * (3.0 * u).sin() + c * (-4.0 * (u * u + v * v)).exp()],
            };
            place.map(|x| scale * (x + noise * choices.signed()) + scale * offset)
        })
        .collect();
    change(&mut points, changes);
    match shape {
        0 | 7 => (off(&points, lines, columns), Format::Off),
        _ => (table(choices, &points, lines, columns, shape), Format::Csv),
    }
}

/// Changes points as the bytes say: three bytes a change.
fn change(points: &mut [[f64; 3]], changes: &[u8]) {
    for change in changes.chunks_exact(3) {
        let [at, other] = [change[0], change[1]].map(|byte| usize::from(byte) % points.len());
        let axis = usize::from(change[2]) % 3;
        match change[2] / 3 % 10 {
            0 => points[at] = points[other],
            1 => points[at][axis] = points[other][axis],
            2 => points[at][axis] = 1e6,
            3 => points[at][axis] = -9999.0,
            4 => points[at] = [0.0; 3],
            5 => points[at][axis] = f64::NAN,
            6 => points[at][axis] += 1e-9 * f64::from(change[1]),
            7 => points.swap(at, other),
            8 => points[at][axis] *= 1.0 + f64::from(change[1]) / 64.0,
            _ => points[at][axis] = points[at][axis].round(),
        }
    }
}

/// A mesh over the lines; some triangles turn the other way round or are missing where points are equal.
fn off(points: &[[f64; 3]], lines: usize, columns: usize) -> String {
    let mut text = format!("OFF\n{} {} 0\n", points.len(), 2 * (lines - 1) * (columns - 1));
    points.iter().for_each(|[x, y, z]| writeln!(text, "{x} {y} {z}").unwrap_or_default());
    for (i, j) in (0..lines - 1).flat_map(|i| (0..columns - 1).map(move |j| (i, j))) {
        let [a, b] = [i, i + 1].map(|i| i * columns + j);
        let _ = writeln!(text, "3 {a} {b} {}\n3 {b} {} {}", a + 1, b + 1, a + 1);
    }
    text
}

/// A table with grid indices, parameters, normals or weights beside the points, or none of these.
fn table(choices: &mut Choices, points: &[[f64; 3]], lines: usize, columns: usize, shape: usize) -> String {
    let [grid, parameters, normals, weights] =
        [shape < 2, (2..4).contains(&shape), choices.with(0.2), choices.with(0.2)];
    let mut text = String::from("x,y,z");
    for (has, names) in [(grid, ",i,j"), (parameters, ",u,v"), (normals, ",nx,ny,nz"), (weights, ",weight")] {
        text += if has { names } else { "" };
    }
    for (at, [x, y, z]) in points.iter().enumerate() {
        let (i, j) = (at / columns, at % columns);
        let _ = write!(text, "\n{x},{y},{z}");
        if grid {
            let _ = write!(text, ",{i},{j}");
        }
        if parameters {
            let _ = write!(text, ",{},{}", i as f64 / (lines.max(2) - 1) as f64, j as f64 / (columns - 1) as f64);
        }
        if normals {
            let _ = write!(text, ",{},{},1", choices.signed(), choices.signed());
        }
        if weights {
            let _ = write!(text, ",{}", choices.below(3));
        }
    }
    text + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_is_typed_in_at_least_one_of_a_hundred_runs() {
        let mut counts = Counts::new();
        for run in 0..20_000_u64 {
            counts.add(&choices_of(&run.wrapping_mul(0x9e37_79b9_7f4a_7c15).to_le_bytes()));
        }
        for ((option, values), counts_of) in CHOICES.iter().zip(&counts.of_values) {
            for (value, &count) in values.iter().zip(counts_of) {
                assert!(100 * count >= counts.runs, "{option} {value}: {count} of {}", counts.runs);
            }
        }
    }

    #[test]
    fn every_option_of_a_fit_that_changes_it_is_among_the_choices() {
        use clap::CommandFactory;
        // Where things go, and what only files in containers or of LAS have.
        let others = [
            "output",
            "report",
            "summary",
            "jobs",
            "quiet",
            "verbose",
            "help",
            "version",
            "format",
            "class",
            "max-expand",
        ];
        let command = Cli::command();
        let fit = command.find_subcommand("fit").expect("there is the command fit");
        for option in fit.get_arguments().filter_map(|argument| argument.get_long()) {
            let is_chosen = CHOICES.iter().any(|(name, _)| name.strip_prefix("--") == Some(option));
            assert!(is_chosen != others.contains(&option), "--{option}");
        }
    }

    #[test]
    fn scans_have_20_to_120_points() {
        for seed in 0..2000_u32 {
            let (text, format) = scan(&mut Choices::of(&seed.to_le_bytes()), &[]);
            let points = match format {
                Format::Off => text.lines().nth(1).and_then(|l| l.split(' ').next()?.parse().ok()).unwrap_or(0),
                _ => text.lines().count() - 1,
            };
            assert!((20..=120).contains(&points), "{points} points of seed {seed}");
        }
    }
}
