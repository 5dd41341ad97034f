//! The nearest of some candidates.

use crate::real::vectorized;

/// Most halvings of the bound before those within it are collected or sorted; the result does not depend on it.
const HALVINGS: usize = 16;

/// Distances that are looked at together when those within the bound are collected.
const CHUNK: usize = 16;

/// The nearest candidates of one query.
#[derive(Default)]
pub(super) struct Nearest {
    /// Squared distances.
    pub(super) distances: Vec<f32>,
    /// Candidates within a rough bound, their squared distances and weights.
    places: Vec<u32>,
    near: Vec<f32>,
    near_weights: Vec<u32>,
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
        let mut within = bound;
        vectorized(
            #[inline(always)]
            || within = self.collect(weights, bound, cap),
        );
        self.keys.clear();
        for (&place, distance) in self.places.iter().zip(&self.near) {
            if *distance <= within {
                let distance = u64::from(distance.max(0.0).to_bits()) << 32;
                self.keys.extend(members(place as usize).iter().take(cap).map(|&index| distance | u64::from(index)));
            }
        }
        if self.keys.len() > cap {
            self.keys.select_nth_unstable(cap - 1);
            self.keys.truncate(cap);
        }
        sources.extend(self.keys.iter().map(|key| *key as u32));
        self.keys.len()
    }

    /// Finds a bound that holds at least `cap` points, if that many are within the given one, and seldom more; collects at
    /// least the candidates within it.
    #[inline(always)]
    fn collect(&mut self, weights: &[u32], bound: f32, cap: usize) -> f32 {
        let distances = &self.distances[..];
        // An infinite bound has no middle.
        let bound = if bound.is_finite() { bound } else { distances.iter().fold(0.0, |far: f32, d| far.max(*d)) };
        // PERF: counting is a vector loop, sorting out is not; the bound is first brought near the cap-th distance.
        let rough = halved(distances, weights, [0.0, bound], cap, 2 * cap);
        self.places.resize(distances.len() + CHUNK, 0);
        let mut found = 0;
        for (chunk, distances) in distances.chunks(CHUNK).enumerate() {
            // PERF: neighbours stand together, and most chunks hold none.
            let mut any = false;
            distances.iter().for_each(|d| any |= *d <= rough[1]);
            if any {
                for (k, d) in distances.iter().enumerate() {
                    self.places[found] = (chunk * CHUNK + k) as u32;
                    found += usize::from(*d <= rough[1]);
                }
            }
        }
        self.places.truncate(found);
        self.near.clear();
        self.near_weights.clear();
        for &place in &self.places {
            self.near.push(distances[place as usize]);
            self.near_weights.push(weights[place as usize]);
        }
        halved(&self.near, &self.near_weights, rough, cap, cap)[1]
    }
}

/// Halves an interval that the cap-th distance lies in, if there are that many, until no more than `most` points are below
/// its end.
#[inline(always)]
fn halved(distances: &[f32], weights: &[u32], [mut low, mut high]: [f32; 2], cap: usize, most: usize) -> [f32; 2] {
    let mut inside = count(distances, weights, high);
    for _ in 0..HALVINGS {
        if inside <= most {
            break;
        }
        let middle = 0.5 * (low + high);
        match count(distances, weights, middle) {
            fewer if fewer < cap => low = middle,
            enough => (high, inside) = (middle, enough),
        }
    }
    [low, high]
}

/// The points of all candidates within a bound.
#[inline(always)]
fn count(distances: &[f32], weights: &[u32], bound: f32) -> usize {
    let mut count = 0;
    for (d, w) in distances.iter().zip(weights) {
        count += if *d <= bound { *w } else { 0 };
    }
    count as usize
}
