//! One side for all normals of a cloud.

use rayon::prelude::*;

use crate::search::CloudTree;
use crate::vec3::{add, dot, sub, unit};

/// Neighbours along which an orientation is passed on. Fewer may tear the graph, more may jump between close sheets.
const GRAPH_NEIGHBOURS: usize = 8;

/// Weight of leaving the tangent plane against that of turning the normal. Without it the tree jumps between close sheets; at 1
/// steps aslant over a ridge, whose sign is in doubt, go before those straight across.
const OFF_PLANE: f64 = 0.5;

/// Flips `normals` until those of neighbours agree, along a minimum spanning tree (Hoppe et al. 1992, §3.3) over the steps of
/// [`step`], and returns which were flipped.
///
/// The largest component of the sum of the normals of each connected part becomes positive. The tree grows by Kruskal's
/// algorithm, of which only the sorting of the steps counts.
pub(crate) fn orient(tree: &CloudTree<'_>, normals: &mut [[f64; 3]]) -> Vec<bool> {
    let unoriented: &[[f64; 3]] = normals;
    let steps_of = |i: usize| {
        let steps = tree.nearest(i, GRAPH_NEIGHBOURS).into_iter().map(move |(_, j)| {
            let Step { agreement, weight } = step(tree.points, unoriented, i, j as usize);
            // Weights are not negative, so their bits sort like the numbers.
            (weight.to_bits(), [j.min(i as u32), j.max(i as u32)], agreement < 0.0)
        });
        steps.collect::<Vec<_>>()
    };
    let mut steps: Vec<_> = (0..normals.len()).into_par_iter().flat_map_iter(steps_of).collect();
    steps.par_sort_unstable();
    let mut sides = Sides::new(normals.len());
    steps.into_iter().for_each(|(_, [i, j], opposite)| sides.join(i, j, opposite));
    let side: Vec<(u32, bool)> = (0..normals.len() as u32).map(|i| sides.root(i)).collect();
    let mut sums = vec![[0.0; 3]; normals.len()];
    for (normal, &(root, opposite)) in normals.iter().zip(&side) {
        let sum: &mut [f64; 3] = &mut sums[root as usize];
        *sum = if opposite { sub(*sum, *normal) } else { add(*sum, *normal) };
    }
    let points_down =
        |sum: [f64; 3]| sum.into_iter().fold(0.0, |l: f64, x| if x.abs() > l.abs() { x } else { l }) < 0.0;
    let flipped: Vec<bool> =
        side.into_iter().map(|(root, opposite)| opposite != points_down(sums[root as usize])).collect();
    for (normal, _) in normals.iter_mut().zip(&flipped).filter(|(_, flip)| **flip) {
        *normal = normal.map(|x| -x);
    }
    flipped
}

/// Disjoint sets of normals, each on the same side as the one that stands for its set or on the other.
struct Sides(Vec<(u32, bool)>);

impl Sides {
    fn new(n: usize) -> Self {
        Self((0..n as u32).map(|i| (i, false)).collect())
    }

    /// The member that stands for the set of `i`, the smallest, and whether `i` is on the other side.
    fn root(&mut self, mut i: u32) -> (u32, bool) {
        let mut opposite = false;
        while self.0[i as usize].0 != i {
            // Path halving.
            let (up, turn) = self.0[i as usize];
            let (top, further) = self.0[up as usize];
            self.0[i as usize] = (top, turn != further);
            opposite ^= turn != further;
            i = top;
        }
        (i, opposite)
    }

    /// Joins two sets so that `i` and `j` are on the same side, or on opposite ones. Within a set nothing changes.
    fn join(&mut self, i: u32, j: u32, opposite: bool) {
        let ((a, turn_a), (b, turn_b)) = (self.root(i), self.root(j));
        if a != b {
            self.0[a.max(b) as usize] = (a.min(b), turn_a ^ turn_b ^ opposite);
        }
    }
}

/// How an orientation passes from one point to another.
struct Step {
    /// Positive where the normals lie on one side.
    agreement: f64,
    /// Not negative; zero on a plane.
    weight: f64,
}

/// The normal of `i` is carried to `j` along a circular arc, that is, mirrored at the plane halfway between them (Xie et al.,
/// Piecewise C1 continuous surface reconstruction, IEEE Visualization 2003; König & Gumhold, Consistent propagation of normal
/// orientations, VMV 2009): right beyond bends of a right angle, where the plain product of the normals has the wrong sign.
/// A step out of the tangent planes may lead to another sheet, so it weighs more.
fn step(points: &[[f64; 3]], normals: &[[f64; 3]], i: usize, j: usize) -> Step {
    let way = unit(sub(points[j], points[i]));
    let (rise, fall) = (dot(way, normals[i]), dot(way, normals[j]));
    let agreement = dot(normals[i], normals[j]) - 2.0 * rise * fall;
    Step { agreement, weight: (1.0 - agreement.abs()).max(0.0) + OFF_PLANE * (rise.abs() + fall.abs()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_stay_outside_round_a_sharp_ridge() {
        // Two leaves that meet at 80° in the line x = z = 0; the exact normals, with the signs of a coin.
        let (slope, side) = (40f64.to_radians(), 20);
        let mut points = Vec::new();
        let mut outside = Vec::new();
        for leaf in [1.0, -1.0] {
            for k in 0..side * side {
                let (s, y) = ((k / side) as f64 + 0.5, (k % side) as f64 + 0.1 * leaf);
                points.push([s * slope.cos(), y, leaf * s * slope.sin()]);
                outside.push([-slope.sin(), 0.0, leaf * slope.cos()]);
            }
        }
        let mut normals: Vec<[f64; 3]> =
            outside.iter().enumerate().map(|(i, n)| if (i * i) % 7 < 3 { n.map(|x| -x) } else { *n }).collect();
        let tree = CloudTree::new(&points).unwrap();
        let before = normals.clone();
        let flipped = orient(&tree, &mut normals);
        let first = dot(normals[0], outside[0]);
        for i in 0..points.len() {
            assert!(dot(normals[i], outside[i]) * first > 0.5, "{i}");
            assert_eq!(flipped[i], dot(normals[i], before[i]) < 0.0);
        }
    }
}
