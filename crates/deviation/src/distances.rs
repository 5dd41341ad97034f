//! Statistics of distances.

use rayon::slice::ParallelSliceMut;
use serde::Serialize;

/// Distances, weighed by area: those of samples of one surface to another.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Distances {
    /// Share of the weight at a distance of at most the tolerance.
    pub within: f64,
    /// Mean.
    pub mean: f64,
    /// Root of the mean square.
    pub rms: f64,
    /// Half of the weight has at most this distance.
    pub median: f64,
    /// 95 % of the weight have at most this distance.
    pub p95: f64,
    /// 99 % of the weight have at most this distance.
    pub p99: f64,
    /// Largest distance.
    pub max: f64,
    /// Where that is, on the surface that was sampled.
    pub place: [f64; 3],
}

impl Distances {
    /// The statistics of pairs of distance and weight; all are zero without a weight.
    pub fn of(mut pairs: Vec<(f64, f64)>, tolerance: f64, place: [f64; 3]) -> Self {
        pairs.par_sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let total: f64 = pairs.iter().map(|p| p.1).sum();
        let Some(last) = pairs.last().filter(|_| total > 0.0) else { return Self::default() };
        let mut found = Self { max: last.0, place, ..Self::default() };
        let (mut below, mut mean, mut square) = (0.0, 0.0, 0.0);
        let mut quantiles =
            [(0.5, &mut found.median), (0.95, &mut found.p95), (0.99, &mut found.p99)].into_iter().peekable();
        for &(distance, weight) in &pairs {
            below += weight;
            mean += weight * distance;
            square += weight * distance * distance;
            if distance <= tolerance {
                found.within = below / total;
            }
            while let Some((_, quantile)) = quantiles.next_if(|(share, _)| below >= share * total) {
                *quantile = distance;
            }
        }
        // Round-off may leave the sum of all just short of a share of their sum.
        quantiles.for_each(|(_, quantile)| *quantile = last.0);
        (found.mean, found.rms) = (mean / total, (square / total).sqrt());
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_decide() {
        let pairs = vec![(3.0, 1.0), (1.0, 6.0), (2.0, 3.0)];
        let found = Distances::of(pairs, 2.0, [1.0, 2.0, 3.0]);
        assert_eq!((found.within, found.median, found.p95, found.max), (0.9, 1.0, 3.0, 3.0));
        assert!((found.mean - 1.5).abs() < 1e-15 && (found.rms - 2.7f64.sqrt()).abs() < 1e-15);
        assert_eq!(Distances::of(Vec::new(), 1.0, [0.0; 3]), Distances::default());
    }
}
