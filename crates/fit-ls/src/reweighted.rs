//! Least squares whose weights follow the errors: Algorithms 1 and 2 of Imperatore 2024, §3.1.7–3.1.8, and IRLS.

use std::sync::Arc;

use adaptive::{Estimate, Solution, Solve};
use ndarray::{ArrayView1, ArrayView2};
use rayon::prelude::*;
use thb_core::{HierarchicalSpace, SplineMap};

use crate::lambda::uniform_space;
use crate::least_squares::LeastSquares;
use crate::reweight::{Loss, PointWeights, Reweighting, Robust, lengths};
use crate::{Error, Options, SortedPoints};

/// Rounds of solving and weighing in one space of the adaptive loop. The next space goes on from there, so that they need
/// not settle.
const ROUNDS: usize = 6;

/// The provisional smoothing weight for a first look at outliers, before one is chosen without them, as a share of the
/// total weight of the points: hardly any, so that it flattens no feature.
const PROVISIONAL: f64 = 1e-9;

/// Points per function of the space of the first look. In a coarse space, the tips of sharp features are taken for outliers,
/// and a smoothing weight that is chosen without them flattens all others.
const LOOKED_AT: usize = 8;

/// Most functions of that space.
const LOOK: usize = 2500;

/// A method by least squares whose points have weights that change between its solutions.
///
/// [`LeastSquares`] is one. Methods that go on from a fit by least squares, as those with moving parameters do, are others: the
/// weights that follow the errors are then found by least squares at the present parameters, which costs little, before the
/// method solves with them, and once more by the errors that it leaves.
pub trait Weighted<const D: usize>: Solve<D, Error: From<Error>> {
    /// Whether a solution is more than least squares at the present parameters.
    const GOES_ON: bool;

    /// The fit by least squares at the present parameters.
    fn least_squares(&self) -> &LeastSquares<D>;

    /// The same, to fit by it.
    fn least_squares_mut(&mut self) -> &mut LeastSquares<D>;

    /// Replaces the weights, given in the order of the points. The points are sorted for the space that is solved in next.
    /// A point of weight 0 is not there, but that its distance is asked for.
    ///
    /// # Errors
    /// [`Error::Shape`], [`Error::Weight`].
    fn set_point_weights(&mut self, weights: &[f64]) -> Result<(), Self::Error>;
}

impl<const D: usize> Weighted<D> for LeastSquares<D> {
    const GOES_ON: bool = false;

    fn least_squares(&self) -> &LeastSquares<D> {
        self
    }

    fn least_squares_mut(&mut self) -> &mut LeastSquares<D> {
        self
    }

    fn set_point_weights(&mut self, weights: &[f64]) -> Result<(), Error> {
        let (given, expected) = (weights.len(), self.points().len());
        if given != expected {
            return Err(Error::Shape { what: "weights", given, expected });
        }
        let sorted = self.points().order().iter().map(|&i| weights[i as usize]).collect();
        self.set_weights(Some(sorted))
    }
}

/// What came of the weights.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReweightingReport {
    /// Systems that were solved, over all spaces.
    pub rounds: usize,
    /// Whether the robust weights had settled and all markers were satisfied in the end.
    pub settled: bool,
    /// Scale of the residuals; `None` without a robust loss.
    pub scale: Option<f64>,
    /// Points that were set aside for gross residuals, increasing.
    pub gross: Vec<usize>,
    /// Whether more points had gross residuals than may be set aside.
    pub capped: bool,
    /// Markers of type I, and how many of them are nearer than their tolerance.
    pub met: [usize; 2],
    /// Markers of type II, and how many of them are ignored: without weight, or farther than their tolerance.
    pub ignored: [usize; 2],
}

/// Reweighted least squares on a set of points: in one space, or as a method of the adaptive loop. `S` is the method whose points
/// are weighed.
///
/// In the loop, the errors that are shown and marked are those of the points that count: gross outliers and markers
/// of type II drive no refinement.
///
/// ```
/// use std::sync::Arc;
/// use fit_ls::{Lambda, Loss, Options, Reweighted, Reweighting, Robust};
/// use ndarray::Array2;
/// use thb_core::{HierarchicalSpace, Kind, KnotVector};
///
/// // A parabola, every fifth point of which is far off.
/// let parameters = Array2::from_shape_fn((100, 1), |(i, _)| i as f64 / 99.0);
/// let points = parameters.mapv(|u| u * u + if (u * 99.0).round() % 5.0 == 3.0 { 10.0 } else { 0.0 });
///
/// let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [KnotVector::uniform(2, 4)?])?);
/// let options = Options { lambda: Lambda::Fixed(0.0), ..Options::default() };
/// let rules = Reweighting { robust: Some(Robust::plain(Loss::Tukey)), ..Reweighting::default() };
/// let mut fit = Reweighted::<1>::new(parameters.view(), points.view(), None, options, &rules)?;
/// let curve = fit.fit(&space, 50)?;
/// assert!((curve.eval([0.5])?[0] - 0.25).abs() < 1e-9);
/// assert_eq!(fit.report()?.gross.len(), 20);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Reweighted<const D: usize, S = LeastSquares<D>> {
    solver: S,
    weights: PointWeights,
    /// Errors of the last map, in the order in which the points were given.
    errors: Vec<f64>,
    rounds: usize,
    settled: bool,
    /// The points that counted when a space was last prepared; `None` before the first look.
    judged: Option<Vec<bool>>,
    /// Errors of the points that count, by cell of the last map's space, and the children of cells that hold them.
    estimate: (Vec<usize>, Vec<f64>, Vec<u8>),
}

impl<const D: usize> Reweighted<D> {
    /// A problem with points `(m, N)` at parameters `(m, D)`; `confidence` `(m)` multiplies the weights.
    ///
    /// # Errors
    /// Those of [`LeastSquares::new`] and [`PointWeights::new`].
    pub fn new(
        parameters: ArrayView2<'_, f64>,
        points: ArrayView2<'_, f64>,
        confidence: Option<ArrayView1<'_, f64>>,
        options: Options<D>,
        reweighting: &Reweighting,
    ) -> Result<Self, Error> {
        Self::of(LeastSquares::new(parameters, points, confidence, options)?, confidence, reweighting)
    }
}

impl<const D: usize, S: Weighted<D>> Reweighted<D, S> {
    /// A method whose points get weights that follow the errors; `confidence` `(m)` multiplies them. Neighbours are those at the present
    /// parameters.
    ///
    /// # Errors
    /// Those of [`PointWeights::new`].
    pub fn of(solver: S, confidence: Option<ArrayView1<'_, f64>>, reweighting: &Reweighting) -> Result<Self, Error> {
        let points = solver.least_squares().points();
        let mut weights = PointWeights::new::<D>(points.parameters_as_given().view(), confidence, reweighting)?;
        let largest = |k: usize| points.coordinates(k).iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        weights.set_largest_coordinate((0..points.dim()).map(largest).fold(0.0, f64::max));
        let estimate = (Vec::new(), Vec::new(), Vec::new());
        Ok(Self { solver, weights, errors: Vec::new(), rounds: 0, settled: true, judged: None, estimate })
    }

    /// Algorithm 1: fits in one space, over and over, until the robust weights have settled and all markers are satisfied,
    /// or `rounds` systems are solved; at least one is. A marker that cannot be satisfied is no error: see
    /// [`Reweighted::report`]. Parameters stay where they are.
    ///
    /// # Errors
    /// Those of [`LeastSquares::fit`].
    pub fn fit(&mut self, space: &Arc<HierarchicalSpace<D>>, rounds: usize) -> Result<SplineMap<D>, Error> {
        self.prepare(space)?;
        let mut round = 0;
        loop {
            round += 1;
            let (map, settled) = self.round(space)?;
            self.settled = settled && self.weights.unsatisfied(&self.errors)? == [0, 0];
            if self.settled || round >= rounds {
                return Ok(map.map);
            }
            self.weights.update_markers(&self.errors)?;
        }
    }

    /// Takes the errors of a map, such as one that the loop kept when a later space failed.
    ///
    /// # Errors
    /// [`Error::Parameter`].
    pub fn measure(&mut self, map: &SplineMap<D>) -> Result<(), Error> {
        let solver = self.solver.least_squares_mut();
        let distances = solver.distances(map)?.to_vec();
        self.errors = solver.points().as_given(&distances);
        Ok(())
    }

    /// The method under the weights.
    pub fn method(&self) -> &S {
        &self.solver
    }

    /// The same, without its weights' rules.
    pub fn into_method(self) -> S {
        self.solver
    }

    /// The fit under the weights.
    pub fn least_squares(&self) -> &LeastSquares<D> {
        self.solver.least_squares()
    }

    /// The weights.
    pub fn weights(&self) -> &PointWeights {
        &self.weights
    }

    /// Distances of the points to the last map, in the order in which the points were given.
    pub fn errors(&self) -> &[f64] {
        &self.errors
    }

    /// What came of the weights in the last fit.
    ///
    /// # Errors
    /// [`Error::Shape`] before anything was fitted.
    pub fn report(&self) -> Result<ReweightingReport, Error> {
        let [met, ignored] = self.weights.unsatisfied(&self.errors)?;
        let markers = self.weights.markers();
        let gross = self.weights.gross();
        Ok(ReweightingReport {
            rounds: self.rounds,
            settled: self.settled,
            scale: self.weights.scale(),
            gross: (0..gross.len()).filter(|&i| gross[i]).collect(),
            capped: self.weights.is_capped(),
            met: [markers.met.len(), markers.met.len() - met],
            ignored: [markers.ignored.len(), markers.ignored.len() - ignored],
        })
    }

    /// Solves once by least squares and weighs the points by the loss; whether their weights had settled.
    fn round(&mut self, space: &Arc<HierarchicalSpace<D>>) -> Result<(Solution<D>, bool), Error> {
        self.hand_over(space, &self.weights.weights())?;
        let solution = self.solver.least_squares_mut().solve(space, None)?;
        let settled = self.weigh(&solution.map)?;
        Ok((solution, settled))
    }

    /// Weighs the points by the loss, given the map of a solution; whether their weights had settled.
    fn weigh(&mut self, map: &SplineMap<D>) -> Result<bool, Error> {
        let points = self.solver.least_squares().points();
        let residuals = residuals(points, map);
        self.errors = lengths(&residuals, points.len());
        self.rounds += 1;
        self.weights.update_robust(&residuals)
    }

    /// Gives weights, in the order of the points, to the fit by least squares.
    fn hand_over(&mut self, space: &Arc<HierarchicalSpace<D>>, weights: &[f64]) -> Result<(), Error> {
        let solver = self.solver.least_squares_mut();
        solver.sort_for(space)?;
        solver.set_point_weights(weights)
    }

    /// Before a fit in a new space: a first look at the outliers, and an automatic smoothing weight by the points that
    /// count as far as that is known.
    fn prepare(&mut self, space: &Arc<HierarchicalSpace<D>>) -> Result<(), Error> {
        let Some(rule) = self.weights.rule().filter(|rule| rule.neighbours > 0) else { return Ok(()) };
        if self.judged.is_none() {
            self.look(space, rule)?;
        }
        let counted = self.weights.counted();
        let solver = self.solver.least_squares();
        if solver.chooses_lambda() || (solver.is_automatic() && self.judged.as_ref() != Some(&counted)) {
            let weights = self.weights.weights();
            let judged: Vec<f64> =
                weights.iter().zip(&counted).map(|(&w, &counts)| if counts { w } else { 0.0 }).collect();
            self.hand_over(space, &judged)?;
            let solver = self.solver.least_squares_mut();
            solver.hold_lambda(None);
            let chosen = solver.choose_lambda_anew(space)?;
            solver.hold_lambda(Some(chosen));
        }
        self.judged = Some(counted);
        Ok(())
    }

    /// A first fit in a fine uniform space, by Tukey's loss, whatever follows: it starts far from the minimum, and a loss
    /// whose pull never ends keeps what it begins with.
    fn look(&mut self, space: &Arc<HierarchicalSpace<D>>, rule: Robust) -> Result<(), Error> {
        let solver = self.solver.least_squares_mut();
        let provisional = PROVISIONAL * solver.points().total_weight();
        let fine = Arc::new(uniform_space(space, (solver.points().len() / LOOKED_AT).min(LOOK))?);
        solver.hold_lambda(Some(provisional));
        self.weights.set_rule(Robust { loss: Loss::Tukey, ..rule });
        for _ in 0..ROUNDS {
            match self.round(&fine) {
                Ok((_, false)) => {}
                // Voids may be too wide for hardly any smoothing: then the space of the fit has the first look.
                Ok((_, true)) | Err(Error::RankDeficient { .. }) => break,
                Err(error) => return Err(error),
            }
        }
        self.weights.set_rule(rule);
        self.solver.least_squares_mut().hold_lambda(None);
        Ok(())
    }
}

impl<const D: usize, S: Weighted<D>> Solve<D> for Reweighted<D, S> {
    type Error = S::Error;

    /// A few rounds of the robust loss, the solution of a method that goes on from there, then one update of the markers
    /// (Algorithm 2).
    fn solve(
        &mut self,
        space: &Arc<HierarchicalSpace<D>>,
        previous: Option<&SplineMap<D>>,
    ) -> Result<Solution<D>, S::Error> {
        self.prepare(space)?;
        let (mut assemble_seconds, mut solve_seconds) = (0.0, 0.0);
        let mut add = |solution: &Solution<D>| {
            assemble_seconds += solution.assemble_seconds;
            solve_seconds += solution.solve_seconds;
        };
        let mut round = 0;
        let (mut solution, mut settled) = loop {
            round += 1;
            let (solution, settled) = self.round(space)?;
            add(&solution);
            if settled || round >= ROUNDS {
                break (solution, settled);
            }
        };
        if S::GOES_ON {
            self.solver.set_point_weights(&self.weights.weights())?;
            solution = self.solver.solve(space, previous)?;
            add(&solution);
            settled = self.weigh(&solution.map)?;
        }
        self.settled = self.weights.update_markers(&self.errors)? && settled;
        Ok(Solution { map: solution.map, assemble_seconds, solve_seconds })
    }

    /// Errors of the points that count.
    fn estimate(&mut self, map: &SplineMap<D>) -> Result<Estimate<'_>, S::Error> {
        self.measure(map)?;
        let points = self.solver.least_squares().points();
        let counted = self.weights.counted();
        let in_cells = points.children(map.space().as_ref());
        let (offsets, errors, children) = &mut self.estimate;
        offsets.clear();
        errors.clear();
        children.clear();
        offsets.push(0);
        for ends in points.offsets().windows(2) {
            let counting = (ends[0]..ends[1]).map(|at| (at, points.order()[at] as usize)).filter(|&(_, i)| counted[i]);
            for (at, index) in counting {
                errors.push(self.errors[index]);
                children.push(in_cells[at]);
            }
            offsets.push(errors.len());
        }
        Ok(Estimate { offsets, errors, children })
    }
}

/// Residuals `s(u) − p`, one array per coordinate, in the order in which the points were given, of points that are sorted by
/// the cells of the map.
fn residuals<const D: usize>(points: &SortedPoints<D>, map: &SplineMap<D>) -> Vec<Vec<f64>> {
    let (bezier, n) = (map.bezier(), points.dim());
    let cells: Vec<(usize, &[usize])> = points.offsets().windows(2).enumerate().collect();
    let of_cell = |&(cell, ends): &(usize, &[usize])| {
        let mut image = vec![0.0; n];
        let mut rows = Vec::with_capacity(n * (ends[1] - ends[0]));
        for at in ends[0]..ends[1] {
            bezier.derivative(cell, points.parameter(at), [0; D], &mut image);
            rows.extend((0..n).map(|k| image[k] - points.coordinates(k)[at]));
        }
        rows
    };
    let sorted: Vec<Vec<f64>> = cells.par_iter().map(of_cell).collect();
    let mut columns = vec![vec![0.0; points.len()]; n];
    for (row, &index) in sorted.iter().flat_map(|rows| rows.chunks_exact(n)).zip(points.order()) {
        (0..n).for_each(|k| columns[k][index as usize] = row[k]);
    }
    columns
}
