//! One fit of the corpus.

use std::fmt;
use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context, Result};
use reconstruct::{FitOptions, Policy, Tolerance};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::process::peak_memory;
use crate::timed_fit::timed_fit;

/// How much control points may differ between rows that are the same, as a share: sums in another order.
const SAME_CONTROL_POINTS: f64 = 0.02;

/// How much shares of the area may differ.
const SAME_SHARE: f64 = 0.005;

/// How much the root mean square distance may differ, as a share.
const SAME_RMS: f64 = 0.05;

/// A fit to be run.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Job {
    pub(super) name: String,
    pub(super) path: PathBuf,
    pub(super) percent: f64,
    pub(super) method: String,
    /// A threshold that is changed.
    pub(super) threshold: Option<(String, f64)>,
    pub(super) all_candidates: bool,
}

/// Runs a fit in this process and says what came of it, as JSON.
///
/// # Errors
/// Options that are not possible. What a fit meets stands in the answer.
pub fn run(job: &str) -> Result<Value> {
    let job: Job = serde_json::from_str(job).context("not a job")?;
    let mut policy = Policy::default();
    if let Some((name, value)) = &job.threshold {
        policy = policy.with(name, *value).with_context(|| format!("no threshold {name:?}"))?;
    }
    let options = FitOptions {
        tol: Tolerance::Percent(job.percent),
        method: job.method.parse()?,
        policy,
        exhaustive: job.all_candidates,
        ..FitOptions::default()
    };
    let start = Instant::now();
    let (fit, cpu) = timed_fit(&job.path, &options);
    let wall = start.elapsed().as_secs_f64();
    let (result, error) = match fit {
        Ok(fit) => (serde_json::to_value(&fit.report.result)?, String::new()),
        Err(error) => (Value::Null, error.to_string()),
    };
    Ok(json!({"result": result, "error": error, "cpu": cpu, "wall": wall, "memory": peak_memory()}))
}

/// What came of a fit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    pub(super) name: String,
    pub(super) percent: f64,
    pub(super) method: String,
    /// The threshold that was changed, as `NAME=VALUE`; empty without.
    pub(super) changed: String,
    pub(super) all_candidates: bool,
    pub(super) control_points: u64,
    /// `good`, `usable`, `failed`, or `error`.
    pub(super) verdict: String,
    /// Codes of reasons, or the error.
    reasons: String,
    /// Shares within the tolerance: of the scan's area, of the surface's.
    within: [f64; 2],
    /// Largest distances, likewise, in tolerances.
    largest: [f64; 2],
    /// Root mean square distance of the scan from the surface, in tolerances.
    rms: f64,
    gathered: f64,
    pub(super) cpu_seconds: f64,
    wall_seconds: f64,
    /// The same on two threads; absent if not measured.
    wall_seconds_on_two: Option<f64>,
    memory: Option<f64>,
    /// What was tried, in Markdown.
    tried: String,
}

/// Heads of the columns of [`Row::cells`].
pub(super) const HEADER: [&str; 14] = [
    "scan",
    "tolerance, %",
    "method",
    "control points",
    "verdict",
    "within, %",
    "largest",
    "RMS",
    "gathered, %",
    "CPU-s",
    "s, 1 thread",
    "s, 2 threads",
    "MiB",
    "tried",
];

impl Row {
    pub(super) fn new(job: &Job, measured: &Value, on_two: Option<&Value>) -> Self {
        let result = &measured["result"];
        let (deviation, number) = (&result["deviation"], |value: &Value| value.as_f64().unwrap_or(0.0));
        let tolerance = number(&result["tolerance"]);
        let sides = [&deviation["scan_to_surface"], &deviation["surface_to_scan"]];
        let codes = result["reasons"].as_array().into_iter().flatten().filter_map(|reason| reason["code"].as_str());
        let error = measured["error"].as_str().unwrap_or_default();
        Self {
            name: job.name.clone(),
            percent: job.percent,
            method: job.method.clone(),
            changed: job.threshold.as_ref().map_or_else(String::new, |(name, value)| format!("{name}={value}")),
            all_candidates: job.all_candidates,
            control_points: result["dofs"].as_u64().unwrap_or(0),
            verdict: result["verdict"].as_str().unwrap_or("error").to_owned(),
            reasons: if error.is_empty() { codes.collect::<Vec<_>>().join(", ") } else { error.to_owned() },
            within: sides.map(|side| number(&side["within"])),
            largest: sides.map(|side| number(&side["max"]) / tolerance),
            rms: number(&sides[0]["rms"]) / tolerance,
            gathered: number(&deviation["gathered"]["total"]),
            cpu_seconds: number(&measured["cpu"]),
            wall_seconds: number(&measured["wall"]),
            wall_seconds_on_two: on_two.map(|two| number(&two["wall"])),
            memory: measured["memory"].as_f64(),
            tried: tried(&result["tried"]),
        }
    }

    /// Whether the other row is of the same scan at the same tolerance.
    pub(super) fn is_of(&self, other: &Self) -> bool {
        self.name == other.name && self.percent == other.percent
    }

    /// Whether the other row is of the same fit.
    pub(super) fn is_same_fit(&self, other: &Self) -> bool {
        self.is_of(other)
            && self.method == other.method
            && self.changed == other.changed
            && self.all_candidates == other.all_candidates
    }

    /// What differs by more than another order of sums explains; times and memory may.
    pub(super) fn differs(&self, before: &Self) -> Option<String> {
        let far = |a: f64, b: f64, share: f64| (a - b).abs() > share * a.abs().max(b.abs());
        let counts = [before.control_points as f64, self.control_points as f64];
        if before.verdict != self.verdict {
            Some(format!("{} was {}", self.verdict, before.verdict))
        } else if far(counts[0], counts[1], SAME_CONTROL_POINTS) {
            Some(format!("{} control points were {}", counts[1], counts[0]))
        } else if (0..2).any(|side| (self.within[side] - before.within[side]).abs() > SAME_SHARE) {
            Some(format!("within {:?} was {:?}", self.within, before.within))
        } else if far(self.rms, before.rms, SAME_RMS) {
            Some(format!("RMS {} was {}", self.rms, before.rms))
        } else {
            None
        }
    }

    pub(super) fn cells(&self) -> Vec<String> {
        let verdict = if self.reasons.is_empty() {
            self.verdict.clone()
        } else {
            format!("{}: {}", self.verdict, self.reasons.replace('|', "/"))
        };
        let method =
            if self.changed.is_empty() { self.method.clone() } else { format!("{}, {}", self.method, self.changed) };
        vec![
            format!("`{}`", self.name),
            self.percent.to_string(),
            method,
            self.control_points.to_string(),
            verdict,
            self.within.map(|share| format!("{:.1}", 100.0 * share)).join(" / "),
            self.largest.map(|length| format!("{length:.2}")).join(" / "),
            format!("{:.2}", self.rms),
            format!("{:.2}", 100.0 * self.gathered),
            format!("{:.2}", self.cpu_seconds),
            format!("{:.2}", self.wall_seconds),
            self.wall_seconds_on_two.map_or("–".to_owned(), |seconds| format!("{seconds:.2}")),
            self.memory.map_or("–".to_owned(), |mib| format!("{mib:.0}")),
            self.tried.clone(),
        ]
    }
}

impl fmt::Display for Row {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.cells().join("  "))
    }
}

/// The candidates of a report, with what became of each.
fn tried(value: &Value) -> String {
    let tell = |tried: &Value| {
        let name = tried["candidate"].as_str().unwrap_or("?");
        let what = match (tried["verdict"].as_str(), tried["gave_up"].as_object(), tried["error"].as_str()) {
            (Some(verdict), _, _) => verdict.to_owned(),
            (None, Some(why), _) => why.keys().next().map_or_else(String::new, |key| format!("given up, {key}")),
            (None, None, error) => error.unwrap_or("?").to_owned(),
        };
        format!("{name} {} {what} ({:.1} s)", tried["control_points"], tried["seconds"].as_f64().unwrap_or(0.0))
    };
    let all = value.as_array().map(Vec::as_slice).unwrap_or_default();
    let one = |tried: &Value| if tried["kept"] == true { format!("**{}**", tell(tried)) } else { tell(tried) };
    all.iter().map(one).collect::<Vec<_>>().join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(control_points: u64, verdict: &str, within: f64, rms: f64) -> Row {
        let job = Job {
            name: "part.off".to_owned(),
            path: PathBuf::new(),
            percent: 0.5,
            method: "auto".to_owned(),
            threshold: None,
            all_candidates: false,
        };
        let side = json!({"within": within, "max": 3.0, "rms": 2.0 * rms});
        let result = json!({
            "dofs": control_points, "verdict": verdict, "tolerance": 2.0, "reasons": [],
            "deviation": {"scan_to_surface": side, "surface_to_scan": side, "gathered": {"total": 0.0}},
            "tried": [
                {"candidate": "fixed", "control_points": 80, "verdict": "good", "reason": "first", "seconds": 0.5},
                {"candidate": "moving", "control_points": 60, "verdict": "good", "reason": {"fewer": 0.75}, "kept": true, "seconds": 1.0},
                {"candidate": "moving-freely", "control_points": 58, "gave_up": {"needs-as-many": 0.97}, "seconds": 1.5},
            ],
        });
        Row::new(&job, &json!({"result": result, "error": "", "cpu": 1.0, "wall": 1.0, "memory": 10.0}), None)
    }

    #[test]
    fn rows_tell_what_was_tried_and_kept() {
        assert_eq!(
            row(60, "good", 0.97, 0.4).tried,
            "fixed 80 good (0.5 s); **moving 60 good (1.0 s)**; moving-freely 58 given up, needs-as-many (1.5 s)"
        );
        assert_eq!(row(60, "good", 0.97, 0.4).largest, [1.5, 1.5]);
    }

    #[test]
    fn rows_differ_by_more_than_rounding_only() {
        let before = row(100, "good", 0.97, 0.4);
        for same in [row(102, "good", 0.97, 0.4), row(100, "good", 0.974, 0.4), row(100, "good", 0.97, 0.419)] {
            assert_eq!(same.differs(&before), None);
        }
        for (other, word) in [
            (row(103, "good", 0.97, 0.4), "control points"),
            (row(100, "usable", 0.97, 0.4), "usable was good"),
            (row(100, "good", 0.976, 0.4), "within"),
            (row(100, "good", 0.97, 0.43), "RMS"),
        ] {
            let what = other.differs(&before).unwrap();
            assert!(what.contains(word), "{what}");
        }
    }

    #[test]
    fn a_row_is_read_as_it_was_written() {
        let row = row(100, "good", 0.97, 0.4);
        let again: Row = serde_json::from_str(&serde_json::to_string(&row).unwrap()).unwrap();
        assert_eq!(again, row);
    }
}
