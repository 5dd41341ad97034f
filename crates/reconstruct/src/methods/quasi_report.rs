//! What quasi-interpolation tells of its local problems.

use fit_qi::Work;
use serde::Serialize;

/// The local problems of one iteration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct QuasiReport {
    /// Local problems that were solved; with moving parameters over all corrections.
    pub solved: usize,
    /// Points that were summed, over all levels.
    pub summed: usize,
    /// Control points whose local problem had to reach beyond their support.
    pub enlarged: usize,
    /// Control points taken from the coarser level, for want of points nearby.
    pub inherited: usize,
    /// Control points that are means of points, because the parameters of these lie on a line.
    pub collinear: usize,
}

impl QuasiReport {
    /// The report of an iteration, whose surface was computed once, and again after each correction.
    pub(super) fn of(work: &[Work]) -> Self {
        let Some(last) = work.last() else { return Self::default() };
        Self {
            solved: work.iter().map(|w| w.solved).sum(),
            summed: work.iter().map(|w| w.summed).sum(),
            enlarged: last.enlarged,
            inherited: last.inherited,
            collinear: last.collinear.len(),
        }
    }
}
