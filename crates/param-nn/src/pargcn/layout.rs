//! Which weights the network has, and where they stand.

use std::ops::Range;

use crate::slots::{Slot, Slots};

/// Numbers of an edge: its tail, and the way from its head to its tail (Imperatore 2024, (4.13)).
pub(crate) const FEATURES: usize = 6;

/// Channels of every convolution and of the output network.
pub(crate) const WIDTH: usize = 64;

/// Convolutions.
pub(super) const LAYERS: usize = 4;

/// Chebyshev polynomials of a convolution, T₀ to T₄: 2d + 1 for the degree 2 of the loss.
pub(super) const POLYNOMIALS: usize = 5;

/// What the network is told, and how its output is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PargcnForm {
    /// As published (Imperatore 2024, §4.2).
    Published,
    /// The same 80,641 weights. Points are turned into the frame of the boundary; offsets are measured in radii, so that
    /// clouds of any size look alike, and logits lean less in denser ones; and the logits are added to those of weights of largest entropy that reproduce plane
    /// clouds, so that an untrained network is a good map already.
    Guided,
}

impl PargcnForm {
    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Published => "published",
            Self::Guided => "guided",
        }
    }
}

/// A Chebyshev convolution: a matrix for each polynomial, one below the other.
#[derive(Clone, Debug)]
pub(super) struct Convolution {
    pub(super) inputs: usize,
    pub(super) weights: Range<usize>,
    pub(super) bias: Range<usize>,
}

/// Places of all weights in one vector.
#[derive(Clone, Debug)]
pub(crate) struct Layout {
    pub(crate) slots: Slots,
    pub(super) convolutions: Vec<Convolution>,
    /// First layer of the output network: features, then the results of the convolutions.
    pub(super) hidden: Range<usize>,
    pub(super) norm: Range<usize>,
    pub(crate) last: Range<usize>,
}

impl Layout {
    pub(crate) fn new() -> Self {
        let mut slots = Slots::default();
        let convolutions = (1..=LAYERS)
            .map(|k| {
                let inputs = if k == 1 { FEATURES } else { WIDTH };
                let fan_in = POLYNOMIALS * inputs;
                let weights = slots.add(format!("convolution.{k}.weight"), [fan_in, WIDTH], true, Some(fan_in));
                let bias = slots.add(format!("convolution.{k}.bias"), [1, WIDTH], true, Some(fan_in));
                Convolution { inputs, weights, bias }
            })
            .collect();
        let joined = FEATURES + LAYERS * WIDTH;
        let hidden = slots.add("output.1.weight".into(), [joined, WIDTH], true, Some(joined));
        slots.add("output.1.bias".into(), [1, WIDTH], false, Some(joined));
        let norm = slots.add("output.1.norm".into(), [2, WIDTH], true, None);
        let last = slots.add("output.2.weight".into(), [WIDTH, 1], true, Some(WIDTH));
        // The softmax of a neighbourhood does not see what all its logits have in common.
        slots.add("output.2.bias".into(), [1, 1], false, Some(WIDTH));
        Self { slots, convolutions, hidden, norm, last }
    }

    /// Number of weights.
    pub(crate) fn len(&self) -> usize {
        self.slots.len()
    }

    /// All tensors, in their order in the vector.
    pub(crate) fn slots(&self) -> &[Slot] {
        self.slots.as_slice()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_network_has_the_published_number_of_weights() {
        assert_eq!(Layout::new().len(), 80_641);
    }
}
