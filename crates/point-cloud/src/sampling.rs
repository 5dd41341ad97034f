//! How densely a cloud samples its surface, whatever its points do along a rim.

use rayon::prelude::*;

use crate::local_frame::{Frames, median};
use crate::search::CloudTree;

/// Neighbours over which the spacing is smoothed by a median.
const SPACING_MEDIAN: usize = 12;

/// Neighbours among which points beside a dense line are looked for. Lines of more points keep their own spacing.
const BESIDE_NEIGHBOURS: usize = 96;

/// Distances between the points of a cloud.
pub(crate) struct Sampling {
    /// Spacing of the surface around each point: the median over it and its neighbours, without those on lines.
    pub(crate) spacing: Vec<f64>,
    /// Of each point on a line of points (as of a rim that has more points than the inside) its spacing along the line; elsewhere
    /// infinite.
    pub(crate) along_line: Vec<f64>,
}

impl Sampling {
    pub(crate) fn of(tree: &CloudTree<'_>, frames: &Frames) -> Self {
        let m = tree.points.len();
        let around = |i: usize, count: usize| {
            let near = tree.nearest(i, count).into_iter().map(|n| n.1 as usize);
            std::iter::once(i).chain(near).collect::<Vec<usize>>()
        };
        let spacings = |rows: &[usize], lines: bool| {
            let chosen = rows.iter().filter(|&&j| lines || !frames.on_line[j]).take(SPACING_MEDIAN + 1);
            chosen.map(|&j| frames.spacing[j]).collect::<Vec<f64>>()
        };
        let local = |i: usize| {
            let near = around(i, SPACING_MEDIAN);
            if !near.iter().any(|&j| frames.on_line[j]) {
                return median(spacings(&near, true));
            }
            let beside = spacings(&around(i, BESIDE_NEIGHBOURS), false);
            median(if beside.is_empty() { spacings(&near, true) } else { beside })
        };
        let along = |i: usize| if frames.on_line[i] { frames.spacing[i] } else { f64::INFINITY };
        Self { spacing: (0..m).into_par_iter().map(local).collect(), along_line: (0..m).map(along).collect() }
    }
}
