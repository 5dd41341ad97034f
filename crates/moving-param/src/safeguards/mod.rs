//! What shortens or refuses a step once it is known.

use std::fmt::Debug;

use ndarray::Array2;
use thb_core::{HierarchicalSpace, ParameterBox, SplineMap};

use crate::Error;
use crate::state::State;

pub(crate) mod flipping_triangles;
pub(crate) mod stray_points;
pub(crate) mod turned_cells;

/// What a safeguard did to a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Admission {
    /// It may be taken as it is.
    Unchanged,
    /// So many points, or functions, go elsewhere than the step would take them.
    Changed(usize),
    /// It may not be taken.
    Refused,
}

/// A step of the coefficients, and the map that it leads to.
#[derive(Debug)]
pub struct CoefficientStep<'a, const D: usize, S = HierarchicalSpace<D>> {
    /// The map at the start.
    pub from: &'a SplineMap<D, S>,
    /// The change of the coefficients, `(n_functions, N)`.
    pub step: Array2<f64>,
    /// The map after it.
    pub map: SplineMap<D, S>,
}

impl<const D: usize, S: ParameterBox<D>> CoefficientStep<'_, D, S> {
    /// Sets the map after the step anew, where that was changed.
    pub(crate) fn update(&mut self) -> Result<(), Error> {
        self.map = SplineMap::new(self.from.space().clone(), &self.from.coefficients() + &self.step)?;
        Ok(())
    }
}

/// Parameters after a step, and the cells that hold them, in the order of the points.
#[derive(Clone, Debug)]
pub struct Parameters<const D: usize> {
    /// The parameters.
    pub values: Vec<[f64; D]>,
    /// The cells.
    pub cells: Vec<u32>,
}

/// Looks at a step before its objective is computed. Steps of the coefficients come first; parameters follow the map after them.
pub trait Safeguard<const D: usize, S: ParameterBox<D> = HierarchicalSpace<D>>: Debug {
    /// Its name in reports.
    fn name(&self) -> &'static str;

    /// Looks at a step of the coefficients.
    ///
    /// # Errors
    /// Those of the safeguard.
    fn admit_coefficients(&self, step: &mut CoefficientStep<'_, D, S>) -> Result<Admission, Error> {
        let _ = step;
        Ok(Admission::Unchanged)
    }

    /// Looks at moves of the parameters from a state to places on a map.
    ///
    /// # Errors
    /// Those of the safeguard.
    fn admit_parameters(
        &self,
        from: &State<'_, D, S>,
        map: &SplineMap<D, S>,
        moved: &mut Parameters<D>,
    ) -> Result<Admission, Error> {
        let _ = (from, map, moved);
        Ok(Admission::Unchanged)
    }
}

/// Asks all safeguards, one after the other, about moves of the parameters.
pub(crate) fn admit_all<const D: usize, S: ParameterBox<D>>(
    safeguards: &[&dyn Safeguard<D, S>],
    from: &State<'_, D, S>,
    map: &SplineMap<D, S>,
    moved: &mut Parameters<D>,
) -> Result<Admission, Error> {
    let mut changed = 0;
    for safeguard in safeguards {
        match safeguard.admit_parameters(from, map, moved)? {
            Admission::Unchanged => (),
            Admission::Changed(points) => changed += points,
            Admission::Refused => return Ok(Admission::Refused),
        }
    }
    Ok(if changed == 0 { Admission::Unchanged } else { Admission::Changed(changed) })
}
