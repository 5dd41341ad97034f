//! Distances of sorted points to a map.

use rayon::prelude::*;
use thb_core::BezierMap;

use crate::kernel::distances;
use crate::sorted::CHUNK;
use crate::{Error, SortedPoints};

impl<const D: usize> SortedPoints<D> {
    /// Distances of the points to a map whose cells they are sorted by, in their order.
    ///
    /// # Errors
    /// [`Error::Shape`] if they are sorted for another number of cells or the dimensions differ.
    pub fn distances(&self, map: &BezierMap<D>, out: &mut Vec<f64>) -> Result<(), Error> {
        let shape = |what, given: usize, expected: usize| {
            if given == expected { Ok(()) } else { Err(Error::Shape { what, given, expected }) }
        };
        shape("cells the points are sorted for", self.offsets.len() - 1, map.n_cells())?;
        shape("coordinates of the map", map.dim(), self.dim())?;
        out.resize(self.len(), 0.0);
        let mut tasks = Vec::new();
        let mut rest = &mut out[..];
        for (cell, ends) in self.offsets.windows(2).enumerate() {
            for start in (ends[0]..ends[1]).step_by(CHUNK) {
                let end = (start + CHUNK).min(ends[1]);
                let (part, further) = std::mem::take(&mut rest).split_at_mut(end - start);
                tasks.push((cell, start..end, part));
                rest = further;
            }
        }
        tasks.into_par_iter().for_each(|(cell, range, part)| distances(self, range, map, cell, part));
        Ok(())
    }
}
