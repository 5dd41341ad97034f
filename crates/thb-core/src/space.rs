//! What fitting needs to know of a function space: cells, and on each cell a few polynomials.

use crate::Error;
use crate::knots::wrapped;

/// How the functions of a cell combine its tensor-product B-splines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Extraction<'a> {
    /// The functions are the B-splines themselves, in order.
    Identity,
    /// Row-major, one row per function, one column per local B-spline.
    Matrix(&'a [f64]),
}

/// One cell of a space: a box on which every function of the space is a polynomial.
#[derive(Clone, Copy, Debug)]
pub struct Cell<'a, const D: usize> {
    /// Lower corner, in parameters.
    pub lower: [f64; D],
    /// Upper corner.
    pub upper: [f64; D],
    /// The functions that do not vanish on the cell, increasing.
    pub functions: &'a [u32],
    /// Functions as combinations of the `∏(p_d + 1)` local B-splines, first direction fastest.
    pub extraction: Extraction<'a>,
    /// Per direction the Bézier matrix, `(p_d + 1)²` row-major: row `i` holds the Bernstein coefficients of B-spline `i`.
    pub bezier: [&'a [f64]; D],
    /// Degree per direction.
    pub degree: [usize; D],
}

/// A finite-dimensional space of functions, made of cells.
///
/// Implemented by tensor-product polynomials and B-splines ([`crate::TensorSpace`]), by HB- and THB-splines
/// ([`crate::HierarchicalSpace`]), and by patches that are glued together ([`crate::MultiPatchSpace`]). Whatever works cell by cell is
/// written against this trait; what looks for the cell of a parameter asks for a [`ParameterBox`].
pub trait CellSpace<const D: usize>: Send + Sync {
    /// Number of basis functions.
    fn n_functions(&self) -> usize;
    /// Degree per direction.
    fn degree(&self) -> [usize; D];
    /// Number of cells.
    fn n_cells(&self) -> usize;
    /// A cell by its number.
    fn cell(&self, cell: usize) -> Cell<'_, D>;
}

/// A space whose cells fill one box of parameters, so that a parameter alone names a place.
///
/// Glued patches are none: a parameter of theirs is a patch and a place in it.
pub trait ParameterBox<const D: usize>: CellSpace<D> {
    /// Lower and upper corner of the domain.
    fn domain(&self) -> ([f64; D], [f64; D]);
    /// The directions in which functions go on across the ends of the domain: both ends are one place, the seam.
    fn periodic(&self) -> [bool; D] {
        [false; D]
    }
    /// The parameter of the domain that stands for `u`: moved by whole periods in periodic directions, to the nearer end in
    /// others. NaN stays NaN.
    fn to_domain(&self, u: [f64; D]) -> [f64; D] {
        let ((lower, upper), periodic) = (self.domain(), self.periodic());
        std::array::from_fn(|d| {
            if periodic[d] { wrapped(u[d], lower[d], upper[d]) } else { u[d].clamp(lower[d], upper[d]) }
        })
    }
    /// The shortest way between two parameters of the domain: in periodic directions it may lead across the seam.
    fn way(&self, from: [f64; D], to: [f64; D]) -> [f64; D] {
        let ((lower, upper), periodic) = (self.domain(), self.periodic());
        std::array::from_fn(|d| {
            let (way, period) = (to[d] - from[d], upper[d] - lower[d]);
            match periodic[d] {
                true if way > 0.5 * period => way - period,
                true if way < -0.5 * period => way + period,
                _ => way,
            }
        })
    }
    /// The cell that holds a parameter; cells are half-open, the last one in each direction closed.
    ///
    /// # Errors
    /// [`Error::OutsideDomain`], also for NaN.
    fn locate_cell(&self, u: [f64; D]) -> Result<usize, Error>;
}

impl<const D: usize> Cell<'_, D> {
    /// Number of local B-splines, `∏(p_d + 1)`.
    pub fn n_local(&self) -> usize {
        self.degree.iter().map(|p| p + 1).product()
    }

    /// Edge lengths.
    pub fn size(&self) -> [f64; D] {
        std::array::from_fn(|d| self.upper[d] - self.lower[d])
    }

    /// Coefficients of the local B-splines, `(n_local, n)`, from those of all functions, `(n_functions, n)`; both row-major.
    pub fn local_coefficients(&self, coefficients: &[f64], n: usize, out: &mut Vec<f64>) {
        out.clear();
        out.resize(self.n_local() * n, 0.0);
        let row_of = |function: u32| &coefficients[function as usize * n..][..n];
        match self.extraction {
            Extraction::Identity => {
                for (target, &function) in out.chunks_exact_mut(n).zip(self.functions) {
                    target.copy_from_slice(row_of(function));
                }
            }
            Extraction::Matrix(matrix) => {
                for (weights, &function) in matrix.chunks_exact(self.n_local()).zip(self.functions) {
                    let source = row_of(function);
                    for (target, &weight) in out.chunks_exact_mut(n).zip(weights) {
                        for k in 0..n {
                            target[k] += weight * source[k];
                        }
                    }
                }
            }
        }
    }

    /// Bernstein coefficients on the cell, `(n_local, n)`, from those of all functions.
    pub fn bernstein_coefficients(&self, coefficients: &[f64], n: usize, out: &mut Vec<f64>) {
        self.local_coefficients(coefficients, n, out);
        let mut scratch = [0.0; crate::MAX_DEGREE + 1];
        for d in 0..D {
            // Contract direction d with the transposed Bézier matrix.
            for_each_line(&self.degree, n, d, |start, stride, order| {
                for j in 0..order {
                    scratch[j] = (0..order).map(|i| self.bezier[d][i * order + j] * out[start + i * stride]).sum();
                }
                for j in 0..order {
                    out[start + j * stride] = scratch[j];
                }
            });
        }
    }

    /// The partial derivatives of the given order of the cell's functions at a parameter of the cell, to `out`, in the order of
    /// [`Cell::functions`]. Order zero is the values.
    pub fn derivatives(&self, u: [f64; D], order: [usize; D], out: &mut Vec<f64>, scratch: &mut Vec<f64>) {
        let mut basis = [[0.0; crate::MAX_DEGREE + 1]; D];
        let mut scale = 1.0;
        for d in 0..D {
            let size = self.upper[d] - self.lower[d];
            crate::bernstein::derivatives(self.degree[d], order[d], (u[d] - self.lower[d]) / size, &mut basis[d]);
            scale /= size.powi(order[d] as i32);
        }
        out.clear();
        out.push(scale);
        for d in 0..D {
            scratch.clear();
            for value in &basis[d][..=self.degree[d]] {
                scratch.extend(out.iter().map(|product| product * value));
            }
            std::mem::swap(out, scratch);
        }
        self.pull_back(out, 1, scratch);
    }

    /// Turns a matrix in the Bernstein basis of the cell, `(n_local, columns)` row-major, into one whose rows belong to
    /// the cell's functions, `(n_active, columns)`: multiplies with extraction and Bézier matrices from the left.
    pub fn pull_back(&self, bernstein: &mut Vec<f64>, columns: usize, scratch: &mut Vec<f64>) {
        for d in 0..D {
            let order = self.degree[d] + 1;
            let stride = columns * self.degree[..d].iter().map(|p| p + 1).product::<usize>();
            scratch.clear();
            scratch.extend_from_slice(bernstein);
            for (target, source) in bernstein.chunks_exact_mut(order * stride).zip(scratch.chunks_exact(order * stride))
            {
                combine(self.bezier[d], source, target, stride);
            }
        }
        if let Extraction::Matrix(matrix) = self.extraction {
            scratch.clear();
            scratch.resize(self.functions.len() * columns, 0.0);
            combine(matrix, bernstein, scratch, columns);
            std::mem::swap(bernstein, scratch);
        }
    }

    /// Turns symmetric matrices in the Bernstein basis into those of the cell's functions: the congruence with extraction and
    /// Bézier matrices. They lie row beside row, `(n_local, count, n_local)`, and so does the result,
    /// `(n_active, count, n_active)`.
    pub fn pull_back_symmetric(&self, bernstein: &mut Vec<f64>, count: usize, scratch: &mut Vec<f64>) {
        let (n_local, n_active) = (self.n_local(), self.functions.len());
        self.pull_back(bernstein, count * n_local, scratch);
        swap_ends(bernstein, [n_active, count, n_local], scratch);
        self.pull_back(bernstein, count * n_active, scratch);
    }
}

/// Rows of `columns` numbers, combined with a matrix that has a row per target and a column per source.
///
/// PERF: whole rows with the widest vectors of the machine, and without the many zeros of Bézier and extraction matrices.
fn combine(matrix: &[f64], source: &[f64], target: &mut [f64], columns: usize) {
    pulp::Arch::new().dispatch(Combination { matrix, source, target, columns });
}

struct Combination<'a> {
    matrix: &'a [f64],
    source: &'a [f64],
    target: &'a mut [f64],
    columns: usize,
}

impl pulp::WithSimd for Combination<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { matrix, source, target, columns } = self;
        let n_source = source.len() / columns;
        for (target, weights) in target.chunks_exact_mut(columns).zip(matrix.chunks_exact(n_source)) {
            target.fill(0.0);
            for (source, &weight) in source.chunks_exact(columns).zip(weights) {
                if weight != 0.0 {
                    target.iter_mut().zip(source).for_each(|(t, s)| *t += weight * s);
                }
            }
        }
    }
}

/// Swaps the first and the last index of an array.
fn swap_ends(array: &mut Vec<f64>, [first, count, last]: [usize; 3], scratch: &mut Vec<f64>) {
    scratch.clear();
    for j in 0..last {
        for m in 0..count {
            scratch.extend((0..first).map(|i| array[(i * count + m) * last + j]));
        }
    }
    std::mem::swap(array, scratch);
}

/// Calls `line(start, stride, order)` for each line along direction `d` of an array with `∏(p_d + 1)` rows (first
/// direction fastest) of `n` numbers each.
#[inline]
pub(crate) fn for_each_line<const D: usize>(
    degree: &[usize; D],
    n: usize,
    d: usize,
    mut line: impl FnMut(usize, usize, usize),
) {
    let stride: usize = n * degree[..d].iter().map(|p| p + 1).product::<usize>();
    let order = degree[d] + 1;
    let outer: usize = degree[d + 1..].iter().map(|p| p + 1).product();
    for block in 0..outer {
        for inner in 0..stride {
            line(block * stride * order + inner, stride, order);
        }
    }
}
