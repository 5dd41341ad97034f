//! Samples of a map from which foot points are started.

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use thb_core::BezierMap;

use crate::Error;
use crate::points::patch::Patch;
use crate::points::vector::{MAX_DIM, Vector};

/// Most samples along a side.
const MOST_PER_LINE: usize = 512;

/// Samples of a map, searched for the nearest.
pub(crate) struct Samples<const D: usize> {
    /// Samples along a line across the whole domain.
    pub(crate) per_line: usize,
    tree: ImmutableKdTree<f64, MAX_DIM>,
    at: Vec<(u32, [f64; D])>,
}

impl<const D: usize> Samples<D> {
    /// `count` samples per direction in the interior of each cell.
    pub(crate) fn new(map: &BezierMap<D>, count: usize) -> Result<Self, Error> {
        let count = count.max(1);
        let (at, images): (Vec<_>, Vec<_>) = (0..map.n_cells())
            .into_par_iter()
            .flat_map_iter(|cell| {
                let patch = Patch::new(map, cell);
                let (lower, upper) = map.cell_box(cell);
                (0..count.pow(D as u32)).map(move |linear| {
                    let u = std::array::from_fn(|d| {
                        let i = linear / count.pow(d as u32) % count;
                        lower[d] + (upper[d] - lower[d]) * (i as f64 + 0.5) / count as f64
                    });
                    let value = patch.jet(u).value;
                    ((cell as u32, u), [value[0], value[1], value[2]])
                })
            })
            .unzip();
        let failed = |_| Error::Shape { what: "samples of the map", given: 0, expected: 1 };
        let tree = ImmutableKdTree::new_from_slice(&images).map_err(failed)?;
        // As if all cells lay on one line, which is more than enough.
        let per_line = (count * map.n_cells()).min(MOST_PER_LINE);
        Ok(Self { per_line, tree, at })
    }

    pub(crate) fn nearest(&self, point: &Vector) -> (usize, [f64; D]) {
        let query = [point[0], point[1], point[2]];
        let item = self.tree.query(&query).nearest_one::<SquaredEuclidean<f64>>().execute().item;
        let (cell, u) = self.at[item as usize];
        (cell as usize, u)
    }
}
