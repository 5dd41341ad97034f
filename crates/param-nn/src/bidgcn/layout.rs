//! Which weights the networks have, and where they stand.

use std::ops::Range;

use super::layers::WIDTH;
use crate::slots::{Slot, Slots};

/// Hidden edge convolutions.
pub(super) const HIDDEN: usize = 4;

/// Width of the output network.
pub(super) const OUTPUT_WIDTH: usize = 256;

/// Outputs of the input layer and of all hidden layers stand side by side.
const CONCATENATED: usize = (HIDDEN + 1) * WIDTH;

/// The network and its ablation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variant {
    /// With the boundary-informed input layer (Imperatore 2024, §4.3): 192,130 weights.
    Bidgcn,
    /// The same network with a plain edge convolution as input layer, which knows nothing of the boundary (§4.3.5 (a)).
    Dgcnn,
}

impl Variant {
    /// Its name in files and commands.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bidgcn => "bidgcn",
            Self::Dgcnn => "dgcnn",
        }
    }
}

/// The two message networks of the input layer.
#[derive(Clone, Debug)]
pub(super) struct MessageSlots {
    pub(super) inputs: usize,
    pub(super) first: Range<usize>,
    pub(super) norm: Range<usize>,
    pub(super) second: Range<usize>,
    pub(super) bias: Range<usize>,
}

/// A linear layer and, where it has one, the normalization behind it.
#[derive(Clone, Debug)]
pub(super) struct LinearSlots {
    pub(super) weights: Range<usize>,
    pub(super) bias: Range<usize>,
    pub(super) norm: Range<usize>,
}

/// Places of all weights in one vector.
#[derive(Clone, Debug)]
pub(crate) struct Layout {
    pub(crate) slots: Slots,
    pub(super) interior: MessageSlots,
    pub(super) boundary: Option<MessageSlots>,
    pub(super) hidden: Vec<LinearSlots>,
    pub(super) output: [LinearSlots; 3],
}

impl Layout {
    pub(crate) fn new(variant: Variant) -> Self {
        let mut slots = Slots::default();
        let interior = messages(&mut slots, "input.interior", 6);
        let boundary = (variant == Variant::Bidgcn).then(|| messages(&mut slots, "input.boundary", 8));
        let hidden = (1..=HIDDEN)
            .map(|k| linear(&mut slots, &format!("hidden.{k}"), 2 * WIDTH, WIDTH, false, k < HIDDEN))
            .collect();
        let output = [
            linear(&mut slots, "output.1", CONCATENATED, OUTPUT_WIDTH, true, false),
            linear(&mut slots, "output.2", OUTPUT_WIDTH, OUTPUT_WIDTH, true, false),
            linear(&mut slots, "output.3", OUTPUT_WIDTH, 2, false, true),
        ];
        Self { slots, interior, boundary, hidden, output }
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

/// Linear, batch normalization, ReLU, linear.
fn messages(slots: &mut Slots, name: &str, inputs: usize) -> MessageSlots {
    let first = linear(slots, &format!("{name}.1"), inputs, WIDTH, true, false);
    let second = linear(slots, &format!("{name}.2"), WIDTH, WIDTH, false, true);
    MessageSlots { inputs, first: first.weights, norm: first.norm, second: second.weights, bias: second.bias }
}

fn linear(slots: &mut Slots, name: &str, inputs: usize, outputs: usize, norm: bool, active_bias: bool) -> LinearSlots {
    let weights = slots.add(format!("{name}.weight"), [inputs, outputs], true, Some(inputs));
    let bias = slots.add(format!("{name}.bias"), [1, outputs], active_bias, Some(inputs));
    let norm = if norm { slots.add(format!("{name}.norm"), [2, outputs], true, None) } else { 0..0 };
    LinearSlots { weights, bias, norm }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_network_has_the_published_number_of_weights() {
        assert_eq!(Layout::new(Variant::Bidgcn).len(), 192_130);
        assert_eq!(Layout::new(Variant::Dgcnn).len(), 192_130 - (8 * 64 + 64 + 2 * 64) - (64 * 64 + 64));
    }

    #[test]
    fn tensors_follow_each_other_without_gaps() {
        let layout = Layout::new(Variant::Bidgcn);
        let mut end = 0;
        for slot in layout.slots() {
            assert_eq!((slot.range.start, slot.range.len()), (end, slot.shape[0] * slot.shape[1]), "{}", slot.name);
            end = slot.range.end;
        }
        assert_eq!(end, layout.len());
    }
}
