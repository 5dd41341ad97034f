//! Random choices that follow from the bytes of an input, so that an input is always run alike.

use std::hash::Hasher;

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rustc_hash::FxHasher;

/// A source of choices.
pub(crate) struct Choices(ChaCha8Rng);

impl Choices {
    /// Those that follow from bytes.
    pub(crate) fn of(bytes: &[u8]) -> Self {
        let mut hasher = FxHasher::default();
        hasher.write(bytes);
        Self(ChaCha8Rng::seed_from_u64(hasher.finish()))
    }

    /// Whether something of a probability happens.
    pub(crate) fn with(&mut self, probability: f64) -> bool {
        self.0.random::<f64>() < probability
    }

    /// A number below a bound, which is above 0.
    pub(crate) fn below(&mut self, bound: usize) -> usize {
        (self.0.next_u64() % bound as u64) as usize
    }

    /// One of some.
    pub(crate) fn one_of<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.below(all.len())]
    }

    /// A number from -1 to 1.
    pub(crate) fn signed(&mut self) -> f64 {
        2.0 * self.0.random::<f64>() - 1.0
    }
}
