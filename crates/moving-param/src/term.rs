//! What a fit minimizes: a sum of terms.

use std::fmt::Debug;

use thb_core::{HierarchicalSpace, ParameterBox, SplineMap};

use crate::Error;
use crate::equations::{Equations, Linearization};
use crate::safeguards::Safeguard;
use crate::state::{State, StepStart};

/// A summand `E(c, u)` of the objective of a fit, as a function of the coefficients c of a map and the parameters u of all points.
///
/// A step minimizes the sum of what terms say of themselves near its start: gradient and Gauss–Newton matrix. Each parameter is
/// eliminated in a block of its own, so a term may add to two things only: to the block of a single point, or to the equations
/// of the coefficients. One that couples the parameters of several points holds the others constant during the step, and says so.
///
/// [`MovingFit::with_term`](crate::MovingFit::with_term) adds a term of one's own to the joint method.
pub trait Term<const D: usize, S: ParameterBox<D> = HierarchicalSpace<D>>: Debug + Send + Sync {
    /// Its name in reports.
    fn name(&self) -> &'static str;

    /// Sets what is constant during the step that begins at a state; called once a step, before all else.
    ///
    /// # Errors
    /// Those of the term.
    fn freeze(&mut self, at: &StepStart<'_, D, S>) -> Result<(), Error> {
        let _ = at;
        Ok(())
    }

    /// The energy at a state, with what is constant during the step.
    ///
    /// # Errors
    /// Those of the term.
    fn energy(&self, at: &State<'_, D, S>) -> Result<f64, Error>;

    /// Of a sum of one-sided penalties `½ max(0, g_k)²` those that are active for a map, increasing: the equations of a step know only
    /// the active ones, and a step that activates more is computed anew. Such a term adds cell blocks only. None for others.
    fn active(&self, map: &SplineMap<D, S>) -> Vec<u32> {
        let _ = map;
        Vec::new()
    }

    /// Adds minus the gradient, and the Gauss–Newton matrix, at the start of the step, with the penalties that are
    /// active.
    ///
    /// # Errors
    /// Those of the term.
    fn linearize(&self, at: &StepStart<'_, D, S>, active: &[u32], into: &mut Linearization<'_, D>)
    -> Result<(), Error>;

    /// What keeps steps of the coefficients where the term still says something.
    fn safeguard(&self) -> Option<Box<dyn Safeguard<D, S> + '_>> {
        None
    }
}

/// The sum of some terms.
#[derive(Debug)]
pub(crate) struct Objective<'a, const D: usize, S: ParameterBox<D>> {
    terms: Vec<&'a mut dyn Term<D, S>>,
}

impl<'a, const D: usize, S: ParameterBox<D>> Objective<'a, D, S> {
    /// A sum, in this order.
    pub(crate) fn new(terms: Vec<&'a mut dyn Term<D, S>>) -> Self {
        Self { terms }
    }

    /// Sets what all terms hold constant, and what their equations are at the start of a step.
    pub(crate) fn freeze(&mut self, at: &StepStart<'_, D, S>, equations: &mut Equations<D>) -> Result<(), Error> {
        for term in &mut self.terms {
            term.freeze(at)?;
        }
        self.linearize_at(at, equations)
    }

    /// The equations at another state than the one where the step begins, with what is held constant since there.
    pub(crate) fn linearize_at(&self, at: &StepStart<'_, D, S>, equations: &mut Equations<D>) -> Result<(), Error> {
        equations.clear(at.state.weights, self.terms.len());
        let mut active = vec![Vec::new(); self.terms.len()];
        self.extend(at.state.map, &mut active);
        self.linearize(at, &active, equations)
    }

    /// The sum of the energies.
    pub(crate) fn energy(&self, at: &State<'_, D, S>) -> Result<f64, Error> {
        self.terms.iter().try_fold(0.0, |sum, term| Ok(sum + term.energy(at)?))
    }

    /// Adds the penalties that are active for a map to those of each term. True if there are more now.
    pub(crate) fn extend(&self, map: &SplineMap<D, S>, active: &mut [Vec<u32>]) -> bool {
        let mut grew = false;
        for (term, active) in self.terms.iter().zip(active) {
            let known = active.len();
            active.extend(term.active(map));
            active.sort_unstable();
            active.dedup();
            grew |= active.len() > known;
        }
        grew
    }

    /// Linearizes those terms anew whose equations have other active penalties, or none yet.
    pub(crate) fn linearize(
        &self,
        at: &StepStart<'_, D, S>,
        active: &[Vec<u32>],
        equations: &mut Equations<D>,
    ) -> Result<(), Error> {
        for (number, (term, active)) in self.terms.iter().zip(active).enumerate() {
            if let Some(mut into) = equations.of_term(number, active) {
                term.linearize(at, active, &mut into)?;
            }
        }
        Ok(())
    }

    /// The safeguards that terms bring with them.
    pub(crate) fn safeguards(&self) -> impl Iterator<Item = Box<dyn Safeguard<D, S> + '_>> {
        self.terms.iter().filter_map(|term| term.safeguard())
    }
}
