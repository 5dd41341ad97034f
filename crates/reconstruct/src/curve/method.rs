//! The fitting method of curves: least squares or moving parameters, whose spaces grow by inserted knots.

use std::sync::Arc;

use adaptive::{Estimate, Marking, Solution, Solve};
use fit_ls::{Fixed, Lambda, LeastSquares, schoenberg_whitney};
use moving_param::{Moves, MovingFit};
use ndarray::{Array1, Array2, Axis};
use thb_core::{CellSpace, HierarchicalSpace, Kind, KnotVector, Mark, Refinement, SplineMap};

use super::sequence::Sequence;
use super::support::Support;

/// What a fit is to reach, and by which steps.
#[derive(Clone, Copy)]
pub(super) struct Goal {
    pub(super) tolerance: f64,
    /// The share of the points that has to be within the tolerance.
    pub(super) within: f64,
    pub(super) marking: Marking,
    /// No span gets shorter.
    pub(super) shortest: f64,
}

/// A fit of a sequence in one space after the other.
pub(super) struct CurveMethod<'a> {
    sequence: &'a Sequence,
    support: &'a Support,
    /// The points of the sequence, and after them those that are laid over sparse stretches.
    points: Array2<f64>,
    /// Their first parameters.
    first: Array2<f64>,
    fitting: fit_ls::Options<1>,
    /// Moves parameters, if that is asked for.
    moving: Option<MovingFit<1>>,
    /// At the present parameters.
    fixed: LeastSquares<1>,
    goal: Goal,
    /// Where each span would be divided, if it can be; of the map that was estimated last.
    places: Vec<Option<f64>>,
    /// The spans to divide, worst first.
    marked: Vec<usize>,
    /// The errors, sorted by spans, times the demands on their points.
    demanded: Vec<f64>,
}

impl<'a> CurveMethod<'a> {
    pub(super) fn new(
        sequence: &'a Sequence,
        support: &'a Support,
        fitting: fit_ls::Options<1>,
        moving: Option<moving_param::Options>,
        goal: Goal,
    ) -> Result<Self, moving_param::Error> {
        let (parameters, points) = support.beside(sequence);
        let first = parameters.insert_axis(Axis(1));
        let fixed = LeastSquares::new(first.view(), points.view(), None, fitting.clone())?;
        let moving = moving
            .map(|options| MovingFit::new(first.view(), points.view(), None, fitting.clone(), options))
            .transpose()?;
        let (places, marked, demanded) = (Vec::new(), Vec::new(), Vec::new());
        Ok(Self { sequence, support, points, first, fitting, moving, fixed, goal, places, marked, demanded })
    }

    /// The present parameters of the points of the sequence, in their order.
    pub(super) fn parameters(&self) -> Array1<f64> {
        let all = self.fixed.points().parameters_as_given();
        all.column(0).iter().take(self.sequence.points.nrows()).copied().collect()
    }

    /// What happened to the parameters in each space.
    pub(super) fn moves(&self) -> &[Moves] {
        self.moving.as_ref().map_or(&[], MovingFit::reports)
    }

    pub(super) fn lambda(&self) -> f64 {
        self.fixed.lambda().unwrap_or(0.0)
    }

    /// Distances of the points of the sequence at their present parameters, in their order.
    pub(super) fn errors(&mut self, map: &SplineMap<1>) -> Result<Array1<f64>, fit_ls::Error> {
        let sorted = self.fixed.distances(map)?.to_vec();
        let mut errors = self.fixed.points().as_given(&sorted);
        errors.truncate(self.sequence.points.nrows());
        Ok(errors.into())
    }

    /// The end coefficients, where the first and the last point are kept.
    fn ends(&self, space: &HierarchicalSpace<1>) -> Fixed {
        if !self.sequence.held {
            return Vec::new();
        }
        let (points, last) = (&self.sequence.points, space.n_functions() - 1);
        vec![(0, points.row(0).to_vec()), (last, points.row(points.nrows() - 1).to_vec())]
    }
}

impl Solve<1> for CurveMethod<'_> {
    type Error = moving_param::Error;

    fn solve(
        &mut self,
        space: &Arc<HierarchicalSpace<1>>,
        _previous: Option<&SplineMap<1>>,
    ) -> Result<Solution<1>, moving_param::Error> {
        let ends = self.ends(space);
        if let Some(moving) = &mut self.moving {
            // No previous map: the space is no hierarchical refinement of the one before.
            let solution = moving.solve(space, None)?;
            let lambda = Lambda::Fixed(moving.lambda().unwrap_or(0.0));
            let fitting = fit_ls::Options { lambda, ..self.fitting.clone() };
            self.fixed = LeastSquares::new(moving.parameters().view(), self.points.view(), None, fitting)?;
            if ends.is_empty() {
                return Ok(solution);
            }
        }
        let clock = std::time::Instant::now();
        let map = self.fixed.fit_with_fixed(space, &ends)?;
        Ok(Solution { map, assemble_seconds: 0.0, solve_seconds: clock.elapsed().as_secs_f64() })
    }

    fn estimate(&mut self, map: &SplineMap<1>) -> Result<Estimate<'_>, moving_param::Error> {
        let distances = self.fixed.distances(map)?.to_vec();
        let demands = self.support.demands();
        let order = self.fixed.points().order();
        self.demanded = distances.iter().zip(order).map(|(d, &i)| d * demands[i as usize]).collect();
        let parameters = self.fixed.points().parameters(0);
        let offsets = self.fixed.points().offsets();
        self.places = (0..map.space().n_cells())
            .map(|number| {
                let cell = map.space().cell(number);
                let inside = &parameters[offsets[number]..offsets[number + 1]];
                dividing_place(cell.lower[0], cell.upper[0], inside, self.goal.shortest)
            })
            .collect();
        let estimate = Estimate { offsets, errors: &self.demanded, children: &[] };
        let Goal { tolerance, within, marking, .. } = self.goal;
        let threshold = |errors: &[f64]| marking.threshold(errors, tolerance, within);
        self.marked = mark_divisible(estimate, &self.places, map.space().degree()[0], threshold);
        Ok(estimate)
    }

    fn mark(&self, _map: &SplineMap<1>, _tolerance: f64) -> Option<Vec<Mark>> {
        Some(self.marked.iter().map(|&span| Mark::whole(span)).collect())
    }

    fn refine(
        &self,
        space: &HierarchicalSpace<1>,
        marked: &[Mark],
        _refinement: &Refinement<1>,
    ) -> Result<HierarchicalSpace<1>, thb_core::Error> {
        let places: Vec<f64> = marked.iter().filter_map(|mark| self.places.get(mark.cell).copied().flatten()).collect();
        let knots = space.knots(0, 0)?;
        let present = self.fixed.points().parameters(0);
        // Moves that do harm are undone, and then the first parameters have to determine the curve.
        let first = self.moving.is_some().then(|| self.first.column(0).to_vec());
        let sites = std::iter::once(present).chain(first.as_deref());
        let determined =
            |finer: &KnotVector| self.lambda() > 0.0 || sites.clone().all(|sites| schoenberg_whitney(finer, sites));
        let mut finer = with_knots(knots, &places)?;
        if !determined(&finer) {
            // A point on a knot is in no function's support but one: take the knots that leave each function its point.
            finer = knots.clone();
            for place in places {
                finer = Some(with_knots(&finer, &[place])?).filter(determined).unwrap_or(finer);
            }
        }
        HierarchicalSpace::new(Kind::Thb, [finer])
    }
}

fn with_knots(knots: &KnotVector, further: &[f64]) -> Result<KnotVector, thb_core::Error> {
    Ok(knots.insert(further, Array2::zeros((knots.n_functions(), 1)).view())?.0)
}

/// The spans that can be divided and have an error of at least the threshold for all errors, worst first. The errors of a span that
/// cannot be, a single point's, count for the nearest ones on both sides that share a function with it.
fn mark_divisible(
    estimate: Estimate<'_>,
    places: &[Option<f64>],
    degree: usize,
    threshold: impl Fn(&[f64]) -> f64,
) -> Vec<usize> {
    let mut errors: Vec<Vec<f64>> = vec![Vec::new(); places.len()];
    let divisible = |span: &usize| places[*span].is_some();
    for span in 0..places.len() {
        let own = &estimate.errors[estimate.offsets[span]..estimate.offsets[span + 1]];
        if divisible(&span) {
            errors[span].extend_from_slice(own);
            continue;
        }
        let before = (span.saturating_sub(degree)..span).rev().find(divisible);
        let after = (span + 1..(span + degree + 1).min(places.len())).find(divisible);
        for neighbour in before.into_iter().chain(after) {
            errors[neighbour].extend_from_slice(own);
        }
    }
    let spans: Vec<usize> = (0..places.len()).filter(divisible).collect();
    let mut offsets = vec![0];
    let mut listed = Vec::new();
    for &span in &spans {
        listed.extend_from_slice(&errors[span]);
        offsets.push(listed.len());
    }
    let among = adaptive::mark(Estimate { offsets: &offsets, errors: &listed, children: &[] }, threshold(&listed));
    among.into_iter().map(|(mark, _)| spans[mark.cell]).collect()
}

/// The coarsest dyadic place of a span with points on both its sides: with a point in every span no function lacks data.
/// None if all its points share a parameter, or if a part would be too short.
fn dividing_place(lower: f64, upper: f64, points: &[f64], shortest: f64) -> Option<f64> {
    let (first, last) = points.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &t| (a.min(t), b.max(t)));
    let (mut a, mut b) = (lower, upper);
    while 0.5 * (b - a) >= shortest {
        let middle = 0.5 * (a + b);
        if last < middle {
            b = middle;
        } else if first >= middle {
            a = middle;
        } else {
            return Some(middle);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_are_divided_between_their_points() {
        assert_eq!(dividing_place(0.0, 1.0, &[0.1, 0.9], 1e-3), Some(0.5));
        // All points in the first quarter, on both sides of an eighth.
        assert_eq!(dividing_place(0.0, 1.0, &[0.1, 0.2], 1e-3), Some(0.125));
        assert_eq!(dividing_place(0.0, 1.0, &[0.1, 0.2], 0.2), None);
        assert_eq!(dividing_place(0.0, 1.0, &[0.3, 0.3], 1e-3), None);
        assert_eq!(dividing_place(0.0, 1.0, &[], 1e-3), None);
    }
}
