//! Cells of a surface that would turn over.

use thb_core::{CellSpace, HierarchicalSpace, ParameterBox, SplineMap};

use crate::Error;
use crate::safeguards::{Admission, CoefficientStep, Safeguard};
use crate::terms::area_samples::{AreaSamples, Sheet};

/// What is kept, in turn, of the step of the functions around samples that still turn over.
const KEPT: [f64; 6] = [0.5, 0.5, 0.0, 0.0, 0.0, 0.0];

/// Holds the functions around samples that would turn over back; the others go on. Refuses steps after which more samples have
/// turned over than before, still.
#[derive(Debug)]
pub(crate) struct TurnedCells<'a> {
    pub(crate) samples: &'a AreaSamples,
    /// The surface before the step.
    pub(crate) sheet: &'a Sheet,
}

impl<const D: usize, S: ParameterBox<D>> Safeguard<D, S> for TurnedCells<'_> {
    fn name(&self) -> &'static str {
        "turned cells"
    }

    fn admit_coefficients(&self, step: &mut CoefficientStep<'_, D, S>) -> Result<Admission, Error> {
        let Self { samples, sheet } = self;
        let mut held = 0;
        let mut folds = sheet.folds(samples, &step.map);
        for kept in KEPT {
            if !sheet.turns_more(&folds) {
                break;
            }
            let functions = sheet.around_turned(step.from.space().as_ref(), &folds);
            for &function in &functions {
                step.step.row_mut(function as usize).mapv_inplace(|x| kept * x);
            }
            held = held.max(functions.len());
            step.update()?;
            folds = sheet.folds(samples, &step.map);
        }
        Ok(match (sheet.turns_more(&folds), held) {
            (true, _) => Admission::Refused,
            (false, 0) => Admission::Unchanged,
            (false, held) => Admission::Changed(held),
        })
    }
}

/// Whether a surface has turned over at samples where one before it had not.
pub(crate) fn turns<const D: usize>(
    map: &SplineMap<D, HierarchicalSpace<D>>,
    before: &SplineMap<D, HierarchicalSpace<D>>,
) -> bool {
    let samples = AreaSamples::new(map.space().degree());
    let sheet = Sheet::new(&samples, before, 0.0);
    sheet.turns_more(&sheet.folds(&samples, map))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use ndarray::Array2;
    use thb_core::{Kind, KnotVector};

    /// A slightly bent sheet over the Greville sites, with one site moved in x.
    fn sheet(moved: f64) -> SplineMap<2> {
        let knots = KnotVector::uniform(2, 4).unwrap();
        let sites = knots.greville();
        let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap());
        let n = sites.len();
        let mut coefficients = Array2::from_shape_fn((n * n, 3), |(i, k)| {
            let (u, v) = (sites[i % n], sites[i / n]);
            [u, v, 0.1 * (u * u + 0.5 * u * v)][k]
        });
        coefficients[[n * (n / 2) + n / 2, 0]] += moved;
        SplineMap::new(space, coefficients).unwrap()
    }

    #[test]
    fn a_site_pushed_beyond_its_neighbours_turns_the_surface() {
        assert!(!turns(&sheet(0.0), &sheet(0.0)));
        assert!(!turns(&sheet(0.1), &sheet(0.0)));
        assert!(turns(&sheet(0.9), &sheet(0.0)));
    }

    /// A step of two sites of which one is pushed too far: that one is held back, the other goes on.
    #[test]
    fn functions_are_held_back_around_samples_that_turn_and_nowhere_else() {
        let flat = sheet(0.0);
        let samples = AreaSamples::new([2, 2]);
        let before = Sheet::new(&samples, &flat, 0.0);
        let mut step = Array2::zeros((36, 3));
        // Of 6 × 6 functions the one in column 3 of row 3, and a corner.
        (step[[21, 0]], step[[0, 2]]) = (0.9, 0.01);
        let map = SplineMap::new(flat.space().clone(), &flat.coefficients() + &step).unwrap();
        let mut step = CoefficientStep { from: &flat, step, map };
        let around = before.around_turned(flat.space().as_ref(), &before.folds(&samples, &step.map));
        assert!(around.contains(&21) && !around.contains(&0), "{around:?}");
        let guard = TurnedCells { samples: &samples, sheet: &before };
        let admission = guard.admit_coefficients(&mut step).unwrap();
        assert_eq!(admission, Admission::Changed(around.len()));
        assert!(step.step[[21, 0]] < 0.9 && step.step[[0, 2]] == 0.01);
        assert!(!turns(&step.map, &flat));
        assert_eq!(step.map.coefficients(), &flat.coefficients() + &step.step);
        // A step that turns nothing stays as it is, and what had turned before is no reason.
        assert_eq!(guard.admit_coefficients(&mut step).unwrap(), Admission::Unchanged);
        let folded = sheet(0.9);
        let own = Sheet::new(&samples, &folded, 0.0);
        assert!(own.around_turned(flat.space().as_ref(), &own.folds(&samples, &folded)).is_empty());
    }
}
