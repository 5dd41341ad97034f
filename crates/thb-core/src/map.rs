//! Spline maps: coefficients in a space, evaluated through the Bernstein form of each cell.

use std::sync::{Arc, OnceLock};

use ndarray::{Array2, ArrayView2};
use rayon::prelude::*;

use crate::bernstein::{self, BLOCK};
use crate::{Cell, CellSpace, Error, HierarchicalSpace, MAX_DEGREE, ParameterBox};

/// A map from a box in R^D to R^N: coefficients `(n_functions, N)` in a space.
#[derive(Clone, Debug)]
pub struct SplineMap<const D: usize, S = HierarchicalSpace<D>> {
    space: Arc<S>,
    coefficients: Array2<f64>,
    bezier: OnceLock<Arc<BezierMap<D>>>,
}

impl<const D: usize, S: CellSpace<D>> SplineMap<D, S> {
    /// A map from its coefficients, one row per function of the space.
    ///
    /// # Errors
    /// [`Error::Shape`] for a wrong number of rows, [`Error::NotFinite`].
    pub fn new(space: Arc<S>, coefficients: Array2<f64>) -> Result<Self, Error> {
        let (given, expected) = (coefficients.nrows(), space.n_functions());
        if given != expected {
            return Err(Error::Shape { what: "rows of coefficients", given, expected });
        }
        if coefficients.ncols() == 0 {
            return Err(Error::Shape { what: "columns of coefficients", given: 0, expected: 1 });
        }
        if let Some(((row, component), _)) = coefficients.indexed_iter().find(|(_, c)| !c.is_finite()) {
            return Err(Error::NotFinite { row, component });
        }
        // Evaluation reads rows as slices.
        let coefficients = coefficients.as_standard_layout().into_owned();
        Ok(Self { space, coefficients, bezier: OnceLock::new() })
    }

    /// The space.
    pub fn space(&self) -> &Arc<S> {
        &self.space
    }

    /// The coefficients, `(n_functions, N)`.
    pub fn coefficients(&self) -> ArrayView2<'_, f64> {
        self.coefficients.view()
    }

    /// Dimension `N` of the image.
    pub fn dim(&self) -> usize {
        self.coefficients.ncols()
    }

    /// The map in Bernstein form, computed at the first call.
    pub fn bezier(&self) -> &Arc<BezierMap<D>> {
        self.bezier.get_or_init(|| Arc::new(BezierMap::new(self.space.as_ref(), self.coefficients.view())))
    }
}

impl<const D: usize, S: ParameterBox<D>> SplineMap<D, S> {
    /// The point at a parameter.
    ///
    /// # Errors
    /// [`Error::OutsideDomain`].
    pub fn eval(&self, u: [f64; D]) -> Result<Vec<f64>, Error> {
        self.derivative(u, [0; D])
    }

    /// A partial derivative of the given order per direction. At a knot it is the one of the cell that holds `u`.
    ///
    /// # Errors
    /// [`Error::OutsideDomain`].
    pub fn derivative(&self, u: [f64; D], order: [usize; D]) -> Result<Vec<f64>, Error> {
        let cell = self.space.locate_cell(u)?;
        let mut out = vec![0.0; self.dim()];
        self.bezier().derivative(cell, u, order, &mut out);
        Ok(out)
    }

    /// Points at many parameters, `(m, D)` to `(m, N)`, in parallel.
    ///
    /// # Errors
    /// [`Error::OutsideDomain`], [`Error::Shape`].
    pub fn eval_batch(&self, parameters: ArrayView2<'_, f64>) -> Result<Array2<f64>, Error> {
        self.derivative_batch(parameters, [0; D])
    }

    /// Partial derivatives at many parameters, `(m, D)` to `(m, N)`, in parallel.
    ///
    /// # Errors
    /// [`Error::OutsideDomain`], [`Error::Shape`].
    pub fn derivative_batch(&self, parameters: ArrayView2<'_, f64>, order: [usize; D]) -> Result<Array2<f64>, Error> {
        if parameters.ncols() != D {
            return Err(Error::Shape { what: "columns of parameters", given: parameters.ncols(), expected: D });
        }
        let bezier = self.bezier();
        let n = self.dim();
        let mut out = vec![0.0; parameters.nrows() * n];
        let evaluate = |(chunk, rows): (usize, &mut [f64])| {
            for (i, row) in rows.chunks_exact_mut(n).enumerate() {
                let u = std::array::from_fn(|d| parameters[[chunk * BLOCK + i, d]]);
                bezier.derivative(self.space.locate_cell(u)?, u, order, row);
            }
            Ok(())
        };
        // Of several errors the first, whichever thread is faster.
        let blocks = out.par_chunks_mut(n * BLOCK).enumerate();
        if let Some(error) = blocks.find_map_first(|block| evaluate(block).err()) {
            return Err(error);
        }
        Array2::from_shape_vec((parameters.nrows(), n), out).map_err(|_| Error::Shape {
            what: "values",
            given: 0,
            expected: parameters.nrows() * n,
        })
    }
}

/// A point of a map with its first and second partial derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jet<const D: usize> {
    /// The point.
    pub value: [f64; 3],
    /// First derivatives, by direction.
    pub first: [[f64; 3]; D],
    /// Second derivatives; symmetric in its two directions.
    pub second: [[[f64; 3]; D]; D],
}

/// A map as one Bernstein polynomial per cell: the form in which points are evaluated fast.
#[derive(Clone, Debug)]
pub struct BezierMap<const D: usize> {
    degree: [usize; D],
    dim: usize,
    boxes: Vec<([f64; D], [f64; D])>,
    /// `(n_local, N)` per cell.
    coefficients: Vec<f64>,
}

impl<const D: usize> BezierMap<D> {
    /// The Bernstein form of coefficients `(n_functions, N)` in a space.
    pub(crate) fn new<S: CellSpace<D>>(space: &S, coefficients: ArrayView2<'_, f64>) -> Self {
        let dim = coefficients.ncols();
        let degree = space.degree();
        let per_cell = dim * degree.iter().map(|p| p + 1).product::<usize>();
        let rows: Vec<f64> = coefficients.iter().copied().collect();
        let mut out = vec![0.0; per_cell * space.n_cells()];
        out.par_chunks_mut(per_cell).enumerate().for_each_init(Vec::new, |local, (cell, target)| {
            space.cell(cell).bernstein_coefficients(&rows, dim, local);
            target.copy_from_slice(local);
        });
        let corners = |cell: Cell<'_, D>| (cell.lower, cell.upper);
        let boxes = (0..space.n_cells()).map(|cell| corners(space.cell(cell))).collect();
        Self { degree, dim, boxes, coefficients: out }
    }

    /// Degree per direction.
    pub fn degree(&self) -> [usize; D] {
        self.degree
    }

    /// Dimension of the image.
    pub fn dim(&self) -> usize {
        self.dim
    }

    /// Number of cells.
    pub fn n_cells(&self) -> usize {
        self.boxes.len()
    }

    /// Lower and upper corner of a cell, in parameters.
    pub fn cell_box(&self, cell: usize) -> ([f64; D], [f64; D]) {
        self.boxes[cell]
    }

    /// Bernstein coefficients of a cell, `(n_local, N)` row-major, first direction fastest.
    pub fn cell_coefficients(&self, cell: usize) -> &[f64] {
        let per_cell = self.coefficients.len() / self.boxes.len().max(1);
        &self.coefficients[cell * per_cell..(cell + 1) * per_cell]
    }

    /// The point, the first and the second derivatives of a cell's polynomial at a parameter of the domain, in one pass. Of an
    /// image in a space of fewer than three dimensions the further coordinates are 0, of one in more only the first three are taken.
    pub fn jet(&self, cell: usize, u: [f64; D]) -> Jet<D> {
        match self.dim {
            1 => self.jet_in::<1>(cell, u),
            2 => self.jet_in::<2>(cell, u),
            _ => self.jet_in::<3>(cell, u),
        }
    }

    fn jet_in<const N: usize>(&self, cell: usize, u: [f64; D]) -> Jet<D> {
        let (lower, upper) = self.boxes[cell];
        // Values and derivatives of the polynomials of each direction.
        let mut basis = [[[0.0; MAX_DEGREE + 1]; 3]; D];
        for d in 0..D {
            let size = upper[d] - lower[d];
            for (order, out) in basis[d].iter_mut().enumerate() {
                bernstein::derivatives(self.degree[d], order, (u[d] - lower[d]) / size, out);
                let scale = (1.0 / size).powi(order as i32);
                out[..=self.degree[d]].iter_mut().for_each(|value| *value *= scale);
            }
        }
        let mut jet = Jet { value: [0.0; 3], first: [[0.0; 3]; D], second: [[[0.0; 3]; D]; D] };
        let inner = self.degree[0] + 1;
        for (line, rows) in self.cell_coefficients(cell).chunks_exact(inner * self.dim).enumerate() {
            let mut along = [[0.0; N]; 3];
            for (i, row) in rows.chunks_exact(self.dim).filter_map(<[f64]>::first_chunk::<N>).enumerate() {
                for (sum, values) in along.iter_mut().zip(&basis[0]) {
                    (0..N).for_each(|k| sum[k] += values[i] * row[k]);
                }
            }
            // The polynomials of the other directions, derived as often as `orders` says.
            let across = |orders: [usize; D]| {
                let mut rest = line;
                let mut weight = 1.0;
                for d in 1..D {
                    weight *= basis[d][orders[d]][rest % (self.degree[d] + 1)];
                    rest /= self.degree[d] + 1;
                }
                weight
            };
            let add = |target: &mut [f64; 3], orders: [usize; D]| {
                let weight = across(orders);
                (0..N).for_each(|k| target[k] += weight * along[orders[0]][k]);
            };
            add(&mut jet.value, [0; D]);
            for a in 0..D {
                add(&mut jet.first[a], std::array::from_fn(|d| usize::from(d == a)));
                for b in a..D {
                    add(&mut jet.second[a][b], std::array::from_fn(|d| usize::from(d == a) + usize::from(d == b)));
                }
            }
        }
        for a in 0..D {
            for b in 0..a {
                jet.second[a][b] = jet.second[b][a];
            }
        }
        jet
    }

    /// The partial derivative of the given order of a cell's polynomial at a parameter of the domain, to `out` (`N`
    /// numbers). Order zero is the point itself.
    pub fn derivative(&self, cell: usize, u: [f64; D], order: [usize; D], out: &mut [f64]) {
        let (lower, upper) = self.boxes[cell];
        let mut basis = [[0.0; MAX_DEGREE + 1]; D];
        let mut scale = 1.0;
        for d in 0..D {
            let size = upper[d] - lower[d];
            bernstein::derivatives(self.degree[d], order[d], (u[d] - lower[d]) / size, &mut basis[d]);
            scale /= size.powi(order[d] as i32);
        }
        out.fill(0.0);
        let coefficients = self.cell_coefficients(cell);
        let inner = self.degree[0] + 1;
        for (line, rows) in coefficients.chunks_exact(inner * self.dim).enumerate() {
            let mut rest = line;
            let mut outer = scale;
            for d in 1..D {
                outer *= basis[d][rest % (self.degree[d] + 1)];
                rest /= self.degree[d] + 1;
            }
            for (row, value) in rows.chunks_exact(self.dim).zip(&basis[0]) {
                let weight = outer * value;
                for (target, c) in out.iter_mut().zip(row) {
                    *target += weight * c;
                }
            }
        }
    }
}
