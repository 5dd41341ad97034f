//! Fits of a list of scans, pinned: what came out, what it cost, and what else was tried.

mod list;
mod row;

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};
use reconstruct::Policy;

pub use row::{Job, run};

use crate::tables::markdown::table;
use list::Scan;
use row::Row;

/// What is fitted.
pub struct Corpus<'a> {
    /// The root of the workspace.
    pub root: &'a Path,
    /// The folder with the scans that the repository does not hold.
    pub data: Option<&'a Path>,
    /// Scans whose names contain this are fitted, and no others.
    pub only: Option<&'a str>,
    /// Methods, as `thb fit --method` names them.
    pub methods: &'a [String],
    /// Values of a threshold that are compared.
    pub vary: Option<&'a Vary>,
    /// Whether every candidate of the default runs to its end.
    pub all_candidates: bool,
    /// Whether two threads are timed, too.
    pub two_threads: bool,
}

/// A threshold of [`Policy`] and values to try.
#[derive(Clone, Debug, PartialEq)]
pub struct Vary {
    name: String,
    values: Vec<f64>,
}

impl std::str::FromStr for Vary {
    type Err = anyhow::Error;

    fn from_str(text: &str) -> Result<Self> {
        let (name, values) = text.split_once('=').context("expected NAME=VALUE,VALUE,...")?;
        let values: Vec<f64> = values.split(',').map(|v| Ok(v.trim().parse()?)).collect::<Result<_>>()?;
        let known: Vec<&str> = Policy::COMMANDS.iter().map(|(name, _)| *name).collect();
        ensure!(known.contains(&name), "no threshold {name:?}; there are {}", known.join(", "));
        Ok(Self { name: name.to_owned(), values })
    }
}

impl Corpus<'_> {
    /// Fits all, each in a process of its own; `done` is told of each row.
    ///
    /// # Errors
    /// A list that cannot be read, processes that cannot be started. Fits that fail are rows.
    pub fn rows(&self, done: &mut dyn FnMut(&str)) -> Result<Vec<Row>> {
        let mut rows = Vec::new();
        for scan in list::read(&self.root.join("xtask/corpus.txt"))? {
            if self.only.is_some_and(|only| !scan.name.contains(only)) {
                continue;
            }
            let Some(path) = scan.path(self.root, self.data)? else { continue };
            for &percent in &scan.percents {
                for job in self.jobs(&scan, &path, percent) {
                    let row = self.fit(job)?;
                    done(&row.to_string());
                    rows.push(row);
                }
            }
        }
        Ok(rows)
    }

    fn jobs(&self, scan: &Scan, path: &Path, percent: f64) -> Vec<Job> {
        let variants = self.vary.map_or(vec![None], |vary| vary.values.iter().map(|&value| Some(value)).collect());
        let mut jobs = Vec::new();
        for method in self.methods {
            for &value in &variants {
                jobs.push(Job {
                    name: scan.name.clone(),
                    path: path.to_owned(),
                    percent,
                    method: method.clone(),
                    threshold: self.vary.zip(value).map(|(vary, value)| (vary.name.clone(), value)),
                    all_candidates: self.all_candidates,
                });
            }
        }
        jobs
    }

    fn fit(&self, job: Job) -> Result<Row> {
        let measured = child(&job, 1)?;
        let two = if self.two_threads { Some(child(&job, 2)?) } else { None };
        Ok(Row::new(&job, &measured, two.as_ref()))
    }
}

/// Runs a fit in a process of its own, so that its memory and its time are its own.
fn child(job: &Job, threads: usize) -> Result<serde_json::Value> {
    let program = std::env::current_exe().context("the path of this program is not known")?;
    let output = Command::new(program)
        .args(["corpus-row", "--job", &serde_json::to_string(job)?])
        .env("RAYON_NUM_THREADS", threads.to_string())
        .output()
        .context("cannot start a fit")?;
    if !output.status.success() {
        bail!("{} at {} %: {}", job.name, job.percent, String::from_utf8_lossy(&output.stderr).trim());
    }
    serde_json::from_slice(&output.stdout).context("a fit did not print JSON")
}

/// The page of rows.
pub fn page(rows: &[Row]) -> String {
    let cells: Vec<Vec<String>> = rows.iter().map(Row::cells).collect();
    format!("{INTRODUCTION}\n{}\n{}", summary(rows), table(&row::HEADER, &cells))
}

/// Means over the scans on which all methods that stand in the rows, and the default, did well.
fn summary(rows: &[Row]) -> String {
    let defaults: Vec<&Row> = rows.iter().filter(|row| row.method == "auto").collect();
    let mut text = String::new();
    let mut logs = Vec::new();
    let mut good = [0_usize; 2];
    for default in &defaults {
        let singles = rows.iter().filter(|row| row.is_of(default) && row.method != "auto" && row.verdict == "good");
        let best = singles
            .min_by(|a, b| a.control_points.cmp(&b.control_points).then(a.cpu_seconds.total_cmp(&b.cpu_seconds)));
        good[0] += usize::from(default.verdict == "good");
        good[1] += usize::from(best.is_some());
        if let Some(best) = best.filter(|_| default.verdict == "good") {
            let points = default.control_points as f64 / best.control_points as f64;
            logs.push([points.ln(), (default.cpu_seconds / best.cpu_seconds).ln()]);
        }
    }
    if !logs.is_empty() {
        let mean = |k: usize| (logs.iter().map(|log| log[k]).sum::<f64>() / logs.len() as f64).exp();
        text += &format!(
            "Of {} rows of the default {} are good; some single method is good in {}. Where both are, the default has {:.3} of the \
             control points of the best single method and {:.2} of its CPU seconds (geometric means of {} rows).\n",
            defaults.len(),
            good[0],
            good[1],
            mean(0),
            mean(1),
            logs.len()
        );
    }
    text
}

/// What differs from rows that were made before, by more than rounding explains.
pub fn differing(before: &[Row], now: &[Row]) -> Vec<String> {
    let mut findings = Vec::new();
    for row in now {
        match before.iter().find(|old| old.is_same_fit(row)) {
            None => findings.push(format!("{row}: no such row before")),
            Some(old) => {
                findings.extend(row.differs(old).map(|what| format!("{} at {} %: {what}", row.name, row.percent)))
            }
        }
    }
    findings
}

/// Rows of a file that [`to_lines`] has made.
///
/// # Errors
/// A file that cannot be read, or is not of this kind.
pub fn from_file(path: &Path) -> Result<Vec<Row>> {
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    text.lines().map(|line| serde_json::from_str(line).with_context(|| format!("{}: {line}", path.display()))).collect()
}

/// Rows as lines of a file.
///
/// # Errors
/// None that are known: rows are plain.
pub fn to_lines(rows: &[Row]) -> Result<String> {
    rows.iter().map(|row| Ok(serde_json::to_string(row)? + "\n")).collect()
}

/// The file of rows below the root.
pub fn file(root: &Path) -> PathBuf {
    root.join("docs/results/corpus.jsonl")
}

const INTRODUCTION: &str = "\
# The corpus: what fits come to, and what they cost

    RAYON_NUM_THREADS=1 cargo xtask corpus --data DIR --methods auto,ls,joint

The scans are those of `xtask/corpus.txt`: fixtures of this repository, generated ones, and scans in DIR by their names. Each is fitted by
the default (`auto`) and by single methods, each fit in a process of its own. *Within* is the share of the area within the tolerance in
percent, from the scan to the surface / from the surface to the scan; *largest* and *RMS* are in tolerances; *gathered* is the share of the
area in large patches of misses, in percent; *MiB* is the largest resident memory. *Tried* lists the candidates of the default in their order:
control points, and the verdict or why it was given up; the one that was kept stands in bold. `cargo xtask corpus --check` compares new fits
with these (`docs/results/corpus.jsonl`) but for times and memory; `--vary NAME=VALUE,...` runs other thresholds; `--all-candidates` runs
every candidate to its end.
";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thresholds_are_named_as_the_policy_names_them() {
        let vary: Vary = "hopeless=0.9,1".parse().unwrap();
        assert_eq!(vary, Vary { name: "hopeless".to_owned(), values: vec![0.9, 1.0] });
        for wrong in ["hopeless", "hopeles=1", "hopeless=x"] {
            assert!(wrong.parse::<Vary>().is_err(), "{wrong} was read");
        }
    }

    #[test]
    fn the_list_names_scans_once_and_only_fixtures_that_exist() {
        let root = crate::workspace_root();
        let scans = list::read(&root.join("xtask/corpus.txt")).unwrap();
        let mut names: Vec<&str> = scans.iter().map(|scan| scan.name.as_str()).collect();
        names.sort_unstable();
        assert!(names.windows(2).all(|pair| pair[0] != pair[1]), "{names:?}");
        for scan in scans.iter().filter(|scan| scan.name.starts_with("fixtures/")) {
            assert!(root.join(&scan.name).is_file(), "{}", scan.name);
        }
    }
}
