//! What is fitted: points with weights, and where they lie on the patches.

use rayon::prelude::*;
use thb_core::{CellSpace, MultiPatchSpace, PatchPlace};

use crate::Error;

/// A sample of the surface that is sought.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// The point.
    pub point: [f64; 3],
    /// Unit normal there, outward; zero where there is none, as on a crease.
    pub normal: [f64; 3],
    /// What it counts for, such as an area; positive.
    pub weight: f64,
    /// Its parameter.
    pub place: PatchPlace,
    /// The arc that it is a sample of, on which its parameter stays: a crease or an outline.
    pub arc: Option<u32>,
}

/// Samples with their cells.
#[derive(Clone, Debug)]
pub struct Samples {
    samples: Vec<Sample>,
    cells: Vec<u32>,
    total_weight: f64,
}

impl Samples {
    /// Samples in a space.
    ///
    /// # Errors
    /// [`Error::NoSamples`], [`Error::BadSample`], [`Error::ForeignArc`]; [`Error::Space`] for places outside their patches.
    pub fn new(space: &MultiPatchSpace, samples: Vec<Sample>) -> Result<Self, Error> {
        if samples.is_empty() {
            return Err(Error::NoSamples);
        }
        let mut cells = Vec::with_capacity(samples.len());
        for (index, sample) in samples.iter().enumerate() {
            let finite = sample.point.iter().chain(&sample.normal).all(|x| x.is_finite());
            if !(finite && sample.weight > 0.0 && sample.weight.is_finite()) {
                return Err(Error::BadSample { index });
            }
            cells.push(space.locate(sample.place)? as u32);
            if let Some(arc) = sample.arc {
                let patch = sample.place.patch;
                let is_side = space.topology().uses(arc as usize).iter().any(|on| on.patch == patch);
                if !is_side {
                    return Err(Error::ForeignArc { index, arc, patch });
                }
            }
        }
        let total_weight = samples.iter().map(|sample| sample.weight).sum();
        Ok(Self { samples, cells, total_weight })
    }

    /// The samples.
    pub fn as_slice(&self) -> &[Sample] {
        &self.samples
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.samples.len()
    }

    /// Whether there are none; there is one at least.
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }

    /// The cell of each sample.
    pub fn cells(&self) -> &[u32] {
        &self.cells
    }

    /// Sum of the weights.
    pub fn total_weight(&self) -> f64 {
        self.total_weight
    }

    /// The same with all points multiplied by `unit`.
    pub(crate) fn scaled(mut self, unit: f64) -> Self {
        self.samples.iter_mut().for_each(|sample| sample.point = sample.point.map(|x| x * unit));
        self
    }

    /// Samples of each cell, increasing.
    pub(crate) fn by_cell(&self, space: &MultiPatchSpace) -> Vec<Vec<u32>> {
        let mut of_cell = vec![Vec::new(); space.n_cells()];
        self.cells.iter().zip(0..).for_each(|(&cell, sample)| of_cell[cell as usize].push(sample));
        of_cell
    }

    /// Moves each sample to where `to` says, its cell and its place.
    pub(crate) fn move_each(&mut self, to: impl Fn(&Sample, usize) -> (u32, PatchPlace) + Sync) {
        self.samples.par_iter_mut().zip(&mut self.cells).for_each(|(sample, cell)| {
            (*cell, sample.place) = to(sample, *cell as usize);
        });
    }
}
