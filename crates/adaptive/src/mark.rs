//! MARK: which cells to refine.

use thb_core::Mark;

use crate::Estimate;

/// Rules by which cells, or the children of cells that hold the points, are marked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Marking {
    /// Those with a point whose error is at least the tolerance.
    Threshold,
    /// Those with one of the given share (0 to 1) of points of largest error, as far as it is at least the tolerance.
    Share(f64),
}

/// The marked places, by decreasing largest error; equal ones by number. Children of cells where the estimate tells them,
/// whole cells otherwise.
pub fn mark(estimate: Estimate<'_>, marking: Marking, tolerance: f64) -> Vec<Mark> {
    let threshold = match marking {
        Marking::Threshold => tolerance,
        Marking::Share(share) => tolerance.max(upper_quantile(estimate.errors, share)),
    };
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
    marked.into_iter().map(|(mark, _)| mark).collect()
}

/// The smallest of the given share of largest errors; at least one counts.
fn upper_quantile(errors: &[f64], share: f64) -> f64 {
    if errors.is_empty() {
        return 0.0;
    }
    let count = ((share * errors.len() as f64).ceil() as usize).clamp(1, errors.len());
    let mut sorted = errors.to_vec();
    *sorted.select_nth_unstable_by(errors.len() - count, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn threshold_and_share_mark_the_cells_of_large_errors() {
        let estimate = Estimate { offsets: &[0, 2, 2, 5], errors: &[0.1, 0.4, 0.2, 0.9, 0.3], children: &[] };
        let cells = |marking, tolerance| -> Vec<usize> {
            mark(estimate, marking, tolerance).into_iter().map(|mark| mark.cell).collect()
        };
        assert_eq!(cells(Marking::Threshold, 0.4), [2, 0]);
        assert_eq!(cells(Marking::Threshold, 0.5), [2]);
        assert_eq!(cells(Marking::Share(0.2), 0.0), [2]);
        assert_eq!(cells(Marking::Share(0.4), 0.0), [2, 0]);
        // Cells within the tolerance are never marked.
        assert_eq!(cells(Marking::Share(1.0), 0.95), [0_usize; 0]);
    }

    #[test]
    fn each_child_with_a_large_error_is_marked_once() {
        let children = [0, 3, 3, 1, 3];
        let estimate = Estimate { offsets: &[0, 2, 5], errors: &[0.1, 0.4, 0.2, 0.9, 0.5], children: &children };
        let marks = mark(estimate, Marking::Threshold, 0.2);
        let places: Vec<_> = marks.iter().map(|mark| (mark.cell, mark.child)).collect();
        assert_eq!(places, [(1, Some(1)), (1, Some(3)), (0, Some(3))]);
    }
}
