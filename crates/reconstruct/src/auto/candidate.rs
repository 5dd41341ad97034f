//! What is tried, and what is known of it afterwards.

use deviation::Verdict;
use moving_param::JointOptions;
use serde::Serialize;

use crate::attempt::Attempt;
use crate::options::Method;

/// A way to fit that may be tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Candidate {
    /// Least squares with fixed parameters.
    Fixed,
    /// The joint method; parameters move as their neighbours do.
    Moving,
    /// The joint method; each parameter moves by itself. This tears the map of some scans; others need far fewer control points.
    MovingFreely,
}

impl Candidate {
    pub(super) fn method(self) -> Method {
        match self {
            Self::Fixed => Method::Ls,
            Self::Moving | Self::MovingFreely => Method::Joint,
        }
    }

    pub(super) fn joint(self) -> JointOptions {
        match self {
            Self::Fixed | Self::Moving => JointOptions::DEFAULT,
            Self::MovingFreely => JointOptions { cohesion: 0.0, ..JointOptions::DEFAULT },
        }
    }

    /// What is told while it runs.
    pub(super) fn step(self) -> &'static str {
        match self {
            Self::Fixed => "fitting",
            Self::Moving => "fitting with moving parameters",
            Self::MovingFreely => "fitting with parameters that move freely",
        }
    }
}

/// What is known of a candidate that was fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Measured {
    pub(super) candidate: Candidate,
    pub(super) control_points: usize,
    pub(super) verdict: Verdict,
    /// Whether nothing is wrong with it but that it may not be near enough to the scan.
    pub(super) is_sound: bool,
    /// Share of the scan's area within the tolerance; beyond the share asked for it does not count.
    pub(super) within: f64,
    /// Largest distance between surface and scan, in diagonals.
    pub(super) farthest: f64,
    /// Share of neighbouring samples between which the normal turns by more than a right angle.
    pub(super) creases: f64,
    /// Share of the area that lies across the points around it, where that was looked at.
    pub(super) across: Option<f64>,
    pub(super) missed_markers: usize,
}

impl Measured {
    pub(super) fn of(candidate: Candidate, attempt: &Attempt, diagonal: f64, asked: f64) -> Self {
        Self {
            candidate,
            control_points: attempt.control_points(),
            verdict: attempt.judgement.verdict(),
            is_sound: attempt.judgement.is_sound(),
            within: attempt.judgement.deviation.scan_to_surface.within.min(asked),
            farthest: attempt.farthest() / diagonal,
            creases: attempt.creases,
            across: None,
            missed_markers: attempt.missed_markers(),
        }
    }
}
