//! Statistics of distances.

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
        let (mut total, mut within, mut mean, mut square, mut max) = (0.0, 0.0, 0.0, 0.0, 0.0_f64);
        for &(distance, weight) in &pairs {
            total += weight;
            within += if distance <= tolerance { weight } else { 0.0 };
            mean += weight * distance;
            square += weight * distance * distance;
            max = max.max(distance);
        }
        if total <= 0.0 {
            return Self::default();
        }
        let mut quantiles = [0.5, 0.95, 0.99].map(|share| (share * total, max));
        find_quantiles(&mut pairs, 0.0, &mut quantiles);
        let [median, p95, p99] = quantiles.map(|(_, distance)| distance);
        Self { within: within / total, mean: mean / total, rms: (square / total).sqrt(), median, p95, p99, max, place }
    }
}

/// Sets the distance of each quantile, given by the weight below it, increasing: the first distance with which the weight of `below`
/// and of all smaller ones reaches it. What is never reached, by round-off, stays as it is.
fn find_quantiles(pairs: &mut [(f64, f64)], below: f64, quantiles: &mut [(f64, f64)]) {
    if pairs.is_empty() || quantiles.is_empty() {
        return;
    }
    let middle = pairs.len() / 2;
    let (less, &mut (distance, weight), more) = pairs.select_nth_unstable_by(middle, |a, b| a.0.total_cmp(&b.0));
    let with_less = below + less.iter().map(|p| p.1).sum::<f64>();
    let in_less = quantiles.partition_point(|(asked, _)| *asked <= with_less);
    let (low, rest) = quantiles.split_at_mut(if less.is_empty() { 0 } else { in_less });
    find_quantiles(less, below, low);
    let here = rest.partition_point(|(asked, _)| *asked <= with_less + weight);
    rest[..here].iter_mut().for_each(|(_, found)| *found = distance);
    find_quantiles(more, with_less + weight, &mut rest[here..]);
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

    #[test]
    fn quantiles_are_those_of_sorted_distances() {
        let number = |k: u64| (k.wrapping_mul(6_364_136_223_846_793_005) >> 40) as f64 / f64::from(1 << 24);
        for n in 1..200_u64 {
            // Whole weights and few distances: sums are exact and many distances alike.
            let pairs: Vec<(f64, f64)> =
                (0..n).map(|k| ((9.0 * number(3 * k + n)).floor(), 1.0 + (4.0 * number(7 * k + n)).floor())).collect();
            let mut sorted = pairs.clone();
            sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
            let total: f64 = sorted.iter().map(|p| p.1).sum();
            let quantile = |share: f64| {
                let mut below = 0.0;
                let reaches = |p: &&(f64, f64)| {
                    below += p.1;
                    below >= share * total
                };
                sorted.iter().find(reaches).unwrap().0
            };
            let found = Distances::of(pairs, 4.0, [0.0; 3]);
            assert_eq!([found.median, found.p95, found.p99], [0.5, 0.95, 0.99].map(quantile), "{n}");
        }
    }
}
