//! Trained networks: files, and the parameters they give.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use ndarray::{Array2, ArrayView2};
use rayon::prelude::*;

use super::cloud::Cloud;
use super::inference::{Inference, Memory};
use super::layout::{Layout, Variant};
use super::midpoints::with_midpoints;
use super::symmetry::{Symmetries, Symmetry};
use crate::archive::Archive;
use crate::error::NnError;
use crate::graph::Neighbours;

/// Version of the weights' format; others are refused.
const VERSION: &str = "1";

/// Most points that are read at once: where features are alike without being equal, the graphs compare all pairs of them,
/// and time grows with the square.
pub const LARGEST_CLOUD: usize = 10_000;

/// How a network reads a cloud.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reading {
    /// Images over which predictions are averaged.
    pub symmetries: Symmetries,
    /// Clouds of at most so many interior points are read together with the midpoints of their Gabriel graph, which make them
    /// three times as dense: the radius of the graphs is fixed, and holds too few points of a sparse cloud. Clouds that
    /// would grow beyond [`LARGEST_CLOUD`] are read as they are.
    pub midpoints_up_to: usize,
}

impl Reading {
    /// Smallest errors on clouds of all sizes.
    pub const BEST: Self = Self { symmetries: Symmetries::Eight, midpoints_up_to: 300 };
}

/// A network that parameterizes scattered clouds (Imperatore 2024, §4.3).
#[derive(Clone, Debug)]
pub struct Bidgcn {
    pub(crate) layout: Arc<Layout>,
    pub(crate) variant: Variant,
    pub(crate) frame: bool,
    pub(crate) neighbours: Neighbours,
    pub(crate) theta: Vec<f32>,
    pub(crate) notes: BTreeMap<String, String>,
    pub(crate) reading: Reading,
}

/// Trained by the command in its notes.
const EMBEDDED: &[u8] = include_bytes!("../../weights/bidgcn.safetensors");

impl Bidgcn {
    /// The network that comes with this crate.
    ///
    /// # Errors
    /// As [`Bidgcn::load`]; none if the crate was built from an undamaged file.
    pub fn embedded() -> Result<Self, NnError> {
        Self::load(EMBEDDED)
    }

    /// A network from the bytes of a weights file.
    ///
    /// # Errors
    /// [`NnError::DamagedWeights`], [`NnError::OtherWeights`].
    pub fn load(bytes: &[u8]) -> Result<Self, NnError> {
        Self::of_archive(Archive::from_bytes(bytes)?)
    }

    pub(crate) fn of_archive(mut archive: Archive) -> Result<Self, NnError> {
        let mut take = |name: &'static str| archive.metadata.remove(name).unwrap_or_default();
        let (version, architecture, frame) = (take("version"), take("architecture"), take("frame"));
        let other = |what, found: String, required: &'static str| Err(NnError::OtherWeights { what, found, required });
        if version != VERSION {
            return other("format version", version, VERSION);
        }
        let Some(variant) = [Variant::Bidgcn, Variant::Dgcnn].into_iter().find(|v| v.name() == architecture) else {
            return other("architecture", architecture, "bidgcn or dgcnn");
        };
        let frame = match frame.as_str() {
            "boundary" => true,
            "none" => false,
            _ => return other("frame", frame, "boundary or none"),
        };
        let graph = archive.metadata.remove("graph").unwrap_or_default();
        let neighbours = match graph.strip_prefix("nearest ").map(str::parse) {
            None if graph.is_empty() => Neighbours::WithinRadius,
            Some(Ok(count)) => Neighbours::Nearest(count),
            _ => return other("graph", graph, "none named, or nearest and a number"),
        };
        let layout = Layout::new(variant);
        let theta = layout.slots.take(&mut archive)?;
        Ok(Self {
            layout: Arc::new(layout),
            variant,
            frame,
            neighbours,
            theta,
            notes: archive.metadata,
            reading: Reading::default(),
        })
    }

    /// The bytes of a weights file: safetensors, with the architecture, a checksum and the notes as metadata.
    pub fn to_bytes(&self) -> Vec<u8> {
        self.to_archive().to_bytes()
    }

    pub(crate) fn to_archive(&self) -> Archive {
        let mut metadata = self.notes.clone();
        let frame = if self.frame { "boundary" } else { "none" };
        for (name, value) in [("version", VERSION), ("architecture", self.variant.name()), ("frame", frame)] {
            metadata.insert(name.into(), value.into());
        }
        if let Neighbours::Nearest(count) = self.neighbours {
            metadata.insert("graph".into(), format!("nearest {count}"));
        }
        let mut archive = Archive { metadata, ..Archive::default() };
        self.layout.slots.put(&self.theta, &mut archive);
        archive
    }

    /// The same network, reading clouds in another way; by default each is read once, as it is.
    #[must_use]
    pub fn read_as(self, reading: Reading) -> Self {
        Self { reading, ..self }
    }

    /// The network or its ablation.
    pub fn variant(&self) -> Variant {
        self.variant
    }

    /// The graphs that it was trained on.
    pub fn neighbours(&self) -> Neighbours {
        self.neighbours
    }

    /// Number of trained weights.
    pub fn weights(&self) -> usize {
        self.theta.len()
    }

    /// What the file says about its making: command, seed, steps.
    pub fn notes(&self) -> &BTreeMap<String, String> {
        &self.notes
    }

    /// Parameters of a cloud `points`, shape `(m, 3)`, in any units: shape `(m, 2)`, in the unit square. The points in the
    /// rows `boundary` have the parameters `boundary_parameters`, shape `(boundary.len(), 2)`, on the boundary of the
    /// square, and keep them.
    ///
    /// The result does not depend on the rotation of the cloud, up to round-off of single precision, nor on the number of
    /// threads. Nothing guarantees that the map has no folds: check it, and fall back where it has.
    ///
    /// # Errors
    /// [`NnError::TooManyPoints`] above [`LARGEST_CLOUD`]; clouds that are no surface; [`NnError::WrongShape`];
    /// [`NnError::BadBoundaryPoint`]; [`NnError::NotFinite`] where the network breaks down.
    pub fn predict(
        &self,
        points: ArrayView2<'_, f64>,
        boundary: &[u32],
        boundary_parameters: ArrayView2<'_, f64>,
    ) -> Result<Array2<f64>, NnError> {
        if points.nrows() > LARGEST_CLOUD {
            return Err(NnError::TooManyPoints { given: points.nrows(), limit: LARGEST_CLOUD });
        }
        let span = tracing::info_span!("bidgcn", points = points.nrows());
        let _guard = span.enter();
        let cloud = Cloud::new(points, boundary, boundary_parameters)?;
        if cloud.interior == 0 {
            return Ok(cloud.scattered(&[]));
        }
        let uv = self.interior_parameters(&cloud);
        if let Some(index) = uv.iter().position(|uv| !uv.iter().all(|x| x.is_finite())) {
            return Err(NnError::NotFinite { row: cloud.rows[index] });
        }
        Ok(cloud.scattered(&uv))
    }

    pub(crate) fn interior_parameters(&self, cloud: &Cloud) -> Vec<[f64; 2]> {
        let Reading { symmetries, midpoints_up_to } = self.reading;
        let dense = (cloud.interior <= midpoints_up_to).then(|| with_midpoints(cloud));
        let dense = dense.filter(|dense| dense.xyz.len() <= LARGEST_CLOUD);
        let input = dense.as_ref().unwrap_or(cloud).input::<f32>(self.frame, self.neighbours);
        let sigmoid = |x: f32| 1.0 / (1.0 + (-f64::from(x)).exp());
        let inference = Inference::new(&self.layout, &self.theta, &input);
        let all: Vec<Symmetry> = symmetries.all().collect();
        let mut memory = Memory::default();
        let (own, graphs) = inference.logits(all[0], None, &mut memory);
        // PERF: finding graphs takes longer than the layers; with graphs of their own the images give the same errors within 0.5 %.
        let free = Mutex::new(vec![memory]);
        let one = |symmetry: &Symmetry| {
            let taken = free.lock().unwrap_or_else(PoisonError::into_inner).pop();
            let mut memory = taken.unwrap_or_default();
            let logits = inference.logits(*symmetry, Some(&graphs), &mut memory).0;
            free.lock().unwrap_or_else(PoisonError::into_inner).push(memory);
            logits
        };
        let others: Vec<Vec<f32>> = all[1..].par_iter().map(one).collect();
        let share = 1.0 / all.len() as f64;
        let mut mean = vec![[0.0; 2]; cloud.interior];
        for (symmetry, logits) in all.iter().zip(std::iter::once(&own).chain(&others)) {
            for (mean, pair) in mean.iter_mut().zip(logits.as_chunks::<2>().0) {
                let uv = symmetry.back(pair.map(sigmoid));
                (0..2).for_each(|k| mean[k] += share * uv[k]);
            }
        }
        mean
    }
}

#[cfg(test)]
#[path = "model_tests.rs"]
mod tests;
