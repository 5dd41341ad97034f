//! One fit, as the product reports it and as the meter finds it.

use serde_json::Value;

use super::super::finished::Finished;
use super::files::CROSSING;

/// Share of the area that has to be within the tolerance for exit code 0: the default 0.95 less 0.01.
///
/// Derived: the promise of exit code 0 (docs, "The verdict"); so are the other three.
const LEAST_WITHIN: f64 = 0.94;
/// Share of the scan beyond the rim of the surface, at most.
const MOST_BEYOND_RIM: f64 = 0.01;
/// Diagonal of the surface's box, in diagonals of the scan's, at most.
const MOST_BOX: f64 = 1.05;
/// Share of the surface that is folded over, at most: 0.001, and two standard deviations of the meter's 1.5 · 10⁵ samples.
const MOST_FOLDED: f64 = 1.2e-3;

/// Difference of shares up to which figures agree.
///
/// Derived: what is asked of reported figures (docs, "Reported and measured").
const SHARE_AGREES: f64 = 0.01;
/// Difference of largest distances up to which figures agree: this share of the larger one, and this share of the tolerance.
///
/// Derived: as above.
const LARGEST_AGREES: f64 = 0.05;

/// What became of one file at one tolerance.
#[derive(Clone, Debug)]
pub(super) struct Row {
    /// Name of the file in its folder.
    pub(super) file: String,
    /// Tolerance in percent of the diagonal.
    pub(super) percent: f64,
    /// Exit code of `thb fit`.
    pub(super) exit: u8,
    /// Why there is no surface; empty if there is one.
    pub(super) error: String,
    /// CPU seconds of the fit.
    pub(super) seconds: f64,
    /// `result` of the report; null if there is no surface.
    pub(super) result: Value,
    /// What `measure_step.py` printed; null if it could not measure.
    pub(super) measured: Value,
}

impl Finished for Row {
    fn to_json(&self, commit: &str) -> Value {
        serde_json::json!({
            "commit": commit, "file": self.file, "percent": self.percent, "exit": self.exit, "error": self.error,
            "seconds": self.seconds, "result": self.result, "measured": self.measured,
        })
    }

    fn from_json(line: &str, commit: &str) -> Option<Self> {
        let value: Value = serde_json::from_str(line).ok()?;
        (value["commit"].as_str()? == commit).then_some(())?;
        Some(Self {
            file: value["file"].as_str()?.to_owned(),
            percent: value["percent"].as_f64()?,
            exit: u8::try_from(value["exit"].as_u64()?).ok()?,
            error: value["error"].as_str()?.to_owned(),
            seconds: value["seconds"].as_f64()?,
            result: value["result"].clone(),
            measured: value["measured"].clone(),
        })
    }
}

impl Row {
    /// A reported figure: the first of the paths, with dots between keys, that the report has.
    pub(super) fn reported(&self, paths: &[&str]) -> Option<f64> {
        paths.iter().find_map(|path| number(&self.result, path))
    }

    /// A figure of the meter.
    pub(super) fn measured(&self, path: &str) -> Option<f64> {
        number(&self.measured, path)
    }

    /// Reported and measured share of one direction. Reports from before there was a verdict have that of the points only.
    pub(super) fn shares(&self, direction: Direction) -> [Option<f64>; 2] {
        let name = direction.name();
        let by_area = format!("deviation.{name}.within");
        let paths: &[&str] = match direction {
            Direction::ScanToSurface => &[&by_area, "within"],
            Direction::SurfaceToScan => &[&by_area],
        };
        [self.reported(paths), self.measured(&format!("{name}.within"))]
    }

    /// Reported and measured largest distance of one direction, in tolerances.
    pub(super) fn largest(&self, direction: Direction) -> [Option<f64>; 2] {
        let name = direction.name();
        let by_area = format!("deviation.{name}.max");
        let paths: &[&str] = match direction {
            Direction::ScanToSurface => &[&by_area, "max"],
            Direction::SurfaceToScan => &[&by_area],
        };
        let tolerances = |length: Option<f64>, tolerance: Option<f64>| Some(length? / tolerance?);
        [
            tolerances(self.reported(paths), self.reported(&["tolerance"])),
            tolerances(self.measured(&format!("{name}.max")), self.measured("tol")),
        ]
    }

    /// `good`, `usable`, `failed`; or whether the tolerance was reached, of reports without a verdict; or `error`.
    pub(super) fn verdict(&self) -> &str {
        match (self.result["verdict"].as_str(), self.result["reached"].as_bool()) {
            (Some(verdict), _) => verdict,
            (None, Some(true)) => "reached",
            (None, Some(false)) => "not reached",
            (None, None) => "error",
        }
    }

    /// Codes of the reasons.
    pub(super) fn reasons(&self) -> Vec<&str> {
        self.result["reasons"].as_array().into_iter().flatten().filter_map(|reason| reason["code"].as_str()).collect()
    }

    /// What of the promise of exit code 0 the measured figures break; nothing if they keep it. None where nothing was measured.
    pub(super) fn broken(&self) -> Option<Vec<String>> {
        let within = self.measured("scan_to_surface.within")?;
        let mut broken = Vec::new();
        if within < LEAST_WITHIN {
            broken.push(format!("scan within {:.1} %", 100.0 * within));
        }
        let is_mesh = self.measured["scan"]["kind"] == "mesh";
        if let Some(within) = self.measured("surface_to_scan.within").filter(|&share| is_mesh && share < LEAST_WITHIN) {
            broken.push(format!("surface within {:.1} %", 100.0 * within));
        }
        if let Some(share) = self.measured("coverage.scan_beyond_rim").filter(|&share| share > MOST_BEYOND_RIM) {
            broken.push(format!("{:.1} % of the scan beyond the rim", 100.0 * share));
        }
        if let Some(ratio) = self.measured("box").filter(|&ratio| ratio > MOST_BOX) {
            broken.push(format!("box {ratio:.2}"));
        }
        let crosses = |pairs: &f64| *pairs > 0.0 && !CROSSING.contains(&self.file.as_str());
        if let Some(pairs) = self.measured("crossings.pairs").filter(crosses) {
            broken.push(format!("crosses itself ({pairs:.0} pairs)"));
        }
        if let Some(share) = self.measured("folds.share").filter(|&share| share > MOST_FOLDED) {
            broken.push(format!("{:.2} % folded", 100.0 * share));
        }
        Some(broken)
    }

    /// Whether reported and measured figures agree: shares both ways, largest distances both ways. None where one is missing.
    pub(super) fn agreement(&self) -> [Option<bool>; 2] {
        let both = [Direction::ScanToSurface, Direction::SurfaceToScan];
        let all = |agrees: &dyn Fn(Direction) -> Option<bool>| {
            let known: Vec<bool> = both.into_iter().filter_map(agrees).collect();
            (!known.is_empty()).then(|| known.into_iter().all(|agrees| agrees))
        };
        [
            all(&|direction| shares_agree(self.shares(direction))),
            all(&|direction| largest_agree(self.largest(direction))),
        ]
    }
}

/// From which side distances are measured.
#[derive(Clone, Copy, Debug)]
pub(super) enum Direction {
    /// From the area of the scan.
    ScanToSurface,
    /// From the area of the surface.
    SurfaceToScan,
}

impl Direction {
    fn name(self) -> &'static str {
        match self {
            Self::ScanToSurface => "scan_to_surface",
            Self::SurfaceToScan => "surface_to_scan",
        }
    }
}

fn number(value: &Value, path: &str) -> Option<f64> {
    path.split('.').try_fold(value, |value, key| value.get(key))?.as_f64()
}

fn shares_agree(shares: [Option<f64>; 2]) -> Option<bool> {
    let [reported, measured] = shares;
    Some((reported? - measured?).abs() <= SHARE_AGREES)
}

fn largest_agree(largest: [Option<f64>; 2]) -> Option<bool> {
    let [reported, measured] = [largest[0]?, largest[1]?];
    Some((reported - measured).abs() <= LARGEST_AGREES * reported.max(measured).max(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A fit whose reported and measured figures are given.
    fn row(reported: &Value, measured: &Value) -> Row {
        Row {
            file: "part.off".to_owned(),
            percent: 0.5,
            exit: 0,
            error: String::new(),
            seconds: 1.0,
            result: reported.clone(),
            measured: measured.clone(),
        }
    }

    /// Measured figures that keep the promise of exit code 0.
    fn kept() -> Value {
        serde_json::json!({
            "tol": 2.0, "scan": {"kind": "mesh"}, "box": 1.01, "crossings": {"pairs": 0}, "folds": {"share": 0.0},
            "coverage": {"scan_beyond_rim": 0.0}, "scan_to_surface": {"within": 0.96, "max": 3.0},
            "surface_to_scan": {"within": 0.95, "max": 2.6},
        })
    }

    #[test]
    fn each_clause_of_the_promise_is_looked_at() {
        assert_eq!(row(&Value::Null, &kept()).broken(), Some(Vec::new()));
        assert_eq!(row(&Value::Null, &Value::Null).broken(), None);
        for (key, inner, bad, word) in [
            ("scan_to_surface", "within", 0.93, "scan within"),
            ("surface_to_scan", "within", 0.93, "surface within"),
            ("coverage", "scan_beyond_rim", 0.02, "rim"),
            ("crossings", "pairs", 3.0, "crosses"),
            ("folds", "share", 0.01, "folded"),
        ] {
            let mut measured = kept();
            measured[key][inner] = bad.into();
            let broken = row(&Value::Null, &measured).broken().unwrap();
            assert!(broken.len() == 1 && broken[0].contains(word), "{key}: {broken:?}");
        }
        let mut measured = kept();
        measured["box"] = 1.06.into();
        assert_eq!(row(&Value::Null, &measured).broken().unwrap(), ["box 1.06"]);
        // The surface over a cloud may lie far from its points: nobody knows what is between them.
        let mut measured = kept();
        measured["scan"]["kind"] = "cloud".into();
        measured["surface_to_scan"]["within"] = 0.5.into();
        assert_eq!(row(&Value::Null, &measured).broken(), Some(Vec::new()));
    }

    #[test]
    fn figures_agree_up_to_what_is_asked_of_them() {
        let reported = |within: f64, max: f64| {
            serde_json::json!({
                "tolerance": 2.0, "deviation": {
                    "scan_to_surface": {"within": within, "max": max}, "surface_to_scan": {"within": 0.95, "max": 2.6},
                },
            })
        };
        assert_eq!(row(&reported(0.969, 3.13), &kept()).agreement(), [Some(true), Some(true)]);
        assert_eq!(row(&reported(0.971, 3.2), &kept()).agreement(), [Some(false), Some(false)]);
        // Reports without a verdict know the points only.
        let old = serde_json::json!({"tolerance": 2.0, "within": 0.955, "max": 3.0, "reached": true});
        assert_eq!(row(&old, &kept()).agreement(), [Some(true), Some(true)]);
        assert_eq!(row(&old, &kept()).shares(Direction::SurfaceToScan)[0], None);
        assert_eq!(row(&Value::Null, &Value::Null).agreement(), [None, None]);
    }

    #[test]
    fn a_finished_row_is_read_again_at_its_own_commit_only() {
        let row = row(&serde_json::json!({"verdict": "good", "reasons": [{"code": "not-covered"}]}), &kept());
        let line = row.to_json("abc").to_string();
        let again = Row::from_json(&line, "abc").unwrap();
        assert_eq!(again.to_json("abc"), row.to_json("abc"));
        assert_eq!((again.verdict(), again.reasons()), ("good", vec!["not-covered"]));
        assert!(Row::from_json(&line, "abd").is_none());
        assert!(Row::from_json(&line[..line.len() / 2], "abc").is_none());
    }
}
