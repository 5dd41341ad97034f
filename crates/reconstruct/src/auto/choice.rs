//! The decision between the results of several methods.

use deviation::Verdict;
use serde::Serialize;

use super::candidate::Measured;
use crate::options::Policy;

/// What no surface should have that replaces another one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Defect {
    /// It lies far from the scan somewhere.
    Far,
    /// It has creases.
    Creased,
    /// Part of its area lies across the points around it.
    Across,
    /// It misses more markers.
    MissesMarkers,
}

/// Why a candidate was kept or not.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reason {
    /// Nothing else was to choose from.
    First,
    /// It is better by its verdict.
    Better,
    /// As good, with this share of the control points.
    Fewer(f64),
    /// Both fail; it comes closer.
    Closer,
    /// It is worse by its verdict, or fails and comes no closer.
    Worse,
    /// As good, but with this share of the control points.
    NotFewer(f64),
    /// It has what no surface should have that replaces another one.
    Defective(Vec<Defect>),
}

/// Chooses among measured candidates, of which the first has fixed parameters unless these were left. Returns its place, and for each
/// candidate why it was kept or not, in the order in which they were compared.
///
/// Each is compared with the best of those before it: the better verdict wins; among failed ones the closer one; else the one with clearly
/// fewer control points.
///
/// # Panics
/// If there is no candidate.
pub(super) fn choose(measured: &[Measured], policy: &Policy) -> (usize, Vec<Reason>) {
    let mut best = 0;
    let mut reasons = vec![Reason::First];
    for (at, candidate) in measured.iter().enumerate().skip(1) {
        let reason = compare(&measured[0], &measured[best], candidate, policy);
        if matches!(reason, Reason::Better | Reason::Fewer(_) | Reason::Closer) {
            best = at;
        }
        reasons.push(reason);
    }
    (best, reasons)
}

/// Whether a candidate replaces the best so far.
fn compare(first: &Measured, best: &Measured, candidate: &Measured, policy: &Policy) -> Reason {
    let mut found = defects(candidate, first, policy);
    if best.verdict < Verdict::Failed && lies_across(candidate, best, policy) {
        found.push(Defect::Across);
    }
    if candidate.verdict < best.verdict && !found.contains(&Defect::Across) {
        return Reason::Better;
    }
    if candidate.verdict > best.verdict {
        return Reason::Worse;
    }
    if !found.is_empty() && defects(best, first, policy).is_empty() {
        return Reason::Defective(found);
    }
    if candidate.verdict == Verdict::Failed {
        let rank = |m: &Measured| (m.is_sound, defects(m, first, policy).is_empty(), m.within);
        return if rank(candidate) > rank(best) { Reason::Closer } else { Reason::Worse };
    }
    let share = candidate.control_points as f64 / best.control_points as f64;
    if share <= policy.most_control_points { Reason::Fewer(share) } else { Reason::NotFewer(share) }
}

/// What a candidate should not have, beside the first.
fn defects(candidate: &Measured, first: &Measured, policy: &Policy) -> Vec<Defect> {
    let passes = first.verdict < Verdict::Failed;
    let far = policy.far.max(if passes { policy.further * first.farthest } else { 0.0 });
    let creased = if passes { first.creases + policy.creased_more } else { policy.creased };
    [
        (candidate.farthest > far, Defect::Far),
        (candidate.creases > creased, Defect::Creased),
        (candidate.missed_markers > first.missed_markers, Defect::MissesMarkers),
    ]
    .into_iter()
    .filter_map(|(has, defect)| has.then_some(defect))
    .collect()
}

/// Whether more of a surface's area lies across the points than of another one, as far as that was looked at and the points tell.
fn lies_across(candidate: &Measured, other: &Measured, policy: &Policy) -> bool {
    candidate.across.zip(other.across).is_some_and(|(now, before)| {
        before <= policy.across_most && now > policy.across_more + policy.across_factor * before
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::auto::candidate::Candidate;

    const FIXED: Measured = Measured {
        candidate: Candidate::Fixed,
        control_points: 100,
        verdict: Verdict::Good,
        is_sound: true,
        within: 0.95,
        farthest: 0.01,
        creases: 1e-4,
        across: None,
        missed_markers: 0,
    };
    const MOVING: Measured = Measured { candidate: Candidate::Moving, control_points: 80, ..FIXED };
    const FAILED: Measured = Measured { verdict: Verdict::Failed, within: 0.9, ..FIXED };

    fn second(first: Measured, second: Measured) -> (usize, Reason) {
        let (best, mut reasons) = choose(&[first, second], &Policy::default());
        (best, reasons.remove(1))
    }

    #[test]
    fn the_first_is_chosen_without_others() {
        assert_eq!(choose(&[FIXED], &Policy::default()), (0, vec![Reason::First]));
    }

    #[test]
    fn fewer_control_points_are_taken_if_they_are_clearly_fewer() {
        for (control_points, chosen, reason) in [
            (80, 1, Reason::Fewer(0.8)),
            (95, 1, Reason::Fewer(0.95)),
            (96, 0, Reason::NotFewer(0.96)),
            (120, 0, Reason::NotFewer(1.2)),
        ] {
            assert_eq!(second(FIXED, Measured { control_points, ..MOVING }), (chosen, reason));
        }
        // The third is compared with the best of those before it.
        let freely = Measured { candidate: Candidate::MovingFreely, control_points: 78, ..FIXED };
        let (best, reasons) = choose(&[FIXED, MOVING, freely], &Policy::default());
        assert_eq!((best, &reasons[2]), (1, &Reason::NotFewer(78.0 / 80.0)));
        let freely = Measured { control_points: 60, ..freely };
        assert_eq!(choose(&[FIXED, MOVING, freely], &Policy::default()).0, 2);
    }

    #[test]
    fn the_better_verdict_goes_first_whatever_it_costs() {
        let usable = Measured { verdict: Verdict::Usable, ..FIXED };
        let more = Measured { control_points: 500, farthest: 0.5, creases: 0.1, missed_markers: 3, ..MOVING };
        assert_eq!(second(usable, more), (1, Reason::Better));
        assert_eq!(second(FAILED, Measured { verdict: Verdict::Usable, ..more }), (1, Reason::Better));
        assert_eq!(second(FIXED, Measured { verdict: Verdict::Usable, ..MOVING }), (0, Reason::Worse));
        assert_eq!(second(FIXED, Measured { verdict: Verdict::Failed, ..MOVING }), (0, Reason::Worse));
    }

    #[test]
    fn defects_keep_a_candidate_from_replacing_one_that_is_as_good() {
        for (candidate, defect) in [
            (Measured { farthest: 0.08, ..MOVING }, Defect::Far),
            (Measured { creases: 2.6e-4, ..MOVING }, Defect::Creased),
            (Measured { missed_markers: 1, ..MOVING }, Defect::MissesMarkers),
        ] {
            assert_eq!(second(FIXED, candidate), (0, Reason::Defective(vec![defect])));
        }
        // What fixed parameters have, too, is none.
        let far = Measured { farthest: 0.2, creases: 0.01, missed_markers: 2, ..FIXED };
        let candidate = Measured { control_points: 80, farthest: 0.21, creases: 0.0101, ..far };
        assert_eq!(second(far, candidate), (1, Reason::Fewer(0.8)));
        // Nor is anything a bar to what replaces what is defective itself.
        let torn = Measured { creases: 0.01, ..FAILED };
        assert_eq!(second(torn, Measured { within: 0.92, ..torn }), (1, Reason::Closer));
    }

    #[test]
    fn area_across_the_points_counts_where_it_was_looked_at() {
        let lies = |before: f64, now: f64| {
            let fixed = Measured { across: Some(before), ..FIXED };
            second(fixed, Measured { across: Some(now), ..MOVING }).1
        };
        assert_eq!(lies(0.0, 2.1e-4), Reason::Defective(vec![Defect::Across]));
        assert_eq!(lies(0.0, 1.9e-4), Reason::Fewer(0.8));
        assert_eq!(lies(0.01, 0.0126), Reason::Fewer(0.8));
        assert_eq!(lies(0.01, 0.0128), Reason::Defective(vec![Defect::Across]));
        // Normals that tell nothing.
        assert_eq!(lies(0.06, 0.5), Reason::Fewer(0.8));
        assert_eq!(second(FIXED, Measured { across: Some(0.5), ..MOVING }).1, Reason::Fewer(0.8));
        // A torn surface is no better than one that is usable; it is better than none.
        let usable = Measured { verdict: Verdict::Usable, across: Some(0.0), ..FIXED };
        let torn = Measured { across: Some(0.01), ..MOVING };
        assert_eq!(second(usable, torn), (0, Reason::Defective(vec![Defect::Across])));
        assert_eq!(second(Measured { across: Some(0.0), ..FAILED }, torn), (1, Reason::Better));
    }

    #[test]
    fn of_two_that_fail_the_sound_one_then_the_closer_one_is_taken() {
        let unsound = Measured { is_sound: false, within: 0.95, ..FAILED };
        assert_eq!(second(unsound, Measured { within: 0.5, ..FAILED }), (1, Reason::Closer));
        assert_eq!(second(FAILED, unsound), (0, Reason::Worse));
        assert_eq!(second(FAILED, Measured { within: 0.91, control_points: 999, ..FAILED }), (1, Reason::Closer));
        assert_eq!(second(FAILED, FAILED), (0, Reason::Worse));
        assert_eq!(second(FAILED, Measured { within: 0.91, farthest: 0.08, ..FAILED }).0, 0);
    }
}
