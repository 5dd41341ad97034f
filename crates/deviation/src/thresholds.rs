//! The limits that a verdict goes by.

use serde::Serialize;

/// The limits that a verdict goes by.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Thresholds {
    /// Share of the area, both ways, that has to be within the tolerance.
    pub within: f64,
    /// By how much that share may be missed: it is measured on samples.
    pub slack: f64,
    /// Share of the scan's area in the largest patch of misses from which on a surface is no more than usable. Faithful surfaces have at
    /// most 0.0006, those that lost a mouth or an eye 0.0014 to 0.009.
    pub gathered: f64,
    /// Share of the scan that may lie beyond the rim of the surface by more than the tolerance and the spacing.
    pub beyond_rim: f64,
    /// Diagonal of the surface's box in diagonals of the scan's: a surface that is larger swings out.
    pub box_ratio: f64,
    /// Share of the surface's area that may be folded over.
    pub folded: f64,
    /// Share of the points that may be set aside unasked for a good surface.
    pub left_out: f64,
}

impl Default for Thresholds {
    fn default() -> Self {
        Self {
            within: 0.95,
            slack: 0.01,
            gathered: 1e-3,
            beyond_rim: 0.01,
            box_ratio: 1.05,
            folded: 1e-3,
            left_out: 0.02,
        }
    }
}

impl Thresholds {
    /// Whether the share of the area asked for holds.
    pub fn is_within(&self, share: f64) -> bool {
        share >= self.within - self.slack
    }
}
