//! Tensor-product spaces: B-splines on a grid, and polynomials in Bernstein form as their one-element case.

use crate::level::Level;
use crate::{Cell, CellSpace, Error, Extraction, KnotVector, ParameterBox};

/// Tensor-product B-splines of open knots; function and cell numbers run with the first direction fastest.
#[derive(Clone, Debug)]
pub struct TensorSpace<const D: usize> {
    levels: [Level; D],
    /// Functions of each cell, `∏(p_d + 1)` per cell.
    functions: Vec<u32>,
}

impl<const D: usize> TensorSpace<D> {
    /// The space of the given knots. Periodic tensor-product splines are a [`crate::HierarchicalSpace`] that is not
    /// refined.
    ///
    /// # Errors
    /// [`Error::Elements`] if the functions cannot be counted in 32 bits, [`Error::PeriodicKnots`].
    pub fn new(knots: [KnotVector; D]) -> Result<Self, Error> {
        if let Some(direction) = knots.iter().position(KnotVector::is_periodic) {
            return Err(Error::PeriodicKnots { direction });
        }
        let limit = u32::MAX as usize;
        let total = |counts: [usize; D]| counts.iter().fold(1_usize, |product, &n| product.saturating_mul(n));
        let n_functions = total(std::array::from_fn(|d| knots[d].n_functions()));
        if n_functions > limit {
            return Err(Error::Elements { given: n_functions, limit });
        }
        let counts: [usize; D] = std::array::from_fn(|d| knots[d].n_functions());
        let spans: [usize; D] = std::array::from_fn(|d| knots[d].n_spans());
        let mut functions = Vec::new();
        for cell in 0..total(spans) {
            let index = unravel(cell, spans);
            let first: [usize; D] = std::array::from_fn(|d| knots[d].first_function(index[d]));
            let orders = std::array::from_fn(|d| knots[d].degree() + 1);
            functions.extend((0..total(orders)).map(|k| {
                let local = unravel(k, orders);
                ravel(std::array::from_fn(|d| first[d] + local[d]), counts) as u32
            }));
        }
        Ok(Self { levels: knots.map(Level::new), functions })
    }

    /// Polynomials of the given degrees on `[0, 1]^D`, in Bernstein form.
    ///
    /// # Errors
    /// [`Error::Degree`].
    pub fn bernstein(degree: [usize; D]) -> Result<Self, Error> {
        let mut knots = Vec::with_capacity(D);
        for p in degree {
            knots.push(KnotVector::uniform(p, 1)?);
        }
        Self::new(std::array::from_fn(|d| knots[d].clone()))
    }

    /// The knots of a direction.
    pub fn knots(&self, direction: usize) -> &KnotVector {
        &self.levels[direction].knots
    }

    fn spans(&self) -> [usize; D] {
        std::array::from_fn(|d| self.levels[d].knots.n_spans())
    }
}

impl<const D: usize> TensorSpace<D> {
    /// Lower and upper corner of the domain.
    pub fn domain(&self) -> ([f64; D], [f64; D]) {
        let ends: [(f64, f64); D] = std::array::from_fn(|d| self.levels[d].knots.domain());
        (ends.map(|e| e.0), ends.map(|e| e.1))
    }

    /// The cell that holds a parameter; cells are half-open, the last one in each direction closed.
    ///
    /// # Errors
    /// [`Error::OutsideDomain`], also for NaN.
    pub fn locate_cell(&self, u: [f64; D]) -> Result<usize, Error> {
        Ok(ravel(spans_at(std::array::from_fn(|d| &self.levels[d].knots), u)?, self.spans()))
    }
}

impl<const D: usize> CellSpace<D> for TensorSpace<D> {
    fn n_functions(&self) -> usize {
        self.levels.iter().map(|level| level.knots.n_functions()).product()
    }

    fn degree(&self) -> [usize; D] {
        std::array::from_fn(|d| self.levels[d].knots.degree())
    }

    fn n_cells(&self) -> usize {
        self.spans().iter().product()
    }

    fn cell(&self, cell: usize) -> Cell<'_, D> {
        let index = unravel(cell, self.spans());
        let degree = self.degree();
        let n_local: usize = degree.iter().map(|p| p + 1).product();
        Cell {
            lower: std::array::from_fn(|d| self.levels[d].knots.breaks()[index[d]]),
            upper: std::array::from_fn(|d| self.levels[d].knots.breaks()[index[d] + 1]),
            functions: &self.functions[cell * n_local..(cell + 1) * n_local],
            extraction: Extraction::Identity,
            bezier: std::array::from_fn(|d| self.levels[d].bezier(index[d])),
            degree,
        }
    }
}

impl<const D: usize> ParameterBox<D> for TensorSpace<D> {
    fn domain(&self) -> ([f64; D], [f64; D]) {
        self.domain()
    }

    fn locate_cell(&self, u: [f64; D]) -> Result<usize, Error> {
        self.locate_cell(u)
    }
}

/// The spans that hold a parameter.
pub(crate) fn spans_at<const D: usize>(knots: [&KnotVector; D], u: [f64; D]) -> Result<[usize; D], Error> {
    let mut spans = [0; D];
    for (direction, span) in spans.iter_mut().enumerate() {
        let (lower, upper) = knots[direction].domain();
        let value = u[direction];
        *span = knots[direction].span_at(value).ok_or(Error::OutsideDomain { value, direction, lower, upper })?;
    }
    Ok(spans)
}

/// The multi-index of a linear index, first direction fastest.
pub fn unravel<const D: usize>(mut linear: usize, counts: [usize; D]) -> [usize; D] {
    counts.map(|n| {
        let i = linear % n;
        linear /= n;
        i
    })
}

/// The linear index of a multi-index, first direction fastest.
pub(crate) fn ravel<const D: usize>(index: [usize; D], counts: [usize; D]) -> usize {
    (0..D).rev().fold(0, |linear, d| linear * counts[d] + index[d])
}
