//! Random numbers and directions.

use std::f64::consts::TAU;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::part::Point;

pub(super) fn between(random: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * random.random::<f64>()
}

/// A whole number, both ends included.
pub(super) fn whole(random: &mut ChaCha8Rng, low: usize, high: usize) -> usize {
    random.random_range(low..=high)
}

/// A rotation, evenly over all (Shoemake 1992), by its rows.
pub(super) fn rotation(random: &mut ChaCha8Rng) -> [Point; 3] {
    let (u, a, b) = (random.random::<f64>(), TAU * random.random::<f64>(), TAU * random.random::<f64>());
    let (s, t) = ((1.0 - u).sqrt(), u.sqrt());
    let (x, y, z, w) = (s * a.sin(), s * a.cos(), t * b.sin(), t * b.cos());
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
        [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
        [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
    ]
}
