//! Outliers and stray pieces. Nothing is removed here: each function says which points stay and why.

use rayon::prelude::*;

use crate::edges::DisjointSets;
use crate::local_frame::{NORMAL_MEDIAN, median};
use crate::neighbour_lists::Neighbours;
use crate::{CloudError, SPACING_NEIGHBOURS};

/// Points whose neighbours are unusually far away.
#[derive(Clone, Debug, PartialEq)]
pub struct Outliers {
    /// Rows of the other points, increasing.
    pub kept: Vec<usize>,
    /// Rows of the outliers, increasing.
    pub removed: Vec<usize>,
    /// Mean distance to the `k` nearest beyond which a point counts as an outlier.
    pub limit: f64,
}

/// Finds statistical outliers among the points with these `neighbours`: the logarithm of the mean distance to the `k` nearest exceeds
/// the median by more than `factor` robust standard deviations (MAD / 0.6745).
///
/// Logarithms, because densities vary by factors. A usual choice is `k = 12`, `factor = 5`; clusters of more than `k` stray points
/// are found by [`find_stray_pieces`] instead. Of points with fewer than `k` neighbours all count.
///
/// # Errors
/// [`CloudError::BadOption`] unless `k ≥ 1` and `factor` is positive.
pub fn find_outliers(neighbours: &Neighbours, k: usize, factor: f64) -> Result<Outliers, CloudError> {
    // The points of a perfect lattice have no spread at all; at its corners neighbours are about twice as far as inside.
    const LEAST_SPREAD: f64 = 0.2;
    if k == 0 {
        return Err(CloudError::BadOption { name: "k", value: 0.0, range: "at least 1" });
    }
    if !(factor > 0.0 && factor.is_finite()) {
        return Err(CloudError::BadOption { name: "factor", value: factor, range: "positive and finite" });
    }
    // Equal points have distance zero; the smallest normal number keeps their logarithm finite.
    let log_mean = |i: usize| {
        let d = neighbours.distances_of(i);
        let d = &d[..d.len().min(k)];
        (d.iter().sum::<f64>() / d.len().max(1) as f64).max(f64::MIN_POSITIVE).ln()
    };
    let logs: Vec<f64> = (0..neighbours.count()).into_par_iter().map(log_mean).collect();
    let middle = median(logs.clone());
    let spread = (median(logs.iter().map(|l| (l - middle).abs()).collect()) / NORMAL_MEDIAN).max(LEAST_SPREAD);
    let limit = middle + factor * spread;
    let (kept, removed) = (0..logs.len()).partition(|&i| logs[i] <= limit);
    Ok(Outliers { kept, removed, limit: limit.exp() })
}

/// The connected pieces of a cloud.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CloudPieces {
    /// Piece of each point, shape `(m,)`.
    pub piece_of: Vec<usize>,
    /// Points of each piece, largest first; of equal ones that with the first point is earlier.
    pub sizes: Vec<usize>,
}

impl CloudPieces {
    /// Rows of the points in pieces of at least `share` of all points, increasing, and of the others: the stray ones.
    pub fn split(&self, share: f64) -> (Vec<usize>, Vec<usize>) {
        let least = share * self.piece_of.len() as f64;
        (0..self.piece_of.len()).partition(|&i| self.sizes[self.piece_of[i]] as f64 >= least)
    }
}

/// Finds the connected pieces of the points with these `neighbours`: two points are joined when one is a neighbour of the other and
/// not farther than `reach` times the larger spacing (mean distance to the six nearest) of both.
///
/// A usual choice is `reach = 3` with 24 nearest neighbours: enough to reach over a dense region's rim into a thin one next to it.
///
/// # Errors
/// [`CloudError::BadOption`] unless `reach` is positive and finite.
pub fn find_stray_pieces(neighbours: &Neighbours, reach: f64) -> Result<CloudPieces, CloudError> {
    if !(reach > 0.0 && reach.is_finite()) {
        return Err(CloudError::BadOption { name: "reach", value: reach, range: "positive and finite" });
    }
    let m = neighbours.count();
    let spacing: Vec<f64> = (0..m)
        .into_par_iter()
        .map(|i| {
            let d = neighbours.distances_of(i);
            let d = &d[..d.len().min(SPACING_NEIGHBOURS)];
            d.iter().sum::<f64>() / d.len().max(1) as f64
        })
        .collect();
    // The spacing of an outlier is large itself; the median of its neighbourhood is not.
    let local: Vec<f64> = (0..m)
        .into_par_iter()
        .map(|i| median(neighbours.of(i).iter().take(SPACING_NEIGHBOURS).map(|&j| spacing[j as usize]).collect()))
        .collect();
    let mut sets = DisjointSets::new(m);
    for i in 0..m {
        for (&j, &d) in neighbours.of(i).iter().zip(neighbours.distances_of(i)) {
            if d <= reach * local[i].max(local[j as usize]) {
                sets.join(i as u32, j);
            }
        }
    }
    let roots: Vec<usize> = (0..m as u32).map(|i| sets.root(i) as usize).collect();
    let mut size = vec![0; m];
    roots.iter().for_each(|&r| size[r] += 1);
    let mut order: Vec<usize> = (0..m).filter(|&r| size[r] > 0).collect();
    order.sort_by_key(|&r| std::cmp::Reverse(size[r]));
    let mut rank = vec![0; m];
    order.iter().enumerate().for_each(|(k, &r)| rank[r] = k);
    Ok(CloudPieces {
        piece_of: roots.iter().map(|&r| rank[r]).collect(),
        sizes: order.iter().map(|&r| size[r]).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::thin::tests::sheet;
    use ndarray::{Array2, concatenate};

    #[test]
    fn planted_outliers_are_named_and_no_others() {
        let good = sheet(30);
        let bad = Array2::from_shape_fn((5, 3), |(i, k)| [6.0 * i as f64, 10.0, 20.0 + 5.0 * i as f64][k]);
        let cloud = concatenate![ndarray::Axis(0), good, bad];
        let neighbours = |cloud: &Array2<f64>| Neighbours::nearest(cloud.view(), 24).unwrap();
        let outliers = find_outliers(&neighbours(&cloud), 12, 5.0).unwrap();
        assert_eq!(outliers.removed, [900, 901, 902, 903, 904]);
        assert_eq!(outliers.kept.len(), 900);
        assert!(find_outliers(&neighbours(&good), 12, 5.0).unwrap().removed.is_empty());
        assert!(matches!(find_outliers(&neighbours(&good), 0, 5.0), Err(CloudError::BadOption { name: "k", .. })));
    }

    #[test]
    fn pieces_are_told_apart_whatever_their_density() {
        let (coarse, fine) = (sheet(20), sheet(12) * 0.2 + 40.0);
        let cloud = concatenate![ndarray::Axis(0), fine, coarse];
        let pieces = find_stray_pieces(&Neighbours::nearest(cloud.view(), 24).unwrap(), 3.0).unwrap();
        assert_eq!(pieces.sizes, [400, 144]);
        let (kept, stray) = pieces.split(0.5);
        assert_eq!((kept.len(), stray), (400, (0..144).collect::<Vec<_>>()));
    }
}
