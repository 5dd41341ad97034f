//! Quasi-interpolation with moving parameters: A-QI (Imperatore 2024, §5.1.2).

use std::sync::Arc;
use std::time::Instant;

use adaptive::{Estimate, Solution, Solve};
use fit_ls::SortedPoints;
use fit_qi::QuasiInterpolation;
use ndarray::{Array2, ArrayView1, ArrayView2};
use thb_core::{HierarchicalSpace, Mark, SplineMap};

use crate::constraint::Constraints;
use crate::foot_point::{FootPoints, foot_points};
use crate::moving::{Measure, Moves};
use crate::{Boundary, Error, FootPointOptions};

/// How parameters move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QuasiOptions {
    /// Corrections after each refinement; 0 for fixed parameters.
    pub corrections: usize,
    /// What happens to points on the boundary.
    pub boundary: Boundary,
    /// How foot points are sought.
    pub foot_points: FootPointOptions,
    /// Distance at which a point counts as met, in units of the points: where all are met, nothing moves any more.
    pub tolerance: f64,
}

impl Default for QuasiOptions {
    /// Two corrections, boundary points kept on their sides.
    fn default() -> Self {
        Self { corrections: 2, boundary: Boundary::Kept, foot_points: FootPointOptions::default(), tolerance: 0.0 }
    }
}

/// Hierarchical quasi-interpolation of points whose parameters move: a method for [`adaptive::run`].
///
/// In each space the quasi-interpolant is computed at the present parameters; then, so many times as asked, all parameters
/// move to their foot points and it is computed anew. Errors are those after the last correction, and functions are marked
/// by them.
#[derive(Debug)]
pub struct MovingQuasi<const D: usize> {
    method: QuasiInterpolation<D>,
    options: QuasiOptions,
    constraints: Option<Constraints<D>>,
    start: Array2<f64>,
    reports: Vec<Moves>,
}

impl<const D: usize> MovingQuasi<D> {
    /// A problem with points `(m, N)`, N ≤ 3, starting from parameters `(m, D)`, with weights `(m)` if given.
    ///
    /// # Errors
    /// Those of [`QuasiInterpolation::new`]; [`Error::Dimension`], [`Error::Option`].
    pub fn new(
        parameters: ArrayView2<'_, f64>,
        points: ArrayView2<'_, f64>,
        weights: Option<ArrayView1<'_, f64>>,
        local: fit_qi::Options<D>,
        options: QuasiOptions,
    ) -> Result<Self, Error> {
        let method = QuasiInterpolation::new(parameters, points, weights, local)?;
        if points.ncols() > crate::patch::MAX_DIM {
            return Err(Error::Dimension { given: points.ncols(), limit: crate::patch::MAX_DIM });
        }
        if options.tolerance.is_nan() || options.tolerance < 0.0 {
            return Err(Error::Option { name: "tolerance", value: options.tolerance, allowed: "at least 0" });
        }
        Ok(Self { method, options, constraints: None, start: parameters.to_owned(), reports: Vec::new() })
    }

    /// The quasi-interpolation at the present parameters.
    pub fn quasi_interpolation(&self) -> &QuasiInterpolation<D> {
        &self.method
    }

    /// The points, in the order of the cells of the last space.
    pub fn points(&self) -> &SortedPoints<D> {
        self.method.points()
    }

    /// What happened in each space, in the order of the calls.
    pub fn reports(&self) -> &[Moves] {
        &self.reports
    }

    /// The present parameters, `(m, D)`, in the order in which the points were given.
    pub fn parameters(&self) -> Array2<f64> {
        self.method.points().parameters_as_given()
    }

    fn measure(&mut self, map: &SplineMap<D>) -> Result<Measure, Error> {
        Ok(Measure::of(self.method.distances(map)?, self.options.tolerance))
    }
}

impl<const D: usize> Solve<D> for MovingQuasi<D> {
    type Error = Error;

    fn solve(
        &mut self,
        space: &Arc<HierarchicalSpace<D>>,
        previous: Option<&SplineMap<D>>,
    ) -> Result<Solution<D>, Error> {
        let Solution { mut map, assemble_seconds, solve_seconds } = self.method.solve(space, previous)?;
        let clock = Instant::now();
        let constraints = self
            .constraints
            .get_or_insert_with(|| Constraints::in_space(self.start.view(), space.as_ref(), self.options.boundary))
            .clone();
        let entry = self.parameters();
        let before = self.measure(&map)?;
        let mut moves = Moves::from(before);
        if before.max > self.options.tolerance {
            for _ in 0..self.options.corrections {
                let found = foot_points(&map, self.method.points(), &constraints, &self.options.foot_points)?;
                moves.count(&found.report);
                let FootPoints { parameters, cells, .. } = found;
                self.method.relocate(&parameters, &cells)?;
                map = self.method.fit(space)?;
            }
            moves.reach(self.measure(&map)?);
        }
        moves.travel(space, &entry, &self.parameters());
        tracing::debug!(?moves, "parameters moved");
        self.reports.push(moves);
        let solve_seconds = solve_seconds + clock.elapsed().as_secs_f64();
        Ok(Solution { map, assemble_seconds, solve_seconds })
    }

    fn estimate(&mut self, map: &SplineMap<D>) -> Result<Estimate<'_>, Error> {
        Ok(Solve::estimate(&mut self.method, map)?)
    }

    fn mark(&self, map: &SplineMap<D>, tolerance: f64) -> Option<Vec<Mark>> {
        self.method.mark(map, tolerance)
    }
}
