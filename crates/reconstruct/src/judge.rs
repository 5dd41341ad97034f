//! Fits are judged by the true distances between surface and scan, not by those of points at their parameters.

use std::sync::Arc;

use adaptive::{Estimate, Missed, Solution, Solve};
use deviation::{Deviation, Measured, Reason, Scan, ScanSide, Thresholds, Verdict, tessellate, verdict};
use fit_ls::{LeastSquares, LocalSmoothing, Weighted};
use moving_param::{Boundary, Constraints, FootPointOptions, foot_points};
use ndarray::{ArrayView2, Axis};
use param_classic::triangulate_parameters;
use thb_core::{CellSpace, HierarchicalSpace, Mark, ParameterBox, Refinement, SplineMap};

use crate::Error;

/// Points in order up to which triangles are spanned over their parameters.
///
/// Limit: a triangulation takes a second for a million points; folds of such grids are not told.
pub(crate) const MOST_IN_ORDER: usize = 100_000;

/// Factor of the smoothing weight in a trial: a step of the automatic choice.
///
/// Derived: `fit_ls::Lambda::Auto` chooses among powers of ten.
const SOFTER: f64 = 0.1;

/// Trials with less smoothing in a fit, and with more at a time.
///
/// Limit: each costs a solution on the same space.
const TRIALS: usize = 3;

/// How often in a fit more smoothing is tried against a surface that passes through itself.
///
/// Limit: each time costs up to twice [`LOCAL_TRIALS`] and [`TRIALS`] solutions on the same space.
const STIFFENINGS: usize = 3;

/// How often in a fit the cells are refined in which the surface passes through itself.
///
/// Limit: where two sheets find no room between them by then, further cells only wind more.
const OPENINGS: usize = 3;

/// Trials with more smoothing in some cells at a time.
///
/// Limit: as above.
const LOCAL_TRIALS: usize = 6;

/// Share of the misses that a trial may leave for the weight to stay.
const HELPS: f64 = 0.5;

/// A scan that surfaces are judged against.
pub(crate) struct Judge<'a> {
    scan: Scan<'a>,
    tolerance: f64,
    thresholds: Thresholds,
}

/// What was measured of a surface, and what that means.
#[derive(Clone, Debug)]
pub(crate) struct Judgement {
    pub(crate) deviation: Deviation,
    pub(crate) reasons: Vec<Reason>,
}

impl Judgement {
    pub(crate) fn verdict(&self) -> Verdict {
        verdict(&self.reasons)
    }

    /// Adds `by` to all places.
    pub(crate) fn move_by(&mut self, by: [f64; 3]) {
        self.deviation = self.deviation.clone().moved(by);
        for place in self.reasons.iter_mut().filter_map(|reason| reason.place.as_mut()) {
            *place = std::array::from_fn(|k| place[k] + by[k]);
        }
    }

    /// Whether nothing is wrong with the surface but that it may not be near enough to the scan.
    pub(crate) fn is_sound(&self) -> bool {
        self.reasons.iter().all(|reason| reason.verdict < Verdict::Failed || reason.code == deviation::SCAN_NOT_WITHIN)
    }
}

impl<'a> Judge<'a> {
    /// A judge by points, and by the triangles over them if they are what was scanned. Triangles that were spanned over the points tell
    /// folds; points in order have those of their parameters, which also tell where the scan passes through itself.
    pub(crate) fn new(
        points: &'a [[f64; 3]],
        triangles: &[[u32; 3]],
        is_mesh: bool,
        parameters: ArrayView2<'_, f64>,
        tolerance: f64,
        within: f64,
    ) -> Result<Self, Error> {
        let scan = if is_mesh && !triangles.is_empty() {
            Scan::mesh(points, triangles)?
        } else if triangles.is_empty() && points.len() <= MOST_IN_ORDER {
            Scan::cloud(points)?.with_spanned(&triangulate_parameters(parameters).unwrap_or_default(), true)
        } else {
            Scan::cloud(points)?.with_spanned(triangles, false)
        };
        Ok(Self { scan, tolerance, thresholds: Thresholds { within, ..Thresholds::default() } })
    }

    pub(crate) fn scan(&self) -> &Scan<'a> {
        &self.scan
    }

    /// Measures a surface. The first rows of `parameters` are those of the scan's points.
    pub(crate) fn judge(
        &self,
        map: &SplineMap<2>,
        parameters: Option<ArrayView2<'_, f64>>,
    ) -> Result<Judgement, Error> {
        let deviation = deviation::measure(map, &self.scan, parameters, self.tolerance, &self.thresholds)?;
        let reasons = self.thresholds.reasons(&deviation);
        Ok(Judgement { deviation, reasons })
    }

    /// Where a surface misses the scan: all parts beyond the tolerance where less than the share `within` of the scan's area is within
    /// it, else the patches of misses that are too large; without any, or if it `looks_on`, where it passes through itself.
    fn misses(
        &self,
        map: &SplineMap<2>,
        parameters: ArrayView2<'_, f64>,
        within: f64,
        looks_on: bool,
    ) -> Result<Misses, Error> {
        let tessellation = tessellate(map, self.tolerance)?;
        let measured = Measured::new(map, &tessellation)?;
        let ScanSide { distances, gathered, mut misses, .. } =
            measured.scan_side(&self.scan, Some(parameters), self.tolerance, &self.thresholds);
        let lacks = distances.within < within;
        misses.retain(|miss| lacks || miss.gathered > self.thresholds.gathered);
        misses.sort_by(|a, b| b.distance.total_cmp(&a.distance));
        let mut places: Vec<Mark> = Vec::new();
        let mut seen = std::collections::BTreeSet::new();
        for miss in misses {
            let cell = map.space().cell(miss.cell);
            let upper = |d: usize| u8::from(2.0 * miss.parameter[d] >= cell.lower[d] + cell.upper[d]);
            let child = upper(0) | upper(1) << 1;
            if seen.insert((miss.cell, child)) {
                places.push(Mark { cell: miss.cell, child: Some(child) });
            }
        }
        let crossed = if places.is_empty() || looks_on { self.crossed(map, &measured)? } else { Vec::new() };
        Ok(Misses { places, lacks, share: if lacks { 1.0 - distances.within } else { gathered.total }, crossed })
    }

    /// The cells in which a surface passes through itself. Two sheets that do may have room enough between them, once they are nearer to
    /// the scan.
    fn crossed(&self, map: &SplineMap<2>, measured: &Measured<'_>) -> Result<Vec<usize>, Error> {
        let mut cells = Vec::new();
        for crossing in measured.crossings(&self.scan, self.tolerance)?.places {
            for u in crossing.parameters {
                cells.push(map.space().locate_cell(map.space().to_domain(u))?);
            }
        }
        cells.sort_unstable();
        cells.dedup();
        Ok(cells)
    }
}

/// Where a surface misses the scan.
struct Misses {
    /// The places of the surface nearest to the misses, the worst first.
    places: Vec<Mark>,
    /// Whether less of the scan's area is within the tolerance than asked for.
    lacks: bool,
    /// Share of the scan's area that they are.
    share: f64,
    /// Cells in which the surface passes through itself; looked for where there are no such places.
    crossed: Vec<usize>,
}

/// Trials with less smoothing. An automatic weight is chosen by points that are held out, all over the scan; where misses gather, it may
/// flatten what is no noise, and no refinement helps there.
#[derive(Clone, Copy, Debug)]
struct Softening {
    /// Trials that are left.
    trials: usize,
    /// The weight before the last trial and the share of the area that missed with it, until what came of the trial is known.
    before: Option<(f64, f64)>,
}

impl Softening {
    /// The next smoothing weight, if it is to change: softer by one decade on trial, or back where a trial left more than `HELPS` of the
    /// misses. `missing` is the share of the area that misses with the weight `lambda`.
    fn next(&mut self, lambda: Option<f64>, missing: f64) -> Option<Change> {
        if let Some((lambda, share)) = self.before.take().filter(|(_, share)| missing > HELPS * share) {
            tracing::debug!(share, missing, "less smoothing did not help");
            self.trials = 0;
            return Some(Change { lambda, solves_again: false });
        }
        let lambda = lambda.filter(|lambda| *lambda > 0.0 && self.trials > 0 && missing > 0.0)?;
        self.trials -= 1;
        self.before = Some((lambda, missing));
        Some(Change { lambda: SOFTER * lambda, solves_again: true })
    }
}

/// A new smoothing weight, and whether to solve on the same space with it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Change {
    lambda: f64,
    solves_again: bool,
}

/// A method whose errors are distances to the closest points of the surface near the points' parameters, and whose loop ends
/// when the scan's area is near enough to the surface. Without a judge it is the method as it is.
///
/// Of a cloud, a point beyond the rim counts by its distance across the surface: where a scanned region ends is not known better
/// than the spacing of its points.
pub(crate) struct Judged<'a, S> {
    pub(crate) method: S,
    judge: Option<&'a Judge<'a>>,
    within: f64,
    /// Points from this one on guide the surface where the scan has none; their errors do not count.
    counted: usize,
    errors: Vec<f64>,
    softening: Softening,
    /// How often more smoothing may be tried where the surface passes through itself.
    stiffenings: usize,
    /// How often the cells may be refined in which it does.
    openings: usize,
    /// A surface that more smoothing has cured, until it is the solution.
    cured: Option<SplineMap<2>>,
}

impl<'a, S> Judged<'a, S> {
    /// `counted`: number of points, in the order that they were given in, whose errors count; `softens`: whether the smoothing weight is
    /// ours to change.
    pub(crate) fn new(method: S, judge: Option<&'a Judge<'a>>, within: f64, counted: usize, softens: bool) -> Self {
        let softening = Softening { trials: if softens { TRIALS } else { 0 }, before: None };
        let stiffenings = if softens { STIFFENINGS } else { 0 };
        Self {
            method,
            judge,
            within,
            counted,
            errors: Vec::new(),
            softening,
            stiffenings,
            openings: OPENINGS,
            cured: None,
        }
    }
}

impl<S> Judged<'_, S>
where
    S: Weighted<2>,
    Error: From<S::Error>,
{
    /// Distances to the closest points, in the order of the cells.
    fn distances(&self, judge: &Judge<'_>, map: &SplineMap<2>) -> Result<Vec<f64>, Error> {
        let points = self.method.least_squares().points();
        let space = map.space();
        let free = Constraints::in_space(points.parameters_as_given().view(), space.as_ref(), Boundary::Free);
        let feet = foot_points(map, points, &free, &FootPointOptions::default())?;
        let mut distances = feet.distances;
        for (distance, &i) in distances.iter_mut().zip(points.order()) {
            if i as usize >= self.counted {
                *distance = 0.0;
            }
        }
        if judge.scan.is_mesh() {
            return Ok(distances);
        }
        let ((lower, upper), periodic) = (space.domain(), space.periodic());
        for (at, u) in feet.parameters.iter().enumerate() {
            let on_rim = (0..2).any(|d| !periodic[d] && (u[d] <= lower[d] || u[d] >= upper[d]));
            if on_rim && (points.order()[at] as usize) < self.counted {
                let offset: [f64; 3] = std::array::from_fn(|k| points.coordinates(k)[at]);
                distances[at] = deviation::distance_across(map, feet.cells[at] as usize, *u, offset);
            }
        }
        Ok(distances)
    }

    fn misses(&self, judge: &Judge<'_>, map: &SplineMap<2>, looks_on: bool) -> Result<Misses, Error> {
        let parameters = self.method.least_squares().points().parameters_as_given();
        judge.misses(map, parameters.slice_axis(Axis(0), (..judge.scan.len()).into()), self.within, looks_on)
    }

    /// Whether the surface is as near to the scan and no longer passes through itself with more smoothing, which is then set. Between
    /// points that hold it from one side only, at a rim or beside what the scanner did not see, a surface winds where little smooths it.
    /// First it is smoothed next to the cells in which it passes through itself, then ever farther round them, then all over.
    ///
    /// Tried by least squares at the present parameters: nothing of the method changes but its smoothing, and what cures the surface is
    /// the next solution as it is.
    fn stiffen(&mut self, judge: &Judge<'_>, map: &SplineMap<2>, crossed: &[usize]) -> Result<bool, Error> {
        let Some(before) = self.method.least_squares().lambda().filter(|_| self.stiffenings > 0) else {
            return Ok(false);
        };
        self.stiffenings -= 1;
        let boxes = self.method.least_squares().local_smoothing().to_vec();
        // Next to the cells nothing is lost; farther round them detail may be.
        for widening in [0, 1] {
            let mut cells = crossed.to_vec();
            for trial in 0..LOCAL_TRIALS {
                let fit = self.method.least_squares_mut();
                let rings = (1 + widening * trial) as f64;
                let mut more = fit.local_smoothing().to_vec();
                more.extend(cells.iter().map(|&cell| stiffer_round(fit, map.space(), cell, rings)));
                fit.smooth_locally(more);
                match self.crossed_when_fitted(judge, map.space())? {
                    Some(crossed) if crossed.is_empty() => {
                        tracing::debug!(
                            trial,
                            rings,
                            "more smoothing there keeps the surface from passing through itself"
                        );
                        return Ok(true);
                    }
                    Some(crossed) => cells = crossed,
                    None => break,
                }
            }
            self.method.least_squares_mut().smooth_locally(boxes.clone());
        }
        for trial in 1..=TRIALS {
            let lambda = before / SOFTER.powi(trial as i32);
            self.method.least_squares_mut().hold_lambda(Some(lambda));
            match self.crossed_when_fitted(judge, map.space())? {
                Some(crossed) if crossed.is_empty() => {
                    tracing::debug!(before, lambda, "more smoothing keeps the surface from passing through itself");
                    return Ok(true);
                }
                Some(_) => (),
                None => break,
            }
        }
        self.method.least_squares_mut().hold_lambda(Some(before));
        Ok(false)
    }

    /// The cells in which least squares with the present smoothing pass through themselves, without any of which they are the next
    /// solution; `None` where they are not as near to the scan as asked.
    fn crossed_when_fitted(
        &mut self,
        judge: &Judge<'_>,
        space: &Arc<HierarchicalSpace<2>>,
    ) -> Result<Option<Vec<usize>>, Error> {
        let surface = self.method.least_squares_mut().fit(space)?;
        let distances = self.distances(judge, &surface)?;
        if adaptive::Deviation::new(&distances, judge.tolerance).within < self.within {
            return Ok(None);
        }
        let Misses { places, lacks, crossed, .. } = self.misses(judge, &surface, true)?;
        tracing::debug!(missed = places.len(), lacks, crossed = crossed.len(), "tried more smoothing");
        if lacks {
            return Ok(None);
        }
        // Misses that gather now find cells of their own.
        if crossed.is_empty() {
            self.cured = Some(surface);
        }
        Ok(Some(crossed))
    }
}

/// A box of ten times the smoothing that a cell has: round the cell and `rings` of its size on either side, one at first, for the functions
/// of a cell reach into its neighbours, and one more a trial where that does not do.
fn stiffer_round(fit: &LeastSquares<2>, space: &HierarchicalSpace<2>, cell: usize, rings: f64) -> LocalSmoothing<2> {
    let cell = space.cell(cell);
    let size = cell.size();
    LocalSmoothing {
        lower: std::array::from_fn(|d| cell.lower[d] - rings * size[d]),
        upper: std::array::from_fn(|d| cell.upper[d] + rings * size[d]),
        factor: fit.local_factor(&cell) / SOFTER,
    }
}

impl<S> Solve<2> for Judged<'_, S>
where
    S: Weighted<2>,
    Error: From<S::Error>,
{
    type Error = Error;

    fn solve(
        &mut self,
        space: &Arc<HierarchicalSpace<2>>,
        previous: Option<&SplineMap<2>>,
    ) -> Result<Solution<2>, Error> {
        // What moves parameters could undo the cure.
        if let Some(map) = self.cured.take().filter(|map| Arc::ptr_eq(map.space(), space)) {
            return Ok(Solution { map, assemble_seconds: 0.0, solve_seconds: 0.0 });
        }
        Ok(self.method.solve(space, previous)?)
    }

    fn estimate(&mut self, map: &SplineMap<2>) -> Result<Estimate<'_>, Error> {
        let Some(judge) = self.judge else { return Ok(self.method.estimate(map)?) };
        self.method.least_squares_mut().sort_for(map.space())?;
        self.errors = self.distances(judge, map)?;
        let at_parameters = self.method.estimate(map)?;
        Ok(Estimate { errors: &self.errors, ..at_parameters })
    }

    fn mark(&self, map: &SplineMap<2>, tolerance: f64) -> Option<Vec<Mark>> {
        self.method.mark(map, tolerance)
    }

    fn missed(&mut self, map: &SplineMap<2>) -> Result<Missed, Error> {
        let Some(judge) = self.judge else { return Ok(self.method.missed(map)?) };
        let Misses { places, share, crossed, .. } = self.misses(judge, map, false)?;
        if let Some(change) = self.softening.next(self.method.least_squares().lambda(), share) {
            self.method.least_squares_mut().hold_lambda(Some(change.lambda));
            if change.solves_again {
                return Ok(Missed::Again);
            }
        }
        if !places.is_empty() {
            return Ok(Missed::Places(places));
        }
        if crossed.is_empty() {
            return Ok(Missed::Nothing);
        }
        if self.stiffen(judge, map, &crossed)? {
            self.softening.trials = 0;
            return Ok(Missed::Again);
        }
        if self.openings == 0 {
            return Ok(Missed::Nothing);
        }
        self.openings -= 1;
        Ok(Missed::Places(crossed.into_iter().map(Mark::whole).collect()))
    }

    fn is_to_solve_again(&mut self, map: &SplineMap<2>) -> Result<bool, Error> {
        let Some(judge) = self.judge else { return Ok(self.method.is_to_solve_again(map)?) };
        // Where misses gather nothing else was looked for; a surface that loses detail is of use all the same.
        let crossed = self.misses(judge, map, true)?.crossed;
        let cured = !crossed.is_empty() && self.stiffen(judge, map, &crossed)?;
        if cured {
            self.softening.trials = 0;
        }
        Ok(cured)
    }

    fn refine(
        &self,
        space: &HierarchicalSpace<2>,
        marked: &[Mark],
        refinement: &Refinement<2>,
    ) -> Result<HierarchicalSpace<2>, thb_core::Error> {
        self.method.refine(space, marked, refinement)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smoothing_is_lowered_as_long_as_it_halves_what_misses() {
        let again = |lambda: f64| Some(Change { lambda, solves_again: true });
        let mut softening = Softening { trials: 3, before: None };
        // Helps, helps, does not: back to the second weight, and no further trial.
        assert_eq!(softening.next(Some(1.0), 0.1), again(0.1));
        assert_eq!(softening.next(Some(0.1), 0.04), again(0.1 * SOFTER));
        let kept = Change { lambda: 0.1, solves_again: false };
        assert_eq!(softening.next(Some(0.1 * SOFTER), 0.03), Some(kept));
        assert_eq!(softening.next(Some(0.1), 0.03), None);
        // What helps stays; nothing missing, no weight, or none of ours to change: no trial.
        let mut softening = Softening { trials: 3, before: None };
        assert_eq!(softening.next(Some(1.0), 0.1), again(0.1));
        assert_eq!(softening.next(Some(0.1), 0.0), None);
        assert_eq!(softening.next(None, 0.1), None);
        assert_eq!(softening.next(Some(0.0), 0.1), None);
        assert_eq!(Softening { trials: 0, before: None }.next(Some(1.0), 0.1), None);
    }
}
