//! A surface as a triangle mesh, with a deviation at each vertex.

use ndarray::{Array1, Array2};
use point_cloud::TriangleMesh;
use rstar::RTree;
use rstar::primitives::GeomWithData;
use thb_core::{CellSpace, SplineMap};

use crate::{Error, Fit};

/// Fewest and most quads per direction of a sampled surface: smooth to the eye, and at most some 10⁵ vertices.
const QUADS: std::ops::RangeInclusive<usize> = 40..=320;

/// Quads per element of level 0 and level, so that fine levels show.
const QUADS_PER_CELL: usize = 2;

/// Samples a surface on a regular grid of its domain. Returns the mesh and the parameters of its vertices, `(n, 2)`. In
/// closed directions the last quads end at the first vertices: there is no gap at the seam.
pub(crate) fn tessellate(map: &SplineMap<2>, reversed: bool) -> Result<(TriangleMesh, Array2<f64>), Error> {
    let space = map.space();
    let finest = space.n_levels() - 1;
    let quads = space.mesh().grid(finest).map(|cells| (QUADS_PER_CELL * cells).clamp(*QUADS.start(), *QUADS.end()));
    let (lower, upper) = space.domain();
    let periodic = space.periodic();
    let vertices: [usize; 2] = std::array::from_fn(|d| quads[d] + usize::from(!periodic[d]));
    let columns = vertices[0];
    let at = |i: usize, d: usize| {
        if i == quads[d] { upper[d] } else { lower[d] + (upper[d] - lower[d]) * i as f64 / quads[d] as f64 }
    };
    let parameters = Array2::from_shape_fn((columns * vertices[1], 2), |(k, d)| {
        at(if d == 0 { k % columns } else { k / columns }, d)
    });
    let number = |i: usize, j: usize| ((j % vertices[1]) * columns + i % columns) as u32;
    let mut triangles = Vec::with_capacity(2 * quads[0] * quads[1]);
    for j in 0..quads[1] {
        for i in 0..quads[0] {
            let (a, b, c, d) = (number(i, j), number(i + 1, j), number(i + 1, j + 1), number(i, j + 1));
            for [p, q, r] in [[a, b, c], [a, c, d]] {
                triangles.push(if reversed { [p, r, q] } else { [p, q, r] });
            }
        }
    }
    Ok((TriangleMesh { vertices: map.eval_batch(parameters.view())?, triangles }, parameters))
}

/// For each parameter, `(n, 2)`, the error of the fitted point whose parameters are nearest.
pub(crate) fn nearest_errors(fit: &Fit, parameters: &Array2<f64>) -> Array1<f64> {
    let sites =
        fit.parameters.outer_iter().zip(&fit.errors).map(|(u, &e)| GeomWithData::new([u[0], u[1]], e)).collect();
    let tree = RTree::bulk_load(sites);
    parameters.outer_iter().map(|u| tree.nearest_neighbor([u[0], u[1]]).map_or(0.0, |site| site.data)).collect()
}
