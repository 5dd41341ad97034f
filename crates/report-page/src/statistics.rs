//! Distributions that a page can ask anything of.

/// The values that are not exceeded on the shares 0, 1/n, 2/n, …, 1 of the weight; without weights all count alike. Empty without values.
pub fn quantiles(values: impl Iterator<Item = f64>, weights: &[f64], n: usize) -> Vec<f64> {
    let weight = |i: usize| weights.get(i).copied().unwrap_or(1.0);
    let mut pairs: Vec<(f64, f64)> = values.enumerate().map(|(i, value)| (value, weight(i))).collect();
    pairs.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = pairs.iter().map(|pair| pair.1).sum();
    let Some(&(last, _)) = pairs.last() else { return Vec::new() };
    let mut found = Vec::with_capacity(n + 1);
    let mut below = 0.0;
    for (value, weight) in pairs {
        below += weight;
        while found.len() < n && below > total * found.len() as f64 / n as f64 {
            found.push(value);
        }
    }
    found.resize(n + 1, last);
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_of_the_weight_lie_below() {
        let values = (0..1000).map(f64::from);
        assert_eq!(quantiles(values.clone(), &[], 4), [0.0, 250.0, 500.0, 750.0, 999.0]);
        // The upper half weighs three times as much: half of the weight is reached at two thirds of the way through it.
        let weights: Vec<f64> = (0..1000).map(|i| if i < 500 { 1.0 } else { 3.0 }).collect();
        assert_eq!(quantiles(values, &weights, 2), [0.0, 666.0, 999.0]);
        assert_eq!(quantiles([7.0].into_iter(), &[0.0], 2), [7.0; 3]);
        assert!(quantiles(std::iter::empty(), &[], 2).is_empty());
    }
}
