//! Searches among the points of a cloud.

use std::num::NonZero;

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;

use crate::CloudError;
use crate::neighbour_lists::{Neighbour, Neighbours, order};

/// Points that search together, fewest and most: more share one search of the tree, but look through more points far from each.
const SEARCHED_TOGETHER: [usize; 2] = [12, 32];

/// Slices of more points are halved by two threads.
const HALVED_IN_PARALLEL: usize = 4096;

/// Distances are computed to a few units of round-off; this factor on a bound of theirs keeps it one.
const ROUND_OFF: f64 = 1.0 + 1e-9;

/// A search tree over points, which are named by their rows.
pub struct CloudTree<'a, const N: usize = 3> {
    pub(crate) points: &'a [[f64; N]],
    tree: ImmutableKdTree<f64, N>,
    /// Answers to the questions that several steps ask, searched once.
    known: Option<Known>,
}

/// The nearest neighbours of all points, up to some number.
struct Known {
    neighbours: Neighbours,
    count: usize,
}

impl<'a, const N: usize> CloudTree<'a, N> {
    /// A tree over `points` with finite coordinates. O(m log m).
    ///
    /// # Errors
    /// [`CloudError::TooFewPoints`] without a point.
    pub fn new(points: &'a [[f64; N]]) -> Result<Self, CloudError> {
        let too_few = CloudError::TooFewPoints { given: points.len(), required: 1 };
        if points.is_empty() {
            return Err(too_few);
        }
        // Construction fails only for clouds beyond 2^32 points.
        let tree = ImmutableKdTree::new_from_slice(points).map_err(|_| too_few)?;
        Ok(Self { points, tree, known: None })
    }

    /// Searches the `count` nearest neighbours of all points at once and keeps them: 12 bytes each.
    pub(crate) fn with_known(self, count: usize) -> Self {
        let neighbours = self.all_nearest(count);
        Self { known: Some(Known { neighbours, count }), ..self }
    }

    /// The `k` nearest neighbours of point `i`, itself left out, by distance and then by row.
    pub fn nearest(&self, i: usize, k: usize) -> Vec<Neighbour> {
        if let Some(Known { neighbours, .. }) = self.known.as_ref().filter(|known| k <= known.count) {
            let pairs = neighbours.distances_of(i).iter().zip(neighbours.of(i));
            return pairs.take(k).map(|(&d, &j)| (d, j)).collect();
        }
        self.nearest_within(i, k, f64::MAX.sqrt())
    }

    /// Those of the `k` nearest neighbours of point `i` at a distance of at most `radius`, by distance and then by row.
    /// Which of equally far ones the number cuts off is up to the tree.
    pub fn nearest_within(&self, i: usize, k: usize, radius: f64) -> Vec<Neighbour> {
        // One more than asked for: the point finds itself.
        let count = NonZero::new(k.min(self.points.len() - 1) + 1).unwrap_or(NonZero::<usize>::MIN);
        let query = self.tree.query(&self.points[i]);
        let found = query.nearest_n::<SquaredEuclidean<f64>>(count).within(radius * radius).execute();
        let mut list = others(i, found.iter().map(|f| (f.distance, f.item)));
        list.truncate(k);
        list
    }

    /// The `k` points nearest to a place, by distance and then by row.
    pub(crate) fn nearest_to(&self, place: [f64; N], k: usize) -> Vec<Neighbour> {
        let count = NonZero::new(k.min(self.points.len())).unwrap_or(NonZero::<usize>::MIN);
        let found = self.tree.query(&place).nearest_n::<SquaredEuclidean<f64>>(count).execute();
        let mut list: Vec<Neighbour> = found.iter().map(|f| (f.distance.sqrt(), f.item)).collect();
        list.sort_unstable_by(order);
        list
    }

    /// The neighbours of point `i` at a distance of at most `radius`, by distance and then by row.
    pub fn within(&self, i: usize, radius: f64) -> Vec<Neighbour> {
        let query = self.tree.query(&self.points[i]);
        let found = query.within::<SquaredEuclidean<f64>>(radius * radius).unsorted().execute();
        others(i, found.iter().map(|f| (f.distance, f.item)))
    }

    /// Distance of a place to the nearest point.
    pub fn distance(&self, place: [f64; N]) -> f64 {
        self.closest(place).0
    }

    /// The point nearest to a place.
    pub fn closest(&self, place: [f64; N]) -> Neighbour {
        let found = self.tree.query(&place).nearest_one::<SquaredEuclidean<f64>>().execute();
        (found.distance.sqrt(), found.item)
    }

    /// Calls `visit` with every point at a distance of at most `radius` from point `i`, itself included, in no order.
    pub(crate) fn for_each_within(&self, i: usize, radius: f64, mut visit: impl FnMut(u32)) {
        let query = self.tree.query(&self.points[i]);
        let found = query.within::<SquaredEuclidean<f64>>(radius * radius).unsorted().execute();
        found.iter().for_each(|f| visit(f.item));
    }

    pub(crate) fn all_nearest(&self, k: usize) -> Neighbours {
        Neighbours::from_lists(&self.map_nearest(k, |_, near| {
            near.sort_unstable_by(order);
            near.to_vec()
        }))
    }

    /// What `make` makes of each point and its `k` nearest neighbours, which come in an order that only depends on the cloud.
    ///
    /// Points close together search together, several times as fast as alone.
    pub fn map_nearest<T: Send>(&self, k: usize, make: impl Fn(usize, &mut [Neighbour]) -> T + Sync) -> Vec<T> {
        let m = self.points.len();
        if self.known.as_ref().is_some_and(|known| k <= known.count) {
            return (0..m).into_par_iter().map(|i| make(i, &mut self.nearest(i, k))).collect();
        }
        let [fewest, most] = SEARCHED_TOGETHER;
        let size = (k / 8).clamp(fewest, most);
        let mut rows: Vec<u32> = (0..m as u32).collect();
        cluster(self.points, &mut rows, size);
        let together = |cluster: &[u32]| {
            let mut made = Vec::with_capacity(cluster.len());
            self.search_together(cluster, k.min(m - 1), |i, near| made.push((i, make(i, near))));
            made
        };
        let mut made: Vec<(usize, T)> = rows.par_chunks(size).flat_map_iter(together).collect();
        made.par_sort_unstable_by_key(|(i, _)| *i);
        made.into_iter().map(|(_, made)| made).collect()
    }

    /// Visits each point of a cluster with its `k` nearest neighbours, `k` below the number of points.
    ///
    /// Where the middle point of the cluster has its `k` nearest within a radius, a point at the distance `d` from the middle
    /// has its own within that radius and `d`: all of them lie in one ball round the middle.
    fn search_together(&self, cluster: &[u32], k: usize, mut visit: impl FnMut(usize, &mut [Neighbour])) {
        let place = |i: u32| self.points[i as usize];
        let share = 1.0 / cluster.len() as f64;
        let center = cluster
            .iter()
            .fold([0.0; N], |sum, &i| std::array::from_fn(|c| sum[c] + share * self.points[i as usize][c]));
        let off_center = |i: u32| squared_distance(place(i), center);
        let Some(&middle) = cluster.iter().min_by(|&&i, &&j| off_center(i).total_cmp(&off_center(j))) else { return };
        let radius = self.nearest(middle as usize, k).last().map_or(0.0, |n| n.0);
        let from_middle = |i: u32| squared_distance(place(i), place(middle)).sqrt();
        let spread = cluster.iter().map(|&i| from_middle(i)).fold(0.0, f64::max);
        let mut ball: Vec<([f64; N], u32)> = Vec::new();
        // Over a gap or next to a much denser part the ball would hold far too many points.
        if spread <= radius {
            self.for_each_within(middle as usize, (radius + 2.0 * spread) * ROUND_OFF, |j| ball.push((place(j), j)));
        }
        let mut near = vec![(0.0, 0); ball.len()];
        for &i in cluster {
            let own = place(i);
            let bound = ((radius + from_middle(i)) * ROUND_OFF).powi(2);
            let mut count = 0;
            for &(p, j) in &ball {
                // Written in any case and kept or not: a branch here would be guessed wrongly half of the time.
                near[count] = (squared_distance(p, own), j);
                count += usize::from(near[count].0 <= bound && j != i);
            }
            if count < k {
                visit(i as usize, &mut self.nearest(i as usize, k));
                continue;
            }
            if count > k {
                near[..count].select_nth_unstable_by(k, order);
            }
            near[..k].iter_mut().for_each(|n| n.0 = n.0.sqrt());
            visit(i as usize, &mut near[..k]);
        }
    }
}

/// Brings `rows` into an order in which every chunk of `size` points lies close together: they are halved, whole
/// chunks to a half, across the longest side of their box.
fn cluster<const N: usize>(points: &[[f64; N]], rows: &mut [u32], size: usize) {
    if rows.len() <= size {
        return;
    }
    let (mut lower, mut upper) = ([f64::INFINITY; N], [f64::NEG_INFINITY; N]);
    for &i in rows.iter() {
        lower = std::array::from_fn(|c| lower[c].min(points[i as usize][c]));
        upper = std::array::from_fn(|c| upper[c].max(points[i as usize][c]));
    }
    let side = |c: usize| upper[c] - lower[c];
    let axis = (0..N).max_by(|&a, &b| side(a).total_cmp(&side(b))).unwrap_or(0);
    let along = |i: u32| points[i as usize][axis];
    let middle = (rows.len() / 2).next_multiple_of(size);
    rows.select_nth_unstable_by(middle, |&i, &j| along(i).total_cmp(&along(j)).then(i.cmp(&j)));
    let parallel = rows.len() > HALVED_IN_PARALLEL;
    let (first, second) = rows.split_at_mut(middle);
    if parallel {
        rayon::join(|| cluster(points, first, size), || cluster(points, second, size));
    } else {
        cluster(points, first, size);
        cluster(points, second, size);
    }
}

/// The neighbours of point `i` from squared distances, in order, itself left out.
fn others(i: usize, found: impl Iterator<Item = Neighbour>) -> Vec<Neighbour> {
    let mut list: Vec<_> = found.filter(|f| f.1 as usize != i).map(|(d, j)| (d.sqrt(), j)).collect();
    list.sort_unstable_by(order);
    list
}

fn squared_distance<const N: usize>(a: [f64; N], b: [f64; N]) -> f64 {
    (0..N).map(|c| (a[c] - b[c]) * (a[c] - b[c])).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        /// Whatever the cloud: even, in clumps, on a line, with equal points.
        #[test]
        fn searching_together_finds_what_each_point_finds_alone(
            places in prop::collection::vec(prop::array::uniform3(-1.0..1.0f64), 2..400),
            power in 1i32..6, flat in any::<bool>(), k in 0usize..60,
        ) {
            let shape = |p: [f64; 3]| if flat { [p[0].powi(power), 0.25 * (4.0 * p[1]).round(), 0.0] } else { p.map(|x| x.powi(power)) };
            let points: Vec<[f64; 3]> = places.into_iter().map(shape).collect();
            let tree = CloudTree::new(&points).unwrap();
            let together = tree.map_nearest(k, |i, near| {
                near.sort_unstable_by(order);
                (i, near.to_vec())
            });
            for (i, (at, near)) in together.into_iter().enumerate() {
                prop_assert_eq!(at, i);
                // Which of equally far points the number cuts off may differ.
                let distances = |near: &[Neighbour]| near.iter().map(|n| n.0).collect::<Vec<f64>>();
                prop_assert_eq!(distances(&near), distances(&tree.nearest(i, k)));
                prop_assert!(near.is_sorted_by(|a, b| order(a, b).is_lt()));
                prop_assert!(near.iter().all(|n| n.1 as usize != i));
            }
        }
    }

    #[test]
    fn places_and_bounded_numbers_are_searched() {
        let points = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 0.0], [5.0, 0.0]];
        let tree = CloudTree::new(&points).unwrap();
        assert_eq!(tree.distance([4.0, 0.0]), 1.0);
        assert_eq!(tree.within(0, 1.0), [(0.5, 3), (1.0, 1), (1.0, 2)]);
        assert_eq!(tree.nearest_within(0, 1, 1.0), [(0.5, 3)]);
        assert_eq!(tree.nearest_within(0, 9, 0.75), [(0.5, 3)]);
        assert!(matches!(CloudTree::<2>::new(&[]), Err(CloudError::TooFewPoints { .. })));
    }
}
