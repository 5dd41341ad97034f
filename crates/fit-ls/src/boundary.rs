//! Surfaces with given boundary curves: the coefficients that a side's functions must have.

use std::sync::Arc;

use ndarray::Array2;
use thb_core::{CellSpace, HierarchicalSpace, Quadrature, SplineMap, SymmetricPattern, ThinPlate};

use crate::cholesky::Cholesky;
use crate::least_squares::{Fixed, penalized};
use crate::{Error, NormalEquations, SortedPoints};

/// A side of the parameter square.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Smallest u.
    Left,
    /// Largest u.
    Right,
    /// Smallest v.
    Bottom,
    /// Largest v.
    Top,
}

impl Side {
    /// The direction that is constant on the side, and whether it is at its upper end.
    fn fixed(self) -> (usize, bool) {
        match self {
            Self::Left => (0, false),
            Self::Right => (0, true),
            Self::Bottom => (1, false),
            Self::Top => (1, true),
        }
    }
}

/// Largest deviation of a boundary curve, relative to its largest coordinate, that counts as round-off.
const ROUND_OFF: f64 = 1e-9;

/// The functions that do not vanish on a side, increasing. None where the side is a seam.
pub fn boundary_functions(space: &HierarchicalSpace<2>, side: Side) -> Vec<usize> {
    let (direction, upper) = side.fixed();
    let mut functions = Vec::new();
    if space.periodic()[direction] {
        return functions;
    }
    for level in 0..space.n_levels() {
        let counts = space.function_counts(level);
        let wanted = if upper { counts[direction] - 1 } else { 0 };
        let first = space.first_of_level(level);
        for (k, &index) in space.active_functions(level).iter().enumerate() {
            let index = index as usize;
            if [index % counts[0], index / counts[0]][direction] == wanted {
                functions.push(first + k);
            }
        }
    }
    functions
}

/// Coefficients with which the surfaces of a space follow a curve along a side, to be held fixed in
/// [`crate::LeastSquares::fit_with_fixed`]. The curve is parameterized as the side is.
///
/// # Errors
/// [`Error::BoundaryCurve`] if no surface of the space has this boundary, [`Error::Space`] if the domains differ,
/// [`Error::Seam`] for a side where the space is periodic.
pub fn boundary_coefficients(
    space: &Arc<HierarchicalSpace<2>>,
    side: Side,
    curve: &SplineMap<1>,
) -> Result<Fixed, Error> {
    let (direction, upper) = side.fixed();
    if space.periodic()[direction] {
        return Err(Error::Seam { direction });
    }
    let (low, high) = space.domain();
    let constant = if upper { high[direction] } else { low[direction] };
    // More samples per cell than its polynomial has coefficients.
    let per_cell = 2 * (space.degree()[1 - direction] + 1);
    let mut sites = Vec::new();
    for number in 0..space.n_cells() {
        let cell = space.cell(number);
        let edge = if upper { cell.upper } else { cell.lower };
        if edge[direction] == constant {
            let (a, b) = (cell.lower[1 - direction], cell.upper[1 - direction]);
            sites.extend((0..per_cell).map(|i| a + (b - a) * (i as f64 + 0.5) / per_cell as f64));
        }
    }
    let parameters = Array2::from_shape_fn((sites.len(), 2), |(i, d)| if d == direction { constant } else { sites[i] });
    let along = Array2::from_shape_fn((sites.len(), 1), |(i, _)| sites[i]);
    let points = curve.eval_batch(along.view())?;
    let mut sorted = SortedPoints::<2>::new(parameters.view(), points.view(), None)?;
    sorted.sort_refined(space, None)?;
    let pattern = SymmetricPattern::new(space.as_ref());
    let equations = NormalEquations::new(space.as_ref(), &pattern, &sorted)?;
    let energy = ThinPlate::new(space.degree(), Quadrature::Exact).gram(space.as_ref(), &pattern)?;
    let functions = boundary_functions(space, side);
    // All other functions vanish on the side: held at zero they leave the equations of the boundary curve.
    let others = (0..space.n_functions())
        .filter(|f| functions.binary_search(f).is_err())
        .map(|f| (f, vec![0.0; points.ncols()]))
        .collect();
    let mut solver = Cholesky::new(&pattern).map_err(|_| Error::OutOfMemory { functions: space.n_functions() })?;
    let coefficients = penalized(&mut solver, equations, &energy, 0.0, &others)?;
    let fitted = SplineMap::new(space.clone(), coefficients.clone())?.eval_batch(parameters.view())?;
    let deviation = (&fitted - &points).iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    if deviation > ROUND_OFF * points.iter().fold(1.0_f64, |m, x| m.max(x.abs())) {
        return Err(Error::BoundaryCurve { deviation });
    }
    Ok(functions.into_iter().map(|f| (f, coefficients.row(f).to_vec())).collect())
}
