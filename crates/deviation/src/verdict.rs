//! One verdict on a surface: good, usable or failed, with the reasons.

use std::borrow::Cow;
use std::fmt;

use serde::{Deserialize, Serialize};

use crate::{Deviation, Thresholds};

/// Code of the reason that less of the scan than asked is within the tolerance.
pub const SCAN_NOT_WITHIN: &str = "scan-not-within";

/// How good a surface is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// Near the scan everywhere, with nothing to look at.
    Good,
    /// Near the scan as asked, but some places need a look.
    Usable,
    /// Not what was asked for: not near enough, or not a surface that can be worked with.
    Failed,
}

impl Verdict {
    /// A word for reports and tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Usable => "usable",
            Self::Failed => "failed",
        }
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A reason why a surface is not good.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub struct Reason {
    /// A stable name.
    pub code: Cow<'static, str>,
    /// The verdict that it leads to.
    pub verdict: Verdict,
    /// What is wrong, in a sentence.
    pub text: String,
    /// What was measured.
    pub figure: f64,
    /// What was allowed.
    pub limit: f64,
    /// Where it is worst.
    pub place: Option<[f64; 3]>,
}

impl Thresholds {
    /// Why a surface is not good where a share of the points was set aside unasked; `None` if that share is small.
    pub fn set_aside(&self, share: f64) -> Option<Reason> {
        (share > self.left_out).then(|| Reason {
            code: "points-set-aside".into(),
            verdict: Verdict::Usable,
            text: format!(
                "{:.1} % of the points were set aside unasked as values far beyond the rest or points that stand alone: look whether \
                 they were",
                100.0 * share
            ),
            figure: share,
            limit: self.left_out,
            place: None,
        })
    }

    /// Why a surface that runs between two layers of points, a `distance` apart, is not good.
    pub fn two_layers(&self, distance: f64, share: f64) -> Reason {
        Reason {
            code: "two-layers".into(),
            verdict: Verdict::Usable,
            text: format!(
                "two layers of points, {distance:.4e} apart over {:.0} % of them: the surface runs in the middle, and distances are to the \
                 middle; register the scans anew for better",
                100.0 * share
            ),
            figure: distance,
            limit: 0.0,
            place: None,
        }
    }

    /// Why a surface is not good; nothing if it is.
    pub fn reasons(&self, deviation: &Deviation) -> Vec<Reason> {
        let mut reasons = Vec::new();
        let mut add = |code: &'static str, verdict, figure: f64, limit: f64, place, text: String| {
            reasons.push(Reason { code: code.into(), verdict, text, figure, limit, place });
        };
        let tolerance = deviation.tolerance;
        let to_surface = &deviation.scan_to_surface;
        let least = self.within - self.slack;
        if !self.is_within(to_surface.within) {
            let what = if deviation.scan == "mesh" { "scan's area" } else { "points, weighed by their spacing," };
            let text = format!(
                "{:.1} % of the {what} lie within {tolerance:.4e} of the surface, {:.1} % are asked for; the largest distance is \
                 {:.1} tolerances",
                100.0 * to_surface.within,
                100.0 * self.within,
                to_surface.max / tolerance
            );
            add(SCAN_NOT_WITHIN, Verdict::Failed, to_surface.within, least, Some(to_surface.place), text);
        }
        let to_scan = &deviation.surface_to_scan;
        if deviation.scan == "mesh" && !self.is_within(to_scan.within) {
            let text = format!(
                "{:.1} % of the surface's area inside the scan's outline lie within {tolerance:.4e} of the scan; the largest distance \
                 is {:.1} tolerances: the surface bulges or folds between the points",
                100.0 * to_scan.within,
                to_scan.max / tolerance
            );
            add("surface-not-within", Verdict::Failed, to_scan.within, least, Some(to_scan.place), text);
        }
        if deviation.beyond_rim > self.beyond_rim {
            let text = format!(
                "{:.1} % of the scan lie beyond the rim of the surface: it does not cover the scan",
                100.0 * deviation.beyond_rim
            );
            add("not-covered", Verdict::Failed, deviation.beyond_rim, self.beyond_rim, None, text);
        }
        if deviation.box_ratio > self.box_ratio {
            let text = format!(
                "the surface swings out: its box is {:.2} times as large as the scan's, the largest distance to the scan is {:.1} \
                 tolerances",
                deviation.box_ratio,
                to_scan.max / tolerance
            );
            add("swings-out", Verdict::Failed, deviation.box_ratio, self.box_ratio, Some(to_scan.place), text);
        }
        let crossings = &deviation.crossings;
        if let Some(crossing) = crossings.places.first() {
            let text = format!(
                "the surface passes through itself, {:.2} tolerances deep along {:.1}",
                crossing.depth / tolerance,
                crossing.extent / tolerance
            );
            add("crosses-itself", Verdict::Failed, crossing.extent, 0.0, Some(crossing.place), text);
        }
        if let Some(folded) = deviation.folded.filter(|&folded| folded > self.folded) {
            let text = format!("{:.2} % of the surface's area are folded over", 100.0 * folded);
            add("folded", Verdict::Failed, folded, self.folded, None, text);
        }
        let largest = deviation.gathered.largest;
        if largest > self.gathered {
            let patch = deviation.gathered.patches.first();
            let text = format!(
                "a patch of {:.2} % of the scan's area lies beyond the tolerance, by up to {:.1} tolerances: detail is lost there",
                100.0 * largest,
                patch.map_or(0.0, |patch| patch.distance / tolerance)
            );
            add("misses-gather", Verdict::Usable, largest, self.gathered, patch.map(|patch| patch.place), text);
        }
        reasons
    }
}

/// The verdict that reasons lead to.
pub fn verdict(reasons: &[Reason]) -> Verdict {
    reasons.iter().map(|reason| reason.verdict).max().unwrap_or(Verdict::Good)
}
