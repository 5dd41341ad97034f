//! Named tensors of weights, one behind the other in one vector.

use std::ops::Range;

use crate::archive::Archive;
use crate::error::NnError;

/// A tensor among the weights, shape `(rows, columns)`; a row acts on an input, a column makes an output. Vectors have
/// one row; `.norm` holds γ, then β.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Slot {
    pub(crate) name: String,
    pub(crate) shape: [usize; 2],
    pub(crate) range: Range<usize>,
    /// Whether it acts on the result; a bias that a batch normalization follows does not.
    pub(crate) active: bool,
    /// Inputs of the linear layer, which set the size of random weights; none for what does not start at random.
    pub(crate) fan_in: Option<usize>,
}

/// All tensors of a network, in their order in the vector.
#[derive(Clone, Debug, Default)]
pub(crate) struct Slots(Vec<Slot>);

impl Slots {
    /// Adds a tensor behind the others.
    pub(crate) fn add(&mut self, name: String, shape: [usize; 2], active: bool, fan_in: Option<usize>) -> Range<usize> {
        let start = self.len();
        let range = start..start + shape[0] * shape[1];
        self.0.push(Slot { name, shape, range: range.clone(), active, fan_in });
        range
    }

    /// Number of weights.
    pub(crate) fn len(&self) -> usize {
        self.0.last().map_or(0, |slot| slot.range.end)
    }

    pub(crate) fn as_slice(&self) -> &[Slot] {
        &self.0
    }

    /// Takes the weights out of an archive; other tensors stay in it.
    ///
    /// # Errors
    /// [`NnError::OtherWeights`].
    pub(crate) fn take(&self, archive: &mut Archive) -> Result<Vec<f32>, NnError> {
        let mut theta = vec![0.0; self.len()];
        for slot in &self.0 {
            match archive.tensors.remove(&slot.name) {
                Some((shape, values)) if shape == slot.shape && values.iter().all(|x| x.is_finite()) => {
                    theta[slot.range.clone()].copy_from_slice(&values);
                }
                found => {
                    let found = found.map_or("nothing".into(), |(shape, _)| format!("shape {shape:?}"));
                    return Err(NnError::OtherWeights {
                        what: "tensors",
                        found: format!("{}: {found}", slot.name),
                        required: "finite numbers in the shape of the network",
                    });
                }
            }
        }
        Ok(theta)
    }

    /// Puts weights into an archive.
    pub(crate) fn put(&self, theta: &[f32], archive: &mut Archive) {
        let tensor = |slot: &Slot| (slot.name.clone(), (slot.shape, theta[slot.range.clone()].to_vec()));
        archive.tensors.extend(self.0.iter().map(tensor));
    }
}
