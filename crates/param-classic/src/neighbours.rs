//! Neighbours of the interior points of a cloud: the radius graph.

use std::num::NonZero;

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;

use crate::ParamError;

/// Points closer than this, in units of the cloud's longest side, count as equal and are not neighbours: they take
/// their parameters from the same surroundings. A reciprocal distance would tie them to each other and to nothing else.
pub(crate) const COINCIDENT: f64 = 1e-12;

/// Neighbour queries on a cloud.
pub(crate) struct Neighbours<'a, const N: usize> {
    points: &'a [[f64; N]],
    tree: ImmutableKdTree<f64, N>,
}

impl<'a, const N: usize> Neighbours<'a, N> {
    /// Indexes finite points.
    pub(crate) fn new(points: &'a [[f64; N]]) -> Result<Self, ParamError> {
        let tree = ImmutableKdTree::new_from_slice(points)
            .map_err(|e| ParamError::NeighbourSearch { points: points.len(), reason: format!("{e:?}") })?;
        Ok(Self { points, tree })
    }

    /// The neighbours of point `i` within `radius` but not equal to it, nearest first, at most `limit` of them, points
    /// equal to `i` counted. Equally far ones are ordered by index; which of them the limit cuts off is up to the tree.
    pub(crate) fn within(&self, i: usize, radius: f64, limit: Option<usize>) -> Vec<u32> {
        let query = self.tree.query(&self.points[i]);
        let squared = radius * radius;
        let found: Vec<(f64, u32)> = match limit.and_then(|l| NonZero::new(l + 1)) {
            Some(limit) => query
                .nearest_n::<SquaredEuclidean<f64>>(limit)
                .within(squared)
                .execute()
                .into_iter()
                .map(|n| (n.distance, n.item))
                .collect(),
            None => query
                .within::<SquaredEuclidean<f64>>(squared)
                .execute()
                .into_iter()
                .map(|n| (n.distance, n.item))
                .collect(),
        };
        self.ordered(found, limit.unwrap_or(usize::MAX))
    }

    /// The `count` nearest points that are not equal to point `i`, nearest first.
    pub(crate) fn nearest(&self, i: usize, count: usize) -> Vec<u32> {
        self.within(i, f64::MAX.sqrt(), Some(count))
    }

    /// Distance of a place to the nearest point.
    pub(crate) fn distance(&self, place: [f64; N]) -> f64 {
        self.tree.query(&place).nearest_one::<SquaredEuclidean<f64>>().execute().distance.sqrt()
    }

    fn ordered(&self, mut found: Vec<(f64, u32)>, limit: usize) -> Vec<u32> {
        found.retain(|&(squared, _)| squared > COINCIDENT * COINCIDENT);
        found.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        found.into_iter().take(limit).map(|(_, j)| j).collect()
    }

    /// The neighbours of every point that is not fixed; nothing for the fixed ones (Imperatore 2024, eq. 4.10).
    pub(crate) fn graph(&self, fixed: &[bool], radius: f64, limit: Option<usize>) -> Vec<Vec<u32>> {
        let row = |i: usize| if fixed[i] { Vec::new() } else { self.within(i, radius, limit) };
        (0..fixed.len()).into_par_iter().map(row).collect()
    }
}

/// The points that are not fixed and from which no path along `neighbours` leads to a fixed one, increasing.
pub(crate) fn cut_off<T>(fixed: &[bool], neighbours: &[Vec<T>], target: impl Fn(&T) -> u32) -> Vec<u32> {
    // Backwards along the edges, from all fixed points at once.
    let mut starts = vec![0usize; fixed.len() + 1];
    neighbours.iter().flatten().for_each(|n| starts[target(n) as usize + 1] += 1);
    for j in 0..fixed.len() {
        starts[j + 1] += starts[j];
    }
    let mut filled = starts.clone();
    let mut sources = vec![0u32; starts[fixed.len()]];
    for (i, row) in neighbours.iter().enumerate() {
        for n in row {
            let place = &mut filled[target(n) as usize];
            sources[*place] = i as u32;
            *place += 1;
        }
    }
    let mut reached = fixed.to_vec();
    let mut stack: Vec<u32> = (0..fixed.len() as u32).filter(|&i| fixed[i as usize]).collect();
    while let Some(j) = stack.pop() {
        for &i in &sources[starts[j as usize]..starts[j as usize + 1]] {
            if !reached[i as usize] {
                reached[i as usize] = true;
                stack.push(i);
            }
        }
    }
    (0..fixed.len() as u32).filter(|&i| !reached[i as usize]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_come_by_distance_then_index_and_equal_points_are_left_out() {
        let points = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 0.0], [0.5, 0.0], [5.0, 0.0]];
        let neighbours = Neighbours::new(&points).unwrap();
        assert_eq!(neighbours.within(0, 1.5, None), [4, 1, 2]);
        assert_eq!(neighbours.within(0, 1.5, Some(2)), [4]);
        assert_eq!(neighbours.nearest(5, 2), [1, 4]);
        assert_eq!(neighbours.distance([4.0, 0.0]), 1.0);
    }

    #[test]
    fn paths_to_the_fixed_points_follow_the_direction_of_the_edges() {
        // 0 fixed; 1 -> 0; 2 -> 1; 3 <-> 4; 5 -> 3; edges into 3 from nowhere reached.
        let rows = vec![vec![], vec![0], vec![1], vec![4], vec![3], vec![3]];
        let fixed = [true, false, false, false, false, false];
        assert_eq!(cut_off(&fixed, &rows, |&j| j), [3, 4, 5]);
    }
}
