//! When a candidate is given up: told by counts and errors of its iterations, never by time.

use std::ops::ControlFlow;

use adaptive::Iteration;
use serde::Serialize;

/// How far a candidate may go.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits<'a> {
    /// Iterations of another fit: where that has the same error with hardly more control points, the candidate is given up.
    pub(super) rival: &'a [Iteration],
    /// Share of the rival's control points from which on it is.
    pub(super) hopeless: f64,
    /// Control points beyond which nothing is won.
    pub(super) most: usize,
    /// Spaces after which it is left, so that others are tried.
    pub(super) spaces: usize,
}

impl Limits<'_> {
    /// Without a limit.
    pub(super) const NONE: Self = Self { rival: &[], hopeless: 0.0, most: usize::MAX, spaces: usize::MAX };
}

/// Asked after each iteration whether a candidate is to go on.
pub(super) struct Budget<'a> {
    limits: Limits<'a>,
    /// Iterations so far, and the control points of the last.
    spaces: usize,
    dofs: usize,
    /// Why the candidate was given up.
    gave_up: Option<GaveUp>,
}

/// Why a candidate was given up.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum GaveUp {
    /// It needs this share of the control points of the fit to beat for the same root mean square distance.
    NeedsAsMany(f64),
    /// It has this number of control points, more than allowed, and has not reached the tolerance.
    TooMany(usize),
    /// It was left after this number of spaces, others were tried, and it was not taken up again.
    Left(usize),
}

impl<'a> Budget<'a> {
    pub(super) fn new(limits: Limits<'a>) -> Self {
        Self { limits, spaces: 0, dofs: 0, gave_up: None }
    }

    pub(super) fn gave_up(&self) -> Option<GaveUp> {
        self.gave_up
    }

    /// `Break` gives the candidate up.
    pub(super) fn after(&mut self, record: &Iteration) -> ControlFlow<()> {
        if record.dofs != self.dofs {
            (self.dofs, self.spaces) = (record.dofs, self.spaces + 1);
        }
        self.gave_up = if record.dofs > self.limits.most {
            Some(GaveUp::TooMany(record.dofs))
        } else if self.spaces >= self.limits.spaces {
            Some(GaveUp::Left(self.limits.spaces))
        } else {
            control_points_at(self.limits.rival, record.deviation.mse)
                .map(|as_near| record.dofs as f64 / as_near)
                .filter(|&share| share > self.limits.hopeless)
                .map(GaveUp::NeedsAsMany)
        };
        if self.gave_up.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// Control points with which a fit had this mean square distance, between its iterations by a power law; `None` if it never came as near.
fn control_points_at(iterations: &[Iteration], mse: f64) -> Option<f64> {
    let mut before: Option<(f64, f64)> = None;
    for record in iterations {
        let (n, e) = (record.dofs as f64, record.deviation.mse);
        match before {
            Some((n0, e0)) if e <= mse && e0 > mse => {
                let share = (e0 / mse).ln() / (e0 / e).ln();
                return Some(if share.is_finite() { n0 * (n / n0).powf(share) } else { n });
            }
            _ if e <= mse => return Some(n),
            Some((_, e0)) if e >= e0 => (),
            _ => before = Some((n, e)),
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use adaptive::Deviation;

    fn record(dofs: usize, mse: f64) -> Iteration {
        let deviation = Deviation { points: 100, max: 1.0, mse, within: 0.5 };
        Iteration { iteration: 0, dofs, levels: 1, cells: 1, deviation, seconds: adaptive::Seconds::default() }
    }

    #[test]
    fn control_points_for_an_error_follow_a_power_law_between_iterations() {
        let rival = [record(10, 1.0), record(40, 0.25), record(50, 0.3), record(80, 0.0625)];
        assert_eq!(control_points_at(&rival, 2.0), Some(10.0));
        assert_eq!(control_points_at(&rival, 1.0), Some(10.0));
        assert!((control_points_at(&rival, 0.5).unwrap() - 20.0).abs() < 1e-12);
        // What is worse than an iteration before does not count.
        assert!((control_points_at(&rival, 0.125).unwrap() - 40.0 * 2.0_f64.sqrt()).abs() < 1e-12);
        assert_eq!(control_points_at(&rival, 0.06), None);
        assert_eq!(control_points_at(&[], 1.0), None);
        assert_eq!(control_points_at(&[record(10, 1.0), record(20, 0.0)], 0.0), Some(20.0));
    }

    #[test]
    fn a_candidate_is_given_up_when_it_needs_as_many_or_has_too_many_or_after_some_spaces() {
        let rival = [record(10, 1.0), record(40, 0.25)];
        let limits = Limits { rival: &rival, hopeless: 0.95, most: 38, ..Limits::NONE };
        let after = |dofs, mse| {
            let mut budget = Budget::new(limits);
            let goes_on = budget.after(&record(dofs, mse)).is_continue();
            assert_eq!(goes_on, budget.gave_up().is_none());
            budget.gave_up()
        };
        assert_eq!(after(10, 1.0), Some(GaveUp::NeedsAsMany(1.0)));
        assert_eq!(after(10, 0.5), None);
        assert_eq!(after(38, 0.2), None);
        assert_eq!(after(39, 0.2), Some(GaveUp::TooMany(39)));
        let mut alone = Budget::new(Limits::NONE);
        assert!(alone.after(&record(1_000_000, 9.0)).is_continue());
        // Iterations on the same space count once.
        let mut few = Budget::new(Limits { spaces: 2, ..Limits::NONE });
        for dofs in [10, 10] {
            assert!(few.after(&record(dofs, 1.0)).is_continue());
        }
        assert!(few.after(&record(20, 1.0)).is_break() && few.gave_up() == Some(GaveUp::Left(2)));
    }
}
