//! Whether points and a map fit together.

use fit_ls::SortedPoints;
use thb_core::{ParameterBox, SplineMap};

use crate::Error;
use crate::points::vector::MAX_DIM;

/// Checks that points and map fit together.
pub(crate) fn check<const D: usize, S: ParameterBox<D>>(
    map: &SplineMap<D, S>,
    points: &SortedPoints<D>,
) -> Result<(), Error> {
    if points.dim() > MAX_DIM {
        return Err(Error::Dimension { given: points.dim(), limit: MAX_DIM });
    }
    for (what, given, expected) in [
        ("coordinates of the points", points.dim(), map.dim()),
        ("cells the points are sorted for", points.offsets().len() - 1, map.space().n_cells()),
    ] {
        if given != expected {
            return Err(Error::Shape { what, given, expected });
        }
    }
    Ok(())
}
