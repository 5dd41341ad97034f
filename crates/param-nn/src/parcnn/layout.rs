//! Forms of the network, and where their weights stand.

use std::ops::Range;

use rand::RngExt;

use crate::slots::{Slot, Slots};
use crate::synthetic::stream;

/// Stream of the random initial weights; training batches count from 0 on.
const WEIGHT_STREAM: u64 = u64::MAX;

/// How a network reads its points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// As published: edges in, convolutions with ReLU, softmax out (Imperatore 2024, §4.1.2).
    Published {
        /// Degree d that it is trained for; the kernel is 2d + 1 wide.
        degree: usize,
        /// Convolutions before the last: 4 for curves, 5 for surfaces, 6 in Table 4.1.
        blocks: usize,
        /// Channels between them: 100, 30 in Table 4.1.
        width: usize,
    },
    /// Reads the least-squares fit at the present parameters, too, and corrects them; run several times. Starts from the
    /// best classical parameters.
    Feedback {
        /// Residual blocks.
        blocks: usize,
        /// Channels.
        width: usize,
    },
}

/// The form of the networks that come with this crate.
pub const SHIPPED_FORM: Form = Form::Feedback { blocks: 6, width: 64 };

/// A network without its weights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Architecture {
    /// Dimension N of the points: 2 or 3.
    pub dimension: usize,
    /// Directions D of the grid: 1 for sequences, 2 for grids.
    pub directions: usize,
    /// How it reads its points.
    pub form: Form,
}

/// Width of the kernel of the feedback form, in edges.
pub(super) const FEEDBACK_KERNEL: usize = 5;

/// Spacing of the kernel's entries, block after block: the last blocks see the whole of a hundred points.
const DILATIONS: [usize; 4] = [1, 2, 4, 8];

/// A convolution: its entries, each an offset across lines and along the line.
#[derive(Clone, Debug)]
pub(super) struct Convolution {
    pub(super) taps: Vec<[isize; 2]>,
    pub(super) inputs: usize,
    pub(super) weights: Range<usize>,
    pub(super) bias: Range<usize>,
}

/// A residual block of the feedback form.
#[derive(Clone, Debug)]
pub(super) struct Block {
    pub(super) convolution: Convolution,
    /// Acts on the means over the line.
    pub(super) along: Range<usize>,
    /// Acts on the means over all lines; empty for sequences.
    pub(super) across: Range<usize>,
    pub(super) second: Range<usize>,
    pub(super) second_bias: Range<usize>,
}

/// Places of all weights in one vector.
#[derive(Clone, Debug)]
pub(crate) struct Layout {
    pub(crate) architecture: Architecture,
    pub(super) width: usize,
    pub(crate) slots: Slots,
    /// All layers of the published form; the first and the last of the feedback form.
    pub(super) convolutions: Vec<Convolution>,
    pub(super) blocks: Vec<Block>,
}

impl Layout {
    pub(crate) fn new(architecture: Architecture) -> Self {
        let Architecture { dimension, directions, form } = architecture;
        let mut slots = Slots::default();
        match form {
            Form::Published { degree, blocks, width } => {
                let half = degree as isize;
                let across = if directions == 2 { half } else { 0 };
                let taps: Vec<[isize; 2]> =
                    (-across..=across).flat_map(|a| (-half..=half).map(move |b| [a, b])).collect();
                let mut inputs = dimension * directions;
                let mut convolutions = Vec::new();
                for layer in 0..=blocks {
                    let outputs = if layer == blocks { directions } else { width };
                    convolutions.push(convolution(
                        &mut slots,
                        &format!("layer.{layer}"),
                        taps.clone(),
                        inputs,
                        outputs,
                    ));
                    inputs = width;
                }
                Self { architecture, width, slots, convolutions, blocks: Vec::new() }
            }
            Form::Feedback { blocks, width } => {
                let features = super::features::count(dimension, directions);
                let first = convolution(&mut slots, "input", vec![[0, 0]], features, width);
                let blocks = (0..blocks).map(|k| block(&mut slots, k, width, directions)).collect();
                let last = convolution(&mut slots, "output", vec![[0, 0]], width, 1);
                Self { architecture, width, slots, convolutions: vec![first, last], blocks }
            }
        }
    }

    /// Number of weights.
    pub(crate) fn len(&self) -> usize {
        self.slots.len()
    }

    /// All tensors, in their order in the vector.
    pub(crate) fn slots(&self) -> &[Slot] {
        self.slots.as_slice()
    }

    /// Evenly distributed weights with the variance that ReLU keeps (He et al. 2015); biases are zero. The feedback form
    /// starts without its corrections: what ends a block, and what ends the network, is zero.
    pub(crate) fn initial_weights(&self, seed: u64) -> Vec<f32> {
        let mut random = stream(seed, WEIGHT_STREAM);
        let mut theta = vec![0.0; self.len()];
        for slot in self.slots() {
            let Some(inputs) = slot.fan_in.filter(|_| slot.active) else { continue };
            let bound = (6.0 / inputs as f32).sqrt();
            theta[slot.range.clone()].iter_mut().for_each(|x| *x = bound * (2.0 * random.random::<f32>() - 1.0));
        }
        theta
    }
}

impl Layout {
    /// Weights and biases of the published form within ±1/√inputs, which PyTorch takes where nothing is said.
    pub(crate) fn default_weights(&self, seed: u64) -> Vec<f32> {
        let mut random = stream(seed, WEIGHT_STREAM);
        let mut theta = vec![0.0; self.len()];
        for Convolution { taps, inputs, weights, bias } in &self.convolutions {
            let bound = 1.0 / ((taps.len() * inputs) as f32).sqrt();
            for range in [weights, bias] {
                let part = &mut theta[range.clone()];
                part.iter_mut().for_each(|x| *x = bound * (2.0 * random.random::<f32>() - 1.0));
            }
        }
        theta
    }
}

/// Adds a tensor; `random` weights have a number of inputs, others start as zero.
fn tensor(slots: &mut Slots, name: String, shape: [usize; 2], inputs: Option<usize>) -> Range<usize> {
    slots.add(name, shape, inputs.is_some(), inputs)
}

fn convolution(slots: &mut Slots, name: &str, taps: Vec<[isize; 2]>, inputs: usize, outputs: usize) -> Convolution {
    let rows = taps.len() * inputs;
    let random = (name != "output").then_some(rows);
    let weights = tensor(slots, format!("{name}.weight"), [rows, outputs], random);
    let bias = tensor(slots, format!("{name}.bias"), [1, outputs], None);
    Convolution { taps, inputs, weights, bias }
}

fn block(slots: &mut Slots, index: usize, width: usize, directions: usize) -> Block {
    let (half, spacing) = (FEEDBACK_KERNEL as isize / 2, DILATIONS[index % DILATIONS.len()] as isize);
    let taps = (-half..=half).map(|k| [0, k * spacing]).collect();
    let name = format!("block.{index}");
    Block {
        convolution: convolution(slots, &name, taps, width, width),
        along: tensor(slots, format!("{name}.along"), [width, width], Some(8 * width)),
        across: match directions {
            1 => 0..0,
            _ => tensor(slots, format!("{name}.across"), [width, width], Some(8 * width)),
        },
        second: tensor(slots, format!("{name}.second"), [width, width], None),
        second_bias: tensor(slots, format!("{name}.second.bias"), [1, width], None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_small_published_networks_have_the_printed_numbers_of_weights() {
        for (degree, count) in [(2, 23_131), (3, 32_311), (4, 41_491), (5, 50_671)] {
            let form = Form::Published { degree, blocks: 6, width: 30 };
            assert_eq!(Layout::new(Architecture { dimension: 2, directions: 1, form }).len(), count);
        }
    }

    #[test]
    fn tensors_follow_each_other_without_gaps() {
        for directions in [1, 2] {
            let layout = Layout::new(Architecture { dimension: 3, directions, form: SHIPPED_FORM });
            let mut end = 0;
            for slot in layout.slots() {
                assert_eq!((slot.range.start, slot.range.len()), (end, slot.shape[0] * slot.shape[1]), "{}", slot.name);
                end = slot.range.end;
            }
            assert_eq!(end, layout.len());
        }
    }
}
