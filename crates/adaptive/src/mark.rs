//! MARK: which cells to refine.

use thb_core::Mark;

use crate::Estimate;

/// Of the points beyond the tolerance [`Marking::Worst`] refines for this share of those that still have to come within:
/// refining brings in others beside them. On thirteen scans at 0.5 and 0.1 % this left an eighth fewer functions than 1.5, with half of
/// those beyond at least; 0.5, with a fifth at least, left a fifth fewer, and relief finer than the tolerance was lost.
const OF_LACKING: f64 = 0.75;

/// It refines for this share of all points beyond the tolerance at least: fewer make many small steps, and those leave
/// ribbons of fine cells.
const OF_BEYOND: f64 = 0.3;

/// Share of the points refined for by which those within the tolerance must grow for it to go on like this. Where the worst points
/// lie along what no spline follows, refining for them alone goes on for ever.
const YIELD: f64 = 0.3;

/// Rules by which cells, or the children of cells that hold the points, are marked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Marking {
    /// Those with a point whose error is at least the tolerance.
    Threshold,
    /// Of these only those with the largest errors, where points may stay beyond the tolerance: three quarters of
    /// the points that still have to come within, but three tenths of those beyond at least. All of them once this brought hardly any point
    /// within.
    Worst,
    /// Those with one of the given share (0 to 1) of points of largest error, as far as it is at least the tolerance.
    Share(f64),
}

impl Marking {
    /// The error from which on points are refined for: the tolerance or more. `within` is the share of points (0 to 1) that
    /// has to be within the tolerance.
    pub fn threshold(self, errors: &[f64], tolerance: f64, within: f64) -> f64 {
        let count = match self {
            Self::Threshold => return tolerance,
            // None may stay beyond.
            Self::Worst if within >= 1.0 => return tolerance,
            Self::Share(share) => share * errors.len() as f64,
            Self::Worst => {
                let beyond = errors.iter().filter(|&&e| e > tolerance).count() as f64;
                let total = errors.len() as f64;
                worst(beyond, beyond - (total - (within * total).ceil()))
            }
        };
        tolerance.max(nth_largest(errors, count.ceil() as usize))
    }
}

/// How many points [`Marking::Worst`] refines for, of those beyond the tolerance and those that still have to come within.
fn worst(beyond: f64, lacking: f64) -> f64 {
    (OF_LACKING * lacking).max(OF_BEYOND * beyond)
}

/// Whether refining for the worst points brought hardly any within: the share of points within the tolerance before and after, and the
/// one asked for.
pub(crate) fn in_vain(before: f64, after: f64, asked: f64) -> bool {
    after - before <= YIELD * worst(1.0 - before, asked - before)
}

/// The places with a point whose error is at least the threshold, each with its largest error, by decreasing error; equal ones
/// by number. Children of cells where the estimate tells them, whole cells otherwise.
pub fn mark(estimate: Estimate<'_>, threshold: f64) -> Vec<(Mark, f64)> {
    let mut marked: Vec<(Mark, f64)> = Vec::new();
    for (cell, ends) in estimate.offsets.windows(2).enumerate() {
        let first = marked.len();
        for at in (ends[0]..ends[1]).filter(|&at| estimate.errors[at] >= threshold) {
            let (child, error) = (estimate.children.get(at).copied(), estimate.errors[at]);
            match marked[first..].iter_mut().find(|(mark, _)| mark.child == child) {
                Some((_, largest)) => *largest = largest.max(error),
                None => marked.push((Mark { cell, child }, error)),
            }
        }
    }
    marked.sort_by(|a, b| b.1.total_cmp(&a.1));
    marked
}

/// The `n`-th largest number, from 1; the largest for 0, the smallest beyond the end, 0 of none.
fn nth_largest(numbers: &[f64], n: usize) -> f64 {
    if numbers.is_empty() {
        return 0.0;
    }
    let mut sorted = numbers.to_vec();
    *sorted.select_nth_unstable_by(numbers.len() - n.clamp(1, numbers.len()), f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn threshold_and_share_mark_the_cells_of_large_errors() {
        let estimate = Estimate { offsets: &[0, 2, 2, 5], errors: &[0.1, 0.4, 0.2, 0.9, 0.3], children: &[] };
        let cells = |marking: Marking, tolerance| -> Vec<usize> {
            let threshold = marking.threshold(estimate.errors, tolerance, 1.0);
            mark(estimate, threshold).into_iter().map(|(mark, _)| mark.cell).collect()
        };
        assert_eq!(cells(Marking::Threshold, 0.4), [2, 0]);
        assert_eq!(cells(Marking::Threshold, 0.5), [2]);
        assert_eq!(cells(Marking::Share(0.2), 0.0), [2]);
        assert_eq!(cells(Marking::Share(0.4), 0.0), [2, 0]);
        // Cells within the tolerance are never marked.
        assert_eq!(cells(Marking::Share(1.0), 0.95), [0_usize; 0]);
        assert_eq!(Marking::Share(0.5).threshold(&[], 0.1, 1.0), 0.1);
    }

    #[test]
    fn the_worst_are_some_of_those_that_have_to_come_within_but_not_too_few() {
        // Twenty points, eight of them beyond 0.5 with errors 1, 2, ..., 8.
        let errors: Vec<f64> = (0..20).map(|i| if i < 12 { 0.1 } else { f64::from(i - 11) }).collect();
        let threshold = |within| Marking::Worst.threshold(&errors, 0.5, within);
        // All eight have to come within: for all is refined. If two may stay beyond, for five.
        assert_eq!((threshold(1.0), threshold(0.9)), (0.5, 4.0));
        // Seven may: for three, not for one.
        assert_eq!(threshold(0.65), 6.0);
        assert_eq!(Marking::Threshold.threshold(&errors, 0.5, 0.65), 0.5);
    }

    #[test]
    fn a_step_that_brought_hardly_any_point_within_was_in_vain() {
        // From 0.8 to 0.9 of the points: for 0.075 is refined.
        assert!(in_vain(0.8, 0.8, 0.9) && in_vain(0.8, 0.82, 0.9));
        assert!(!in_vain(0.8, 0.825, 0.9));
        // Closer to the goal for three tenths of those beyond, 0.06.
        assert!(in_vain(0.8, 0.815, 0.81) && !in_vain(0.8, 0.82, 0.81));
    }

    #[test]
    fn each_child_with_a_large_error_is_marked_once() {
        let children = [0, 3, 3, 1, 3];
        let estimate = Estimate { offsets: &[0, 2, 5], errors: &[0.1, 0.4, 0.2, 0.9, 0.5], children: &children };
        let places: Vec<_> = mark(estimate, 0.2).iter().map(|(mark, error)| (mark.cell, mark.child, *error)).collect();
        assert_eq!(places, [(1, Some(1), 0.9), (1, Some(3), 0.5), (0, Some(3), 0.4)]);
    }
}
