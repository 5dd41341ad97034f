//! Which weights the networks have, and where they stand.

use std::ops::Range;

use super::layers::WIDTH;

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

/// A tensor among the weights, shape `(rows, columns)`; a row acts on an input, a column makes an output. Vectors have
/// one row; `.norm` holds γ, then β.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Slot {
    pub(crate) name: String,
    pub(crate) shape: [usize; 2],
    pub(crate) range: Range<usize>,
    /// Whether it acts on the result; a bias that a batch normalization follows does not.
    pub(crate) active: bool,
    /// Inputs of the linear layer, which set the size of random weights; none for a normalization.
    pub(crate) fan_in: Option<usize>,
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
    slots: Vec<Slot>,
    pub(super) interior: MessageSlots,
    pub(super) boundary: Option<MessageSlots>,
    pub(super) hidden: Vec<LinearSlots>,
    pub(super) output: [LinearSlots; 3],
}

impl Layout {
    pub(crate) fn new(variant: Variant) -> Self {
        let mut builder = Builder::default();
        let interior = builder.messages("input.interior", 6);
        let boundary = (variant == Variant::Bidgcn).then(|| builder.messages("input.boundary", 8));
        let hidden =
            (1..=HIDDEN).map(|k| builder.linear(&format!("hidden.{k}"), 2 * WIDTH, WIDTH, false, k < HIDDEN)).collect();
        let output = [
            builder.linear("output.1", CONCATENATED, OUTPUT_WIDTH, true, false),
            builder.linear("output.2", OUTPUT_WIDTH, OUTPUT_WIDTH, true, false),
            builder.linear("output.3", OUTPUT_WIDTH, 2, false, true),
        ];
        Self { slots: builder.slots, interior, boundary, hidden, output }
    }

    /// Number of weights.
    pub(crate) fn len(&self) -> usize {
        self.slots.last().map_or(0, |slot| slot.range.end)
    }

    /// All tensors, in their order in the vector.
    pub(crate) fn slots(&self) -> &[Slot] {
        &self.slots
    }
}

#[derive(Default)]
struct Builder {
    slots: Vec<Slot>,
}

impl Builder {
    fn slot(&mut self, name: String, shape: [usize; 2], active: bool, fan_in: Option<usize>) -> Range<usize> {
        let start = self.slots.last().map_or(0, |slot| slot.range.end);
        let range = start..start + shape[0] * shape[1];
        self.slots.push(Slot { name, shape, range: range.clone(), active, fan_in });
        range
    }

    /// Linear, batch normalization, ReLU, linear.
    fn messages(&mut self, name: &str, inputs: usize) -> MessageSlots {
        let first = self.linear(&format!("{name}.1"), inputs, WIDTH, true, false);
        let second = self.linear(&format!("{name}.2"), WIDTH, WIDTH, false, true);
        MessageSlots { inputs, first: first.weights, norm: first.norm, second: second.weights, bias: second.bias }
    }

    fn linear(&mut self, name: &str, inputs: usize, outputs: usize, norm: bool, active_bias: bool) -> LinearSlots {
        let weights = self.slot(format!("{name}.weight"), [inputs, outputs], true, Some(inputs));
        let bias = self.slot(format!("{name}.bias"), [1, outputs], active_bias, Some(inputs));
        let norm = if norm { self.slot(format!("{name}.norm"), [2, outputs], true, None) } else { 0..0 };
        LinearSlots { weights, bias, norm }
    }
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
