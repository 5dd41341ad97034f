//! Reported figures beside those of a meter that shares no code with the product: `tests/peers/measure_step.py`.

mod files;
mod row;

use std::fs;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, bail};
use reconstruct::{Domain, FitOptions, OutputPaths, Tolerance, write_outputs};
use serde_json::Value;

use super::finished::Cache;
use super::markdown::table;
use crate::timed_fit::timed_fit;
use files::{KINDS, Kind, OWN_DOMAINS};
use row::{Direction, Row};

/// Tolerances in percent of the diagonal.
const PERCENTS: [f64; 2] = [0.5, 0.1];

/// Codes with which `thb fit` ends.
const EXIT_SUCCESS: u8 = 0;
const EXIT_ERROR: u8 = 1;
const EXIT_FAILED: u8 = 3;

/// What results depend on, below the root of the workspace.
const CODE: [&str; 3] = ["crates", "Cargo.lock", "tests/peers"];

/// The meter, below the root of the workspace.
const METER: &str = "tests/peers/measure_step.py";

/// What the table is made from.
pub struct Truth<'a> {
    /// The folder with the scans.
    pub data: &'a Path,
    /// A Python interpreter with the packages of `tests/peers/requirements.txt`.
    pub python: &'a Path,
    /// Files whose names contain this are fitted, and no others.
    pub only: Option<&'a str>,
    /// A file of finished rows, one a line. Surfaces are written to a folder beside it.
    pub cache: &'a Path,
    /// Whether rows of this commit that are finished are taken from there.
    pub resume: bool,
}

/// The page. `log` is told what begins and what is skipped.
///
/// # Errors
/// What the interpreter and files meet; not those of a fit, which are part of the table.
pub fn document(truth: &Truth<'_>, log: &mut dyn FnMut(&str)) -> Result<String> {
    let root = crate::workspace_root();
    check_python(truth.python)?;
    let commit = crate::process::commit(&root, &CODE);
    let mut cache = Cache::open(truth.cache, truth.resume, &commit)?;
    let surfaces = truth.cache.with_extension("surfaces");
    fs::create_dir_all(&surfaces).with_context(|| format!("cannot create {}", surfaces.display()))?;
    let mut rows = Vec::new();
    for Kind { files, .. } in &KINDS {
        for file in *files {
            let path = truth.data.join(file);
            if !path.is_file() {
                log(&format!("{file}: not in {}, skipped", truth.data.display()));
                continue;
            }
            for percent in PERCENTS {
                if let Some(row) = cache.take(|row: &Row| row.file == *file && row.percent == percent) {
                    rows.push(row);
                } else if truth.only.is_none_or(|only| file.contains(only)) {
                    log(&format!("{file} at {percent} %"));
                    let step = surfaces.join(format!("{}-{percent}.step", file.replace('/', "-")));
                    let row = fitted(file, &path, percent, &step, truth.python, &root.join(METER));
                    cache.add(&row)?;
                    rows.push(row);
                }
            }
        }
    }
    Ok(page(&rows, &commit))
}

fn check_python(python: &Path) -> Result<()> {
    let found = Command::new(python)
        .args(["-c", "import OCP.gp, igl, scipy"])
        .output()
        .with_context(|| format!("cannot run {}", python.display()))?;
    if !found.status.success() {
        let text = String::from_utf8_lossy(&found.stderr);
        let last = text.lines().last().unwrap_or_default();
        bail!("{} lacks packages of tests/peers/requirements.txt: {last}", python.display());
    }
    Ok(())
}

/// Fits a file, writes the surface and has it measured.
fn fitted(file: &str, path: &Path, percent: f64, step: &Path, python: &Path, meter: &Path) -> Row {
    let mut options = FitOptions { tol: Tolerance::Percent(percent), ..FitOptions::default() };
    if OWN_DOMAINS.contains(&file) {
        options.parameters.domain = Domain::Data;
    }
    let (fit, seconds) = timed_fit(path, &options);
    let mut row = Row {
        file: file.to_owned(),
        percent,
        exit: EXIT_ERROR,
        error: String::new(),
        seconds,
        result: Value::Null,
        measured: Value::Null,
    };
    let outputs = OutputPaths { files: vec![step.to_owned()], reports: Vec::new() };
    let written = fit.and_then(|fit| {
        write_outputs(&fit, &outputs)?;
        Ok(fit)
    });
    match written {
        Ok(fit) => {
            row.exit = if fit.reached() { EXIT_SUCCESS } else { EXIT_FAILED };
            let result = serde_json::to_value(&fit.report.result).map_err(anyhow::Error::from);
            let measured = result.and_then(|result| {
                row.result = result;
                measured(python, meter, step, path, fit.report.result.tolerance)
            });
            match measured {
                Ok(measured) => row.measured = measured,
                Err(error) => row.error = format!("not measured: {error:#}"),
            }
        }
        Err(error) => row.error = error.to_string(),
    }
    row
}

fn measured(python: &Path, meter: &Path, step: &Path, scan: &Path, tolerance: f64) -> Result<Value> {
    let output = Command::new(python)
        .args([meter, step, scan])
        .args(["--largest-piece", "--tol", &tolerance.to_string()])
        .output()?;
    if !output.status.success() {
        let text = String::from_utf8_lossy(&output.stderr);
        bail!("{}", text.lines().last().unwrap_or("no reason given"));
    }
    serde_json::from_slice(&output.stdout).context("the meter did not print JSON")
}

fn page(rows: &[Row], commit: &str) -> String {
    let mut text = format!("{INTRODUCTION}\nCommit {commit}.\n\n{}", summary(rows));
    for Kind { heading, files } in &KINDS {
        for percent in PERCENTS {
            let some: Vec<Vec<String>> = rows
                .iter()
                .filter(|row| row.percent == percent && files.contains(&row.file.as_str()))
                .map(cells)
                .collect();
            if !some.is_empty() {
                text += &format!("\n## {heading}, {percent} % of the diagonal\n\n{}", table(&HEADER, &some));
            }
        }
    }
    text
}

const HEADER: [&str; 13] = [
    "file",
    "exit",
    "method",
    "control points",
    "CPU-s",
    "within, reported",
    "within, measured",
    "largest, reported",
    "largest, measured",
    "box",
    "crossings",
    "largest patch",
    "reasons",
];

fn cells(row: &Row) -> Vec<String> {
    let both = |figures: &dyn Fn(Direction) -> [Option<f64>; 2], which: usize, show: &dyn Fn(f64) -> String| {
        [Direction::ScanToSurface, Direction::SurfaceToScan]
            .map(|direction| figures(direction)[which].map_or("–".to_owned(), show))
            .join(" / ")
    };
    let percent = |share: f64| format!("{:.1}", 100.0 * share);
    let tolerances = |length: f64| format!("{length:.2}");
    let pair = |reported: &str, measured: &str, show: &dyn Fn(f64) -> String| {
        [row.reported(&[reported]), row.measured(measured)]
            .map(|figure| figure.map_or("–".to_owned(), show))
            .join(" / ")
    };
    let result = |key: &str| match &row.result[key] {
        Value::String(text) => text.clone(),
        Value::Number(number) => number.to_string(),
        _ => "–".to_owned(),
    };
    let reasons = if row.error.is_empty() { row.reasons().join(", ") } else { row.error.replace('|', "/") };
    vec![
        format!("`{}`", row.file),
        format!("{} {}", row.exit, row.verdict()),
        result("method"),
        result("dofs"),
        format!("{:.1}", row.seconds),
        both(&|direction| row.shares(direction), 0, &percent),
        both(&|direction| row.shares(direction), 1, &percent),
        both(&|direction| row.largest(direction), 0, &tolerances),
        both(&|direction| row.largest(direction), 1, &tolerances),
        pair("deviation.box_ratio", "box", &|ratio| format!("{ratio:.3}")),
        pair("deviation.crossings.pairs", "crossings.pairs", &|pairs| format!("{pairs:.0}")),
        pair("deviation.gathered.largest", "gathered.largest", &|share| format!("{:.2}", 100.0 * share)),
        reasons,
    ]
}

/// What the rows show together.
fn summary(rows: &[Row]) -> String {
    let name = |row: &Row| format!("`{}` at {} %", row.file, row.percent);
    let counted = |count: usize, of: &str| format!("{count} {of}");
    let mut verdicts: Vec<(&str, usize)> = Vec::new();
    for row in rows {
        match verdicts.iter_mut().find(|(verdict, _)| *verdict == row.verdict()) {
            Some((_, count)) => *count += 1,
            None => verdicts.push((row.verdict(), 1)),
        }
    }
    let verdicts: Vec<String> = verdicts.into_iter().map(|(verdict, count)| counted(count, verdict)).collect();
    let mut text = format!("{} fits: {}.\n\n", rows.len(), verdicts.join(", "));
    for (which, what) in
        ["Shares (to 0.01)", "Largest distances (to max(5 %, 0.05 tolerances))"].into_iter().enumerate()
    {
        let known: Vec<(&Row, bool)> =
            rows.iter().filter_map(|row| row.agreement()[which].map(|agrees| (row, agrees))).collect();
        let differing: Vec<String> = known.iter().filter(|(_, agrees)| !agrees).map(|(row, _)| name(row)).collect();
        text +=
            &format!("- {what} agree in {} of {}{}\n", known.len() - differing.len(), known.len(), listed(&differing));
    }
    let quiet: Vec<String> = rows
        .iter()
        .filter(|row| row.exit == EXIT_SUCCESS)
        .filter_map(|row| row.broken().filter(|broken| !broken.is_empty()).map(|broken| (row, broken)))
        .map(|(row, broken)| format!("{} ({})", name(row), broken.join(", ")))
        .collect();
    text += &format!("- Exit code 0 without what it promises: {}{}\n", quiet.len(), listed(&quiet));
    let strict: Vec<String> = rows
        .iter()
        .filter(|row| row.exit == EXIT_FAILED && row.broken().is_some_and(|broken| broken.is_empty()))
        .map(|row| format!("{} ({})", name(row), row.reasons().join(", ")))
        .collect();
    text += &format!("- Exit code 3 although all that is promised holds: {}{}\n", strict.len(), listed(&strict));
    let unmeasured: Vec<String> = rows.iter().filter(|row| row.measured.is_null()).map(name).collect();
    text += &format!("- Without a surface, or not measured: {}{}\n", unmeasured.len(), listed(&unmeasured));
    text
}

fn listed(names: &[String]) -> String {
    if names.is_empty() { ".".to_owned() } else { format!(": {}.", names.join("; ")) }
}

const INTRODUCTION: &str = "\
# Reported and measured

    cargo xtask tables truth --data DIR --python PROGRAM

DIR has the scans by the names below; PROGRAM is a Python with the packages of `tests/peers/requirements.txt`. Each scan is fitted
with the defaults at a tolerance of 0.5 % and of 0.1 % of its diagonal and written as STEP. *Reported* is what `thb fit` says of
its result, *measured* what `tests/peers/measure_step.py` finds, which reads the STEP file with Open CASCADE and shares no code
with the product; its head defines the figures.

*Within* is the share of the area within the tolerance in percent (of a cloud, of its points, weighed by spacing²), from the scan to
the surface / from the surface to the scan; *largest* is in tolerances, likewise. The others are reported / measured: *box* is the
diagonal of the surface's box in diagonals of the scan's; *crossings* counts pairs of triangles that pass through each other (on
other triangles, so that only none and some compare); *largest patch* is the largest connected part of the scan beyond the
tolerance, in percent of its area. A dash stands for what is not known. A fit is ended after ten minutes of CPU time,
with the surface of then.

Exit code 0 promises: 94 % of the scan within (0.95 are asked for, 0.01 is the accuracy of the measure); of a mesh, 94 % of the
surface inside the outline and not over holes; at most 1 % of the scan beyond the rim; a box of at most 1.05; no crossing; at
most 0.1 % of the surface folded over (0.12 % by the meter, whose samples scatter by 0.01 %). What the scan does the surface may do:
`thbs_face_*` are points of a surface that passes through itself (`thb compare thbs_face_3levels.xml thbs_face_grid.csv` shows it), and
so do the triangles that the given parameters of `nefertiti_up.xml` span over its points, so that their crossings are not counted as
broken promises. Crossings that are shorter than half a tolerance all together count as none.

Of a mesh of several pieces the largest is fitted and measured. `deepdrawingC.xml` brings parameters from -1 to 0.94 and is fitted with
`--domain data`; `iea15_blade.xyz` is a cloud of three pieces, which is refused with the advice to fit them one by one.
";

#[cfg(test)]
mod tests {
    use super::*;

    fn row(file: &str, exit: u8, within: f64) -> Row {
        let side = serde_json::json!({"within": within, "max": 1.5});
        Row {
            file: file.to_owned(),
            percent: 0.5,
            exit,
            error: String::new(),
            seconds: 1.25,
            result: serde_json::json!({
                "verdict": if exit == EXIT_SUCCESS { "good" } else { "failed" }, "tolerance": 1.0, "dofs": 49, "method": "ls",
                "deviation": {"scan_to_surface": {"within": 0.97, "max": 1.5}, "surface_to_scan": {"within": 0.97, "max": 1.5}},
            }),
            measured: serde_json::json!({
                "tol": 1.0, "scan": {"kind": "mesh"}, "box": 1.0, "scan_to_surface": side, "surface_to_scan": side,
            }),
        }
    }

    #[test]
    fn broken_promises_and_needless_failures_are_named() {
        let rows = [
            row("nefertiti_299.off", EXIT_SUCCESS, 0.97),
            row("solids/blob.off", EXIT_SUCCESS, 0.9),
            row("beetle_bonnet.obj", EXIT_FAILED, 0.97),
        ];
        let text = page(&rows, "abc");
        for line in [
            "3 fits: 2 good, 1 failed.",
            "- Shares (to 0.01) agree in 2 of 3: `solids/blob.off` at 0.5 %.",
            "- Exit code 0 without what it promises: 1: `solids/blob.off` at 0.5 % (scan within 90.0 %, surface within 90.0 %).",
            "- Exit code 3 although all that is promised holds: 1: `beetle_bonnet.obj` at 0.5 % ().",
            "- Without a surface, or not measured: 0.",
        ] {
            assert!(text.contains(line), "{line}\n{text}");
        }
        assert_eq!(text.matches("\n| `").count(), 3);
    }

    #[test]
    fn no_file_is_listed_twice() {
        let mut names: Vec<&str> = KINDS.iter().flat_map(|kind| kind.files).copied().collect();
        let count = names.len();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), count);
    }
}
