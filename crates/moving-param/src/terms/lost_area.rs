//! A penalty that keeps surfaces from folding over.

use std::sync::Arc;

use rayon::prelude::*;
use thb_core::{ParameterBox, SplineMap};

use crate::equations::Linearization;
use crate::safeguards::Safeguard;
use crate::safeguards::turned_cells::TurnedCells;
use crate::state::{State, StepStart};
use crate::term::Term;
use crate::terms::area_samples::{AreaSamples, CellPart, Folds, PER_CELL, Sheet};
use crate::terms::data::half_squares;
use crate::{Error, JointOptions};

/// `½ ω Σ_g max(0, ε − J_g)²` over samples g of all cells of a surface in space.
///
/// `J_g = (S_u × S_v) · n_g / a_g` says how the area around a sample has changed against the map before the step, which has
/// the mean unit normal `n_g` around the sample and the mean area `a_g` in its cell. Where parameters move, points can
/// leave a part of the domain whose image then folds at no distance from any of them.
///
/// Held constant during a step: `n_g`, `a_g` and `ω = 2 ρ max(½ Σ ω_i d_i², ½ τ² Σ ω_i) / samples` for
/// ρ = [`JointOptions::regularity`] and the tolerance τ. As long as distances are beyond the tolerance folds cost as much as they do: for
/// less a step would fold first, and then not be taken.
///
/// Active are the samples with `J_g < ε`. A step that turns samples over is made shorter there ([`TurnedCells`]).
#[derive(Debug)]
pub(crate) struct LostArea {
    samples: AreaSamples,
    /// ρ.
    regularity: f64,
    /// τ.
    tolerance: f64,
    /// The surface before the step, once there is one.
    sheet: Option<Sheet>,
}

impl LostArea {
    /// For surfaces of a degree.
    pub(crate) fn new<const D: usize>(degree: [usize; D], options: &JointOptions, tolerance: f64) -> Self {
        Self { samples: AreaSamples::new(degree), regularity: options.regularity, tolerance, sheet: None }
    }

    /// The low and turned samples of a map, if there is a surface to compare it with.
    fn folds<const D: usize, S: ParameterBox<D>>(&self, map: &SplineMap<D, S>) -> Option<Arc<Folds>> {
        self.sheet.as_ref().map(|sheet| sheet.folds(&self.samples, map))
    }
}

impl<const D: usize, S: ParameterBox<D>> Term<D, S> for LostArea {
    fn name(&self) -> &'static str {
        "lost area"
    }

    fn freeze(&mut self, at: &StepStart<'_, D, S>) -> Result<(), Error> {
        let State { map, points, distances, weights, .. } = at.state;
        let of_tolerance = 0.5 * self.tolerance.powi(2) * points.total_weight();
        let level = half_squares(distances, weights).max(of_tolerance);
        let weight = self.regularity * 2.0 * level / map.space().n_cells() as f64;
        self.sheet = Some(Sheet::new(&self.samples, map, weight));
        Ok(())
    }

    fn energy(&self, at: &State<'_, D, S>) -> Result<f64, Error> {
        Ok(self.folds(at.map).map_or(0.0, |folds| folds.energy))
    }

    fn active(&self, map: &SplineMap<D, S>) -> Vec<u32> {
        self.folds(map).map_or_else(Vec::new, |folds| folds.low.clone())
    }

    fn linearize(
        &self,
        at: &StepStart<'_, D, S>,
        active: &[u32],
        into: &mut Linearization<'_, D>,
    ) -> Result<(), Error> {
        let Some(sheet) = &self.sheet else { return Ok(()) };
        let of_one_cell = |a: &u32, b: &u32| a / PER_CELL as u32 == b / PER_CELL as u32;
        let cells: Vec<&[u32]> = active.chunk_by(of_one_cell).collect();
        let parts: Vec<CellPart> =
            cells.into_par_iter().map(|low| sheet.part(&self.samples, at.state.map, low)).collect();
        for CellPart { unknowns, matrix, right } in parts {
            into.coefficients.add_cell(unknowns, matrix, right);
        }
        Ok(())
    }

    fn safeguard(&self) -> Option<Box<dyn Safeguard<D, S> + '_>> {
        let sheet = self.sheet.as_ref()?;
        Some(Box::new(TurnedCells { samples: &self.samples, sheet }))
    }
}
