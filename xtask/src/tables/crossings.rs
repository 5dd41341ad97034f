//! Whether a surface passes through itself.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::Result;
use ndarray::Array2;
use thb_core::SplineMap;

type Triangle = [[f64; 3]; 3];

/// Triangles of the samples of a surface on a square grid over a part of the parameter square, and how many pairs of those
/// that share no vertex pass through each other.
///
/// # Errors
/// Those of evaluation.
pub(super) fn count(map: &SplineMap<2>, lower: [f64; 2], upper: [f64; 2], samples: usize) -> Result<usize> {
    let parameters = Array2::from_shape_fn((samples * samples, 2), |(k, d)| {
        let step = [k % samples, k / samples][d] as f64 / (samples - 1) as f64;
        (lower[d] + (upper[d] - lower[d]) * step).clamp(lower[d], upper[d])
    });
    let image = map.eval_batch(parameters.view())?;
    let corner = |k: usize| [image[[k, 0]], image[[k, 1]], image[[k, 2]]];
    let mut triangles: Vec<([usize; 3], Triangle)> = Vec::new();
    for k in (0..samples * (samples - 1)).filter(|k| k % samples + 1 < samples) {
        for t in [[k, k + 1, k + samples], [k + 1, k + samples + 1, k + samples]] {
            triangles.push((t, t.map(corner)));
        }
    }
    // Boxes of about twice the edge of a triangle; only triangles that share one can meet.
    let lengths = triangles.iter().map(|(_, [a, b, _])| length(sub(*a, *b)));
    let edge = 2.0 * lengths.sum::<f64>() / triangles.len() as f64;
    let mut boxes: BTreeMap<[i64; 3], Vec<usize>> = BTreeMap::new();
    for (number, (_, triangle)) in triangles.iter().enumerate() {
        let range = |k: usize| {
            let of = |pick: fn(f64, f64) -> f64| triangle.iter().map(|p| p[k]).reduce(pick).unwrap_or(0.0);
            (of(f64::min) / edge).floor() as i64..=(of(f64::max) / edge).floor() as i64
        };
        for x in range(0) {
            for y in range(1) {
                range(2).for_each(|z| boxes.entry([x, y, z]).or_default().push(number));
            }
        }
    }
    let mut crossing = BTreeSet::new();
    for within in boxes.values() {
        for (at, &i) in within.iter().enumerate() {
            for &j in &within[at + 1..] {
                let ((s, a), (t, b)) = (&triangles[i], &triangles[j]);
                if !s.iter().any(|v| t.contains(v)) && (pierces(a, b) || pierces(b, a)) {
                    crossing.insert((i, j));
                }
            }
        }
    }
    Ok(crossing.len())
}

/// Whether an edge of one triangle passes through the inside of the other.
fn pierces(edges: &Triangle, triangle: &Triangle) -> bool {
    let [a, b, c] = *triangle;
    let volume = |p, q, r, s| dot(cross(sub(q, p), sub(r, p)), sub(s, p));
    (0..3).any(|k| {
        let (p, q) = (edges[k], edges[(k + 1) % 3]);
        let across = volume(a, b, c, p) * volume(a, b, c, q) < 0.0;
        let sides = [volume(p, q, a, b), volume(p, q, b, c), volume(p, q, c, a)];
        across && (sides.iter().all(|&s| s > 0.0) || sides.iter().all(|&s| s < 0.0))
    })
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn length(a: [f64; 3]) -> f64 {
    dot(a, a).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_triangle_is_pierced_or_not() {
        let flat = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let through = [[0.2, 0.2, -1.0], [0.2, 0.2, 1.0], [3.0, 3.0, 1.0]];
        let beside = through.map(|p| [p[0] + 2.0, p[1], p[2]]);
        assert!(pierces(&through, &flat) && pierces(&flat, &through));
        assert!(!pierces(&beside, &flat) && !pierces(&flat, &beside));
    }
}
