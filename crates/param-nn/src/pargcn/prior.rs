//! Logits of weights of largest entropy: what a guided network starts from.

use point_cloud::principal_axes;
use point_cloud::vec3::{dot, sub};

use super::edges::EdgeGraph;

/// Preference for near neighbours: at the radius, a weight has exp(−LOCALITY) of what it has at the centre.
const LOCALITY: f64 = 4.0;

/// Added to the variances that a step divides by, in radii squared. Keeps steps finite where all neighbours lie on one side,
/// and no weights balance them.
const FLOOR: f64 = 1e-3;

/// Newton's steps; from the middle, three to five reach round-off.
const STEPS: usize = 8;

/// Longest step; larger ones overshoot where neighbours are one-sided.
const LONGEST_STEP: f64 = 4.0;

/// Logits of all edges: −β |q|² + μ · q for offsets q in the tangent plane, in radii, with μ such that the weighted mean of
/// the offsets vanishes (Arroyo & Ortiz, Local maximum-entropy approximation schemes, IJNME 65, 2006). Their map reproduces
/// plane clouds.
pub(super) fn logits(graph: &EdgeGraph, points: &[[f64; 3]]) -> Vec<f64> {
    let mut logits = Vec::with_capacity(graph.edges());
    for i in 0..graph.interior {
        let around: Vec<[f64; 3]> = graph.leaving.of(i).iter().map(|&j| points[j as usize]).collect();
        let [_, second, first] = principal_axes(&around).directions;
        let offset = |p: &[f64; 3]| [first, second].map(|axis| dot(axis, sub(*p, points[i])) / graph.radius);
        let offsets: Vec<[f64; 2]> = around.iter().map(offset).collect();
        let multiplier = balance(&offsets);
        logits.extend(offsets.iter().map(|q| logit(*q, multiplier)));
    }
    logits
}

fn logit(q: [f64; 2], multiplier: [f64; 2]) -> f64 {
    multiplier[0] * q[0] + multiplier[1] * q[1] - LOCALITY * (q[0] * q[0] + q[1] * q[1])
}

/// The multiplier μ, by Newton's method on the convex logarithm of the sum of weights.
fn balance(offsets: &[[f64; 2]]) -> [f64; 2] {
    let mut multiplier = [0.0; 2];
    for _ in 0..STEPS {
        let largest = offsets.iter().fold(f64::NEG_INFINITY, |m, q| m.max(logit(*q, multiplier)));
        let (mut total, mut mean, mut square) = (0.0, [0.0; 2], [0.0; 3]);
        for q in offsets {
            let weight = (logit(*q, multiplier) - largest).exp();
            total += weight;
            (0..2).for_each(|k| mean[k] += weight * q[k]);
            for (s, x) in square.iter_mut().zip([q[0] * q[0], q[0] * q[1], q[1] * q[1]]) {
                *s += weight * x;
            }
        }
        mean = mean.map(|x| x / total);
        let a = square[0] / total - mean[0] * mean[0] + FLOOR;
        let b = square[1] / total - mean[0] * mean[1];
        let c = square[2] / total - mean[1] * mean[1] + FLOOR;
        let determinant = a * c - b * b;
        let step = [(c * mean[0] - b * mean[1]) / determinant, (a * mean[1] - b * mean[0]) / determinant];
        let length = step[0].hypot(step[1]);
        let factor = if length > LONGEST_STEP { LONGEST_STEP / length } else { 1.0 };
        (0..2).for_each(|k| multiplier[k] -= factor * step[k]);
    }
    multiplier
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pargcn::solve::{softmax, solve};
    use crate::synthetic::stream;
    use rand::RngExt;

    #[test]
    fn plane_clouds_are_reproduced() {
        let mut random = stream(8, 0);
        let mut uv: Vec<[f64; 2]> = (0..150).map(|_| random.random()).collect();
        for k in 0..40 {
            let t = f64::from(k % 10) / 10.0;
            uv.push([[t, 0.0], [1.0, t], [1.0 - t, 1.0], [0.0, 1.0 - t]][k as usize / 10]);
        }
        let points: Vec<[f64; 3]> = uv.iter().map(|[u, v]| [0.6 * u, 0.6 * v + 0.2 * u, 0.3 * u - 0.5 * v]).collect();
        let graph = EdgeGraph::new(&points, 150, 0.2, 32).unwrap();
        let weights = softmax(&graph, &logits(&graph, &points));
        let (found, _) = solve(&graph, &weights, &uv[150..], |_| Vec::new()).unwrap();
        let worst = found.iter().zip(&uv).map(|(a, b)| (a[0] - b[0]).abs().max((a[1] - b[1]).abs()));
        let worst = worst.fold(0.0, f64::max);
        assert!(worst < 2e-2, "{worst}");
    }
}
