//! Nearest and radius neighbours of all points of a cloud.

use ndarray::ArrayView2;
use rayon::prelude::*;

use crate::neighbour_lists::Neighbours;
use crate::search::CloudTree;
use crate::{CloudError, check_finite};

impl Neighbours {
    /// The `k` nearest neighbours of each of `points`, shape `(m, 3)`; all others where `k ≥ m`. O(m k log m).
    ///
    /// # Errors
    /// [`CloudError::WrongDimension`], [`CloudError::TooFewPoints`] without a point, those of [`check_finite`].
    pub fn nearest(points: ArrayView2<'_, f64>, k: usize) -> Result<Self, CloudError> {
        Ok(CloudTree::new(&rows(points)?)?.all_nearest(k))
    }

    /// The neighbours of each of `points`, shape `(m, 3)`, at a distance of at most `radius`.
    ///
    /// # Errors
    /// Those of [`Neighbours::nearest`]; [`CloudError::BadOption`] if `radius` is negative or not finite.
    pub fn within(points: ArrayView2<'_, f64>, radius: f64) -> Result<Self, CloudError> {
        if !(radius.is_finite() && radius >= 0.0) {
            return Err(CloudError::BadOption { name: "radius", value: radius, range: "finite and not negative" });
        }
        let points = rows(points)?;
        let tree = CloudTree::new(&points)?;
        let lists: Vec<_> = (0..points.len()).into_par_iter().map(|i| tree.within(i, radius)).collect();
        Ok(Self::from_lists(&lists))
    }
}

/// The rows of `points` as arrays.
pub(crate) fn rows(points: ArrayView2<'_, f64>) -> Result<Vec<[f64; 3]>, CloudError> {
    if points.ncols() != 3 {
        return Err(CloudError::WrongDimension { given: points.ncols(), required: 3 });
    }
    check_finite(points)?;
    Ok(points.rows().into_iter().map(|p| [p[0], p[1], p[2]]).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn both_queries_agree_with_brute_force(coordinates in prop::collection::vec(-1.0..1.0, 30..240), k in 1usize..12) {
            let m = coordinates.len() / 3;
            let points = Array2::from_shape_fn((m, 3), |(i, c)| coordinates[3 * i + c]);
            let radius = 0.7;
            let nearest = Neighbours::nearest(points.view(), k).unwrap();
            let within = Neighbours::within(points.view(), radius).unwrap();
            for i in 0..m {
                let distance = |j: u32| {
                    let d = &points.row(j as usize) - &points.row(i);
                    d.dot(&d).sqrt()
                };
                let mut all: Vec<u32> = (0..m as u32).filter(|&j| j as usize != i).collect();
                all.sort_by(|&a, &b| distance(a).total_cmp(&distance(b)).then(a.cmp(&b)));
                prop_assert_eq!(nearest.of(i), &all[..k.min(m - 1)]);
                let close: Vec<u32> = all.iter().copied().filter(|&j| distance(j) <= radius).collect();
                prop_assert_eq!(within.of(i), &close[..]);
                for (&j, &d) in within.of(i).iter().zip(within.distances_of(i)) {
                    prop_assert!((d - distance(j)).abs() < 1e-14);
                }
            }
            let symmetric = nearest.symmetric();
            for i in 0..m {
                prop_assert!(nearest.of(i).iter().all(|j| symmetric.of(i).contains(j)));
                prop_assert!(symmetric.of(i).iter().all(|&j| symmetric.of(j as usize).contains(&(i as u32))));
            }
        }
    }

    #[test]
    fn a_lattice_and_equal_points_are_searched_without_trouble() {
        let lattice = Array2::from_shape_fn((400, 3), |(i, k)| [(i / 20) as f64, (i % 20) as f64, 0.0][k]);
        let neighbours = Neighbours::nearest(lattice.view(), 4).unwrap();
        assert_eq!(neighbours.of(21), [1, 20, 22, 41]);
        let equal = Array2::from_elem((100, 3), 1.0);
        assert!((0..100).all(|i| Neighbours::nearest(equal.view(), 5).unwrap().of(i).len() == 5));
        assert!(matches!(Neighbours::nearest(Array2::zeros((0, 3)).view(), 3), Err(CloudError::TooFewPoints { .. })));
        assert!(matches!(Neighbours::within(lattice.view(), f64::NAN), Err(CloudError::BadOption { .. })));
    }
}
