//! What the moves of a point's neighbours say of its own.

use fit_ls::SortedPoints;
use rayon::prelude::*;
use thb_core::SmallCholesky;

use crate::points::vector::point;
use crate::points::vector::{Vector, difference, dot};

/// Share of the variance of the neighbours that is added to each direction: it keeps the slopes of one-sided and of flat neighbourhoods, which have
/// no variance along their normal, small.
const RIDGE: f64 = 0.05;

/// Points of one parallel task.
const CHUNK: usize = 1024;

/// For each point weights of the ends of its edges in a triangulation, which sum to 1: the value at the point of the affine function
/// of the place in space that fits what the neighbours have, weighted by the reciprocals of their distances.
#[derive(Clone, Debug)]
pub(crate) struct NeighbourWeights {
    /// Where the neighbours of each point begin, and where the last ones end.
    offsets: Vec<usize>,
    /// Neighbours with their weights.
    entries: Vec<(u32, f64)>,
}

impl NeighbourWeights {
    /// The weights of neighbours in triangles, by indices of points. Points of weight 0 are nobody's neighbours.
    pub(crate) fn new<const D: usize>(triangles: &[[u32; 3]], points: &SortedPoints<D>) -> Self {
        let places = points.places();
        let point = |i: u32| point(points, places[i as usize]);
        let mut edges: Vec<[u32; 2]> =
            triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, a], [b, c], [c, b], [c, a], [a, c]]).collect();
        edges.par_sort_unstable();
        edges.dedup();
        let counts = |i: u32| points.weights().is_none_or(|weights| weights[places[i as usize]] > 0.0);
        edges.retain(|&[a, b]| counts(b) && point(a) != point(b));
        let offsets: Vec<usize> =
            (0..=points.len()).map(|i| edges.partition_point(|edge| (edge[0] as usize) < i)).collect();
        let rings = offsets.par_windows(2).with_min_len(CHUNK).map(|ends| {
            let ring = &edges[ends[0]..ends[1]];
            let ways: Vec<Vector> = ring.iter().map(|&[a, b]| difference(&point(b), &point(a))).collect();
            ring.iter().map(|edge| edge[1]).zip(affine_weights(&ways)).collect::<Vec<_>>()
        });
        let entries = rings.collect::<Vec<_>>().concat();
        Self { offsets, entries }
    }

    /// Whether no point has neighbours.
    pub(crate) fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// The neighbours of a point and their weights; none where it belongs to no triangle.
    pub(crate) fn of(&self, index: usize) -> &[(u32, f64)] {
        &self.entries[self.offsets[index]..self.offsets[index + 1]]
    }
}

/// Weights of values at the ends of some ways, none of them zero, that give the value of their affine fit where the ways start.
fn affine_weights(ways: &[Vector]) -> Vec<f64> {
    let mut weights: Vec<f64> = ways.iter().map(|way| dot(way, way).sqrt().recip()).collect();
    let sum: f64 = weights.iter().sum();
    weights.iter_mut().for_each(|w| *w /= sum);
    let mean: [f64; 3] = std::array::from_fn(|k| weights.iter().zip(ways).map(|(w, way)| w * way[k]).sum());
    let away: Vec<[f64; 3]> = ways.iter().map(|way| std::array::from_fn(|k| way[k] - mean[k])).collect();
    let moment = |a: usize, b: usize| weights.iter().zip(&away).map(|(w, x)| w * x[a] * x[b]).sum::<f64>();
    let variance: [[f64; 3]; 3] = std::array::from_fn(|a| std::array::from_fn(|b| moment(a, b)));
    let total = (0..3).map(|k| variance[k][k]).sum::<f64>();
    // A single neighbour has no variance, and says all there is.
    let Some(factor) = SmallCholesky::new(&variance, &[RIDGE * total; 3], [true; 3]) else { return weights };
    let slope = factor.step(&mean);
    for (weight, x) in weights.iter_mut().zip(&away) {
        *weight *= 1.0 + (0..3).map(|k| slope[k] * x[k]).sum::<f64>();
    }
    weights
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_affine_function_is_reproduced_inside_and_nearly_at_a_rim() {
        let value = |x: &Vector| 3.0 + 2.0 * x[0] - 0.7 * x[1];
        let at = |angle: f64, radius: f64| [radius * angle.cos(), radius * angle.sin(), 0.0, 0.0];
        let ring = |angles: std::ops::Range<i32>| -> Vec<Vector> {
            angles.map(|k| at(f64::from(k), 1.0 + 0.3 * f64::from(k % 3))).collect()
        };
        for (ways, error) in [(ring(0..6), 0.03), (ring(0..3), 0.5)] {
            let weights = affine_weights(&ways);
            assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-14);
            let mean = |values: &[f64]| weights.iter().zip(values).map(|(w, x)| w * x).sum::<f64>();
            let values: Vec<f64> = ways.iter().map(value).collect();
            assert!((mean(&values) - 3.0).abs() < error, "{} of {} neighbours", mean(&values), ways.len());
        }
        assert_eq!(affine_weights(&[at(1.0, 2.0)]), [1.0]);
    }
}
