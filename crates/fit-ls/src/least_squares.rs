//! The fitting method: points, weights, smoothing, constraints.

use std::sync::Arc;
use std::time::Instant;

use adaptive::{Estimate, Solution, Solve};
use ndarray::{Array2, ArrayView1, ArrayView2};
use thb_core::{
    Cell, CellSpace, HierarchicalSpace, Quadrature, SplineMap, SymmetricMatrix, SymmetricPattern, ThinPlate,
};

use crate::cholesky::{Cholesky, FactorizationError};
use crate::cross_validation::{Path, by_cross_validation, by_discrepancy};
use crate::lambda::{subset, uniform_space};
use crate::{Error, Lambda, NormalEquations, SortedPoints};

/// Number of functions without data that an error names.
const NAMED: usize = 5;

/// Functions up to which cross-validation looks at all smoothing weights.
const FEW: usize = 500;

/// Functions for each one of the space in which it looks at all of them otherwise.
const COARSER: usize = 6;

/// Points for each function of that space by which the weight is guessed.
const GUESSED_BY: usize = 12;

/// How to fit.
#[derive(Clone, Debug)]
pub struct Options<const D: usize> {
    /// The smoothing weight λ.
    pub lambda: Lambda,
    /// How the energy is integrated.
    pub quadrature: Quadrature,
    /// Lengths of the parameter domain per direction in the energy ([`ThinPlate::scaled`]).
    pub lengths: [f64; D],
}

impl<const D: usize> Default for Options<D> {
    fn default() -> Self {
        Self { lambda: Lambda::Auto { tolerance: f64::INFINITY }, quadrature: Quadrature::Exact, lengths: [1.0; D] }
    }
}

/// A box of the parameter domain in which the smoothing weight is another one: λ times `factor`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalSmoothing<const D: usize> {
    /// Lower corner.
    pub lower: [f64; D],
    /// Upper corner.
    pub upper: [f64; D],
    /// Factor of the smoothing weight, positive.
    pub factor: f64,
}

impl<const D: usize> LocalSmoothing<D> {
    fn overlaps(&self, cell: &Cell<'_, D>) -> bool {
        (0..D).all(|d| self.lower[d] < cell.upper[d] && cell.lower[d] < self.upper[d])
    }
}

/// Coefficients held fixed: functions, increasing, and their rows of coefficients.
pub type Fixed = Vec<(usize, Vec<f64>)>;

/// Penalized weighted least squares on a set of points, in one space after the other.
#[derive(Debug)]
pub struct LeastSquares<const D: usize> {
    points: SortedPoints<D>,
    sorted_for: Option<Arc<HierarchicalSpace<D>>>,
    options: Options<D>,
    /// λ as a number, once it is chosen.
    lambda: Option<f64>,
    /// λ to be used whatever the options say.
    held: Option<f64>,
    /// Where another λ holds.
    local: Vec<LocalSmoothing<D>>,
    solver: Option<Cholesky>,
    /// The energy of the last space.
    energy: Option<(Arc<HierarchicalSpace<D>>, SymmetricMatrix)>,
    errors: Vec<f64>,
    /// Children of cells that hold the points, at the last estimate.
    children: Vec<u8>,
}

impl<const D: usize> LeastSquares<D> {
    /// A problem with points `(m, N)` at parameters `(m, D)`, with weights `(m)` if given.
    ///
    /// # Errors
    /// Those of [`SortedPoints::new`]; [`Error::Lambda`].
    pub fn new(
        parameters: ArrayView2<'_, f64>,
        points: ArrayView2<'_, f64>,
        weights: Option<ArrayView1<'_, f64>>,
        options: Options<D>,
    ) -> Result<Self, Error> {
        Self::of(SortedPoints::new(parameters, points, weights)?, options)
    }

    /// A problem with points that are sorted in any way.
    pub(crate) fn of(points: SortedPoints<D>, options: Options<D>) -> Result<Self, Error> {
        options.lambda.check()?;
        let lambda = if let Lambda::Fixed(value) = options.lambda { Some(value) } else { None };
        Ok(Self {
            points,
            sorted_for: None,
            options,
            lambda,
            held: None,
            local: Vec::new(),
            solver: None,
            energy: None,
            errors: Vec::new(),
            children: Vec::new(),
        })
    }

    /// The smoothing weight in use; `None` as long as an automatic one is not chosen.
    pub fn lambda(&self) -> Option<f64> {
        self.held.or(self.lambda)
    }

    /// Whether the next fit in a new space would choose a smoothing weight.
    pub(crate) fn chooses_lambda(&self) -> bool {
        match self.options.lambda {
            Lambda::Fixed(_) => false,
            Lambda::Auto { .. } => self.lambda.is_none(),
            Lambda::CrossValidation | Lambda::Discrepancy { .. } => true,
        }
    }

    /// Whether the smoothing weight is that of [`Lambda::Auto`].
    pub(crate) fn is_automatic(&self) -> bool {
        matches!(self.options.lambda, Lambda::Auto { .. })
    }

    /// As [`LeastSquares::choose_lambda`], also where one was chosen before.
    pub(crate) fn choose_lambda_anew(&mut self, space: &Arc<HierarchicalSpace<D>>) -> Result<f64, Error> {
        if self.is_automatic() {
            self.lambda = None;
        }
        self.choose_lambda(space)
    }

    /// Uses a smoothing weight whatever the options say, or no longer.
    pub fn hold_lambda(&mut self, lambda: Option<f64>) {
        self.held = lambda;
    }

    /// Lets the smoothing weight differ from place to place (thesis §3.1.8, where λ is one number; the energy of each cell has its own
    /// here): a cell that overlaps boxes has the largest of their factors, all others have 1. It holds for all fits that follow, in
    /// whatever space; a weight is chosen as if it were the same everywhere.
    pub fn smooth_locally(&mut self, boxes: Vec<LocalSmoothing<D>>) {
        if boxes != self.local {
            self.local = boxes;
            self.energy = None;
        }
    }

    /// The factor of the smoothing weight in a cell.
    pub fn local_factor(&self, cell: &Cell<'_, D>) -> f64 {
        let factors = self.local.iter().filter(|local| local.overlaps(cell)).map(|local| local.factor);
        factors.reduce(f64::max).unwrap_or(1.0)
    }

    /// The boxes of [`LeastSquares::smooth_locally`].
    pub fn local_smoothing(&self) -> &[LocalSmoothing<D>] {
        &self.local
    }

    /// The smoothing weight for a space, as the options say, by the points with their present weights.
    pub(crate) fn choose_lambda(&mut self, space: &Arc<HierarchicalSpace<D>>) -> Result<f64, Error> {
        self.choose_and_reduce(space).map(|(lambda, _)| lambda)
    }

    /// As [`LeastSquares::choose_lambda`], with the equations of the points where the choice has formed them.
    fn choose_and_reduce(
        &mut self,
        space: &Arc<HierarchicalSpace<D>>,
    ) -> Result<(f64, Option<NormalEquations>), Error> {
        let (chosen, reduced) = match (self.options.lambda, self.lambda) {
            (Lambda::Fixed(lambda), _) | (Lambda::Auto { .. }, Some(lambda)) => (lambda, None),
            (Lambda::Auto { tolerance }, None) => {
                (crate::automatic_lambda(&self.points, space, &self.options, tolerance)?, None)
            }
            (choice @ (Lambda::CrossValidation | Lambda::Discrepancy { .. }), mut guess) => {
                if guess.is_none() && choice == Lambda::CrossValidation && space.n_functions() > FEW {
                    guess = Some(self.guess_lambda(space)?);
                }
                self.sort(space)?;
                let energy = self.energy(space)?;
                let mut solver = self.solver_for(&energy)?;
                let probes = choice == Lambda::CrossValidation;
                let mut path = Path::new(space, &self.points, &energy, &mut solver, probes)?;
                let chosen = match choice {
                    Lambda::Discrepancy { noise } => by_discrepancy(&mut path, noise)?,
                    _ => by_cross_validation(&mut path, guess)?,
                };
                let reduced = path.into_equations();
                self.solver = Some(solver);
                (chosen, Some(reduced))
            }
        };
        self.lambda = Some(chosen);
        Ok((chosen, reduced))
    }

    /// The weight that cross-validation chooses in a coarse uniform space: there, looking at all weights costs little.
    fn guess_lambda(&self, space: &Arc<HierarchicalSpace<D>>) -> Result<f64, Error> {
        let functions = space.n_functions() / COARSER;
        let coarse = Arc::new(uniform_space(space, functions)?);
        let step = (self.points.len() / (GUESSED_BY * functions)).max(1);
        let some: Vec<usize> = (0..self.points.len()).step_by(step).collect();
        let mut method = Self::of(subset(&self.points, &some)?, self.options.clone())?;
        // The same noise at fewer points needs as much smoothing for each of them.
        Ok(method.choose_lambda(&coarse)? * step as f64)
    }

    /// The solver of the space before if it has the pattern of a matrix, or a new one.
    fn solver_for(&mut self, matrix: &SymmetricMatrix) -> Result<Cholesky, Error> {
        match self.solver.take().filter(|solver| solver.pattern() == matrix.pattern()) {
            Some(solver) => Ok(solver),
            None => Cholesky::new(matrix.pattern()).map_err(|_| Error::OutOfMemory { functions: matrix.pattern().n() }),
        }
    }

    /// The points, in the order of the cells of the last space.
    pub fn points(&self) -> &SortedPoints<D> {
        &self.points
    }

    /// Moves the points to other parameters: see [`SortedPoints::relocate`].
    ///
    /// # Errors
    /// [`Error::Shape`].
    pub fn relocate(&mut self, parameters: &[[f64; D]], cells: &[u32]) -> Result<(), Error> {
        self.points.relocate(parameters, cells)
    }

    /// Replaces the weights, given in the order of the cells: see [`SortedPoints::set_weights`].
    ///
    /// # Errors
    /// [`Error::Shape`], [`Error::Weight`].
    pub fn set_weights(&mut self, weights: Option<Vec<f64>>) -> Result<(), Error> {
        self.points.set_weights(weights)
    }

    /// Sorts the points by the cells of a space, as fitting in it does.
    ///
    /// # Errors
    /// [`Error::Parameter`].
    pub fn sort_for(&mut self, space: &Arc<HierarchicalSpace<D>>) -> Result<(), Error> {
        self.sort(space)
    }

    /// The matrix of the energy in a space, in the pattern of the space.
    ///
    /// # Errors
    /// Those of [`ThinPlate::gram`].
    pub fn energy(&mut self, space: &Arc<HierarchicalSpace<D>>) -> Result<SymmetricMatrix, Error> {
        if let Some((_, energy)) = self.energy.as_ref().filter(|(known, _)| Arc::ptr_eq(known, space)) {
            return Ok(energy.clone());
        }
        let pattern = SymmetricPattern::new(space.as_ref());
        let energy = ThinPlate::scaled(space.degree(), self.options.quadrature, self.options.lengths);
        let energy = energy.weighted_gram(space.as_ref(), &pattern, |cell| self.local_factor(cell))?;
        self.energy = Some((space.clone(), energy.clone()));
        Ok(energy)
    }

    /// Fits in a space.
    ///
    /// # Errors
    /// [`Error::Parameter`], [`Error::RankDeficient`], [`Error::OutOfMemory`].
    pub fn fit(&mut self, space: &Arc<HierarchicalSpace<D>>) -> Result<SplineMap<D>, Error> {
        self.fit_with_fixed(space, &Vec::new())
    }

    /// Fits in a space with some coefficients held fixed.
    ///
    /// # Errors
    /// As [`LeastSquares::fit`]; [`Error::Shape`] for fixed functions that do not exist or rows of a wrong length.
    pub fn fit_with_fixed(&mut self, space: &Arc<HierarchicalSpace<D>>, fixed: &Fixed) -> Result<SplineMap<D>, Error> {
        self.solve_timed(space, fixed).map(|solution| solution.map)
    }

    /// Distances of the points to a map on the space last fitted in, sorted by cell; [`SortedPoints::order`] has the
    /// indices of the points.
    ///
    /// # Errors
    /// [`Error::Parameter`].
    pub fn distances(&mut self, map: &SplineMap<D>) -> Result<&[f64], Error> {
        self.sort(map.space())?;
        let mut errors = std::mem::take(&mut self.errors);
        self.points.distances(map.bezier(), &mut errors)?;
        self.errors = errors;
        Ok(&self.errors)
    }

    pub(crate) fn sort(&mut self, space: &Arc<HierarchicalSpace<D>>) -> Result<(), Error> {
        if !self.sorted_for.as_ref().is_some_and(|sorted| Arc::ptr_eq(sorted, space)) {
            self.points.sort_refined(space, self.sorted_for.as_deref())?;
            self.sorted_for = Some(space.clone());
        }
        Ok(())
    }

    fn solve_timed(&mut self, space: &Arc<HierarchicalSpace<D>>, fixed: &Fixed) -> Result<Solution<D>, Error> {
        let start = Instant::now();
        self.sort(space)?;
        let (lambda, reduced) = match self.held {
            Some(lambda) => (lambda, None),
            None => self.choose_and_reduce(space)?,
        };
        let energy = self.energy(space)?;
        let pattern = energy.pattern().clone();
        let equations = match reduced {
            Some(equations) => equations,
            None => NormalEquations::new(space.as_ref(), &pattern, &self.points)?,
        };
        let assembled = start.elapsed().as_secs_f64();
        let solving = Instant::now();
        let solver = self.solver_for(&energy)?;
        let coefficients = penalized(self.solver.insert(solver), equations, &energy, lambda, fixed)?;
        let map = SplineMap::new(space.clone(), coefficients)?;
        Ok(Solution { map, assemble_seconds: assembled, solve_seconds: solving.elapsed().as_secs_f64() })
    }
}

impl<const D: usize> Solve<D> for LeastSquares<D> {
    type Error = Error;

    fn solve(
        &mut self,
        space: &Arc<HierarchicalSpace<D>>,
        _previous: Option<&SplineMap<D>>,
    ) -> Result<Solution<D>, Error> {
        self.solve_timed(space, &Vec::new())
    }

    fn estimate(&mut self, map: &SplineMap<D>) -> Result<Estimate<'_>, Error> {
        self.distances(map)?;
        self.children = self.points.children(map.space().as_ref());
        Ok(Estimate { offsets: self.points.offsets(), errors: &self.errors, children: &self.children })
    }
}

/// Solves `(A + λG) c = b` with some rows of `c` held fixed.
pub(crate) fn penalized(
    solver: &mut Cholesky,
    equations: NormalEquations,
    energy: &SymmetricMatrix,
    lambda: f64,
    fixed: &Fixed,
) -> Result<Array2<f64>, Error> {
    let NormalEquations { mut matrix, mut right } = equations;
    let functions = right.nrows();
    let columns = matrix.pattern().columns();
    let without_data: Vec<usize> = (0..functions).filter(|&j| matrix.values()[columns[j]] == 0.0).collect();
    let deficient = |without_data: &[usize]| Error::RankDeficient {
        without_data: without_data.len(),
        functions,
        first: without_data.iter().take(NAMED).copied().collect(),
        lambda,
    };
    if lambda == 0.0 && without_data.iter().any(|&j| fixed.iter().all(|(f, _)| *f != j)) {
        return Err(deficient(&without_data));
    }
    matrix.values_mut().iter_mut().zip(energy.values()).for_each(|(a, g)| *a += lambda * g);
    eliminate(&mut matrix, &mut right, fixed)?;
    let failed = |failure| match failure {
        FactorizationError::NotPositiveDefinite => deficient(&without_data),
        FactorizationError::OutOfMemory => Error::OutOfMemory { functions },
    };
    solver.factorize(&matrix).map_err(failed)?;
    let mut solution = solver.solve(&right).map_err(failed)?;
    // One step of iterative refinement: moments lose a few digits where a cell's points cluster.
    for k in 0..right.ncols() {
        let residual = matrix.multiply(&solution.column(k).to_vec());
        right.column_mut(k).iter_mut().zip(residual).for_each(|(b, ax)| *b -= ax);
    }
    solution += &solver.solve(&right).map_err(failed)?;
    Ok(solution)
}

/// Moves fixed coefficients to the right-hand side and replaces their equations by `c_j = value`.
///
/// # Errors
/// [`Error::Shape`] for fixed functions that do not exist or rows of a wrong length.
pub fn eliminate(matrix: &mut SymmetricMatrix, right: &mut Array2<f64>, fixed: &Fixed) -> Result<(), Error> {
    if fixed.is_empty() {
        return Ok(());
    }
    let (n, dim) = right.dim();
    let mut value_of: Vec<Option<&[f64]>> = vec![None; n];
    for (function, row) in fixed {
        if *function >= n {
            return Err(Error::Shape { what: "fixed function", given: *function, expected: n });
        }
        if row.len() != dim {
            return Err(Error::Shape { what: "fixed coefficients in a row", given: row.len(), expected: dim });
        }
        value_of[*function] = Some(row);
    }
    let pattern = matrix.pattern().clone();
    for j in 0..n {
        for at in pattern.columns()[j]..pattern.columns()[j + 1] {
            let i = pattern.rows()[at];
            let entry = matrix.values()[at];
            let replaced = match (value_of[i], value_of[j]) {
                (None, None) => continue,
                (Some(_), Some(_)) => f64::from(u8::from(i == j)),
                (Some(row), None) => {
                    (0..dim).for_each(|k| right[[j, k]] -= entry * row[k]);
                    0.0
                }
                (None, Some(row)) => {
                    (0..dim).for_each(|k| right[[i, k]] -= entry * row[k]);
                    0.0
                }
            };
            matrix.values_mut()[at] = replaced;
        }
    }
    for (function, row) in fixed {
        (0..dim).for_each(|k| right[[*function, k]] = row[k]);
    }
    Ok(())
}
