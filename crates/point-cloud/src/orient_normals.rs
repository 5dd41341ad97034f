//! One side for all normals of a cloud.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::neighbours::CloudTree;
use crate::vec3::{dot, sub, unit};

/// Neighbours along which an orientation is passed on. Fewer may tear the graph, more may jump between close sheets.
const GRAPH_NEIGHBOURS: usize = 8;

/// Weight of leaving the tangent plane against that of turning the normal. Without it the tree jumps between close sheets; at 1
/// steps aslant over a ridge, whose sign is in doubt, go before those straight across.
const OFF_PLANE: f64 = 0.5;

/// Flips `normals` until those of neighbours agree, along a minimum spanning tree (Hoppe et al. 1992, §3.3) over the steps of
/// [`step`], and returns which were flipped.
///
/// The largest component of the sum of the normals of each connected part becomes positive.
pub(crate) fn orient(tree: &CloudTree<'_>, normals: &mut [[f64; 3]]) -> Vec<bool> {
    let graph = tree.all_nearest(GRAPH_NEIGHBOURS).symmetric();
    let mut flipped = vec![false; normals.len()];
    let mut done = vec![false; normals.len()];
    for start in 0..normals.len() {
        if done[start] {
            continue;
        }
        let mut part = Vec::new();
        let mut sum = [0.0f64; 3];
        // Prim's algorithm; the weights are not negative, so their bits sort like the numbers.
        let mut heap = BinaryHeap::from([Reverse((0u64, start as u32, start as u32))]);
        while let Some(Reverse((_, at, from))) = heap.pop() {
            let i = at as usize;
            if done[i] {
                continue;
            }
            done[i] = true;
            if i != start && step(tree.points, normals, from as usize, i).agreement < 0.0 {
                normals[i] = normals[i].map(|x| -x);
                flipped[i] = true;
            }
            part.push(i);
            sum = std::array::from_fn(|k| sum[k] + normals[i][k]);
            for &j in graph.of(i) {
                if !done[j as usize] {
                    heap.push(Reverse((step(tree.points, normals, i, j as usize).weight.to_bits(), j, at)));
                }
            }
        }
        let largest = sum.into_iter().fold(0.0, |l: f64, x| if x.abs() > l.abs() { x } else { l });
        if largest < 0.0 {
            for i in part {
                normals[i] = normals[i].map(|x| -x);
                flipped[i] = !flipped[i];
            }
        }
    }
    flipped
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
