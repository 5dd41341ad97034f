//! The graph of neighbours of the interior points of a cloud.

use point_cloud::{CloudTree, Neighbour};
use rayon::prelude::*;

/// Points closer than this, in units of the cloud's longest side, count as equal and are not neighbours: they take
/// their parameters from the same surroundings. A reciprocal distance would tie them to each other and to nothing else.
pub(crate) const COINCIDENT: f64 = 1e-12;

/// The neighbours of every point that is not fixed within `radius`, nearest first, at most `limit` of them, points equal to it
/// counted but left out; nothing for the fixed ones (Imperatore 2024, eq. 4.10).
pub(crate) fn radius_graph(tree: &CloudTree<'_>, fixed: &[bool], radius: f64, limit: Option<usize>) -> Vec<Vec<u32>> {
    let Some(limit) = limit else {
        let row = |i: usize| if fixed[i] { Vec::new() } else { apart(tree.within(i, radius)) };
        return (0..fixed.len()).into_par_iter().map(row).collect();
    };
    tree.map_nearest(limit, |i, near| {
        let mut row: Vec<Neighbour> = near.iter().copied().filter(|n| !fixed[i] && n.0 <= radius).collect();
        row.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        apart(row)
    })
}

/// The rows of neighbours that do not coincide with the point.
pub(crate) fn apart(neighbours: Vec<Neighbour>) -> Vec<u32> {
    neighbours.into_iter().filter(|n| n.0 > COINCIDENT).map(|n| n.1).collect()
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
    fn neighbours_come_by_distance_then_row_and_equal_points_are_left_out() {
        let points = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0; 3], [0.5, 0.0, 0.0], [5.0, 0.0, 0.0]];
        let tree = CloudTree::new(&points).unwrap();
        let fixed = [false, true, true, true, true, true];
        assert_eq!(radius_graph(&tree, &fixed, 1.5, None), [vec![4, 1, 2], vec![], vec![], vec![], vec![], vec![]]);
        assert_eq!(radius_graph(&tree, &fixed, 1.5, Some(2))[0], [4]);
        assert_eq!(apart(tree.nearest(5, 2)), [1, 4]);
    }

    #[test]
    fn paths_to_the_fixed_points_follow_the_direction_of_the_edges() {
        // 0 fixed; 1 -> 0; 2 -> 1; 3 <-> 4; 5 -> 3; edges into 3 from nowhere reached.
        let rows = vec![vec![], vec![0], vec![1], vec![4], vec![3], vec![3]];
        let fixed = [true, false, false, false, false, false];
        assert_eq!(cut_off(&fixed, &rows, |&j| j), [3, 4, 5]);
    }
}
