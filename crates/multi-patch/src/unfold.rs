//! The end of a fit: folds are undone.

use std::collections::BTreeSet;

use thb_core::CellSpace;

use crate::fit::Fit;
use crate::measure::{turned_over, turned_places};
use crate::{Error, Options};

/// What the stiffness of functions is multiplied by where the surface turns over.
///
/// Calibrated: on layouts of `bear` and `part` of which 6 and 47 places turn over, all are undone with 2 and 3, with 10 one and 53 are
/// left.
const STIFFER: f64 = 3.0;

/// Rounds of stiffening that leave no fewer places turned over than the best before, after which it ends.
///
/// Calibrated: on `part` two in a row leave more before the third leaves fewer.
const UNFOLDINGS_IN_VAIN: usize = 3;

/// Most Gauss–Newton steps between two looks at what turns over.
const STEPS: usize = 2;

impl Fit<'_> {
    /// Where the surface turns over, cells and those around are made stiffer until it does so nowhere, or that no longer helps. How many places
    /// are left.
    pub(crate) fn unfold(
        &mut self,
        outward: &(dyn Fn([f64; 3], [f64; 3]) -> [f64; 3] + Sync),
        options: &Options,
    ) -> Result<usize, Error> {
        let turned = |fit: &Self| -> Result<Vec<usize>, Error> {
            let surface = fit.surface(&fit.coefficients, options.diagonal)?;
            let mut turned = turned_places(&surface, outward);
            turned_over(&surface, fit.sharp).into_iter().for_each(|cell| turned[cell] += 1);
            Ok(turned)
        };
        let mut now = turned(self)?;
        let mut best = (now.iter().sum::<usize>(), self.coefficients.clone(), self.samples.clone());
        let mut stiffness = vec![1.0; self.space.n_functions()];
        let mut in_vain = 0;
        let few = Options { angle_steps: options.angle_steps.min(STEPS), ..options.clone() };
        while best.0 > 0 && in_vain < UNFOLDINGS_IN_VAIN {
            let cells = (0..now.len()).filter(|&cell| now[cell] > 0);
            let functions: BTreeSet<u32> =
                cells.flat_map(|cell| self.space.cell(cell).functions.iter().copied()).collect();
            functions.into_iter().for_each(|function| stiffness[function as usize] *= STIFFER);
            self.plates.set_stiffness(self.space, &stiffness);
            self.second_stage(&few)?;
            now = turned(self)?;
            let places = now.iter().sum();
            tracing::info!(places, "unfolding");
            in_vain += 1;
            if places < best.0 {
                best = (places, self.coefficients.clone(), self.samples.clone());
                in_vain = 0;
            }
        }
        let left;
        (left, self.coefficients, self.samples) = best;
        Ok(left)
    }
}
