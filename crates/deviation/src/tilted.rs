//! Scars: places where a surface does not lie as the points around do.

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use ndarray::ArrayView2;
use point_cloud::vec3::{dot, norm};
use rayon::prelude::*;
use thb_core::SplineMap;

use crate::Error;
use crate::creases::area_vector;
use crate::hausdorff::{check_widths, padded};

/// Points whose normals a sample is compared with. A fold may lie beside a sharp edge, with points of both its sides around it.
const NEAREST: usize = 4;

/// Cosine of the angle from which on a normal is another one.
const COSINE: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Share of the area of a surface, by `samples` per direction and cell, whose normal is more than 45° from the normals of the
/// four nearest points, `normals` of shape `(m, 3)` with either sign. Distances do not see a narrow fold beside the points, and
/// it need not turn by a right angle.
///
/// # Errors
/// [`Error::Dimension`] unless the map goes to space; [`Error::Count`] unless there is a normal for each point; [`Error::NoPoints`].
pub fn tilted(
    map: &SplineMap<2>,
    points: ArrayView2<'_, f64>,
    normals: ArrayView2<'_, f64>,
    samples: usize,
) -> Result<f64, Error> {
    check_widths(map, points)?;
    if map.dim() != 3 {
        return Err(Error::Dimension { given: map.dim() });
    }
    if normals.dim() != points.dim() {
        return Err(Error::Count { what: "normals", given: normals.nrows(), expected: points.nrows() });
    }
    let (places, normals) = (padded(points), padded(normals));
    let tree: ImmutableKdTree<f64, 3> = ImmutableKdTree::new_from_slice(&places).map_err(|_| Error::NoPoints)?;
    let nearest = NEAREST.min(places.len()).try_into().map_err(|_| Error::NoPoints)?;
    let bezier = map.bezier();
    let per_cell = samples.max(1);
    let of_cell = |cell: usize| {
        let (lower, upper) = bezier.cell_box(cell);
        let size = (upper[0] - lower[0]) * (upper[1] - lower[1]);
        let mut areas = [0.0; 2];
        let mut image = [0.0; 3];
        for linear in 0..per_cell * per_cell {
            let at = [linear % per_cell, linear / per_cell];
            let u = std::array::from_fn(|d| lower[d] + (upper[d] - lower[d]) * (at[d] as f64 + 0.5) / per_cell as f64);
            bezier.derivative(cell, u, [0, 0], &mut image);
            let normal = area_vector(bezier, cell, u);
            let area = norm(normal);
            let alike = |item: u32| dot(normal, normals[item as usize]).abs() > COSINE * area;
            let around = tree.query(&image).nearest_n::<SquaredEuclidean<f64>>(nearest).execute();
            areas[0] += if around.iter().any(|found| alike(found.item)) { 0.0 } else { size * area };
            areas[1] += size * area;
        }
        areas
    };
    let parts: Vec<[f64; 2]> = (0..bezier.n_cells()).into_par_iter().map(of_cell).collect();
    let [tilted, all] = parts.iter().fold([0.0; 2], |sum, part| [sum[0] + part[0], sum[1] + part[1]]);
    Ok(if all > 0.0 { tilted / all } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;
    use std::sync::Arc;
    use thb_core::{HierarchicalSpace, Kind, KnotVector};

    #[test]
    fn only_what_stands_across_the_points_is_tilted() {
        // Points of the plane; a surface of degree 1 with a fin of height h along the middle, two cells of 10 wide.
        let knots = KnotVector::uniform(1, 10).unwrap();
        let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap());
        let fin = |h: f64| {
            let coefficients = Array2::from_shape_fn((121, 3), |(i, k)| match k {
                0 => (i % 11) as f64 / 10.0,
                1 => (i / 11) as f64 / 10.0,
                _ => [0.0, h][usize::from(i % 11 == 5)],
            });
            SplineMap::new(space.clone(), coefficients).unwrap()
        };
        let points = Array2::from_shape_fn((441, 3), |(i, k)| [(i % 21) as f64 / 20.0, (i / 21) as f64 / 20.0, 0.0][k]);
        let normals = Array2::from_shape_fn((441, 3), |(i, k)| if k == 2 { [1.0, -1.0][i % 2] } else { 0.0 });
        let share = |h: f64| tilted(&fin(h), points.view(), normals.view(), 4).unwrap();
        assert_eq!(share(0.0), 0.0);
        // Slope 0.9 and 2: the sides of the fin are as long as 0.2 · √5 in 0.8 + 0.2 · √5.
        assert_eq!(share(0.09), 0.0);
        let sides = 0.2 * 5.0_f64.sqrt();
        assert!((share(0.2) - sides / (0.8 + sides)).abs() < 1e-12);
        let short = normals.slice_axis(ndarray::Axis(0), (0..7).into());
        assert!(matches!(tilted(&fin(0.0), points.view(), short, 4), Err(Error::Count { given: 7, .. })));
    }
}
