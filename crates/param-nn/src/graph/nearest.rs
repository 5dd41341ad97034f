//! The nearest of some candidates.

use crate::real::vectorized;

/// Halvings of the bound before those within it are sorted out; the result does not depend on it.
const HALVINGS: usize = 24;

/// Distances that are looked at together when those within the bound are collected.
const CHUNK: usize = 16;

/// The nearest candidates of one query.
#[derive(Default)]
pub(super) struct Nearest {
    /// Squared distances.
    pub(super) distances: Vec<f32>,
    /// Candidates within the bound, and how many there are.
    places: Vec<u32>,
    found: usize,
    /// Squared distances in the upper half (the bits of positive floats are ordered as they are), indices in the lower.
    keys: Vec<u64>,
}

impl Nearest {
    /// Indices of the `cap` nearest points within the squared distance `bound`; equally far ones by index. Candidate k
    /// stands for the points `members(k)`, ascending, and has the weight `weights[k]`: their number, at most `cap`.
    pub(super) fn search<'a>(
        &mut self,
        weights: &[u32],
        bound: f32,
        cap: usize,
        members: impl Fn(usize) -> &'a [u32],
        sources: &mut Vec<u32>,
    ) -> usize {
        self.places.resize(self.distances.len() + CHUNK, 0);
        vectorized(
            #[inline(always)]
            || self.collect(weights, bound, cap),
        );
        self.keys.clear();
        for &place in &self.places[..self.found] {
            let distance = u64::from(self.distances[place as usize].max(0.0).to_bits()) << 32;
            self.keys.extend(members(place as usize).iter().take(cap).map(|&index| distance | u64::from(index)));
        }
        if self.keys.len() > cap {
            self.keys.select_nth_unstable(cap - 1);
            self.keys.truncate(cap);
        }
        sources.extend(self.keys.iter().map(|key| *key as u32));
        self.keys.len()
    }

    /// All candidates within a bound that holds at least `cap` points, if that many are within the given one.
    #[inline(always)]
    fn collect(&mut self, weights: &[u32], bound: f32, cap: usize) {
        let distances = &self.distances[..];
        // An infinite bound has no middle.
        let bound = if bound.is_finite() { bound } else { distances.iter().fold(0.0, |far: f32, d| far.max(*d)) };
        // PERF: counting is a vector loop, sorting out is not; the bound is brought to the cap-th distance first.
        let count = |bound: f32| {
            distances.iter().zip(weights).map(|(d, w)| if *d <= bound { *w } else { 0 }).sum::<u32>() as usize
        };
        let (mut low, mut high) = (0.0, bound);
        let mut inside = count(bound);
        for _ in 0..HALVINGS {
            if inside <= cap {
                break;
            }
            let middle = 0.5 * (low + high);
            match count(middle) {
                fewer if fewer < cap => low = middle,
                enough => (high, inside) = (middle, enough),
            }
        }
        let mut found = 0;
        for (chunk, distances) in distances.chunks(CHUNK).enumerate() {
            // PERF: neighbours stand together, and most chunks hold none.
            if distances.iter().map(|d| u32::from(*d <= high)).sum::<u32>() > 0 {
                for (k, d) in distances.iter().enumerate() {
                    self.places[found] = (chunk * CHUNK + k) as u32;
                    found += usize::from(*d <= high);
                }
            }
        }
        self.found = found;
    }
}
