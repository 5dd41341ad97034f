//! Quasi-interpolation with moving parameters: A-QI (Imperatore 2024, §5.1.2).

use std::sync::Arc;
use std::time::Instant;

use adaptive::{Estimate, Solution, Solve};
use fit_ls::SortedPoints;
use fit_qi::{QuasiInterpolation, Work};
use ndarray::{Array2, ArrayView1, ArrayView2};
use thb_core::{HierarchicalSpace, Mark, Refinement, SplineMap};

use crate::moving::{Measure, Moves};
use crate::points::constraint::Constraints;
use crate::points::foot_point::{FootPoints, foot_points};
use crate::points::place::placed;
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

/// Rounds in which points get their first parameters back. Each may push neighbours away, which are next; where a few rounds do not
/// help, the surface has moved as a whole.
const ROUNDS_OF_RETURN: usize = 3;

/// Growth of the largest distance from which on moving has done harm. Less is the chance of one point, and often gone with the next
/// refinement: with 1, a blade lost the control points that it had saved.
const HARM: f64 = 1.5;

fn largest(distances: &[f64]) -> f64 {
    distances.iter().fold(0.0, |a, &b| a.max(b))
}

/// Hierarchical quasi-interpolation of points whose parameters move: a method for [`adaptive::run`].
///
/// In each space the quasi-interpolant is computed at the present parameters; then, so many times as asked, all parameters
/// move to their foot points and it is computed anew. Errors are those after the last correction, and functions are marked
/// by them.
///
/// Foot points of a few points may lie on the wrong part of the surface, and each surface follows them further. So where the
/// largest distance, beyond the tolerance, has become half as large again as with the first parameters in the same space, points
/// that got worse get theirs back, and if that does not help all points, until it is no larger than that.
#[derive(Debug)]
pub struct MovingQuasi<const D: usize> {
    method: QuasiInterpolation<D>,
    options: QuasiOptions,
    constraints: Option<Constraints<D>>,
    start: Array2<f64>,
    reports: Vec<Moves>,
    /// Number of quasi-interpolants that were computed up to the end of each space.
    computed: Vec<usize>,
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
        if points.ncols() > crate::points::vector::MAX_DIM {
            return Err(Error::Dimension { given: points.ncols(), limit: crate::points::vector::MAX_DIM });
        }
        if options.tolerance.is_nan() || options.tolerance < 0.0 {
            return Err(Error::Option { name: "tolerance", value: options.tolerance, allowed: "at least 0" });
        }
        Ok(Self {
            method,
            options,
            constraints: None,
            start: parameters.to_owned(),
            reports: Vec::new(),
            computed: Vec::new(),
        })
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

    /// The work of each space, in the order of the calls: that of every quasi-interpolant that was computed there.
    pub fn work(&self) -> Vec<&[Work]> {
        let all = self.method.work();
        let starts = std::iter::once(0).chain(self.computed.iter().copied());
        starts.zip(&self.computed).map(|(start, &end)| &all[start..end]).collect()
    }

    /// The present parameters, `(m, D)`, in the order in which the points were given.
    pub fn parameters(&self) -> Array2<f64> {
        self.method.points().parameters_as_given()
    }

    /// The surface fitted to the moved points, or one with some of the first parameters back if the farthest point is nearer then.
    fn guarded(&mut self, moved: SplineMap<D>, moves: &mut Moves) -> Result<SplineMap<D>, Error> {
        let space = moved.space().clone();
        let (reached, start) = (self.parameters(), self.start.clone());
        if reached == start || self.measure(&moved)?.max <= self.options.tolerance {
            return Ok(moved);
        }
        let after = self.distances_as_given(&moved)?;
        self.restore(&start, &space)?;
        let unmoved = self.method.fit(&space)?;
        let fixed = self.distances_as_given(&unmoved)?;
        let limit = largest(&fixed).max(self.options.tolerance);
        let (mut tried, mut distances, mut map) = (reached, after, moved);
        let mut put_back = vec![false; fixed.len()];
        for round in 0.. {
            if largest(&distances) <= if round == 0 { HARM * limit } else { limit } {
                self.restore(&tried, &space)?;
                moves.held += put_back.iter().filter(|back| **back).count();
                return Ok(map);
            }
            if round == ROUNDS_OF_RETURN {
                break;
            }
            for at in 0..fixed.len() {
                if distances[at] > fixed[at].max(self.options.tolerance) && !put_back[at] {
                    put_back[at] = true;
                    tried.row_mut(at).assign(&start.row(at));
                }
            }
            self.restore(&tried, &space)?;
            map = self.method.fit(&space)?;
            distances = self.distances_as_given(&map)?;
        }
        moves.postponed = true;
        tracing::info!(?moves, "corrections did harm and are postponed");
        self.restore(&start, &space)?;
        Ok(unmoved)
    }

    /// Distances of the points to a map, in the order in which they were given.
    fn distances_as_given(&mut self, map: &SplineMap<D>) -> Result<Vec<f64>, Error> {
        let sorted = self.method.distances(map)?.to_vec();
        Ok(self.points().as_given(&sorted))
    }

    /// Gives the points parameters, `(m, D)` in the order in which they were given.
    fn restore(&mut self, parameters: &Array2<f64>, space: &HierarchicalSpace<D>) -> Result<(), Error> {
        let (placed, cells) = placed(self.points(), parameters, space)?;
        Ok(self.method.relocate(&placed, &cells)?)
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
            map = self.guarded(map, &mut moves)?;
            moves.reach(self.measure(&map)?);
        }
        moves.travel(space, &entry, &self.parameters());
        tracing::debug!(?moves, "parameters moved");
        self.reports.push(moves);
        self.computed.push(self.method.work().len());
        let solve_seconds = solve_seconds + clock.elapsed().as_secs_f64();
        Ok(Solution { map, assemble_seconds, solve_seconds })
    }

    fn estimate(&mut self, map: &SplineMap<D>) -> Result<Estimate<'_>, Error> {
        Ok(Solve::estimate(&mut self.method, map)?)
    }

    fn mark(&self, map: &SplineMap<D>, tolerance: f64) -> Option<Vec<Mark>> {
        self.method.mark(map, tolerance)
    }

    fn refine(
        &self,
        space: &HierarchicalSpace<D>,
        marked: &[Mark],
        refinement: &Refinement<D>,
    ) -> Result<HierarchicalSpace<D>, thb_core::Error> {
        self.method.refine(space, marked, refinement)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use thb_core::{Kind, KnotVector};

    #[test]
    fn points_in_wrong_places_are_put_back() {
        let side = 30;
        let parameters =
            Array2::from_shape_fn((side * side, 2), |(i, d)| [i % side, i / side][d] as f64 / (side - 1) as f64);
        let points = Array2::from_shape_fn((side * side, 3), |(i, k)| {
            let (u, v) = (parameters[[i, 0]], parameters[[i, 1]]);
            [u, v, 0.2 * (5.0 * u).sin() * (4.0 * v).cos()][k]
        });
        let knots = KnotVector::uniform(2, 6).unwrap();
        let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap());
        let options = QuasiOptions { tolerance: 1e-6, ..QuasiOptions::default() };
        let mut method =
            MovingQuasi::new(parameters.view(), points.view(), None, fit_qi::Options::default(), options).unwrap();
        let fixed = method.method.fit(&space).unwrap();
        for (wrong, shift, held, postponed) in [(5, 0.4, 5, false), (0, 1e-3, 0, false)] {
            let mut moved = parameters.clone();
            for i in 0..wrong {
                moved[[137 * i + 60, 0]] = (moved[[137 * i + 60, 0]] + shift) % 1.0;
            }
            if wrong == 0 {
                moved[[435, 0]] += shift;
            }
            method.restore(&moved, &space).unwrap();
            let map = method.method.fit(&space).unwrap();
            let before = method.measure(&fixed).unwrap();
            let mut moves = Moves::from(before);
            let guarded = method.guarded(map.clone(), &mut moves).unwrap();
            assert_eq!((moves.held >= held, moves.postponed), (true, postponed), "{moves:?}");
            if wrong == 0 {
                // Hardly worse: the moves stay.
                assert_eq!((method.parameters(), guarded.coefficients()), (moved, map.coefficients()));
            } else {
                let at = method.parameters();
                assert!((0..wrong).all(|i| at.row(137 * i + 60) == parameters.row(137 * i + 60)));
                let limit = largest(&method.distances_as_given(&guarded).unwrap());
                method.restore(&parameters, &space).unwrap();
                assert!(limit <= largest(&method.distances_as_given(&fixed).unwrap()) * (1.0 + 1e-12));
            }
        }
    }
}
