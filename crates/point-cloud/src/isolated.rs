//! Points that belong to no surface: sparse beside the others, and not along a sheet.

use ndarray::ArrayView2;
use rayon::prelude::*;

use crate::local_frame::median;
use crate::neighbours::rows;
use crate::quadric::principal_axes;
use crate::search::CloudTree;
use crate::thin::{Voxels, middle_point};
use crate::vec3::{dot, scale, sub};
use crate::{BoundingBox, CloudError};

/// Points that stand for a larger cloud, one for each of about as many voxels: the cost of all searches is bounded by it.
///
/// Limit: 60,000 are searched in a quarter of a second on one core; a sheet of 10⁶ points has some 17 in a voxel.
const REPRESENTATIVES: usize = 60_000;

/// Neighbours that a point is compared with: about two rings on a surface.
///
/// Calibrated: with 8 points of sparse random sheets have no flat neighbourhood by chance; with 24 clumps of outliers hide no longer,
/// but the rims of small clouds count as bent.
const NEIGHBOURS: usize = 12;

/// Only points whose neighbours are on average this many times as far as in the median of the cloud can be isolated.
///
/// Calibrated: on 30 scans of heads, hulls, blades, cars and terrain nothing is found with 3, but for one point in 10,133 of a forest;
/// with 2.5, 16 there. Outliers nearer than that are within a few spacings of the surface.
const SPARSE: f64 = 3.0;

/// A sparse point is isolated if its neighbours are this many times as far from it as from their own neighbours, in the median.
///
/// Calibrated: with 3 points at the ends of scanned stream beds are found; planted outliers found rise by 1 % only.
const SPARSER_THAN_NEIGHBOURS: f64 = 4.0;

/// A sparse point is isolated if its neighbourhood has this share of its variance across its flattest plane; 1/3 has a ball.
///
/// Calibrated: random points in a box have 0.2 on average and less than 0.12 in a quarter of the cases; on real scans no
/// sparse neighbourhood of an open surface comes above 0.11.
const THICK: f64 = 0.12;

/// A point, sparse or not, is isolated if its distance from the plane of its neighbours is longer than this many of their mean
/// distances to theirs, and than [`OFF_PER_THICKNESS`] times their own standard deviation from the plane.
///
/// Calibrated: with 1 nothing is found on 40 open surfaces but one point of 22,320 on the view of an anchor, and nearly all planted points
/// one and a half spacings or more off random sheets; with 0.7 two on a raw face and five on terrain too.
const OFF_PER_SPACING: f64 = 1.0;

/// See [`OFF_PER_SPACING`].
///
/// Calibrated: noise and bends make neighbours as uneven as the point; with 4 one point of 4240 random ones of a face is found.
const OFF_PER_THICKNESS: f64 = 8.0;

/// Neighbours whose variance along the second direction is below this share of that along the first are on a line, as those of a
/// densely sampled rim or of a scanner's row, and tell nothing of the points beside it.
///
/// Calibrated: 0.28 is usual on a straight rim of even density; below 0.02 come one in some thousand random neighbourhoods.
const LINE_VARIANCE: f64 = 0.05;

/// A sparse point is isolated too if this share of the sparse points around it, itself among them, is isolated by itself.
///
/// Calibrated: three quarters of random points in a box are isolated by themselves, in a sparse part of a sheet hardly one in a hundred.
const ISOLATED_AROUND: f64 = 0.34;

/// Searches, each without the points found before: outliers have hidden others.
///
/// Limit: a third search finds less than one in a hundred more.
const SEARCHES: usize = 3;

/// Share of the points from which on they are no outliers but part of what was scanned.
///
/// Limit: beyond it the cloud has no surface that is much denser than the rest.
const MOST: f64 = 0.1;

/// Fewest points among which isolated ones can be told.
///
/// Limit: with fewer each neighbourhood holds half of the cloud.
const FEWEST: usize = 50;

/// Rows, increasing, of the isolated points among `points`, shape `(m, 3)`: those whose twelve nearest are three times
/// as far as in the median of the cloud, and which are either four times as far from these as they are from theirs or lie among
/// points that fill space instead of following a sheet; and those that are off the plane of their neighbours, where these
/// are on it, by more than their spacing. Sparse parts of a surface are none. None at all if more than a tenth
/// of the points would be.
///
/// Large clouds are gathered in voxels and judged by one point of each, so outliers in the voxels of the surface stay. Remove
/// equal points and far values ([`crate::FarValues`]) before. O(m log m), about 0.4 s of one core for a million points.
///
/// # Errors
/// [`CloudError::WrongDimension`], those of [`crate::check_finite`].
pub fn find_isolated(points: ArrayView2<'_, f64>) -> Result<Vec<u32>, CloudError> {
    let all = rows(points)?;
    if all.len() < FEWEST {
        return Ok(Vec::new());
    }
    let bounds = BoundingBox::of(points)?;
    let unit = bounds.longest_side();
    let voxels = Voxels::of(&all, &bounds, REPRESENTATIVES);
    // In the unit cube no square under- or overflows.
    let lower = [bounds.lower[0], bounds.lower[1], bounds.lower[2]];
    let into_cube = |i: u32| if unit > 0.0 { scale(unit.recip(), sub(all[i as usize], lower)) } else { [0.0; 3] };
    let mut places: Vec<[f64; 3]> = voxels.iter().map(|voxel| into_cube(middle_point(&all, voxel))).collect();
    let mut left: Vec<u32> = (0..places.len() as u32).collect();
    let mut found = Vec::new();
    let mut sparse = None;
    for _ in 0..SEARCHES {
        if places.len() < FEWEST {
            break;
        }
        let isolated = search(&places, &mut sparse)?;
        if !isolated.contains(&true) {
            break;
        }
        found.extend(left.iter().zip(&isolated).filter(|(_, isolated)| **isolated).map(|(&voxel, _)| voxel));
        let mut keep = isolated.iter().map(|isolated| !isolated);
        left.retain(|_| keep.next().unwrap_or(true));
        let mut keep = isolated.iter().map(|isolated| !isolated);
        places.retain(|_| keep.next().unwrap_or(true));
    }
    let mut isolated: Vec<u32> = found.into_iter().flat_map(|voxel| voxels.of_voxel(voxel as usize)).copied().collect();
    if isolated.len() as f64 > MOST * all.len() as f64 {
        return Ok(Vec::new());
    }
    isolated.sort_unstable();
    if !isolated.is_empty() {
        tracing::info!(count = isolated.len(), points = all.len(), "found isolated points");
    }
    Ok(isolated)
}

/// What the neighbours of a point tell.
struct Neighbourhood {
    /// Mean distance of the neighbours.
    distance: f64,
    /// Share of the variance across the flattest plane.
    thickness: f64,
    /// Distance of the point from the plane of its neighbours, and their standard deviation from it.
    off: [f64; 2],
    /// Whether the neighbours are spread over a sheet, not along a line.
    spread: bool,
    neighbours: [u32; NEIGHBOURS],
}

/// Whether each of `places` is isolated. The distance from which on a point is sparse is that of the first search.
fn search(places: &[[f64; 3]], sparse: &mut Option<f64>) -> Result<Vec<bool>, CloudError> {
    let tree = CloudTree::new(places)?;
    let around: Vec<Neighbourhood> = tree.map_nearest(NEIGHBOURS, |i, near| {
        let mut neighbours = [i as u32; NEIGHBOURS];
        neighbours.iter_mut().zip(near.iter()).for_each(|(place, n)| *place = n.1);
        let distance = near.iter().map(|n| n.0).sum::<f64>() / near.len().max(1) as f64;
        let own = |j: usize| sub(places[j], places[i]);
        let mut offsets: Vec<[f64; 3]> = near.iter().map(|n| own(n.1 as usize)).collect();
        let plane = principal_axes(&offsets);
        let off = [dot(plane.centre, plane.directions[0]).abs(), plane.variances[0].max(0.0).sqrt()];
        let spread = plane.variances[1] > LINE_VARIANCE * plane.variances[2];
        offsets.push([0.0; 3]);
        let variances = principal_axes(&offsets).variances;
        let total = variances.iter().sum::<f64>();
        let thickness = if total > 0.0 { variances[0] / total } else { 0.0 };
        Neighbourhood { distance, thickness, off, spread, neighbours }
    });
    let limit = *sparse.get_or_insert_with(|| SPARSE * median(around.iter().map(|a| a.distance).collect()));
    let is_sparse = |i: usize| around[i].distance > limit;
    let by_itself: Vec<bool> = (0..around.len())
        .into_par_iter()
        .map(|i| {
            let here = &around[i];
            let their = median(here.neighbours.iter().map(|&j| around[j as usize].distance).collect());
            let [off, deviation] = here.off;
            let is_off = off > OFF_PER_SPACING * their && off > OFF_PER_THICKNESS * deviation;
            let is_sparser = here.distance > SPARSER_THAN_NEIGHBOURS * their;
            here.spread && is_off || is_sparse(i) && (here.thickness > THICK || is_sparser)
        })
        .collect();
    let among_isolated = |i: usize| {
        let near = || around[i].neighbours.iter().map(|&j| j as usize).chain([i]).filter(|&j| is_sparse(j));
        near().filter(|&j| by_itself[j]).count() as f64 > ISOLATED_AROUND * near().count() as f64
    };
    Ok((0..around.len()).into_par_iter().map(|i| by_itself[i] || is_sparse(i) && among_isolated(i)).collect())
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use ndarray::{Array2, Axis, concatenate};

    /// Numbers in [0, 1) by a multiplicative congruential generator (Knuth's MMIX).
    pub(crate) fn random(seed: u64) -> impl FnMut() -> f64 {
        let mut state = seed.wrapping_mul(2_654_435_761).wrapping_add(12_345);
        move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        }
    }

    /// A wavy sheet, one bent to half a cylinder, and one whose density falls by a factor of ten.
    pub(crate) fn sheet(kind: usize, m: usize, seed: u64) -> Array2<f64> {
        let mut random = random(seed);
        let mut points = Array2::zeros((m, 3));
        for mut p in points.rows_mut() {
            let (x, y) = (random(), random());
            let [a, b, c] = match kind {
                0 => [x, y, 0.1 * (6.0 * x).sin() * (4.0 * y).cos()],
                1 => [0.4 * (3.0 * x).cos(), 0.4 * (3.0 * x).sin(), 0.8 * y],
                _ => [0.1 * x + 0.9 * x.powi(3), y, 0.2 * (-8.0 * (x - 0.5).powi(2)).exp()],
            };
            (p[0], p[1], p[2]) = (a, b, c);
        }
        points
    }

    #[test]
    fn random_points_around_a_sheet_are_found_and_no_others() {
        for kind in 0..3 {
            for (m, seed) in [(60, 1), (300, 2), (1000, 3), (1000, 4), (10_000, 5), (100_000, 6)] {
                let good = sheet(kind, m, seed);
                assert_eq!(find_isolated(good.view()).unwrap(), [0; 0], "{kind} {m}");
                let bounds = BoundingBox::of(good.view()).unwrap();
                let (unit, mut random) = (bounds.longest_side(), random(seed + 100));
                for share in [100, 50] {
                    let n = m.div_ceil(share);
                    let bad = Array2::from_shape_fn((n, 3), |(_, k)| bounds.lower[k] + unit * (1.1 * random() - 0.05));
                    let cloud = concatenate![Axis(0), good, bad];
                    let found = find_isolated(cloud.view()).unwrap();
                    let surface: Vec<[f64; 3]> = good.rows().into_iter().map(|p| [p[0], p[1], p[2]]).collect();
                    let tree = CloudTree::new(&surface).unwrap();
                    let spacing = unit / (m as f64).sqrt();
                    let far = (m as u32..(m + n) as u32).filter(|&i| {
                        let p = cloud.row(i as usize);
                        tree.distance([p[0], p[1], p[2]]) > 6.0 * spacing && found.binary_search(&i).is_err()
                    });
                    let (missed, wrong) = (far.count(), found.iter().filter(|&&i| (i as usize) < m).count());
                    // Where outliers crowd each other some hide; of the good ones none may go, but for those at a rim by chance.
                    assert!(
                        20 * missed <= n + 20 && wrong <= m / 1000,
                        "{kind} {m} {n}: {missed} missed, {wrong} wrong"
                    );
                }
            }
        }
    }

    #[test]
    fn what_fills_space_is_no_surface_with_outliers() {
        let mut random = random(9);
        let ball = Array2::from_shape_fn((2000, 3), |_| random());
        assert!(find_isolated(ball.view()).unwrap().len() <= 2);
        assert!(find_isolated(Array2::from_elem((500, 3), 1.0).view()).unwrap().is_empty());
        assert!(matches!(find_isolated(Array2::zeros((60, 2)).view()), Err(CloudError::WrongDimension { .. })));
    }

    #[test]
    fn points_beside_dense_lines_stay() {
        // A rim with points five times as close as inside, and rows of a scanner.
        let mut random = random(2);
        let rim = Array2::from_shape_fn((500, 3), |(i, k)| {
            let (side, t) = (i % 4, (i / 4) as f64 / 125.0);
            let (x, y) = ([t, 1.0, 1.0 - t, 0.0][side], [0.0, t, 1.0, 1.0 - t][side]);
            [x, y, 0.1 * x + 0.05 * x * y][k]
        });
        let mut inside = Array2::from_shape_fn((600, 3), |_| 0.02 + 0.96 * random());
        inside.rows_mut().into_iter().for_each(|mut p| p[2] = 0.1 * p[0] + 0.05 * p[0] * p[1]);
        let rows = Array2::from_shape_fn((2000, 3), |(i, k)| {
            [(i / 200) as f64, 0.03 * (i % 200) as f64, 0.1 * (i / 200) as f64][k]
        });
        for cloud in [concatenate![Axis(0), rim, inside], rows] {
            assert_eq!(find_isolated(cloud.view()).unwrap(), [0; 0]);
        }
    }

    #[test]
    fn the_scale_does_not_matter() {
        let mut cloud = sheet(0, 500, 3);
        cloud.row_mut(17).assign(&ndarray::arr1(&[0.5, 0.5, 0.9]));
        for scale in [1e-90, 1.0, 1e90] {
            assert_eq!(find_isolated((&cloud * scale).view()).unwrap(), [17]);
        }
    }
}
