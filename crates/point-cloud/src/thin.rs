//! Well-spread parts of a cloud. Nothing is removed here: each function says which points stay.

use ndarray::ArrayView2;
use rayon::prelude::*;

use crate::neighbours::rows;
use crate::search::CloudTree;
use crate::vec3::{add, dot, norm, scale, sub};
use crate::{BoundingBox, CloudError};

/// A well-spread part of a cloud.
#[derive(Clone, Debug, PartialEq)]
pub struct Thinned {
    /// Rows of the points that stay, increasing.
    pub kept: Vec<usize>,
    /// No two of them are closer than this, and every other point is at most this far from one of them; 0 if all stay.
    pub distance: f64,
}

/// Thins `points`, shape `(m, 3)`, to at most `n`: a Poisson-disk sample, the points taken in the order of their rows.
///
/// A point stays unless an earlier one that stays is closer than a distance, which is bisected until between 0.9 `n` and `n`
/// points stay. No random numbers are used. For far more points than `n` see [`spread_subset`].
///
/// # Errors
/// [`CloudError::BadOption`] for `n = 0`; those of [`crate::Neighbours::nearest`].
pub fn thin(points: ArrayView2<'_, f64>, n: usize) -> Result<Thinned, CloudError> {
    let rows = checked_rows(points, n)?;
    let m = rows.len();
    if m <= n {
        return Ok(Thinned { kept: (0..m).collect(), distance: 0.0 });
    }
    let order: Vec<u32> = (0..m as u32).collect();
    let (mut kept, distance) = poisson_disk(&rows, &order, BoundingBox::of(points)?.diagonal(), n)?;
    kept.sort_unstable();
    Ok(Thinned { kept: kept.into_iter().map(|i| i as usize).collect(), distance })
}

/// Candidates per point of a subset: about three of them across the distance of two points that stay, so that the sample
/// is little coarser than one of all points, at a cost that hardly depends on their number.
const CANDIDATES: usize = 8;

/// Neighbours of a candidate that tell inside from rim: about two rings.
const RIM_NEIGHBOURS: usize = 16;

/// A candidate lies at the rim when the mean of its neighbours is farther away than this share of their mean distance:
/// 0 inside an even cloud, 2/π = 0.64 on a straight rim, below 0.25 by chance.
const RIM_OFFSET: f64 = 0.35;

/// Rows, increasing, of at most `n` of `points`, shape `(m, 3)`, spread evenly whatever the density of the cloud, with the
/// rim kept: all points if `m ≤ n`, else 0.9 `n` or more where the cloud has that many different points.
///
/// The points are gathered in voxels; of each voxel the point nearest to their mean is a candidate, at the rim of
/// the cloud the outermost one. Then a Poisson-disk sample of the candidates is taken from the rim inwards, as [`thin`] does.
/// Stray points count as rim; remove them before ([`crate::find_outliers`], [`crate::find_stray_pieces`]).
/// O(m log m): a million points take about a second. No random numbers are used.
///
/// # Errors
/// Those of [`thin`].
pub fn spread_subset(points: ArrayView2<'_, f64>, n: usize) -> Result<Vec<u32>, CloudError> {
    let rows = checked_rows(points, n)?;
    if rows.len() <= n {
        return Ok((0..rows.len() as u32).collect());
    }
    let bounds = BoundingBox::of(points)?;
    let voxels = Voxels::of(&rows, &bounds, n.saturating_mul(CANDIDATES));
    let mut candidates: Vec<u32> = voxels.iter().map(|voxel| middle_point(&rows, voxel)).collect();
    let places: Vec<[f64; 3]> = candidates.iter().map(|&i| rows[i as usize]).collect();
    let tree = CloudTree::new(&places)?;
    // For each candidate the way from its neighbours' mean to itself, in mean distances of the neighbours.
    let outward: Vec<[f64; 3]> = (0..places.len())
        .into_par_iter()
        .map(|i| {
            let near = tree.nearest(i, RIM_NEIGHBOURS);
            let total: f64 = near.iter().map(|n| n.0).sum();
            let sum = near.iter().fold([0.0; 3], |sum, n| add(sum, sub(places[i], places[n.1 as usize])));
            if total > 0.0 { scale(total.recip(), sum) } else { sum }
        })
        .collect();
    for ((candidate, voxel), out) in candidates.iter_mut().zip(voxels.iter()).zip(&outward) {
        if norm(*out) > RIM_OFFSET {
            let reach = |i: &u32| dot(*out, sub(rows[*i as usize], rows[voxel[0] as usize]));
            *candidate =
                voxel.iter().copied().max_by(|a, b| reach(a).total_cmp(&reach(b)).then(b.cmp(a))).unwrap_or(*candidate);
        }
    }
    let places: Vec<[f64; 3]> = candidates.iter().map(|&i| rows[i as usize]).collect();
    let mut order: Vec<u32> = (0..places.len() as u32).collect();
    let offset = |c: u32| norm(outward[c as usize]);
    order.sort_by(|&a, &b| offset(b).total_cmp(&offset(a)).then(a.cmp(&b)));
    let kept = if places.len() <= n { order } else { poisson_disk(&places, &order, bounds.diagonal(), n)?.0 };
    let mut kept: Vec<u32> = kept.into_iter().map(|c| candidates[c as usize]).collect();
    kept.sort_unstable();
    tracing::debug!(points = rows.len(), candidates = candidates.len(), kept = kept.len(), "took a subset");
    Ok(kept)
}

fn checked_rows(points: ArrayView2<'_, f64>, n: usize) -> Result<Vec<[f64; 3]>, CloudError> {
    if n == 0 {
        return Err(CloudError::BadOption { name: "n", value: 0.0, range: "at least 1" });
    }
    let rows = rows(points)?;
    if rows.is_empty() {
        return Err(CloudError::TooFewPoints { given: 0, required: 1 });
    }
    Ok(rows)
}

/// Points gathered in cubes of one size.
pub(crate) struct Voxels {
    /// Rows of the points, voxel after voxel, increasing in each.
    members: Vec<u32>,
    /// Where each voxel begins in `members`, and the end.
    starts: Vec<usize>,
}

impl Voxels {
    /// Rounds in which the size is adapted; on a surface the second is within a few percent.
    const ROUNDS: usize = 6;

    /// Most voxels along an axis: the three places share 63 bits.
    const MOST_PER_AXIS: f64 = 2_097_151.0;

    /// Voxels so large that there are between 0.7 and 1.5 times `count` of them, or each point its own where there are
    /// fewer points.
    pub(crate) fn of(points: &[[f64; 3]], bounds: &BoundingBox, count: usize) -> Self {
        if points.len() <= count {
            let m = points.len();
            return Self { members: (0..m as u32).collect(), starts: (0..=m).collect() };
        }
        let longest = bounds.longest_side();
        let mut per_axis = (count as f64).sqrt();
        let mut voxels = Self { members: Vec::new(), starts: vec![0] };
        for _ in 0..Self::ROUNDS {
            per_axis = per_axis.clamp(1.0, Self::MOST_PER_AXIS);
            voxels = Self::with_size(points, bounds, longest / per_axis);
            let ratio = count as f64 / voxels.count() as f64;
            if (0.7..=1.5).contains(&ratio.recip()) {
                break;
            }
            // The number of voxels that a surface meets grows with the square.
            per_axis *= ratio.sqrt();
        }
        voxels
    }

    fn with_size(points: &[[f64; 3]], bounds: &BoundingBox, size: f64) -> Self {
        let place = |p: &[f64; 3]| {
            (0..3).fold(0u64, |key, k| {
                let cell = if size > 0.0 { ((p[k] - bounds.lower[k]) / size).min(Self::MOST_PER_AXIS) } else { 0.0 };
                key << 21 | cell as u64
            })
        };
        let mut keyed: Vec<(u64, u32)> = (0u32..).zip(points).map(|(i, p)| (place(p), i)).collect();
        keyed.par_sort_unstable();
        let mut starts = vec![0];
        starts.extend(keyed.chunk_by(|a, b| a.0 == b.0).scan(0, |end, voxel| {
            *end += voxel.len();
            Some(*end)
        }));
        Self { members: keyed.into_iter().map(|k| k.1).collect(), starts }
    }

    fn count(&self) -> usize {
        self.starts.len() - 1
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = &[u32]> {
        (0..self.count()).map(|voxel| self.of_voxel(voxel))
    }

    /// Rows of the points in a voxel.
    pub(crate) fn of_voxel(&self, voxel: usize) -> &[u32] {
        &self.members[self.starts[voxel]..self.starts[voxel + 1]]
    }
}

/// The one of the points `rows[voxel]` that is nearest to their mean: of a noisy sheet the middle.
pub(crate) fn middle_point(rows: &[[f64; 3]], voxel: &[u32]) -> u32 {
    let first = rows[voxel[0] as usize];
    let from_first = |i: &u32| sub(rows[*i as usize], first);
    let sum = voxel.iter().fold([0.0; 3], |sum, i| add(sum, from_first(i)));
    let mean = scale((voxel.len() as f64).recip(), sum);
    let distance = |i: &u32| norm(sub(from_first(i), mean));
    voxel.iter().copied().min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(voxel[0])
}

/// A Poisson-disk sample of between 0.9 `n` and `n` of `places`, taken in the given order, and its distance.
fn poisson_disk(places: &[[f64; 3]], order: &[u32], diagonal: f64, n: usize) -> Result<(Vec<u32>, f64), CloudError> {
    // Twenty halvings reach a millionth of the diagonal; counts rarely need more than eight.
    const HALVINGS: usize = 24;
    let tree = CloudTree::new(places)?;
    // Beyond the diagonal only the first point stays.
    let (mut low, mut high) = (0.0, 1.001 * diagonal);
    let mut best = (vec![order[0]], high);
    // On a surface n points are about diagonal / √n apart: a start near the answer keeps the balls small.
    let mut distance = diagonal / (n as f64).sqrt();
    for _ in 0..HALVINGS {
        match sample(&tree, order, distance, n) {
            Some(kept) => {
                high = distance;
                let enough = 10 * kept.len() >= 9 * n;
                best = (kept, distance);
                if enough {
                    break;
                }
            }
            None => low = distance,
        }
        distance = if high > diagonal { 1.5 * distance } else { 0.5 * (low + high) };
        distance = distance.min(high);
    }
    Ok(best)
}

/// The greedy sample with the given distance, unless it has more than `n` points.
fn sample(tree: &CloudTree<'_>, order: &[u32], distance: f64, n: usize) -> Option<Vec<u32>> {
    let mut covered = vec![false; order.len()];
    let mut kept = Vec::new();
    for &i in order {
        if !covered[i as usize] {
            if kept.len() == n {
                return None;
            }
            kept.push(i);
            tree.for_each_within(i as usize, distance, |j| covered[j as usize] = true);
        }
    }
    Some(kept)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use ndarray::Array2;

    pub(crate) fn sheet(side: usize) -> Array2<f64> {
        Array2::from_shape_fn((side * side, 3), |(i, k)| {
            let (x, y) = ((i / side) as f64, (i % side) as f64);
            // A lattice shaken by irrational steps.
            [x + 0.3 * (7.1 * i as f64).sin(), y + 0.3 * (3.7 * i as f64).cos(), 0.1 * x][k]
        })
    }

    #[test]
    fn a_thinned_cloud_is_spread_and_covers_the_rest() {
        let cloud = sheet(40);
        for n in [1, 10, 200, 1599, 1600, 5000] {
            let Thinned { kept, distance } = thin(cloud.view(), n).unwrap();
            assert!(kept.len() <= n && (n < 10 || 10 * kept.len() >= 7 * n.min(1600)), "{n}: {}", kept.len());
            let gap = |i: usize, j: usize| {
                let d = &cloud.row(i) - &cloud.row(j);
                d.dot(&d).sqrt()
            };
            for i in 0..cloud.nrows() {
                let nearest = kept.iter().filter(|&&j| j != i).map(|&j| gap(i, j)).fold(f64::INFINITY, f64::min);
                if kept.binary_search(&i).is_ok() {
                    assert!(nearest > distance || kept.len() == 1600);
                } else {
                    assert!(nearest <= distance);
                }
            }
        }
    }

    /// Half of a sphere, the poles at the rim, ten times as dense on one side as on the other.
    fn half_sphere(m: usize) -> Array2<f64> {
        let golden = 0.5 * (5f64.sqrt() - 1.0);
        Array2::from_shape_fn((m, 3), |(i, k)| {
            let (s, t) = ((i as f64 + 0.5) / m as f64, (golden * i as f64).fract());
            // Density along t falls from 1 to 0.1.
            let t = (1.0 - (1.0 - 0.99 * t).sqrt()) / 0.9;
            let (z, phi) = (2.0 * s - 1.0, std::f64::consts::PI * t);
            let r = (1.0 - z * z).sqrt();
            [r * phi.cos(), r * phi.sin(), z][k]
        })
    }

    #[test]
    fn a_subset_is_even_and_reaches_the_rim_whatever_the_density() {
        let cloud = half_sphere(60_000);
        let n = 600;
        let kept = spread_subset(cloud.view(), n).unwrap();
        assert!(kept.len() <= n && 10 * kept.len() >= 9 * n, "{}", kept.len());
        assert!(kept.is_sorted_by(|a, b| a < b));
        let row = |i: usize| [cloud[[i, 0]], cloud[[i, 1]], cloud[[i, 2]]];
        let chosen: Vec<[f64; 3]> = kept.iter().map(|&i| row(i as usize)).collect();
        let gap = |p: [f64; 3], skip: usize| {
            let others = chosen.iter().enumerate().filter(|(j, _)| *j != skip);
            others.map(|(_, q)| norm(sub(p, *q))).fold(f64::INFINITY, f64::min)
        };
        let closest = (0..chosen.len()).map(|i| gap(chosen[i], i)).fold(f64::INFINITY, f64::min);
        // An even lattice of n points on the area 2π has the spacing √(4π/(√3 n)).
        let lattice = (4.0 * std::f64::consts::PI / (3f64.sqrt() * n as f64)).sqrt();
        assert!(closest > 0.6 * lattice, "{closest} {lattice}");
        let farthest = (0..60_000).step_by(7).map(|i| gap(row(i), usize::MAX)).fold(0.0, f64::max);
        assert!(farthest < 1.3 * lattice, "{farthest} {lattice}");
        // The rim is the half circle y = 0: the points there are close to it, and no farther apart than inside.
        for k in 0..100 {
            let (z, r) = f64::sin_cos(std::f64::consts::PI * (0.5 - (k as f64 + 0.5) / 100.0));
            let near = |p: &&[f64; 3]| norm(sub(**p, [r, 0.0, z])) < lattice && p[1] < 0.2 * lattice;
            assert!(chosen.iter().any(|p| near(&p)), "no point at the rim near {r} {z}");
        }
    }

    #[test]
    fn subsets_of_few_equal_and_huge_points_are_what_they_must_be() {
        let cloud = sheet(10);
        assert_eq!(spread_subset(cloud.view(), 100).unwrap(), (0..100).collect::<Vec<_>>());
        assert_eq!(
            spread_subset(cloud.view(), 99).unwrap().len(),
            spread_subset((&cloud * 1e80).view(), 99).unwrap().len()
        );
        assert_eq!(spread_subset(Array2::from_elem((1000, 3), 7.0).view(), 10).unwrap().len(), 1);
        assert!(matches!(spread_subset(cloud.view(), 0), Err(CloudError::BadOption { name: "n", .. })));
        assert!(matches!(spread_subset(Array2::zeros((0, 3)).view(), 5), Err(CloudError::TooFewPoints { .. })));
    }
}
