//! MARK: which cells to refine.

use crate::Estimate;

/// Rules by which cells are marked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Marking {
    /// Cells with a point whose error is at least the tolerance.
    Threshold,
    /// Cells with one of the given share (0 to 1) of points of largest error, as far as it is at least the tolerance.
    Share(f64),
}

/// The marked cells, by decreasing largest error; equal ones by number.
pub fn mark(estimate: Estimate<'_>, marking: Marking, tolerance: f64) -> Vec<usize> {
    let threshold = match marking {
        Marking::Threshold => tolerance,
        Marking::Share(share) => tolerance.max(upper_quantile(estimate.errors, share)),
    };
    let largest = |ends: &[usize]| estimate.errors[ends[0]..ends[1]].iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let cells = estimate.offsets.windows(2).map(largest).enumerate();
    let mut marked: Vec<(usize, f64)> = cells.filter(|&(_, error)| error >= threshold).collect();
    marked.sort_by(|a, b| b.1.total_cmp(&a.1));
    marked.into_iter().map(|(cell, _)| cell).collect()
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
        let estimate = Estimate { offsets: &[0, 2, 2, 5], errors: &[0.1, 0.4, 0.2, 0.9, 0.3] };
        assert_eq!(mark(estimate, Marking::Threshold, 0.4), [2, 0]);
        assert_eq!(mark(estimate, Marking::Threshold, 0.5), [2]);
        assert_eq!(mark(estimate, Marking::Share(0.2), 0.0), [2]);
        assert_eq!(mark(estimate, Marking::Share(0.4), 0.0), [2, 0]);
        // Cells within the tolerance are never marked.
        assert_eq!(mark(estimate, Marking::Share(1.0), 0.95), [0_usize; 0]);
    }
}
