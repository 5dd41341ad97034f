//! Rows of points: dense along lines, the lines far apart, as profile scanners and sections give.

use ndarray::ArrayView2;
use rayon::prelude::*;

use crate::CloudError;
use crate::local_frame::median;
use crate::neighbour_lists::Neighbour;
use crate::neighbours::rows;
use crate::quadric::principal_axes;
use crate::search::CloudTree;
use crate::vec3::{add, dot, norm, scale, sub};

/// Points at which rows are looked for.
///
/// Limit: a thousand neighbours of each take some ten milliseconds.
const SAMPLE: usize = 400;

/// Most neighbours that are searched for another row.
///
/// Limit: twice as many rows as long as this many points are apart by a ratio of 500.
const MOST_NEIGHBOURS: usize = 1024;

/// Numbers of neighbours that may lie on a line: few where the row bends, many where its points scatter across it.
///
/// Limit: below 8 points line up by chance, 256 are a ratio of 128.
const ON_LINE: [usize; 6] = [8, 16, 32, 64, 128, 256];

/// Variance across a line, as a share of that along it, up to which points lie on it.
///
/// Derived: of evenly spread points it is 0.25 to 1, on a rim 0.28; an arc of an angle of 80° has 0.02.
const LINE_VARIANCE: f64 = 0.02;

/// Cosine of the least angle between a row and the way to another one.
///
/// Derived: the own row leaves its tangent by 53° only after an arc of 106°.
const BESIDE: f64 = 0.6;

/// Standard deviations across a row within which a point is of the row.
///
/// Derived: of 256 normally distributed points one in a million neighbourhoods has one beyond.
const SCATTER: f64 = 6.0;

/// Share of the sample that must lie in rows.
///
/// Calibrated: clouds of even density have below 0.05, rows with scatter and bends 0.8 and more.
const LEAST_SHARE: f64 = 0.7;

/// Offset of the mean of the neighbours along a row, in their mean distances, from which on a point is an end of it.
///
/// Derived: 0 inside, 1 at the end, 0.33 at a third of the radius from it.
const END_OFFSET: f64 = 0.7;

/// How points lie in rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rows {
    /// Median distance of points along their row, in the units of the points.
    pub along: f64,
    /// Median distance to another row.
    pub across: f64,
}

impl Rows {
    /// How many times as dense the points are along the rows as across them.
    pub fn ratio(&self) -> f64 {
        self.across / self.along
    }
}

/// Looks for rows among `points`, shape `(m, 3)`, in any direction, straight or bent; `None` where most points lie in none. O(m log m).
///
/// # Errors
/// Those of [`crate::Neighbours::nearest`].
pub fn find_rows(points: ArrayView2<'_, f64>) -> Result<Option<Rows>, CloudError> {
    let places = rows(points)?;
    let tree = CloudTree::new(&places)?;
    let step = places.len().div_ceil(SAMPLE);
    let sample: Vec<usize> = (0..places.len()).step_by(step).collect();
    let found: Vec<Rows> = sample.par_iter().filter_map(|&i| row_at(&tree, i)).collect();
    if (found.len() as f64) < LEAST_SHARE * sample.len() as f64 {
        return Ok(None);
    }
    let of = |pick: fn(&Rows) -> f64| median(found.iter().map(pick).collect());
    let rows = Rows { along: of(|row| row.along), across: of(|row| row.across) };
    tracing::debug!(?rows, "found rows of points");
    Ok(Some(rows))
}

/// The row through point `i`, if it lies in one and another is near enough.
fn row_at(tree: &CloudTree<'_>, i: usize) -> Option<Rows> {
    let own = tree.points[i];
    let near = tree.nearest(i, MOST_NEIGHBOURS);
    let offset = |n: &Neighbour| sub(tree.points[n.1 as usize], own);
    let (mut line, mut along, mut scatter) = (None, 0.0, 0.0);
    for count in ON_LINE.into_iter().filter(|&count| count <= near.len()) {
        let offsets: Vec<[f64; 3]> = near[..count].iter().map(offset).collect();
        let axes = principal_axes(&offsets);
        if axes.variances[1] <= LINE_VARIANCE * axes.variances[2] {
            let axis = axes.directions[2];
            let places = offsets.iter().map(|o| dot(*o, axis)).chain([0.0]);
            let (least, most) = places.fold((0.0, 0.0), |(a, b): (f64, f64), x| (a.min(x), b.max(x)));
            (line, along) = (Some(axis), (most - least) / count as f64);
            scatter = axes.variances[1].sqrt();
        }
    }
    let axis = line?;
    let is_beside = |n: &&Neighbour| {
        let way = offset(n);
        n.0 > SCATTER * scatter && dot(way, axis).abs() <= BESIDE * norm(way)
    };
    let across = near.iter().find(is_beside)?.0;
    (along > 0.0).then_some(Rows { along, across })
}

/// Rows, increasing, of points of which no two are closer than `distance` and which are at most so far from all others: first the ends of
/// rows, then along them in the order of the file. With a distance below that of the rows all of them stay.
///
/// # Errors
/// [`CloudError::BadOption`] if `distance` is not positive and finite; those of [`crate::Neighbours::nearest`].
pub fn thin_rows(points: ArrayView2<'_, f64>, distance: f64) -> Result<Vec<u32>, CloudError> {
    if !(distance > 0.0 && distance.is_finite()) {
        return Err(CloudError::BadOption { name: "distance", value: distance, range: "positive and finite" });
    }
    let places = rows(points)?;
    let tree = CloudTree::new(&places)?;
    let is_end = |&i: &u32| {
        let near = tree.within(i as usize, distance);
        let total: f64 = near.iter().map(|n| n.0).sum();
        let sum = near.iter().fold([0.0; 3], |sum, n| add(sum, sub(places[n.1 as usize], places[i as usize])));
        total > 0.0 && norm(scale(total.recip(), sum)) > END_OFFSET
    };
    let all: Vec<u32> = (0..places.len() as u32).collect();
    let (ends, inner): (Vec<u32>, Vec<u32>) = all.into_par_iter().partition(is_end);
    let mut covered = vec![false; places.len()];
    let mut kept = Vec::new();
    for i in ends.into_iter().chain(inner) {
        if !covered[i as usize] {
            kept.push(i);
            tree.for_each_within(i as usize, distance, |j| covered[j as usize] = true);
        }
    }
    kept.sort_unstable();
    Ok(kept)
}

#[cfg(test)]
#[path = "rows_tests.rs"]
mod tests;
