//! One side for all normals of a cloud.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::neighbours::CloudTree;
use crate::vec3::dot;

/// Neighbours along which an orientation is passed on. Fewer may tear the graph, more may jump between close sheets.
const GRAPH_NEIGHBOURS: usize = 8;

/// Flips `normals` until those of neighbours agree, along a minimum spanning tree with the weight `1 − |nᵢ·nⱼ|`
/// (Hoppe et al. 1992, §3.3), and returns which were flipped.
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
            if i != from as usize && across(tree.points, normals, from as usize, i).0 < 0.0 {
                normals[i] = normals[i].map(|x| -x);
                flipped[i] = true;
            }
            part.push(i);
            sum = std::array::from_fn(|k| sum[k] + normals[i][k]);
            for &j in graph.of(i) {
                if !done[j as usize] {
                    let weight = across(tree.points, normals, i, j as usize).1;
                    heap.push(Reverse((weight.to_bits(), j, at)));
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

pub(crate) fn env(name: &str, d: f64) -> f64 {
    std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(d)
}

fn across(points: &[[f64; 3]], normals: &[[f64; 3]], i: usize, j: usize) -> (f64, f64) {
    use crate::vec3::{sub, unit};
    static O: std::sync::LazyLock<f64> = std::sync::LazyLock::new(|| env("ORIENT", 0.0));
    static P: std::sync::LazyLock<f64> = std::sync::LazyLock::new(|| env("PEN", 1.0));
    let d = dot(normals[i], normals[j]);
    if *O == 0.0 {
        return (d, (1.0 - d.abs()).max(0.0));
    }
    let e = unit(sub(points[j], points[i]));
    let (a, b) = (dot(e, normals[i]), dot(e, normals[j]));
    let r = d - 2.0 * a * b;
    if *O == 2.0 {
        return (r, (1.0 - d.abs()).max(0.0));
    }
    if *O == 3.0 {
        return (r, (1.0 - r.abs()).max(0.0) + *P * (a * a).max(b * b));
    }
    (r, (1.0 - r.abs()).max(0.0) + *P * (a.abs() + b.abs()))
}
