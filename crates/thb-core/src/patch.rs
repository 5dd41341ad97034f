//! Hierarchical maps as exact tensor-product B-spline maps, on the whole domain or on a box of it.

use std::sync::Arc;

use ndarray::Array2;

use crate::tensor::unravel;
use crate::{BezierMap, Error, HierarchicalSpace, KnotVector, MAX_DEGREE, SplineMap, TensorSpace};

impl<const D: usize> HierarchicalSpace<D> {
    /// Knots of the smallest tensor-product space that holds every function of this space on a box: the cell boundaries
    /// inside the box, as often as they occur in the knots of level 0, else once.
    ///
    /// # Errors
    /// [`Error::KnotOrder`] for an empty box, [`Error::OutsideDomain`].
    pub fn patch_knots(&self, lower: [f64; D], upper: [f64; D]) -> Result<[KnotVector; D], Error> {
        self.locate_cell(lower)?;
        self.locate_cell(upper)?;
        let mut breaks: [Vec<f64>; D] = std::array::from_fn(|_| Vec::new());
        // Down the tree within the box only: a model may be cut into thousands of boxes.
        let mut rest: Vec<_> = self.mesh().roots().collect();
        while let Some(node) = rest.pop() {
            let (level, index) = (self.mesh().level(node), self.mesh().cell_index(node));
            let mut ends = [[0.0; 2]; D];
            for (d, ends) in ends.iter_mut().enumerate() {
                let breaks = self.knots(level, d)?.breaks();
                *ends = [breaks[index[d] as usize], breaks[index[d] as usize + 1]];
            }
            if (0..D).any(|d| ends[d][1] <= lower[d] || ends[d][0] >= upper[d]) {
                continue;
            }
            if !self.mesh().is_leaf(node) {
                rest.extend(self.mesh().children(node));
                continue;
            }
            for (d, list) in breaks.iter_mut().enumerate() {
                list.extend(ends[d].iter().filter(|&&t| t > lower[d] && t < upper[d]));
            }
        }
        let mut knots = Vec::with_capacity(D);
        for (d, mut inner) in breaks.into_iter().enumerate() {
            inner.sort_by(f64::total_cmp);
            inner.dedup();
            let coarse = self.knots(0, d)?;
            let order = coarse.degree() + 1;
            let repeated = inner.into_iter().flat_map(|t| {
                let multiplicity = coarse.knots().iter().filter(|&&k| k == t).count().max(1);
                std::iter::repeat_n(t, multiplicity)
            });
            let ends = |t| std::iter::repeat_n(t, order);
            knots.push(KnotVector::new(
                coarse.degree(),
                ends(lower[d]).chain(repeated).chain(ends(upper[d])).collect(),
            )?);
        }
        Ok(std::array::from_fn(|d| knots[d].clone()))
    }
}

impl<const D: usize> SplineMap<D> {
    /// The map on a box as a tensor-product B-spline map on the knots of [`HierarchicalSpace::patch_knots`]. Exact: the
    /// coefficients are values of the blossoms of the cells' polynomials.
    ///
    /// # Errors
    /// [`Error::KnotOrder`] for an empty box, [`Error::OutsideDomain`], [`Error::Elements`].
    pub fn patch(&self, lower: [f64; D], upper: [f64; D]) -> Result<SplineMap<D, TensorSpace<D>>, Error> {
        let knots = self.space().patch_knots(lower, upper)?;
        let counts = std::array::from_fn(|d| knots[d].n_functions());
        let widest: [Vec<f64>; D] = std::array::from_fn(|d| {
            (0..counts[d]).map(|function| midpoint_of_widest_span(&knots[d], function)).collect()
        });
        let n = self.dim();
        let mut coefficients = Array2::zeros((counts.iter().product(), n));
        for (linear, mut row) in coefficients.outer_iter_mut().enumerate() {
            let function = unravel(linear, counts);
            let cell = self.space().locate_cell(std::array::from_fn(|d| widest[d][function[d]]))?;
            let value = blossom(self.bezier(), cell, &knots, function);
            row.iter_mut().zip(value).for_each(|(target, v)| *target = v);
        }
        SplineMap::new(Arc::new(TensorSpace::new(knots)?), coefficients)
    }

    /// The whole map as a tensor-product B-spline map.
    ///
    /// # Errors
    /// [`Error::Elements`].
    pub fn tensor_product(&self) -> Result<SplineMap<D, TensorSpace<D>>, Error> {
        let (lower, upper) = self.space().domain();
        self.patch(lower, upper)
    }
}

/// The blossom's arguments then lie at most `degree` cell sizes away, which bounds the amplification of round-off.
fn midpoint_of_widest_span(knots: &KnotVector, function: usize) -> f64 {
    let breaks = knots.breaks();
    let width = |span: usize| breaks[span + 1] - breaks[span];
    let support = knots.support(function);
    let widest = support.clone().fold(support.start, |best, span| if width(span) > width(best) { span } else { best });
    0.5 * (breaks[widest] + breaks[widest + 1])
}

/// The blossom of a cell's polynomial at the inner knots of a B-spline's support, direction after direction.
fn blossom<const D: usize>(map: &BezierMap<D>, cell: usize, knots: &[KnotVector; D], function: [usize; D]) -> Vec<f64> {
    let (lower, upper) = map.cell_box(cell);
    let mut values = map.cell_coefficients(cell).to_vec();
    let n = map.dim();
    for d in 0..D {
        let degree = map.degree()[d];
        let mut arguments = [0.0; MAX_DEGREE];
        for (r, argument) in arguments[..degree].iter_mut().enumerate() {
            *argument = (knots[d].knots()[function[d] + 1 + r] - lower[d]) / (upper[d] - lower[d]);
        }
        // The first remaining direction is the fastest, so each block of degree + 1 rows collapses to one.
        let rows = values.len() / (n * (degree + 1));
        for row in 0..rows {
            let start = row * (degree + 1) * n;
            for step in 0..degree {
                let t = arguments[step];
                for i in 0..(degree - step) * n {
                    values[start + i] = (1.0 - t) * values[start + i] + t * values[start + i + n];
                }
            }
            values.copy_within(start..start + n, row * n);
        }
        values.truncate(rows * n);
    }
    values
}
