//! Points sorted by cell, one array per coordinate.

use ndarray::{Array2, ArrayView1, ArrayView2};
use rayon::prelude::*;
use thb_core::{HierarchicalSpace, ParameterBox};

use crate::Error;

/// Points with parameters, kept in the order of the cells of a space. Coordinates are stored separately so that kernels
/// read whole vectors. Memory: 8 (D + N + 1) + 8 bytes a point, with weights 8 more.
#[derive(Clone, Debug)]
pub struct SortedPoints<const D: usize> {
    /// Parameters, one array per direction.
    pub(crate) parameters: [Vec<f64>; D],
    /// Points, one array per coordinate.
    pub(crate) points: Vec<Vec<f64>>,
    pub(crate) weights: Option<Vec<f64>>,
    /// The original index of each point.
    order: Vec<u32>,
    /// Points of cell `c`: `offsets[c]..offsets[c + 1]`.
    pub(crate) offsets: Vec<usize>,
}

/// Points of one parallel task; tasks are the same for any number of threads.
pub(crate) const CHUNK: usize = 1 << 14;

impl<const D: usize> SortedPoints<D> {
    /// Copies points `(m, N)` with parameters `(m, D)` and weights `(m)`, in their order: sorted for one cell.
    ///
    /// # Errors
    /// [`Error::Shape`], [`Error::NoPoints`], [`Error::TooManyPoints`], [`Error::NotFinite`], [`Error::Weight`].
    pub fn new(
        parameters: ArrayView2<'_, f64>,
        points: ArrayView2<'_, f64>,
        weights: Option<ArrayView1<'_, f64>>,
    ) -> Result<Self, Error> {
        let m = points.nrows();
        let limit = u32::MAX as usize;
        if m == 0 || points.ncols() == 0 {
            return Err(Error::NoPoints);
        }
        if m > limit {
            return Err(Error::TooManyPoints { given: m, limit });
        }
        if parameters.ncols() != D {
            return Err(Error::Shape { what: "columns of parameters", given: parameters.ncols(), expected: D });
        }
        if parameters.nrows() != m {
            return Err(Error::Shape { what: "rows of parameters", given: parameters.nrows(), expected: m });
        }
        let points: Vec<Vec<f64>> = points.columns().into_iter().map(|column| column.to_vec()).collect();
        for (component, column) in points.iter().enumerate() {
            if let Some(index) = column.iter().position(|x| !x.is_finite()) {
                return Err(Error::NotFinite { index, component });
            }
        }
        if let Some(weights) = &weights {
            if weights.len() != m {
                return Err(Error::Shape { what: "weights", given: weights.len(), expected: m });
            }
            if let Some((index, &value)) = weights.iter().enumerate().find(|(_, w)| !w.is_finite() || **w < 0.0) {
                return Err(Error::Weight { index, value });
            }
        }
        Ok(Self {
            parameters: std::array::from_fn(|d| parameters.column(d).to_vec()),
            points,
            weights: weights.map(|w| w.to_vec()),
            order: (0..m as u32).collect(),
            offsets: vec![0, m],
        })
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.order.len()
    }

    /// Whether there are no points; never for a value made by [`SortedPoints::new`].
    pub fn is_empty(&self) -> bool {
        self.order.is_empty()
    }

    /// Dimension N of the points.
    pub fn dim(&self) -> usize {
        self.points.len()
    }

    /// Points of cell `c`: `offsets[c]..offsets[c + 1]`.
    pub fn offsets(&self) -> &[usize] {
        &self.offsets
    }

    /// The original index of each sorted point.
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// The place of each point among the sorted ones, by its original index.
    pub fn places(&self) -> Vec<usize> {
        let mut places = vec![0; self.len()];
        self.order.iter().enumerate().for_each(|(at, &index)| places[index as usize] = at);
        places
    }

    /// Values of the sorted points in the order in which the points were given.
    pub fn as_given(&self, sorted: &[f64]) -> Vec<f64> {
        let mut given = vec![0.0; sorted.len()];
        self.order.iter().zip(sorted).for_each(|(&index, &value)| given[index as usize] = value);
        given
    }

    /// The parameter of a sorted point.
    pub fn parameter(&self, at: usize) -> [f64; D] {
        std::array::from_fn(|d| self.parameters[d][at])
    }

    /// The child of its cell, in the space that the points are sorted for, that holds each point: bit d is set in the upper
    /// half of direction d, as in [`thb_core::Mark`].
    pub fn children(&self, space: &impl ParameterBox<D>) -> Vec<u8> {
        let mut children = Vec::with_capacity(self.len());
        for (number, ends) in self.offsets.windows(2).enumerate() {
            let cell = space.cell(number);
            let upper = |d: usize, at: usize| u8::from(2.0 * self.parameters[d][at] >= cell.lower[d] + cell.upper[d]);
            children.extend((ends[0]..ends[1]).map(|at| (0..D).map(|d| upper(d, at) << d).sum::<u8>()));
        }
        children
    }

    /// Parameters in a direction, in the order of the cells.
    pub fn parameters(&self, direction: usize) -> &[f64] {
        &self.parameters[direction]
    }

    /// All parameters, `(m, D)`, in the order in which the points were given.
    pub fn parameters_as_given(&self) -> Array2<f64> {
        let mut parameters = Array2::zeros((self.len(), D));
        for (at, &index) in self.order.iter().enumerate() {
            (0..D).for_each(|d| parameters[[index as usize, d]] = self.parameters[d][at]);
        }
        parameters
    }

    /// A coordinate of all points, in the order of the cells.
    pub fn coordinates(&self, component: usize) -> &[f64] {
        &self.points[component]
    }

    /// The weights in the order of the cells; `None` if all are 1.
    pub fn weights(&self) -> Option<&[f64]> {
        self.weights.as_deref()
    }

    /// Replaces the weights, given in the order of the cells.
    ///
    /// # Errors
    /// [`Error::Shape`], [`Error::Weight`].
    pub fn set_weights(&mut self, weights: Option<Vec<f64>>) -> Result<(), Error> {
        if let Some(weights) = &weights {
            self.check_length("weights", weights.len())?;
            if let Some(at) = weights.iter().position(|w| !w.is_finite() || *w < 0.0) {
                return Err(Error::Weight { index: self.order[at] as usize, value: weights[at] });
            }
        }
        self.weights = weights;
        Ok(())
    }

    /// Moves the points to other parameters of the same space, given in the order of the cells with the cell of each, and
    /// sorts them anew.
    ///
    /// # Errors
    /// [`Error::Shape`] for arrays of a wrong length, or a cell that does not exist.
    pub fn relocate(&mut self, parameters: &[[f64; D]], cells: &[u32]) -> Result<(), Error> {
        self.check_length("moved parameters", parameters.len())?;
        self.check_length("cells of moved parameters", cells.len())?;
        let n_cells = self.offsets.len() - 1;
        if let Some(&cell) = cells.iter().find(|&&cell| cell as usize >= n_cells) {
            return Err(Error::Shape { what: "cell of a moved parameter", given: cell as usize, expected: n_cells });
        }
        for (d, column) in self.parameters.iter_mut().enumerate() {
            column.iter_mut().zip(parameters).for_each(|(target, u)| *target = u[d]);
        }
        self.arrange(cells, n_cells);
        Ok(())
    }

    fn check_length(&self, what: &'static str, given: usize) -> Result<(), Error> {
        if given == self.len() { Ok(()) } else { Err(Error::Shape { what, given, expected: self.len() }) }
    }

    /// Puts the points in another order, in which `from[at]` is the present place of the point at place `at`, and divides
    /// them among cells: `offsets[c]..offsets[c + 1]` are the places of cell `c`.
    ///
    /// # Errors
    /// [`Error::Shape`] if `from` is no permutation or the offsets do not divide the points.
    pub fn rearrange(&mut self, from: &[u32], offsets: Vec<usize>) -> Result<(), Error> {
        self.check_length("places of points", from.len())?;
        let mut met = vec![false; from.len()];
        for &old in from {
            match met.get_mut(old as usize) {
                Some(met) if !*met => *met = true,
                _ => return Err(Error::Shape { what: "place of a point", given: old as usize, expected: from.len() }),
            }
        }
        self.divide(offsets)?;
        self.gather(from);
        Ok(())
    }

    /// Divides the points, in their present order, among cells: `offsets[c]..offsets[c + 1]` are the places of cell `c`.
    ///
    /// # Errors
    /// [`Error::Shape`] if the offsets do not divide the points.
    pub fn divide(&mut self, offsets: Vec<usize>) -> Result<(), Error> {
        let last = offsets.last().copied().unwrap_or(0);
        self.check_length("last offset of cells", last)?;
        if offsets.len() < 2 || offsets[0] != 0 || !offsets.is_sorted() {
            return Err(Error::Shape {
                what: "increasing offsets of cells, from 0",
                given: 0,
                expected: offsets.len(),
            });
        }
        self.offsets = offsets;
        Ok(())
    }

    /// These points with further coordinates, one array each, in the order of the cells.
    pub(crate) fn with_columns(&self, columns: impl Iterator<Item = Vec<f64>>) -> Self {
        let mut extended = self.clone();
        extended.points.extend(columns);
        extended
    }

    /// The sum of the weights.
    pub fn total_weight(&self) -> f64 {
        self.weights.as_ref().map_or(self.len() as f64, |w| w.iter().sum())
    }

    /// Sorts the points by the cells of a space. Points whose cell of the space before still exists are not located
    /// anew. Points of a cell stay in their order, so the result does not depend on spaces in between, as long as each
    /// refines the one before.
    ///
    /// # Errors
    /// [`Error::Parameter`].
    pub fn sort<S: ParameterBox<D>>(
        &mut self,
        space: &S,
        known: impl Fn(usize) -> Option<usize> + Sync,
    ) -> Result<(), Error> {
        let mut cell_of = vec![0_u32; self.len()];
        let mut tasks = Vec::new();
        let mut rest = &mut cell_of[..];
        for (cell, ends) in self.offsets.windows(2).enumerate() {
            for start in (ends[0]..ends[1]).step_by(CHUNK) {
                let (part, further) = std::mem::take(&mut rest).split_at_mut(CHUNK.min(ends[1] - start));
                tasks.push((cell, start, part));
                rest = further;
            }
        }
        let locate = |(old_cell, start, part): (usize, usize, &mut [u32])| {
            if let Some(cell) = known(old_cell) {
                part.fill(cell as u32);
                return Ok::<(), Error>(());
            }
            for (i, target) in part.iter_mut().enumerate() {
                let cell = space.locate_cell(self.parameter(start + i));
                *target =
                    cell.map_err(|source| Error::Parameter { index: self.order[start + i] as usize, source })? as u32;
            }
            Ok(())
        };
        // Of several errors the first, whichever thread is faster.
        if let Some(error) = tasks.into_par_iter().find_map_first(|task| locate(task).err()) {
            return Err(error);
        }
        self.arrange(&cell_of, space.n_cells());
        Ok(())
    }

    /// A stable counting sort by cell.
    fn arrange(&mut self, cell_of: &[u32], n_cells: usize) {
        let mut offsets = vec![0_usize; n_cells + 1];
        for &cell in cell_of {
            offsets[cell as usize + 1] += 1;
        }
        for cell in 0..n_cells {
            offsets[cell + 1] += offsets[cell];
        }
        let mut next = offsets.clone();
        let mut from = vec![0_u32; self.len()];
        for (old, &cell) in cell_of.iter().enumerate() {
            let slot = &mut next[cell as usize];
            from[*slot] = old as u32;
            *slot += 1;
        }
        self.gather(&from);
        self.offsets = offsets;
    }

    fn gather(&mut self, from: &[u32]) {
        for column in self.parameters.iter_mut().chain(&mut self.points).chain(&mut self.weights) {
            gather(column, from);
        }
        gather(&mut self.order, from);
    }

    /// Sorts by the cells of a hierarchical space, given the one sorted for before.
    ///
    /// # Errors
    /// [`Error::Parameter`].
    pub fn sort_refined(
        &mut self,
        space: &HierarchicalSpace<D>,
        before: Option<&HierarchicalSpace<D>>,
    ) -> Result<(), Error> {
        self.sort(space, |old_cell| {
            let before = before.filter(|b| b.mesh().grid(0) == space.mesh().grid(0))?;
            let node = before.node(old_cell);
            let (level, index) = (before.mesh().level(node), before.mesh().cell_index(node));
            space.cell_of_node(space.mesh().find(level, index)?)
        })
    }
}

fn gather<T: Copy + Send + Sync>(column: &mut Vec<T>, from: &[u32]) {
    let source: &[T] = column;
    *column = from.par_iter().with_min_len(CHUNK).map(|&old| source[old as usize]).collect();
}
