//! Parameters moved together, by one smooth map of the parameter domain to itself.
//!
//! Point by point, parameters can follow noise: a cloud of `m` points has `D m` of them. A tensor-product spline map with
//! few control points cannot. It is no method of Imperatore 2024; it is there to be compared with.

use std::sync::Arc;

use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::cholesky::llt::{factor, solve};
use faer::reborrow::{Reborrow, ReborrowMut};
use faer::{MatMut, Par};
use fit_ls::{Cholesky, FactorizationError, NormalEquations, SortedPoints};
use ndarray::Array2;
use rayon::prelude::*;
use thb_core::{CellSpace, HierarchicalSpace, ParameterBox, SplineMap, bernstein};

use crate::damping::{Damping, DampingRule};
use crate::driver::{Limits, StepProblem, minimize};
use crate::methods::square::SquareMap;
use crate::moving::{Moves, MovingFit};
use crate::points::frame::{Frame, frames_at};
use crate::points::place::cells_of;
use crate::points::vector::dot;
use crate::terms::data::half_squares;
use crate::terms::map_barrier::BarrierEquations;
use crate::terms::smoothing::Smoothing;
use crate::{Error, SquareMapOptions};

/// The damping, relative to the diagonal. Below 1e-10 the equations are too near to singular; beyond 1e6 a step is nothing but a short
/// one down the gradient.
const DAMPING: DampingRule = DampingRule { first: 1e-3, least: 1e-10, most: 1e6, accept: 0.1, refuse: 10.0, pause: 0 };

/// Cells of one parallel task.
const CHUNK: usize = 16;

impl<const D: usize> MovingFit<D> {
    /// Steps of Levenberg and Marquardt for the control points of the map of the domain, from whose equations the
    /// coefficients of the surface are eliminated: they are those of least squares at the moved parameters, always.
    pub(crate) fn move_by_map(
        &mut self,
        map: SplineMap<D>,
        options: &SquareMapOptions,
        moves: &mut Moves,
    ) -> Result<SplineMap<D>, Error> {
        let space = map.space().clone();
        let square = match self.square.take() {
            Some(square) => square,
            None => SquareMap::identity(options.per_side, &space, &self.start)?,
        };
        let smoothing = self.smoothing(&space)?;
        let barrier = options.barrier * self.options.tolerance.powi(2) * self.fit.points().total_weight();
        let surface = self.fit_through(&square, &space)?;
        let mut watch = self.watch.take();
        let mut steps = SquareSteps { fit: self, smoothing, barrier, square, surface, equations: None, moves };
        let limits = Limits { steps: options.max_steps, decrease: options.decrease, slow_steps: 1 };
        let ended = minimize(&mut steps, &mut Damping::new(DAMPING), &limits, watch.as_deref_mut());
        let SquareSteps { square, surface, .. } = steps;
        self.watch = watch;
        let ended = ended?;
        // The last trial may have been refused.
        self.relocate_through(&square, &space)?;
        let least_jacobian = square.barrier.least(&square.control_points);
        tracing::debug!(per_side = square.per_side(), least_jacobian, ?ended);
        self.square = Some(square);
        Ok(surface)
    }

    /// Puts all points at their parameters under the map.
    fn relocate_through(&mut self, square: &SquareMap<D>, space: &HierarchicalSpace<D>) -> Result<(), Error> {
        let (lower, upper) = space.domain();
        let parameter = |&index: &u32| {
            let (start, moved) = (self.start.row(index as usize), square.parameter(index as usize));
            // Points on a side stay there, without the round-off of the map.
            let is_on_side = |d: usize| start[d] == lower[d] || start[d] == upper[d];
            space.to_domain(std::array::from_fn(|d| if is_on_side(d) { start[d] } else { moved[d] }))
        };
        let parameters: Vec<[f64; D]> = self.fit.points().order().iter().map(parameter).collect();
        let cells = cells_of(space, &parameters)?;
        Ok(self.fit.relocate(&parameters, &cells)?)
    }

    /// `½ Σ ω d² + ½ λ J` and the barrier, at the present parameters.
    fn objective(
        &mut self,
        surface: &SplineMap<D>,
        smoothing: &Smoothing,
        barrier: f64,
        square: &SquareMap<D>,
    ) -> Result<f64, Error> {
        let distances = self.fit.distances(surface)?.to_vec();
        let ones = vec![1.0; distances.len()];
        let of_points = half_squares(&distances, self.fit.points().weights().unwrap_or(&ones));
        let of_surface = smoothing.energy_of(surface.coefficients());
        Ok(of_points + of_surface + square.barrier.energy(&square.control_points, barrier))
    }

    fn fit_through(&mut self, square: &SquareMap<D>, space: &Arc<HierarchicalSpace<D>>) -> Result<SplineMap<D>, Error> {
        self.relocate_through(square, space)?;
        Ok(self.fit.fit(space)?)
    }
}

/// The minimization by control points of the map: the state is one of them with the surface that fits best.
struct SquareSteps<'a, const D: usize> {
    fit: &'a mut MovingFit<D>,
    smoothing: Smoothing,
    /// Weight of the barrier.
    barrier: f64,
    square: SquareMap<D>,
    surface: SplineMap<D>,
    /// Those of the present step.
    equations: Option<Reduced>,
    moves: &'a mut Moves,
}

impl<const D: usize> StepProblem for SquareSteps<'_, D> {
    type Trial = (SquareMap<D>, SplineMap<D>);

    fn freeze(&mut self) -> Result<Option<f64>, Error> {
        if self.fit.measure(&self.surface)?.max <= self.fit.options.tolerance {
            return Ok(None);
        }
        self.equations = Some(self.reduced_equations()?);
        let Self { fit, smoothing, barrier, square, surface, .. } = self;
        fit.objective(surface, smoothing, *barrier, square).map(Some)
    }

    fn trial(&mut self, damping: f64) -> Result<Option<(Self::Trial, f64)>, Error> {
        let step = self.equations.as_ref().and_then(|equations| equations.step(damping));
        let next = step.map(|step| self.square.stepped(&step));
        let Some(next) = next.filter(|next| next.barrier.least(&next.control_points) > 0.0) else { return Ok(None) };
        let surface = self.fit.fit_through(&next, self.surface.space())?;
        let objective = self.fit.objective(&surface, &self.smoothing, self.barrier, &next)?;
        Ok(Some(((next, surface), objective)))
    }

    fn accept(&mut self, (square, surface): Self::Trial) -> Result<(), Error> {
        self.moves.corrections += 1;
        (self.square, self.surface) = (square, surface);
        Ok(())
    }
}

impl<const D: usize> SquareSteps<'_, D> {
    fn reduced_equations(&self) -> Result<Reduced, Error> {
        let Self { fit, smoothing, barrier, square, surface, .. } = self;
        let points = fit.fit.points();
        let frames = frames_at(surface, points)?;
        let mut reduced = Reduced::of_points(square, surface, points, &frames);
        reduced.eliminate(surface.space(), points, smoothing)?;
        let BarrierEquations { gradient, matrix } =
            square.barrier.linearize(&square.control_points, &square.free, *barrier);
        reduced.gradient.iter_mut().zip(gradient).for_each(|(g, x)| *g += x);
        reduced.matrix.iter_mut().zip(matrix).for_each(|(h, x)| *h += x);
        Ok(reduced)
    }
}

/// The normal equations of a step of the unknowns of the map.
#[derive(Debug)]
struct Reduced {
    unknowns: usize,
    gradient: Vec<f64>,
    /// `JᵀWJ`, less the part that the surface follows, row-major.
    matrix: Vec<f64>,
    /// Diagonal of `JᵀWJ`, by which steps are damped.
    scale: Vec<f64>,
    /// `BᵀWJ`, a row for each function of the surface and a column for each unknown and coordinate.
    mixed: Array2<f64>,
}

/// What a run of cells adds.
struct Part {
    gradient: Vec<f64>,
    matrix: Vec<f64>,
    /// Cells with their rows of `BᵀWJ`, one per function of the cell.
    rows: Vec<(usize, Vec<f64>)>,
}

impl Reduced {
    /// The sums over the points: gradient, `JᵀWJ` and `BᵀWJ`, where `J` is the derivative of the residuals with respect to the
    /// unknowns at constant coefficients.
    fn of_points<const D: usize>(
        square: &SquareMap<D>,
        surface: &SplineMap<D>,
        points: &SortedPoints<D>,
        frames: &[Frame<D>],
    ) -> Self {
        let (unknowns, dim) = (square.free.len(), surface.dim());
        let places = square.places();
        let cells = surface.space().n_cells();
        let parts: Vec<Part> = (0..cells.div_ceil(CHUNK))
            .into_par_iter()
            .map(|chunk| {
                let mut part =
                    Part { gradient: vec![0.0; unknowns], matrix: vec![0.0; unknowns * unknowns], rows: Vec::new() };
                for cell in chunk * CHUNK..(chunk * CHUNK + CHUNK).min(cells) {
                    part.add(cell, square, &places, surface, points, frames);
                }
                part
            })
            .collect();
        let mut sum = Self {
            unknowns,
            gradient: vec![0.0; unknowns],
            matrix: vec![0.0; unknowns * unknowns],
            scale: Vec::new(),
            mixed: Array2::zeros((surface.space().n_functions(), unknowns * dim)),
        };
        for part in parts {
            sum.gradient.iter_mut().zip(&part.gradient).for_each(|(a, b)| *a += b);
            sum.matrix.iter_mut().zip(&part.matrix).for_each(|(a, b)| *a += b);
            for (cell, rows) in part.rows {
                for (row, &function) in rows.chunks_exact(unknowns * dim).zip(surface.space().cell(cell).functions) {
                    sum.mixed.row_mut(function as usize).iter_mut().zip(row).for_each(|(a, b)| *a += b);
                }
            }
        }
        sum.scale = (0..unknowns).map(|k| sum.matrix[k * unknowns + k]).collect();
        sum
    }

    /// Takes out the part of the residuals that the coefficients take up when the parameters move:
    /// `JᵀWJ − (BᵀWJ)ᵀ (BᵀWB + λG)⁻¹ BᵀWJ`. The gradient has no such part, since the coefficients are optimal.
    fn eliminate<const D: usize>(
        &mut self,
        space: &Arc<HierarchicalSpace<D>>,
        points: &SortedPoints<D>,
        smoothing: &Smoothing,
    ) -> Result<(), Error> {
        let (gram, lambda) = (smoothing.gram(), smoothing.lambda());
        let functions = space.n_functions();
        let failed = |error| match error {
            FactorizationError::OutOfMemory => Error::Fit(fit_ls::Error::OutOfMemory { functions }),
            FactorizationError::NotPositiveDefinite => {
                Error::Minimization { reason: "the coefficients are not determined; smooth more".into() }
            }
        };
        let NormalEquations { mut matrix, .. } = NormalEquations::new(space.as_ref(), gram.pattern(), points)?;
        matrix.values_mut().iter_mut().zip(gram.values()).for_each(|(x, g)| *x += lambda * g);
        let mut solver = Cholesky::new(matrix.pattern()).map_err(failed)?;
        solver.factorize(&matrix).map_err(failed)?;
        let solution = solver.solve(&self.mixed).map_err(failed)?;
        // Columns of one coordinate belong together: they are `unknowns` wide.
        let dim = self.mixed.ncols() / self.unknowns.max(1);
        for k in 0..dim {
            let columns: Vec<usize> = (0..self.unknowns).map(|a| k * self.unknowns + a).collect();
            let mixed = self.mixed.select(ndarray::Axis(1), &columns);
            let followed = mixed.t().dot(&solution.select(ndarray::Axis(1), &columns));
            self.matrix.iter_mut().zip(followed.iter()).for_each(|(h, x)| *h -= x);
        }
        Ok(())
    }

    /// The step `−(H + μ diag)⁻¹ g`; `None` unless the matrix is positive definite.
    fn step(&self, damping: f64) -> Option<Vec<f64>> {
        let n = self.unknowns;
        let largest = self.scale.iter().copied().fold(0.0, f64::max);
        let mut factor = self.matrix.clone();
        for k in 0..n {
            // Unknowns without points near them stay where they are.
            factor[k * n + k] += damping * self.scale[k].max(f64::EPSILON * largest);
        }
        let scratch = StackReq::any_of(&[
            factor::cholesky_in_place_scratch::<f64>(n, Par::Seq, Default::default()),
            solve::solve_in_place_scratch::<f64>(n, 1, Par::Seq),
        ]);
        let mut memory = MemBuffer::try_new(scratch).ok()?;
        let mut factor = MatMut::from_row_major_slice_mut(&mut factor, n, n);
        let stack = MemStack::new(&mut memory);
        factor::cholesky_in_place(factor.rb_mut(), Default::default(), Par::Seq, stack, Default::default()).ok()?;
        let mut x: Vec<f64> = self.gradient.iter().map(|g| -g).collect();
        let right = MatMut::from_column_major_slice_mut(&mut x, n, 1);
        solve::solve_in_place(factor.rb(), right, Par::Seq, stack);
        x.iter().all(|x| x.is_finite()).then_some(x)
    }
}

impl Part {
    fn add<const D: usize>(
        &mut self,
        cell: usize,
        square: &SquareMap<D>,
        places: &[Option<u32>],
        surface: &SplineMap<D>,
        points: &SortedPoints<D>,
        frames: &[Frame<D>],
    ) {
        let range = points.offsets()[cell]..points.offsets()[cell + 1];
        if range.is_empty() {
            return;
        }
        let (unknowns, dim) = (square.free.len(), surface.dim());
        let place = surface.space().cell(cell);
        let size = place.size();
        let width = unknowns * dim;
        let mut rows = vec![0.0; place.n_local() * width];
        for at in range {
            let frame = &frames[at];
            let weight = points.weights().map_or(1.0, |w| w[at]);
            let u = points.parameter(at);
            let local: [f64; D] = std::array::from_fn(|d| (u[d] - place.lower[d]) / size[d]);
            let values = local_values(surface.space().degree(), local);
            // Unknowns that move the point, with their derivative of its parameter and the direction.
            let moving: Vec<(usize, usize, f64)> = square.active[points.order()[at] as usize]
                .iter()
                .flat_map(|&(j, share)| {
                    (0..D).filter_map(move |d| places[j as usize * D + d].map(|place| (place as usize, d, share)))
                })
                .collect();
            let metric: [[f64; D]; D] =
                std::array::from_fn(|a| std::array::from_fn(|b| dot(&frame.tangents[a], &frame.tangents[b])));
            let slope: [f64; D] = std::array::from_fn(|d| dot(&frame.tangents[d], &frame.residual));
            for &(a, d, share) in &moving {
                self.gradient[a] += weight * share * slope[d];
                for &(b, e, other) in &moving {
                    self.matrix[a * unknowns + b] += weight * share * other * metric[d][e];
                }
                for (row, value) in rows.chunks_exact_mut(width).zip(&values) {
                    for k in 0..dim {
                        row[k * unknowns + a] += weight * value * share * frame.tangents[d][k];
                    }
                }
            }
        }
        place.pull_back(&mut rows, width, &mut Vec::new());
        self.rows.push((cell, rows));
    }
}

/// The Bernstein polynomials of all directions at a local parameter, multiplied; the first direction runs fastest.
fn local_values<const D: usize>(degree: [usize; D], local: [f64; D]) -> Vec<f64> {
    let mut all = vec![1.0];
    for d in (0..D).rev() {
        let mut values = [0.0; thb_core::MAX_DEGREE + 1];
        bernstein::values(degree[d], local[d], &mut values);
        all = all.iter().flat_map(|&share| values[..=degree[d]].iter().map(move |x| share * x)).collect();
    }
    all
}
