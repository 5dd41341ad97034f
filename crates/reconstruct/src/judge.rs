//! Fits are judged by the true distances between surface and scan, not by those of points at their parameters.

use std::sync::Arc;

use adaptive::{Estimate, Solution, Solve};
use deviation::{Deviation, Measured, Reason, Scan, Thresholds, Verdict, tessellate, verdict};
use fit_ls::{LeastSquares, SortedPoints};
use moving_param::{Boundary, Constraints, FootPointOptions, MovingFit, foot_points};
use ndarray::{ArrayView2, Axis};
use param_classic::triangulate_parameters;
use thb_core::{CellSpace, HierarchicalSpace, Mark, Refinement, SplineMap};

use crate::Error;

/// Points in order up to which triangles are spanned over their parameters.
///
/// Limit: a triangulation takes a second for a million points; folds of such grids are not told.
const MOST_IN_ORDER: usize = 100_000;

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

    /// The same with `by` added to all places.
    pub(crate) fn moved(self, by: [f64; 3]) -> Self {
        let move_place = |reason: Reason| {
            let place = reason.place.map(|place| std::array::from_fn(|k| place[k] + by[k]));
            Reason { place, ..reason }
        };
        Self { deviation: self.deviation.moved(by), reasons: self.reasons.into_iter().map(move_place).collect() }
    }

    /// Whether nothing is wrong with the surface but that it may not be near enough to the scan.
    pub(crate) fn is_sound(&self) -> bool {
        self.reasons.iter().all(|reason| reason.verdict < Verdict::Failed || reason.code == deviation::SCAN_NOT_WITHIN)
    }
}

impl<'a> Judge<'a> {
    /// A judge by points, and by the triangles over them if they are what was scanned. Triangles that were spanned over the points tell
    /// folds and where the scan passes through itself; points in order have those of their parameters.
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
            Scan::cloud(points)?.with_spanned(&triangulate_parameters(parameters).unwrap_or_default())
        } else {
            Scan::cloud(points)?.with_spanned(triangles)
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

    /// The places of a surface nearest to parts of the scan for which it is to be refined, worst first: all parts beyond the
    /// tolerance where less than the share `within` of the scan's area is within it, those of patches of misses where
    /// these are too large; where all that is well, the places at which the surface passes through itself.
    fn missed(&self, map: &SplineMap<2>, parameters: ArrayView2<'_, f64>, within: f64) -> Result<Vec<Mark>, Error> {
        let tessellation = tessellate(map, self.tolerance)?;
        let measured = Measured::new(map, &tessellation)?;
        let side = measured.scan_side(&self.scan, Some(parameters), self.tolerance, &self.thresholds);
        let lacks = side.distances.within < within;
        let mut misses = side.misses;
        misses.retain(|miss| lacks || miss.gathered > self.thresholds.gathered);
        misses.sort_by(|a, b| b.distance.total_cmp(&a.distance));
        let mut marks: Vec<Mark> = Vec::new();
        let mut seen = std::collections::BTreeSet::new();
        for miss in misses {
            let cell = map.space().cell(miss.cell);
            let upper = |d: usize| u8::from(2.0 * miss.parameter[d] >= cell.lower[d] + cell.upper[d]);
            let child = upper(0) | upper(1) << 1;
            if seen.insert((miss.cell, child)) {
                marks.push(Mark { cell: miss.cell, child: Some(child) });
            }
        }
        if marks.is_empty() {
            // Two sheets that pass through one another may have room enough between them, once they are nearer to the scan.
            for crossing in measured.crossings(&self.scan, self.tolerance)?.places {
                for u in crossing.parameters {
                    marks.push(Mark::whole(map.space().locate_cell(map.space().to_domain(u))?));
                }
            }
            marks.sort_by_key(|mark| mark.cell);
            marks.dedup();
        }
        Ok(marks)
    }
}

/// A method whose points and parameters can be looked at.
pub(crate) trait HasPoints {
    /// The points, in the order of the cells of the last space.
    fn sorted(&self) -> &SortedPoints<2>;
}

impl HasPoints for LeastSquares<2> {
    fn sorted(&self) -> &SortedPoints<2> {
        self.points()
    }
}

impl HasPoints for MovingFit<2> {
    fn sorted(&self) -> &SortedPoints<2> {
        self.points()
    }
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
    errors: Vec<f64>,
}

impl<'a, S> Judged<'a, S> {
    pub(crate) fn new(method: S, judge: Option<&'a Judge<'a>>, within: f64) -> Self {
        Self { method, judge, within, errors: Vec::new() }
    }
}

impl<S> Judged<'_, S>
where
    S: Solve<2> + HasPoints,
    Error: From<S::Error>,
{
    /// Distances to the closest points, in the order of the cells.
    fn distances(&self, judge: &Judge<'_>, map: &SplineMap<2>) -> Result<Vec<f64>, Error> {
        let points = self.method.sorted();
        let space = map.space();
        let free = Constraints::in_space(points.parameters_as_given().view(), space.as_ref(), Boundary::Free);
        let feet = foot_points(map, points, &free, &FootPointOptions::default())?;
        let mut distances = feet.distances;
        if judge.scan.is_mesh() {
            return Ok(distances);
        }
        let ((lower, upper), periodic) = (space.domain(), space.periodic());
        for (at, u) in feet.parameters.iter().enumerate() {
            let on_rim = (0..2).any(|d| !periodic[d] && (u[d] <= lower[d] || u[d] >= upper[d]));
            if on_rim {
                let offset: [f64; 3] = std::array::from_fn(|k| points.coordinates(k)[at]);
                distances[at] = deviation::distance_across(map, feet.cells[at] as usize, *u, offset);
            }
        }
        Ok(distances)
    }
}

impl<S> Solve<2> for Judged<'_, S>
where
    S: Solve<2> + HasPoints,
    Error: From<S::Error>,
{
    type Error = Error;

    fn solve(
        &mut self,
        space: &Arc<HierarchicalSpace<2>>,
        previous: Option<&SplineMap<2>>,
    ) -> Result<Solution<2>, Error> {
        Ok(self.method.solve(space, previous)?)
    }

    fn estimate(&mut self, map: &SplineMap<2>) -> Result<Estimate<'_>, Error> {
        let Some(judge) = self.judge else { return Ok(self.method.estimate(map)?) };
        // This sorts the points by the cells of the map's space.
        self.method.estimate(map)?;
        self.errors = self.distances(judge, map)?;
        let at_parameters = self.method.estimate(map)?;
        Ok(Estimate { errors: &self.errors, ..at_parameters })
    }

    fn mark(&self, map: &SplineMap<2>, tolerance: f64) -> Option<Vec<Mark>> {
        self.method.mark(map, tolerance)
    }

    fn missed(&mut self, map: &SplineMap<2>) -> Result<Vec<Mark>, Error> {
        let Some(judge) = self.judge else { return Ok(self.method.missed(map)?) };
        let parameters = self.method.sorted().parameters_as_given();
        judge.missed(map, parameters.slice_axis(Axis(0), (..judge.scan.len()).into()), self.within)
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
