//! The order of points that are known to lie on one closed curve.

use ndarray::{ArrayView2, Axis};

use crate::CloudError;
use crate::edges::DisjointSets;
use crate::neighbour_lists::Neighbours;
use crate::neighbours::rows;

/// Neighbours that an edge of the loop may lead to. Along a curve two would do; ragged rims double back.
const CANDIDATES: usize = 12;

/// Most rounds of untangling; each shortens the loop.
const ROUNDS: usize = 30;

/// Orders `points`, shape `(n, 3)`, along the closed curve they were taken from: their rows, once round, beginning with row 0.
///
/// The shortest edges between near neighbours that make paths are taken first, the paths are joined at their nearest
/// ends, and crossings are undone while that shortens the loop (2-opt; Croes, A method for solving traveling-salesman
/// problems, Operations Research 6, 1958). Right where the points are closer along the curve than across it.
///
/// # Errors
/// [`CloudError::TooFewPoints`] for fewer than 3 points; those of [`Neighbours::nearest`].
pub fn order_loop(points: ArrayView2<'_, f64>) -> Result<Vec<u32>, CloudError> {
    let places = rows(points)?;
    let n = places.len();
    if n < 3 {
        return Err(CloudError::TooFewPoints { given: n, required: 3 });
    }
    let distance =
        |i: u32, j: u32| (0..3).map(|k| (places[i as usize][k] - places[j as usize][k]).powi(2)).sum::<f64>().sqrt();
    let near = Neighbours::nearest(points, CANDIDATES)?;
    let mut edges: Vec<(f64, u32, u32)> = (0..n)
        .flat_map(|i| {
            near.of(i).iter().zip(near.distances_of(i)).map(move |(&j, &d)| (d, j.min(i as u32), j.max(i as u32)))
        })
        .collect();
    edges.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut paths = Paths { next: vec![Vec::new(); n], sets: DisjointSets::new(n) };
    edges.iter().for_each(|&(_, i, j)| paths.join(i, j));
    paths.join_ends(distance);
    let mut order = paths.walk();
    untangle(&mut order, &near, distance);
    let start = order.iter().position(|&i| i == 0).unwrap_or(0);
    order.rotate_left(start);
    Ok(order)
}

/// Length of the closed polygon through `points`, shape `(n, N)`, in their order.
pub fn loop_length(points: ArrayView2<'_, f64>) -> f64 {
    let n = points.nrows();
    (0..n)
        .map(|i| {
            let (a, b) = (points.index_axis(Axis(0), i), points.index_axis(Axis(0), (i + 1) % n));
            a.iter().zip(b).map(|(x, y)| (x - y).powi(2)).sum::<f64>().sqrt()
        })
        .sum()
}

/// Points joined to open paths: each has at most two neighbours, and no path closes.
struct Paths {
    next: Vec<Vec<u32>>,
    sets: DisjointSets,
}

impl Paths {
    fn join(&mut self, i: u32, j: u32) {
        let free = |p: u32| self.next[p as usize].len() < 2;
        if free(i) && free(j) && self.sets.root(i) != self.sets.root(j) {
            self.sets.join(i, j);
            self.next[i as usize].push(j);
            self.next[j as usize].push(i);
        }
    }

    /// Joins the paths to one, nearest ends first.
    fn join_ends(&mut self, distance: impl Fn(u32, u32) -> f64) {
        loop {
            let ends: Vec<u32> = (0..self.next.len() as u32).filter(|&p| self.next[p as usize].len() < 2).collect();
            let roots: Vec<u32> = ends.iter().map(|&p| self.sets.root(p)).collect();
            let nearest_end = |a: usize| {
                (0..ends.len())
                    .filter(|&b| roots[b] != roots[a])
                    .map(|b| (distance(ends[a], ends[b]), ends[a], ends[b]))
                    .min_by(|x, y| x.0.total_cmp(&y.0))
            };
            // The nearest end of each end, shortest first: each round halves the number of paths at least.
            let mut bridges: Vec<(f64, u32, u32)> = (0..ends.len()).filter_map(nearest_end).collect();
            if bridges.is_empty() {
                return;
            }
            bridges.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
            bridges.iter().for_each(|&(_, i, j)| self.join(i, j));
        }
    }

    /// The points of the one path from end to end.
    fn walk(&self) -> Vec<u32> {
        let first = (0..self.next.len()).find(|&p| self.next[p].len() < 2).unwrap_or(0) as u32;
        let mut order = vec![first];
        let mut before = first;
        let mut at = self.next[first as usize].first().copied();
        while let Some(point) = at {
            order.push(point);
            at = self.next[point as usize].iter().copied().find(|&p| p != before);
            before = point;
        }
        order
    }
}

/// Replaces pairs of edges by the other pair that keeps the loop one, while that shortens it.
fn untangle(order: &mut [u32], near: &Neighbours, distance: impl Fn(u32, u32) -> f64) {
    let n = order.len();
    let mut place = vec![0; n];
    order.iter().enumerate().for_each(|(at, &p)| place[p as usize] = at);
    for _ in 0..ROUNDS {
        let mut changed = false;
        for point in 0..n as u32 {
            let a = place[point as usize];
            let after = order[(a + 1) % n];
            let length = distance(point, after);
            let better = near.of(point as usize).iter().copied().find(|&other| {
                let far = order[(place[other as usize] + 1) % n];
                let now = length + distance(other, far);
                other != after && distance(point, other) + distance(after, far) < now * (1.0 - 1e-12)
            });
            let Some(other) = better else { continue };
            let (first, last) = (a.min(place[other as usize]) + 1, a.max(place[other as usize]));
            order[first..=last].reverse();
            (first..=last).for_each(|at| place[order[at] as usize] = at);
            changed = true;
        }
        if !changed {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    /// Points of a star-shaped curve in space, shuffled by a step coprime to their number.
    fn star(n: usize, step: usize) -> Array2<f64> {
        Array2::from_shape_fn((n, 3), |(i, k)| {
            let t = (i * step % n) as f64 / n as f64 * std::f64::consts::TAU;
            let r = 1.0 + 0.4 * (5.0 * t).cos();
            [r * t.cos(), r * t.sin(), 0.3 * (2.0 * t).sin()][k]
        })
    }

    #[test]
    fn a_shuffled_curve_comes_back_in_order() {
        for (n, step) in [(7, 3), (60, 23), (401, 163)] {
            let points = star(n, step);
            let in_order = star(n, 1);
            let order: Vec<usize> = order_loop(points.view()).unwrap().iter().map(|&i| i as usize).collect();
            let mut rows = order.clone();
            rows.sort_unstable();
            assert_eq!(rows, (0..n).collect::<Vec<_>>());
            let length = loop_length(points.select(Axis(0), &order).view());
            let exact = loop_length(in_order.view());
            assert!((length - exact).abs() < 1e-9 * exact, "{n}: {length} against {exact}");
        }
    }
}
