//! Voids of clouds over the unit square, and what surfaces do there.

use anyhow::Result;
use ndarray::Array2;
use thb_core::SplineMap;

/// Samples per direction of the square.
const SAMPLES: usize = 160;

/// Radius, in mean spacings, of an empty disk that makes a void.
const EMPTY: f64 = 2.5;

/// Fewest samples of a void.
const FEWEST: usize = 9;

/// Distance, in mean spacings, up to which points are the rim of a void.
const RIM: f64 = 4.5;

/// The voids of a cloud.
#[derive(Debug)]
pub(super) struct Voids {
    voids: Vec<Void>,
}

#[derive(Debug)]
struct Void {
    /// Parameters of samples over the void.
    samples: Vec<[f64; 2]>,
    /// Lowest and highest third coordinate of the rim.
    range: [f64; 2],
}

impl Voids {
    /// The voids among points `(m, 3)` at parameters `(m, 2)`.
    pub(super) fn find(parameters: &Array2<f64>, points: &Array2<f64>) -> Self {
        let spacing = (parameters.nrows() as f64).powf(-0.5);
        let at = |i: usize| (i as f64 + 0.5) / SAMPLES as f64;
        // Nearest point of each sample, by a pass over the samples around each point.
        let mut nearest = vec![f64::MAX; SAMPLES * SAMPLES];
        let around = |u: f64, radius: f64| {
            let index = |x: f64| (x * SAMPLES as f64).clamp(0.0, (SAMPLES - 1) as f64) as usize;
            index(u - radius)..index(u + radius) + 1
        };
        for uv in parameters.outer_iter() {
            for j in around(uv[1], RIM * spacing) {
                for i in around(uv[0], RIM * spacing) {
                    let distance = (at(i) - uv[0]).hypot(at(j) - uv[1]);
                    let target = &mut nearest[j * SAMPLES + i];
                    *target = target.min(distance);
                }
            }
        }
        let empty: Vec<bool> = nearest.iter().map(|&distance| distance > EMPTY * spacing).collect();
        let label = components(&empty);
        let count = label.iter().flatten().max().map_or(0, |last| last + 1);
        let mut voids: Vec<Void> =
            (0..count).map(|_| Void { samples: Vec::new(), range: [f64::MAX, f64::MIN] }).collect();
        for (k, label) in label.iter().enumerate() {
            if let Some(label) = label {
                voids[*label].samples.push([at(k % SAMPLES), at(k / SAMPLES)]);
            }
        }
        for (uv, point) in parameters.outer_iter().zip(points.outer_iter()) {
            for j in around(uv[1], RIM * spacing) {
                for i in around(uv[0], RIM * spacing) {
                    let near = (at(i) - uv[0]).hypot(at(j) - uv[1]) <= RIM * spacing;
                    if let Some(label) = label[j * SAMPLES + i].filter(|_| near) {
                        let [low, high] = &mut voids[label].range;
                        (*low, *high) = (low.min(point[2]), high.max(point[2]));
                    }
                }
            }
        }
        voids.retain(|void| void.samples.len() >= FEWEST);
        Self { voids }
    }

    pub(super) fn len(&self) -> usize {
        self.voids.len()
    }

    /// By how much the third coordinate leaves the range of a rim at most, as a share of that range, and the number of
    /// samples at which the map's first two coordinates turn over.
    pub(super) fn judge(&self, map: &SplineMap<2>) -> Result<(f64, usize)> {
        let (mut beyond, mut folded) = (0.0_f64, 0);
        for Void { samples, range: [low, high] } in &self.voids {
            for &u in samples {
                let z = map.eval(u)?[2];
                beyond = beyond.max((z - high).max(low - z) / (high - low));
                let (a, b) = (map.derivative(u, [1, 0])?, map.derivative(u, [0, 1])?);
                folded += usize::from(a[0] * b[1] - a[1] * b[0] <= 0.0);
            }
        }
        Ok((beyond, folded))
    }
}

/// Numbers the connected parts of a square of flags, row by row; neighbours share an edge.
fn components(flags: &[bool]) -> Vec<Option<usize>> {
    let mut label = vec![None; flags.len()];
    let mut count = 0;
    for start in 0..flags.len() {
        if !flags[start] || label[start].is_some() {
            continue;
        }
        let mut stack = vec![start];
        label[start] = Some(count);
        while let Some(k) = stack.pop() {
            let (i, j) = (k % SAMPLES, k / SAMPLES);
            let neighbours = [
                (i > 0).then(|| k - 1),
                (i + 1 < SAMPLES).then_some(k + 1),
                (j > 0).then(|| k - SAMPLES),
                (j + 1 < SAMPLES).then_some(k + SAMPLES),
            ];
            for next in neighbours.into_iter().flatten().filter(|&next| flags[next]) {
                if label[next].is_none() {
                    label[next] = Some(count);
                    stack.push(next);
                }
            }
        }
        count += 1;
    }
    label
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hole_is_found_with_its_rim() {
        let rows: Vec<[f64; 2]> = (0..2500)
            .map(|k| [(f64::from(k % 50) + 0.5) / 50.0, (f64::from(k / 50) + 0.5) / 50.0])
            .filter(|u| (u[0] - 0.4).hypot(u[1] - 0.6) > 0.15)
            .collect();
        let parameters = Array2::from_shape_fn((rows.len(), 2), |(i, d)| rows[i][d]);
        let points = Array2::from_shape_fn((rows.len(), 3), |(i, _)| rows[i][0]);
        let voids = Voids::find(&parameters, &points);
        assert_eq!(voids.len(), 1);
        let [low, high] = voids.voids[0].range;
        // The void reaches from 0.30 to 0.50 (two and a half spacings from the points), its rim 0.09 further.
        assert!((0.19..0.25).contains(&low) && (0.55..0.61).contains(&high), "{low} {high}");
    }
}
