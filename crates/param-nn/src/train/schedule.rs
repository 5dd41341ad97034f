//! What the published trainings share: a fixed set of items in a new order each epoch, and rates that fall on plateaus.

use rand::RngExt;

use super::state::needed;
use crate::archive::Archive;
use crate::error::NnError;
use crate::synthetic::stream;

/// Streams of the orders, counted down from here; items count from 0 on, initial weights have the last one.
const ORDER_STREAM: u64 = u64::MAX - 1;

/// PyTorch's defaults for rates that fall on plateaus, which the public code of BIDGCN takes: the factor, the epochs without
/// a new best, and what counts as one.
const FACTOR: f64 = 0.1;
const PATIENCE: u32 = 10;
const BETTER: f64 = 1.0 - 1e-4;

/// A fixed set of items, each taken once an epoch.
#[derive(Clone, Debug)]
pub(super) struct Epochs {
    count: u64,
    shuffled: Option<u64>,
    order: Vec<u64>,
}

impl Epochs {
    pub(super) fn new(count: u64) -> Self {
        Self { count, shuffled: None, order: Vec::new() }
    }

    /// The item of a step.
    pub(super) fn item(&mut self, seed: u64, step: u64) -> u64 {
        let epoch = step / self.count;
        if self.shuffled != Some(epoch) {
            let mut random = stream(seed, ORDER_STREAM - epoch);
            self.order = (0..self.count).collect();
            for k in (1..self.order.len()).rev() {
                self.order.swap(k, random.random_range(0..=k));
            }
            self.shuffled = Some(epoch);
        }
        self.order[(step % self.count) as usize]
    }
}

/// A rate that is lowered where the mean loss of an epoch no longer falls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Plateau {
    /// Steps of an epoch.
    epoch: u64,
    factor: f64,
    best: f64,
    waited: u32,
    sum: f64,
}

impl Plateau {
    pub(super) fn new(epoch: u64) -> Self {
        Self { epoch, factor: 1.0, best: f64::INFINITY, waited: 0, sum: 0.0 }
    }

    /// The share of the first rate.
    pub(super) fn factor(&self) -> f64 {
        self.factor
    }

    /// After a step with a loss.
    pub(super) fn advance(&mut self, step: u64, loss: f64) {
        self.sum += loss;
        if !(step + 1).is_multiple_of(self.epoch) {
            return;
        }
        let sum = std::mem::take(&mut self.sum);
        if sum < BETTER * self.best {
            (self.best, self.waited) = (sum, 0);
            return;
        }
        self.waited += 1;
        if self.waited > PATIENCE {
            (self.factor, self.waited) = (FACTOR * self.factor, 0);
        }
    }

    pub(super) fn write(&self, archive: &mut Archive) {
        let notes = [
            ("plateau_factor", self.factor.to_string()),
            ("plateau_best", self.best.to_string()),
            ("plateau_waited", self.waited.to_string()),
            ("plateau_sum", self.sum.to_string()),
        ];
        archive.metadata.extend(notes.map(|(name, value)| (name.to_owned(), value)));
    }

    pub(super) fn read(archive: &Archive, epoch: u64) -> Result<Self, NnError> {
        Ok(Self {
            epoch,
            factor: needed(archive, "plateau_factor")?,
            best: needed(archive, "plateau_best")?,
            waited: needed(archive, "plateau_waited")?,
            sum: needed(archive, "plateau_sum")?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_item_comes_once_an_epoch_in_another_order() {
        let mut epochs = Epochs::new(50);
        let mut taken = |from: u64| (from..from + 50).map(|step| epochs.item(7, step)).collect::<Vec<_>>();
        let (first, second) = (taken(0), taken(50));
        assert_ne!(first, second);
        assert_eq!(first, taken(0), "the order of an epoch does not depend on what was asked before");
        for mut order in [first, second] {
            order.sort_unstable();
            assert_eq!(order, (0..50).collect::<Vec<_>>());
        }
    }

    #[test]
    fn a_rate_falls_after_eleven_epochs_without_a_better_one() {
        let mut plateau = Plateau::new(2);
        let mut epoch = |at: u64, loss: f64| {
            (0..2).for_each(|k| plateau.advance(2 * at + k, loss));
            plateau.factor()
        };
        assert_eq!(epoch(0, 1.0), 1.0);
        // As good as before to four digits is not better.
        assert!((1..=10).all(|at| epoch(at, 0.99999) == 1.0));
        assert_eq!(epoch(11, 1.0), 0.1);
        let mut archive = Archive::default();
        plateau.write(&mut archive);
        assert_eq!(Plateau::read(&archive, 2).unwrap(), plateau);
    }
}
