//! When a candidate is given up: told by counts and errors of its iterations, never by time.

use std::ops::ControlFlow;

use adaptive::Iteration;
use serde::Serialize;

use super::policy::Policy;

/// What a candidate has to beat, if there is something.
pub(super) struct Budget<'a> {
    /// The iterations of the fit to beat, if that reached what was asked.
    rival: Option<&'a [Iteration]>,
    /// Control points beyond which nothing is won.
    most: usize,
    policy: &'a Policy,
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
}

impl<'a> Budget<'a> {
    pub(super) fn new(rival: Option<&'a [Iteration]>, most: usize, policy: &'a Policy) -> Self {
        Self { rival, most, policy, gave_up: None }
    }

    pub(super) fn gave_up(&self) -> Option<GaveUp> {
        self.gave_up
    }

    /// Asked after each iteration: `Break` gives the candidate up.
    pub(super) fn after(&mut self, record: &Iteration) -> ControlFlow<()> {
        self.gave_up = if record.dofs > self.most {
            Some(GaveUp::TooMany(record.dofs))
        } else {
            self.rival
                .and_then(|rival| control_points_at(rival, record.deviation.mse))
                .map(|as_near| record.dofs as f64 / as_near)
                .filter(|&share| share > self.policy.hopeless)
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
                let share = (e0 / mse).ln() / (e0 / e.max(f64::MIN_POSITIVE)).ln();
                return Some(n0 * (n / n0).powf(share));
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
    fn a_candidate_is_given_up_when_it_needs_as_many_or_has_too_many() {
        let policy = Policy::default();
        let rival = [record(10, 1.0), record(40, 0.25)];
        let after = |dofs, mse| {
            let mut budget = Budget::new(Some(&rival), 38, &policy);
            let goes_on = budget.after(&record(dofs, mse)).is_continue();
            assert_eq!(goes_on, budget.gave_up().is_none());
            budget.gave_up()
        };
        assert_eq!(after(10, 1.0), Some(GaveUp::NeedsAsMany(1.0)));
        assert_eq!(after(10, 0.5), None);
        assert_eq!(after(38, 0.2), None);
        assert_eq!(after(39, 0.2), Some(GaveUp::TooMany(39)));
        // Where nothing is to beat, only the number counts.
        let mut alone = Budget::new(None, 38, &policy);
        assert!(alone.after(&record(38, 9.0)).is_continue() && alone.after(&record(39, 0.0)).is_break());
    }
}
