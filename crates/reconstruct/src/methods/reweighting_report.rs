//! What came of weights that follow the errors.

use serde::{Deserialize, Serialize};

/// What came of weights that follow the errors. Rows are those of the file, from 0; of long lists the first thousand.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub struct ReweightingReport {
    /// Systems that were solved, over all iterations.
    pub rounds: usize,
    /// Whether the weights had settled, and all markers were satisfied.
    pub settled: bool,
    /// Points that counted for the errors of the result.
    pub counted: usize,
    /// Typical size of the residuals, as a standard deviation; null without `--robust`.
    pub scale: Option<f64>,
    /// Points that were set aside for gross residuals.
    pub ignored: usize,
    /// Whether more points disagree grossly with their neighbours than may be set aside.
    pub capped: bool,
    /// Their rows.
    pub ignored_rows: Vec<u32>,
    /// Markers of type I, and how many of them were met.
    pub markers: usize,
    /// See `markers`.
    pub markers_met: usize,
    /// Rows of those that were not.
    pub markers_missed_rows: Vec<u32>,
    /// Markers of type II, and how many of them were ignored.
    pub markers_to_ignore: usize,
    /// See `markers_to_ignore`.
    pub markers_ignored: usize,
}

impl ReweightingReport {
    /// What happened, in a few words.
    pub fn summary(&self) -> String {
        let mut parts = Vec::new();
        if let Some(scale) = self.scale {
            parts.push(format!("{} points set aside (scale {scale:.3e})", self.ignored));
        }
        if self.markers + self.markers_to_ignore > 0 || parts.is_empty() {
            let (met, ignored) = (self.markers_met, self.markers_ignored);
            parts.push(format!(
                "{met} of {} markers met, {ignored} of {} ignored",
                self.markers, self.markers_to_ignore
            ));
        }
        parts.join(", ")
    }

    /// What the user should know.
    pub(crate) fn warnings(&self, points: usize, max_set_aside: f64) -> Vec<String> {
        let mut warnings = Vec::new();
        if self.ignored > 0 {
            warnings.push(format!(
                "{} of {points} points ({:.1} %) disagree grossly with their neighbours and were set aside; their rows are \
                 in result.reweighting.ignored_rows",
                self.ignored,
                100.0 * self.ignored as f64 / points as f64
            ));
        }
        if self.capped {
            warnings.push(format!(
                "more points disagree grossly with their neighbours than may be set aside, {:.3} % of them: the others count, weighed \
                 less; raise --max-set-aside if they are outliers, or use --clean outliers",
                100.0 * max_set_aside
            ));
        }
        let missed = self.markers - self.markers_met;
        if missed > 0 {
            warnings.push(format!(
                "{missed} of {} markers of type I are not met; allow more --levels, raise --marker-tol, or let their weights \
                 grow faster by --marker-update",
                self.markers
            ));
        }
        warnings
    }
}
