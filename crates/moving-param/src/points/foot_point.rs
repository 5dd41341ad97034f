//! Foot points: the parameters of the map's points nearest to given points (Imperatore 2024, §5.1.1).

use fit_ls::SortedPoints;
use ndarray::Array2;
use pulp::{Simd, WithSimd};
use rayon::prelude::*;
use thb_core::{BezierMap, ClosestPoints, HierarchicalSpace, ParameterBox, SplineMap};

use crate::Error;
use crate::equations::{PointBlock, Spring};
use crate::points::check::check;
use crate::points::constraint::Constraints;
use crate::points::descent::{Descent, DescentState, Local};
use crate::points::patch::Patch;
use crate::points::samples::Samples;
use crate::points::vector::{Vector, difference, dot, point};
use crate::safeguards::Parameters;

/// Where the search for a foot point starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// At the present parameter.
    Present,
    /// At the nearest of samples of the map, so many per direction and cell.
    Sampled(usize),
    /// At both; the nearer foot point wins.
    Both(usize),
    /// At the present parameter, then all pieces of the map that could be nearer are searched: the result is the global
    /// minimum (up to several minima within a piece of nearly constant tangent). Constrained points are not searched.
    Global,
}

/// How foot points are sought.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FootPointOptions {
    /// Where to start.
    pub start: Start,
    /// How to descend.
    pub descent: Descent,
    /// Largest number of steps per start.
    pub max_steps: usize,
}

impl Default for FootPointOptions {
    /// Newton's method from the present parameter, at most 20 steps.
    fn default() -> Self {
        Self { start: Start::Present, descent: Descent::Newton, max_steps: 20 }
    }
}

/// Foot points of sorted points, in their order.
#[derive(Clone, Debug)]
pub struct FootPoints<const D: usize> {
    /// Parameters.
    pub parameters: Vec<[f64; D]>,
    /// Cells that hold them.
    pub cells: Vec<u32>,
    /// Distances of the points to the map there.
    pub distances: Vec<f64>,
    /// What the search did.
    pub report: FootPointReport,
}

/// What a search for foot points did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FootPointReport {
    /// Mean number of steps per point.
    pub mean_steps: f64,
    /// Largest number of steps of a point.
    pub max_steps: usize,
    /// Share of the points whose distance fell, so that they moved.
    pub accepted: f64,
    /// Mean length of the moves, in parameters.
    pub mean_move: f64,
    /// Largest length of a move, in parameters.
    pub max_move: f64,
}

/// Points of one parallel task.
const CHUNK: usize = 512;

/// Steps below this share of the cell are round-off and not taken.
const NO_STEP: f64 = 1e-13;

/// Longest step, in cells: beyond a neighbour the polynomial of the cell says nothing.
const REACH: f64 = 1.0;

/// Foot points of points sorted by the cells of the map's space. A point moves only if its distance falls.
///
/// # Errors
/// [`Error::Dimension`], [`Error::Shape`] if points and map have different dimensions or the points are sorted for another
/// space.
pub fn foot_points<const D: usize>(
    map: &SplineMap<D>,
    points: &SortedPoints<D>,
    constraints: &Constraints<D>,
    options: &FootPointOptions,
) -> Result<FootPoints<D>, Error> {
    foot_points_from(map, points, None, &[], constraints, options)
}

/// As [`foot_points`], from other parameters than the present ones where there are any, of points that hang on the springs of their
/// blocks where there are blocks. What moved is counted from the present parameters, wherever the search starts; distances are without
/// the springs.
pub(crate) fn foot_points_from<const D: usize>(
    map: &SplineMap<D>,
    points: &SortedPoints<D>,
    starts: Option<&Parameters<D>>,
    blocks: &[PointBlock<D>],
    constraints: &Constraints<D>,
    options: &FootPointOptions,
) -> Result<FootPoints<D>, Error> {
    check(map, points)?;
    let search = Search::new(map, options)?;
    let mut result = FootPoints {
        parameters: vec![[0.0; D]; points.len()],
        cells: vec![0; points.len()],
        distances: vec![0.0; points.len()],
        report: FootPointReport::default(),
    };
    let parameters = result.parameters.par_chunks_mut(CHUNK);
    let places = parameters.zip(result.cells.par_chunks_mut(CHUNK)).zip(result.distances.par_chunks_mut(CHUNK));
    let reports: Vec<ChunkReport> = places
        .enumerate()
        .map(|(chunk, ((parameters, cells), distances))| {
            let (search, first) = (&search, chunk * CHUNK);
            // PERF: the vectors of the machine at hand; sums and products are rounded alike everywhere.
            let chunk = Chunk { search, points, starts, blocks, constraints, first, parameters, cells, distances };
            pulp::Arch::new().dispatch(chunk)
        })
        .collect();
    let (mut steps, mut moved) = (0, 0);
    for chunk in reports {
        let report = &mut result.report;
        steps += chunk.steps;
        moved += chunk.moved;
        report.max_steps = report.max_steps.max(chunk.max_steps);
        report.mean_move += chunk.way;
        report.max_move = report.max_move.max(chunk.max_way);
    }
    let count = points.len().max(1) as f64;
    result.report.mean_steps = steps as f64 / count;
    result.report.accepted = moved as f64 / count;
    result.report.mean_move /= count;
    Ok(result)
}

/// What the search did to a range of points.
#[derive(Clone, Copy, Debug, Default)]
struct ChunkReport {
    steps: usize,
    max_steps: usize,
    /// Points that moved.
    moved: usize,
    /// Sum of the lengths of the moves.
    way: f64,
    max_way: f64,
}

/// Foot points of some sorted points, given by position, that start from the nearest samples of the map as well. What is
/// constrained starts from its present parameter only. Parameters and cells, one per position.
pub(crate) fn seek_anew<const D: usize>(
    map: &SplineMap<D>,
    points: &SortedPoints<D>,
    positions: &[usize],
    constraints: &Constraints<D>,
    options: &FootPointOptions,
) -> Result<Vec<([f64; D], u32)>, Error> {
    check(map, points)?;
    let search = Search::new(map, options)?;
    let offsets = points.offsets();
    let of = |&at: &usize| {
        let cell = offsets.partition_point(|&o| o <= at) - 1;
        let mut patch = Patch::new(search.map, cell);
        let free = constraints.free(points.order()[at] as usize);
        let target = Target { point: point(points, at), spring: None };
        let found = search.find(&mut patch, &target, cell, points.parameter(at), free);
        (found.u, found.cell as u32)
    };
    Ok(positions.par_iter().map(of).collect())
}

/// A range of points whose foot points are sought.
struct Chunk<'a, const D: usize> {
    search: &'a Search<'a, D>,
    points: &'a SortedPoints<D>,
    starts: Option<&'a Parameters<D>>,
    blocks: &'a [PointBlock<D>],
    constraints: &'a Constraints<D>,
    first: usize,
    parameters: &'a mut [[f64; D]],
    cells: &'a mut [u32],
    distances: &'a mut [f64],
}

impl<const D: usize> WithSimd for Chunk<'_, D> {
    type Output = ChunkReport;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> Self::Output {
        let Self { search, points, starts, blocks, constraints, first, parameters, cells, distances } = self;
        let offsets = points.offsets();
        let mut cell = offsets.partition_point(|&o| o <= first) - 1;
        let mut patch = Patch::new(search.map, cell);
        let mut report = ChunkReport::default();
        for i in 0..parameters.len() {
            let at = first + i;
            while offsets[cell + 1] <= at {
                cell += 1;
            }
            let (free, before) = (constraints.free(points.order()[at] as usize), points.parameter(at));
            let (cell, u) = match starts {
                Some(starts) => (starts.cells[at] as usize, starts.values[at]),
                None => (cell, before),
            };
            let target = Target { point: point(points, at), spring: blocks.get(at).map(|block| block.spring) };
            let found = search.find(&mut patch, &target, cell, u, free);
            (parameters[i], cells[i], distances[i]) = (found.u, found.cell as u32, found.squared.sqrt());
            let length = search.space.way(before, found.u).iter().map(|w| w.powi(2)).sum::<f64>().sqrt();
            report.steps += found.steps;
            report.max_steps = report.max_steps.max(found.steps);
            report.moved += usize::from(length > 0.0);
            report.way += length;
            report.max_way = report.max_way.max(length);
        }
        report
    }
}

/// A point whose foot point is sought.
struct Target<const D: usize> {
    point: Vector,
    spring: Option<Spring<D>>,
}

/// A parameter reached by the search.
#[derive(Clone, Copy, Debug)]
struct Found<const D: usize> {
    u: [f64; D],
    cell: usize,
    squared: f64,
    steps: usize,
}

/// What all points of a search share.
struct Search<'a, const D: usize> {
    space: &'a HierarchicalSpace<D>,
    map: &'a BezierMap<D>,
    domain: ([f64; D], [f64; D]),
    periodic: [bool; D],
    options: FootPointOptions,
    samples: Option<Samples<D>>,
    global: Option<ClosestPoints<D>>,
}

impl<'a, const D: usize> Search<'a, D> {
    fn new(map: &'a SplineMap<D>, options: &FootPointOptions) -> Result<Self, Error> {
        let samples = match options.start {
            Start::Sampled(count) | Start::Both(count) => Some(Samples::new(map.bezier(), count)?),
            Start::Present | Start::Global => None,
        };
        let global = (options.start == Start::Global).then(|| ClosestPoints::new(map.bezier().clone())).transpose()?;
        let (domain, periodic) = (map.space().domain(), map.space().periodic());
        Ok(Self { space: map.space(), map: map.bezier(), domain, periodic, options: *options, samples, global })
    }

    #[inline(always)]
    fn find(&self, patch: &mut Patch<D>, target: &Target<D>, cell: usize, u: [f64; D], free: [bool; D]) -> Found<D> {
        let point = &target.point;
        let unconstrained = free.iter().all(|f| *f);
        let mut best = match self.options.start {
            Start::Sampled(_) if unconstrained => {
                self.enter(patch, cell);
                let residual = difference(&patch.jet(u).value, point);
                Found { u, cell, squared: dot(&residual, &residual), steps: 0 }
            }
            _ => self.descend(patch, target, cell, u, free),
        };
        if let Some(samples) = self.samples.as_ref().filter(|_| unconstrained) {
            let (cell, u) = samples.nearest(point);
            best = nearer(best, self.descend(patch, target, cell, u, free));
        }
        if let (Some(samples), false) = (&self.samples, unconstrained)
            && free.iter().filter(|f| **f).count() == 1
        {
            let (cell, u) = self.nearest_along(patch, point, u, free, samples.per_line);
            best = nearer(best, self.descend(patch, target, cell, u, free));
        }
        if let Some(global) = self.global.as_ref().filter(|_| unconstrained) {
            let found = global.closest_from(&point[..self.map.dim()], best.cell, best.u);
            best = nearer(best, Found { u: found.u, cell: found.cell, squared: found.distance.powi(2), steps: 0 });
        }
        best
    }

    fn enter(&self, patch: &mut Patch<D>, cell: usize) {
        if patch.cell() != cell {
            patch.load(self.map, cell);
        }
    }

    /// The nearest of samples along the only free direction of a point of a side.
    fn nearest_along(
        &self,
        patch: &mut Patch<D>,
        point: &Vector,
        u: [f64; D],
        free: [bool; D],
        samples: usize,
    ) -> (usize, [f64; D]) {
        let (lower, upper) = self.domain;
        let mut best = (patch.cell(), u, f64::INFINITY);
        for i in 0..samples {
            let share = (i as f64 + 0.5) / samples as f64;
            let at = std::array::from_fn(|d| if free[d] { lower[d] + share * (upper[d] - lower[d]) } else { u[d] });
            self.enter(patch, self.cell_of(patch, at));
            let residual = difference(&patch.first_jet(at).value, point);
            let squared = dot(&residual, &residual);
            if squared < best.2 {
                best = (patch.cell(), at, squared);
            }
        }
        (best.0, best.1)
    }

    /// The cell of a parameter within the domain, given the present one.
    fn cell_of(&self, patch: &Patch<D>, u: [f64; D]) -> usize {
        if patch.contains(u) { patch.cell() } else { self.space.locate_cell(u).unwrap_or(patch.cell()) }
    }

    #[inline(always)]
    fn descend(
        &self,
        patch: &mut Patch<D>,
        target: &Target<D>,
        cell: usize,
        start: [f64; D],
        free: [bool; D],
    ) -> Found<D> {
        self.enter(patch, cell);
        let mut u = start;
        let mut local = self.local(patch, target, u);
        let mut state = DescentState::new(self.options.descent);
        let mut steps = 0;
        let (lower, upper) = self.domain;
        while steps < self.options.max_steps {
            let size = patch.size();
            let outward =
                |d: usize| u[d] <= lower[d] && local.gradient[d] >= 0.0 || u[d] >= upper[d] && local.gradient[d] <= 0.0;
            let free = std::array::from_fn(|d| free[d] && (self.periodic[d] || !outward(d)));
            let Some(step) = state.step(&local, free, size) else { break };
            let relative = |v: &[f64; D]| (0..D).map(|d| (v[d] / size[d]).abs()).fold(0.0, f64::max);
            let shrink = (REACH / relative(&step)).min(1.0);
            let stepped = std::array::from_fn(|d| if free[d] { u[d] + shrink * step[d] } else { u[d] });
            let candidate = self.space.to_domain(stepped);
            let way = self.space.way(u, candidate);
            let moved = relative(&way);
            if moved <= NO_STEP || moved.is_nan() {
                break;
            }
            steps += 1;
            let home = patch.cell();
            self.enter(patch, self.cell_of(patch, candidate));
            let next = self.local(patch, target, candidate);
            if next.squared < local.squared {
                (u, local) = (candidate, next);
                if state.is_last(&way, moved) {
                    break;
                }
                state.accepted(way);
            } else {
                self.enter(patch, home);
                if state.is_last(&way, moved)
                    || !state.rejected(moved * size.iter().copied().fold(f64::INFINITY, f64::min))
                {
                    break;
                }
            }
        }
        // On the edge between two cells the point belongs to the upper one.
        let cell = if patch.owns(u) { patch.cell() } else { self.space.locate_cell(u).unwrap_or(patch.cell()) };
        let spring = target.spring.map_or(0.0, |spring| spring.squared(self.space, u));
        Found { u, cell, squared: (local.squared - spring).max(0.0), steps }
    }

    /// The squared distance and the spring's energy at a parameter of the patch.
    #[inline(always)]
    fn local(&self, patch: &Patch<D>, target: &Target<D>, u: [f64; D]) -> Local<D> {
        let local = Local::new(&patch.jet(u), &target.point);
        match &target.spring {
            None => local,
            Some(spring) => local.anchored(spring.squared(self.space, u), spring.pull(self.space, u), spring.stiffness),
        }
    }
}

fn nearer<const D: usize>(a: Found<D>, b: Found<D>) -> Found<D> {
    let steps = a.steps + b.steps;
    let best = if b.squared < a.squared { b } else { a };
    Found { steps, ..best }
}

/// Foot points of points `(m, N)` from parameters `(m, D)`, in their order: a plain call of [`foot_points`].
/// Returns the parameters `(m, D)`, the distances, and the report.
///
/// # Errors
/// Those of [`foot_points`] and of [`SortedPoints::new`].
pub fn project<const D: usize>(
    map: &SplineMap<D>,
    parameters: ndarray::ArrayView2<'_, f64>,
    points: ndarray::ArrayView2<'_, f64>,
    boundary: crate::Boundary,
    options: &FootPointOptions,
) -> Result<(Array2<f64>, Vec<f64>, FootPointReport), Error> {
    let mut sorted = SortedPoints::new(parameters, points, None)?;
    sorted.sort_refined(map.space(), None)?;
    let constraints = Constraints::in_space(parameters, map.space().as_ref(), boundary);
    let found = foot_points(map, &sorted, &constraints, options)?;
    let mut result = Array2::zeros(parameters.raw_dim());
    let mut distances = vec![0.0; sorted.len()];
    for (at, &index) in sorted.order().iter().enumerate() {
        (0..D).for_each(|d| result[[index as usize, d]] = found.parameters[at][d]);
        distances[index as usize] = found.distances[at];
    }
    Ok((result, distances, found.report))
}
