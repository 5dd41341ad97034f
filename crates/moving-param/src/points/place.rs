//! Where points go when their parameters are set.

use fit_ls::SortedPoints;
use ndarray::Array2;
use thb_core::HierarchicalSpace;

use crate::Error;

/// The cells that hold parameters.
pub(crate) fn cells_of<const D: usize>(
    space: &HierarchicalSpace<D>,
    parameters: &[[f64; D]],
) -> Result<Vec<u32>, Error> {
    let cells = parameters.iter().map(|&u| space.locate_cell(u).map(|cell| cell as u32));
    Ok(cells.collect::<Result<_, _>>()?)
}

/// Parameters `(m, D)`, given in the order of the points, and their cells, in that of the sorted ones.
pub(crate) fn placed<const D: usize>(
    points: &SortedPoints<D>,
    parameters: &Array2<f64>,
    space: &HierarchicalSpace<D>,
) -> Result<(Vec<[f64; D]>, Vec<u32>), Error> {
    let of = |&index: &u32| std::array::from_fn(|d| parameters[[index as usize, d]]);
    let placed: Vec<[f64; D]> = points.order().iter().map(of).collect();
    let cells = cells_of(space, &placed)?;
    Ok((placed, cells))
}
