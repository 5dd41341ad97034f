//! The adaptive loop SOLVE → ESTIMATE → MARK → REFINE, written once for every fitting method.
//!
//! A method implements [`Solve`]; [`run`] does the rest: it marks cells by [`Marking`], refines them, stops by the rules
//! of [`Options`] and keeps a [`History`](Outcome::history). The loop does not know how a method solves.

mod mark;
mod run;

pub use mark::{Marking, mark};
pub use run::{Iteration, Observer, Options, Outcome, Seconds, Stop, run};

use std::sync::Arc;

use thb_core::{HierarchicalSpace, Mark, Refinement, SplineMap};

/// A method that fits a spline map in a given space.
pub trait Solve<const D: usize> {
    /// What can go wrong.
    type Error: std::error::Error;

    /// SOLVE: fits in a space. `previous` is the result on the space before, which the new one refines.
    ///
    /// # Errors
    /// Those of the method.
    fn solve(
        &mut self,
        space: &Arc<HierarchicalSpace<D>>,
        previous: Option<&SplineMap<D>>,
    ) -> Result<Solution<D>, Self::Error>;

    /// ESTIMATE: the error of each point, sorted by cell of the map's space.
    ///
    /// # Errors
    /// Those of the method.
    fn estimate(&mut self, map: &SplineMap<D>) -> Result<Estimate<'_>, Self::Error>;

    /// MARK: the cells to refine, worst first, of a method that has a rule of its own; it is asked after
    /// [`Solve::estimate`] of the same map. `None` leaves the choice to [`Options::marking`]; no cell at all ends the loop
    /// with [`Stop::Data`].
    fn mark(&self, _map: &SplineMap<D>, _tolerance: f64) -> Option<Vec<Mark>> {
        None
    }

    /// Asked once the asked share of the points is within the tolerance: what is to be done all the same. Methods that know no more
    /// than the errors of their points find nothing.
    ///
    /// # Errors
    /// Those of the method.
    fn missed(&mut self, _map: &SplineMap<D>) -> Result<Missed, Self::Error> {
        Ok(Missed::Nothing)
    }

    /// Asked where the loop would end although something is missing, as no cell may be refined or nothing got better: whether the method
    /// has changed and is to solve on the same space again. It does so a limited number of times only: the loop does not count.
    ///
    /// # Errors
    /// Those of the method.
    fn is_to_solve_again(&mut self, _map: &SplineMap<D>) -> Result<bool, Self::Error> {
        Ok(false)
    }

    /// REFINE: the space with the marked cells refined, or the same cells where none of them can be. A method with spaces of
    /// its own, such as B-splines with inserted knots, refines in its own way; the others by [`HierarchicalSpace::refine_at`].
    ///
    /// # Errors
    /// Those of the space: they end the loop with [`Stop::Levels`].
    fn refine(
        &self,
        space: &HierarchicalSpace<D>,
        marked: &[Mark],
        refinement: &Refinement<D>,
    ) -> Result<HierarchicalSpace<D>, thb_core::Error> {
        space.refine_at(marked, refinement)
    }
}

/// What a method finds missing in a map whose points are near enough.
#[derive(Clone, Debug, PartialEq)]
pub enum Missed {
    /// Nothing: the loop ends with [`Stop::ToleranceReached`].
    Nothing,
    /// Places to refine, worst first; no place at all ends the loop with [`Stop::Data`].
    Places(Vec<Mark>),
    /// The method has changed, its smoothing for instance, and is to solve on the same space again. It answers so a limited number
    /// of times only: the loop does not count.
    Again,
}

/// A fitted map, and how long its parts took.
#[derive(Clone, Debug)]
pub struct Solution<const D: usize> {
    /// The map.
    pub map: SplineMap<D>,
    /// Seconds spent on setting up equations.
    pub assemble_seconds: f64,
    /// Seconds spent on solving them.
    pub solve_seconds: f64,
}

/// Distances of points to the map at their parameters.
#[derive(Clone, Copy, Debug)]
pub struct Estimate<'a> {
    /// Errors of cell `c`: `errors[offsets[c]..offsets[c + 1]]`.
    pub offsets: &'a [usize],
    /// The error of each point, sorted by cell.
    pub errors: &'a [f64],
    /// The child of its cell that holds each point, see [`Mark`]; empty where only cells as a whole are to be refined.
    pub children: &'a [u8],
}

/// Summary of the errors of all points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deviation {
    /// Number of points.
    pub points: usize,
    /// Largest distance.
    pub max: f64,
    /// Mean of the squared distances.
    pub mse: f64,
    /// Share of the points whose distance is at most the tolerance.
    pub within: f64,
}

impl Deviation {
    /// The summary of distances with respect to a tolerance. Sums run in the order of the slice.
    pub fn new(errors: &[f64], tolerance: f64) -> Self {
        let count = errors.len().max(1) as f64;
        let (mut max, mut squares, mut inside) = (0.0_f64, 0.0, 0_usize);
        // Partial sums over short runs keep round-off small, whatever the number of points.
        for run in errors.chunks(256) {
            let mut partial = 0.0;
            for &e in run {
                max = max.max(e);
                partial += e * e;
                inside += usize::from(e <= tolerance);
            }
            squares += partial;
        }
        Self { points: errors.len(), max, mse: squares / count, within: inside as f64 / count }
    }

    /// Root of the mean of the squared distances.
    pub fn rmse(&self) -> f64 {
        self.mse.sqrt()
    }
}
