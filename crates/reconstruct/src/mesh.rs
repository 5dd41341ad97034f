//! A surface as a triangle mesh, with a deviation at each vertex.

use ndarray::{Array1, Array2};
use point_cloud::{BoundingBox, TriangleMesh};
use rstar::RTree;
use rstar::primitives::GeomWithData;
use thb_core::SplineMap;

use crate::{Error, Fit};

/// Fewest quads per direction of a sampled surface.
const FEWEST: usize = 40;

/// Quads per element of the finest level and direction to begin with, so that fine levels show.
const QUADS_PER_CELL: usize = 2;

/// Most quads per direction to begin with.
const MOST: usize = 320;

/// Most vertices up to which strips of quads are divided.
const MOST_VERTICES: usize = 400_000;

/// Distance of a chord from the surface, as a share of the diagonal of its control points, from which on strips of quads are divided:
/// a tenth of the usual tolerance.
const CHORD: f64 = 1e-4;

/// Samples a surface on a grid of its domain, with more lines where it bends: chords of the grid stay within 10⁻⁴ of the diagonal, as
/// far as the number of vertices allows. Returns the mesh and the parameters of its vertices, `(n, 2)`. In
/// closed directions the last quads end at the first vertices: there is no gap at the seam.
pub(crate) fn tessellate(map: &SplineMap<2>, reversed: bool) -> Result<(TriangleMesh, Array2<f64>), Error> {
    let space = map.space();
    let finest = space.n_levels() - 1;
    let (lower, upper) = space.domain();
    let mut lines = [0, 1].map(|d| {
        let quads = (QUADS_PER_CELL * space.mesh().grid(finest)[d]).clamp(FEWEST, MOST);
        let at =
            |i: usize| if i == quads { upper[d] } else { lower[d] + (upper[d] - lower[d]) * i as f64 / quads as f64 };
        (0..=quads).map(at).collect::<Vec<f64>>()
    });
    let least = CHORD * BoundingBox::of(map.coefficients())?.diagonal();
    loop {
        let at_lines = map.eval_batch(grid(&lines[0], &lines[1]).view())?;
        let bent = [bent_strips(map, &lines, &at_lines, 0, least)?, bent_strips(map, &lines, &at_lines, 1, least)?];
        let size = |d: usize| lines[d].len() + bent[d].len();
        if bent.iter().all(Vec::is_empty) || size(0) * size(1) > MOST_VERTICES {
            break;
        }
        for (lines, bent) in lines.iter_mut().zip(bent) {
            lines.extend(bent);
            lines.sort_by(f64::total_cmp);
        }
    }
    let periodic = space.periodic();
    let quads = [0, 1].map(|d| lines[d].len() - 1);
    let vertices: [usize; 2] = std::array::from_fn(|d| quads[d] + usize::from(!periodic[d]));
    let columns = vertices[0];
    let parameters = grid(&lines[0][..columns], &lines[1][..vertices[1]]);
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

/// The products of two rows of parameters, the first running fastest, `(n, 2)`.
fn grid(u: &[f64], v: &[f64]) -> Array2<f64> {
    Array2::from_shape_fn((u.len() * v.len(), 2), |(k, d)| if d == 0 { u[k % u.len()] } else { v[k / u.len()] })
}

/// The middles of the strips between neighbouring lines of one direction over which a chord is farther than `least` from the
/// surface at its middle. `at_lines` are the points where the lines cross, as in [`grid`].
fn bent_strips(
    map: &SplineMap<2>,
    lines: &[Vec<f64>; 2],
    at_lines: &Array2<f64>,
    d: usize,
    least: f64,
) -> Result<Vec<f64>, Error> {
    let middles: Vec<f64> = lines[d].windows(2).map(|ends| 0.5 * (ends[0] + ends[1])).collect();
    let parameters = if d == 0 { grid(&middles, &lines[1]) } else { grid(&lines[0], &middles) };
    let between = map.eval_batch(parameters.view())?;
    let bends = |strip: usize| {
        (0..lines[1 - d].len()).any(|other| {
            let row = |i: usize, count: usize| if d == 0 { other * count + i } else { i * lines[0].len() + other };
            let (a, b) = (at_lines.row(row(strip, lines[d].len())), at_lines.row(row(strip + 1, lines[d].len())));
            let middle = between.row(row(strip, middles.len()));
            let squared: f64 = (0..middle.len()).map(|k| (middle[k] - 0.5 * (a[k] + b[k])).powi(2)).sum();
            squared > least * least
        })
    };
    Ok(middles.iter().enumerate().filter(|&(strip, _)| bends(strip)).map(|(_, &middle)| middle).collect())
}

/// For each parameter, `(n, 2)`, the error of the fitted point whose parameters are nearest.
pub(crate) fn nearest_errors(fit: &Fit, parameters: &Array2<f64>) -> Array1<f64> {
    let sites =
        fit.parameters.outer_iter().zip(&fit.errors).map(|(u, &e)| GeomWithData::new([u[0], u[1]], e)).collect();
    let tree = RTree::bulk_load(sites);
    parameters.outer_iter().map(|u| tree.nearest_neighbor([u[0], u[1]]).map_or(0.0, |site| site.data)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use thb_core::{HierarchicalSpace, Kind, KnotVector};

    /// The graph over the square of a biquadratic with two elements per direction that bends three times as much in the lower ones.
    fn bump() -> SplineMap<2> {
        let knots = KnotVector::uniform(2, 2).unwrap();
        let at = knots.greville();
        let space = HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap();
        let height = |i: usize| if i == 5 { 0.4 } else { 0.0 };
        let coefficients = Array2::from_shape_fn((16, 3), |(i, k)| [at[i % 4], at[i / 4], height(i)][k]);
        SplineMap::new(Arc::new(space), coefficients).unwrap()
    }

    #[test]
    fn chords_stay_near_and_lines_go_where_the_surface_bends() {
        let map = bump();
        let (mesh, parameters) = tessellate(&map, false).unwrap();
        let least = CHORD * BoundingBox::of(map.coefficients()).unwrap().diagonal();
        for triangle in &mesh.triangles {
            for k in 0..3 {
                let [i, j] = [triangle[k] as usize, triangle[(k + 1) % 3] as usize];
                let between = |d: usize| 0.5 * (parameters[[i, d]] + parameters[[j, d]]);
                let middle = map.eval([between(0), between(1)]).unwrap();
                let chord = |k: usize| 0.5 * (mesh.vertices[[i, k]] + mesh.vertices[[j, k]]);
                let distance = (0..3).map(|k| (middle[k] - chord(k)).powi(2)).sum::<f64>().sqrt();
                // Diagonals are chords of two directions at once.
                assert!(distance < 4.0 * least, "{distance}");
            }
        }
        let of = |range: std::ops::Range<f64>| parameters.column(0).iter().filter(|u| range.contains(u)).count();
        assert!(of(0.0..0.5) > of(0.5..1.0) * 3 / 2);
    }
}
