//! Creases: places where a surface turns over between one sample and the next.

use point_cloud::vec3::{cross, dot};
use rayon::prelude::*;
use thb_core::{BezierMap, CellSpace, SplineMap};

use crate::Error;

/// Share of neighbouring samples of a surface, `samples` per direction and cell, between which the normal turns by more
/// than a right angle. A surface that follows a scan does so at sharp edges at most; one with too few points to hold it
/// creases between them, which distances at the points do not tell.
///
/// # Errors
/// [`Error::Dimension`] unless the map goes to space; [`Error::Space`].
pub fn creases(map: &SplineMap<2>, samples: usize) -> Result<f64, Error> {
    if map.dim() != 3 {
        return Err(Error::Dimension { given: map.dim() });
    }
    let bezier = map.bezier();
    let per_cell = samples.max(2);
    let space = map.space();
    let normal = |cell: usize, u: [f64; 2]| area_vector(bezier, cell, u);
    let of_cell = |cell: usize| -> Result<[usize; 2], Error> {
        let (lower, upper) = bezier.cell_box(cell);
        let at = |d: usize, i: usize| lower[d] + (upper[d] - lower[d]) * (i as f64 + 0.5) / per_cell as f64;
        let place = |k: usize| [at(0, k % per_cell), at(1, k / per_cell)];
        let normals: Vec<[f64; 3]> = (0..per_cell * per_cell).map(|k| normal(cell, place(k))).collect();
        let mut counts = [0; 2];
        let mut count = |a: &[f64; 3], b: &[f64; 3]| {
            counts[0] += usize::from(dot(*a, *b) < 0.0);
            counts[1] += 1;
        };
        for k in 0..normals.len() {
            for (d, (i, step)) in [(k % per_cell, 1), (k / per_cell, per_cell)].into_iter().enumerate() {
                if i + 1 < per_cell {
                    count(&normals[k], &normals[k + step]);
                    continue;
                }
                // The next sample lies in another cell, or beyond the domain.
                let mut next = place(k);
                next[d] = at(d, per_cell);
                if next[d] < space.domain().1[d] {
                    count(&normals[k], &normal(space.locate_cell(next)?, next));
                }
            }
        }
        Ok(counts)
    };
    let counts: Vec<[usize; 2]> = (0..space.n_cells()).into_par_iter().map(of_cell).collect::<Result<_, _>>()?;
    let [turned, pairs] = counts.iter().fold([0, 0], |sum, c| [sum[0] + c[0], sum[1] + c[1]]);
    Ok(turned as f64 / pairs.max(1) as f64)
}

/// `S_u × S_v` of a surface in space at a parameter of a cell.
pub(crate) fn area_vector(bezier: &BezierMap<2>, cell: usize, u: [f64; 2]) -> [f64; 3] {
    let tangent = |order: [usize; 2]| {
        let mut tangent = [0.0; 3];
        bezier.derivative(cell, u, order, &mut tangent);
        tangent
    };
    cross(tangent([1, 0]), tangent([0, 1]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;
    use std::sync::Arc;
    use thb_core::{HierarchicalSpace, Kind, KnotVector};

    /// The graph of height 0 over the Greville sites, with one site moved in x.
    fn sheet(moved: f64) -> SplineMap<2> {
        let knots = KnotVector::uniform(2, 6).unwrap();
        let sites = knots.greville();
        let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap());
        let n = sites.len();
        let mut coefficients = Array2::from_shape_fn((n * n, 3), |(i, k)| [sites[i % n], sites[i / n], 0.0][k]);
        coefficients[[n * (n / 2) + n / 2, 0]] += moved;
        SplineMap::new(space, coefficients).unwrap()
    }

    #[test]
    fn a_sheet_creases_where_it_is_pushed_beyond_its_neighbours() {
        assert_eq!(creases(&sheet(0.0), 8).unwrap(), 0.0);
        assert_eq!(creases(&sheet(0.1), 8).unwrap(), 0.0);
        let share = creases(&sheet(0.8), 8).unwrap();
        assert!(share > 0.005 && share < 0.2, "{share}");
    }
}
