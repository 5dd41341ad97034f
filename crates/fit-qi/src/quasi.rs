//! The fitting method: hierarchical quasi-interpolation on a set of points, in one space after the other.

use std::sync::Arc;
use std::time::Instant;

use adaptive::{Estimate, Solution, Solve};
use fit_ls::SortedPoints;
use ndarray::{Array2, ArrayView1, ArrayView2};
use thb_core::{CellSpace, HierarchicalSpace, Kind, Mark, Refinement, SplineMap};

use crate::cells::{Layout, LevelCells};
use crate::level::LevelSolver;
use crate::local::Demand;
use crate::mark::mark_functions;
use crate::order::MortonOrder;
use crate::{Error, LocalLambda, Options};

/// Functions whose regions are held in memory at a time.
const BATCH: usize = 1 << 14;

/// What was done in one space.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Work {
    /// Functions of the space.
    pub functions: usize,
    /// Functions whose coefficients were computed; those of all others were kept.
    pub solved: usize,
    /// The same for each level.
    pub solved_per_level: Vec<usize>,
    /// Points that were summed, over all levels. No point is summed twice on a level unless points move.
    pub summed: usize,
    /// Local problems whose region had to be larger than the support.
    pub enlarged: usize,
    /// Largest number of rings by which a support was enlarged.
    pub max_rings: usize,
    /// Functions with too few points within `p + 1` rings of their support, whose coefficient is therefore the one that the
    /// quasi-interpolant of the coarser level has for them.
    pub inherited: usize,
    /// Functions, by number in the space, whose coefficient is the mean of local points, because the parameters of these
    /// lie on a line: there the local problem has no unique solution (Imperatore 2024, Theorem 2).
    pub collinear: Vec<usize>,
    /// How well the least determined coefficient that was computed is determined: the smallest share of a coefficient's
    /// diagonal entry that is left when all other unknowns of its problem are eliminated. Theorem 2 makes it positive.
    pub weakest: f64,
}

/// The sums of the points, valid as long as these do not move.
#[derive(Debug)]
struct Prepared<const D: usize> {
    order: MortonOrder<D>,
    levels: Vec<LevelCells<D>>,
}

/// Hierarchical quasi-interpolation of points.
#[derive(Debug)]
pub struct QuasiInterpolation<const D: usize> {
    points: SortedPoints<D>,
    options: Options<D>,
    /// The weight of the local problems, once it is chosen.
    lambda: Option<LocalLambda>,
    prepared: Option<Prepared<D>>,
    /// The space that points are divided for.
    divided_for: Option<Arc<HierarchicalSpace<D>>>,
    /// Coefficients at the present parameters.
    last: Option<(Arc<HierarchicalSpace<D>>, Array2<f64>)>,
    errors: Vec<f64>,
    work: Vec<Work>,
}

impl<const D: usize> QuasiInterpolation<D> {
    /// A problem with points `(m, N)` at parameters `(m, D)`, with weights `(m)` if given.
    ///
    /// # Errors
    /// Those of [`SortedPoints::new`]; [`Error::Option`], [`Error::TooFewPoints`].
    pub fn new(
        parameters: ArrayView2<'_, f64>,
        points: ArrayView2<'_, f64>,
        weights: Option<ArrayView1<'_, f64>>,
        options: Options<D>,
    ) -> Result<Self, Error> {
        let points = SortedPoints::new(parameters, points, weights)?;
        options.check(points.len())?;
        let lambda = options.lambda.number().map(|_| options.lambda);
        Ok(Self {
            points,
            options,
            lambda,
            prepared: None,
            divided_for: None,
            last: None,
            errors: Vec::new(),
            work: Vec::new(),
        })
    }

    /// The points, in the order of the cells of the last space.
    pub fn points(&self) -> &SortedPoints<D> {
        &self.points
    }

    /// The smoothing weight in use; `None` as long as an automatic one is not chosen.
    pub fn lambda(&self) -> Option<LocalLambda> {
        self.lambda
    }

    /// What was done in each space, in the order of the calls.
    pub fn work(&self) -> &[Work] {
        &self.work
    }

    /// Moves the points to other parameters, given in the order of the sorted points with the cell of each
    /// ([`SortedPoints::relocate`]). All coefficients become unknown.
    ///
    /// # Errors
    /// [`Error::Points`].
    pub fn relocate(&mut self, parameters: &[[f64; D]], cells: &[u32]) -> Result<(), Error> {
        self.points.relocate(parameters, cells)?;
        self.prepared = None;
        self.last = None;
        Ok(())
    }

    /// The quasi-interpolant in a space. Where the space before was one of the same knots, only functions that are new get
    /// a new coefficient.
    ///
    /// # Errors
    /// [`Error::NotTruncated`], [`Error::Points`], [`Error::TooFewPoints`], [`Error::NotDetermined`].
    pub fn fit(&mut self, space: &Arc<HierarchicalSpace<D>>) -> Result<SplineMap<D>, Error> {
        self.prepare(space)?;
        let needed = self.options.local_points(space.degree());
        if self.points.len() < needed {
            return Err(Error::TooFewPoints { given: self.points.len(), needed });
        }
        let lambda = self.choose_lambda(space)?;
        let (mut coefficients, new) = self.kept(space);
        let mut work = Work { functions: space.n_functions(), weakest: 1.0, ..Work::default() };
        for (level, functions) in new.iter().enumerate() {
            self.solve_level(space, level, functions, lambda, &mut coefficients, &mut work)?;
            work.solved += functions.len();
            work.solved_per_level.push(functions.len());
        }
        work.collinear.sort_unstable();
        tracing::debug!(?work, "quasi-interpolated");
        self.work.push(work);
        self.last = Some((space.clone(), coefficients.clone()));
        Ok(SplineMap::new(space.clone(), coefficients)?)
    }

    /// Distances of the points to a map, sorted by the cells of its space; [`SortedPoints::order`] has the indices of the
    /// points.
    ///
    /// # Errors
    /// [`Error::Points`].
    pub fn distances(&mut self, map: &SplineMap<D>) -> Result<&[f64], Error> {
        self.prepare(map.space())?;
        self.points.distances(map.bezier(), &mut self.errors)?;
        Ok(&self.errors)
    }

    /// Sorts the points and divides them among the cells of a space.
    fn prepare(&mut self, space: &Arc<HierarchicalSpace<D>>) -> Result<(), Error> {
        if space.kind() != Kind::Thb {
            return Err(Error::NotTruncated);
        }
        if !self.prepared.as_ref().is_some_and(|prepared| prepared.order.is_for(space)) {
            let order = MortonOrder::sort(space, &mut self.points)?;
            self.prepared = Some(Prepared { order, levels: Vec::new() });
            (self.divided_for, self.last) = (Some(space.clone()), None);
        }
        let Some(Prepared { order, levels }) = &mut self.prepared else { return Ok(()) };
        if !self.divided_for.as_ref().is_some_and(|known| Arc::ptr_eq(known, space)) {
            self.points.divide(order.offsets(space)?)?;
            self.divided_for = Some(space.clone());
        }
        let layout = Layout { degree: space.degree(), columns: self.points.dim() };
        for level in levels.len()..space.n_levels() {
            levels.push(LevelCells::new(level, space, order, layout)?);
        }
        Ok(())
    }

    fn choose_lambda(&mut self, space: &HierarchicalSpace<D>) -> Result<LocalLambda, Error> {
        match (self.lambda, self.options.lambda) {
            (None, LocalLambda::Automatic { tolerance }) => {
                let value = fit_ls::automatic_lambda(&self.points, space, &fit_ls::Options::default(), tolerance)?;
                Ok(*self.lambda.insert(LocalLambda::Constant(value)))
            }
            (chosen, given) => Ok(chosen.unwrap_or(given)),
        }
    }

    /// Coefficients of a space with those that are known, and the tensor indices of the other functions of each level.
    fn kept(&self, space: &HierarchicalSpace<D>) -> (Array2<f64>, Vec<Vec<u64>>) {
        let mut coefficients = Array2::zeros((space.n_functions(), self.points.dim()));
        let mut new = Vec::with_capacity(space.n_levels());
        for level in 0..space.n_levels() {
            let functions = space.active_functions(level);
            let Some((before, known)) = &self.last else {
                new.push(functions.to_vec());
                continue;
            };
            let (first, first_before) = (space.first_of_level(level), before.first_of_level(level));
            let mut of_level = Vec::new();
            for (k, function) in functions.iter().enumerate() {
                match before.active_functions(level).binary_search(function) {
                    Ok(at) => coefficients.row_mut(first + k).assign(&known.row(first_before + at)),
                    Err(_) => of_level.push(*function),
                }
            }
            new.push(of_level);
        }
        (coefficients, new)
    }

    /// Computes the coefficients of functions of a level, given by increasing tensor indices.
    fn solve_level(
        &mut self,
        space: &HierarchicalSpace<D>,
        level: usize,
        functions: &[u64],
        lambda: LocalLambda,
        coefficients: &mut Array2<f64>,
        work: &mut Work,
    ) -> Result<(), Error> {
        let Some(Prepared { order, levels }) = &mut self.prepared else { return Ok(()) };
        let degree = space.degree();
        let mut solver = LevelSolver {
            levels,
            order,
            points: &self.points,
            demand: Demand {
                points: self.options.local_points(degree),
                density: self.options.density,
                rings: degree.iter().max().map_or(1, |p| p + 1),
            },
            lambda,
            layout: Layout { degree, columns: self.points.dim() },
        };
        let first = space.first_of_level(level);
        let active = space.active_functions(level);
        let number = |function: u64| first + active.partition_point(|&f| f < function);
        for batch in functions.chunks(BATCH) {
            let found = solver.coefficients(level, batch)?;
            for (&function, row) in batch.iter().zip(found.rows.chunks_exact(self.points.dim())) {
                coefficients.row_mut(number(function)).iter_mut().zip(row).for_each(|(c, x)| *c = *x);
            }
            work.collinear.extend(found.collinear.into_iter().map(number));
            work.inherited += found.inherited;
            work.enlarged += found.enlarged;
            work.max_rings = work.max_rings.max(found.max_rings);
            work.weakest = work.weakest.min(found.weakest);
            work.summed += found.summed;
        }
        Ok(())
    }
}

impl<const D: usize> Solve<D> for QuasiInterpolation<D> {
    type Error = Error;

    fn solve(
        &mut self,
        space: &Arc<HierarchicalSpace<D>>,
        _previous: Option<&SplineMap<D>>,
    ) -> Result<Solution<D>, Error> {
        let start = Instant::now();
        self.prepare(space)?;
        let assemble_seconds = start.elapsed().as_secs_f64();
        let solving = Instant::now();
        let map = self.fit(space)?;
        Ok(Solution { map, assemble_seconds, solve_seconds: solving.elapsed().as_secs_f64() })
    }

    fn estimate(&mut self, map: &SplineMap<D>) -> Result<Estimate<'_>, Error> {
        self.distances(map)?;
        Ok(Estimate { offsets: self.points.offsets(), errors: &self.errors, children: &[] })
    }

    /// Algorithm 4: the supports of functions with an error beyond the tolerance and points enough.
    fn mark(&self, map: &SplineMap<D>, tolerance: f64) -> Option<Vec<Mark>> {
        let Prepared { order, levels } = self.prepared.as_ref()?;
        let estimate = Estimate { offsets: self.points.offsets(), errors: &self.errors, children: &[] };
        let needed = self.options.points_to_refine(map.space().degree());
        let splits = self.options.splits;
        let cells = mark_functions(map.space(), estimate, tolerance, (order, levels), &self.points, needed, splits);
        Some(cells.into_iter().map(Mark::whole).collect())
    }

    /// Whole supports are marked, so there are no cells around them to refine besides.
    fn refine(
        &self,
        space: &HierarchicalSpace<D>,
        marked: &[Mark],
        refinement: &Refinement<D>,
    ) -> Result<HierarchicalSpace<D>, thb_core::Error> {
        space.refine_at(marked, &Refinement { extension: [0; D], ..*refinement })
    }
}
