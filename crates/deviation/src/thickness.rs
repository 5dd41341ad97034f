//! How thick a surface can be made.

use point_cloud::vec3::{cross, dot, norm, scale};
use thb_core::{MAX_DEGREE, SplineMap, bernstein};

use crate::tessellation::{PARALLEL, combine};
use crate::{Error, Tessellation};

/// Radii of curvature of a surface, by area. A shell of thickness `t` on one side of it degenerates where a radius towards that
/// side is below `t`.
#[derive(Clone, Debug, PartialEq)]
pub struct CurvatureRadii {
    /// The smallest radius found; infinite for a plane.
    pub smallest: f64,
    /// Where it was found.
    pub place: [f64; 3],
    /// Its parameters.
    pub parameters: [f64; 2],
    /// The smallest radius of places that bend towards `S_u × S_v`, and of those that bend away from it.
    pub sides: [f64; 2],
    /// One hundredth of the area has smaller radii.
    pub percentile: f64,
    /// Radii, increasing, each with the share of the area up to it.
    shares: Vec<(f64, f64)>,
}

impl CurvatureRadii {
    /// Share of the area whose smaller radius of curvature is less than a thickness.
    pub fn share_below(&self, thickness: f64) -> f64 {
        let count = self.shares.partition_point(|&(radius, _)| radius < thickness);
        count.checked_sub(1).map_or(0.0, |last| self.shares[last].1)
    }
}

/// Radii of curvature in the middles of the triangles, from the first and second derivatives of `map`, of which `tessellation` is
/// one: `1 / |κ|` of the larger principal curvature, which solve `det(II − κ I) = 0`. Where the tangents are parallel there is
/// no curvature; those places are left out.
///
/// # Errors
/// [`Error::NoArea`].
pub fn curvature_radii(map: &SplineMap<2>, tessellation: &Tessellation) -> Result<CurvatureRadii, Error> {
    let bezier = map.bezier();
    let degree = bezier.degree();
    let mut sides = [f64::INFINITY; 2];
    let mut smallest = (f64::INFINITY, 0);
    let mut radii: Vec<(f64, f64)> = Vec::with_capacity(tessellation.triangles.len());
    for (t, &cell) in tessellation.cells.iter().enumerate() {
        let area = norm(tessellation.area_vector(t));
        let Some([least, most]) = principal_curvatures(map, cell as usize, middle_of(tessellation, t), degree) else {
            continue;
        };
        for (side, curvature) in sides.iter_mut().zip([most, -least]) {
            if curvature > 0.0 {
                *side = side.min(curvature.recip());
            }
        }
        let radius = most.abs().max(least.abs()).recip();
        if radius < smallest.0 {
            smallest = (radius, t);
        }
        radii.push((radius, area));
    }
    radii.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let total: f64 = radii.iter().map(|r| r.1).sum();
    if total.is_nan() || total <= 0.0 {
        return Err(Error::NoArea);
    }
    let mut sum = 0.0;
    let shares: Vec<(f64, f64)> = radii
        .iter()
        .map(|&(radius, area)| {
            sum += area;
            (radius, sum / total)
        })
        .collect();
    let percentile = shares.iter().find(|s| s.1 >= PERCENTILE).map_or(f64::INFINITY, |s| s.0);
    let parameters = tessellation.parameters_at(smallest.1, [1.0 / 3.0; 3]);
    let mut place = [0.0; 3];
    bezier.derivative(tessellation.cells[smallest.1] as usize, parameters, [0, 0], &mut place);
    Ok(CurvatureRadii { smallest: smallest.0, place, parameters, sides, percentile, shares })
}

/// The share of the area of [`CurvatureRadii::percentile`].
///
/// Limit: below it single triangles decide, where a surface has some thousands.
const PERCENTILE: f64 = 0.01;

/// The middle of a triangle, inside its cell; beyond the domain's end where the triangle ends at the seam.
fn middle_of(tessellation: &Tessellation, triangle: usize) -> [f64; 2] {
    let corners = tessellation.corner_parameters(triangle);
    std::array::from_fn(|d| corners.iter().map(|u| u[d]).sum::<f64>() / 3.0)
}

/// The smaller and the larger principal curvature, positive where the surface bends towards `S_u × S_v`.
fn principal_curvatures(map: &SplineMap<2>, cell: usize, u: [f64; 2], degree: [usize; 2]) -> Option<[f64; 2]> {
    let bezier = map.bezier();
    let (lower, upper) = bezier.cell_box(cell);
    // Per direction the polynomials and their first and second derivatives, in units of the cell: curvatures do not depend on
    // the speed of the parameters.
    let rows: [[[f64; MAX_DEGREE + 1]; 3]; 2] = std::array::from_fn(|d| {
        let at = (u[d] - lower[d]) / (upper[d] - lower[d]);
        std::array::from_fn(|order| {
            let mut row = [0.0; MAX_DEGREE + 1];
            bernstein::derivatives(degree[d], order, at, &mut row);
            row
        })
    });
    let coefficients = bezier.cell_coefficients(cell);
    let derivative = |i: usize, j: usize| combine(coefficients, &rows[0][i][..=degree[0]], &rows[1][j][..=degree[1]]);
    let (s_u, s_v) = (derivative(1, 0), derivative(0, 1));
    let area_vector = cross(s_u, s_v);
    let area = norm(area_vector);
    if area.is_nan() || area <= PARALLEL * norm(s_u) * norm(s_v) {
        return None;
    }
    let normal = scale(area.recip(), area_vector);
    let (e, f, g) = (dot(s_u, s_u), dot(s_u, s_v), dot(s_v, s_v));
    let [l, m, n] = [derivative(2, 0), derivative(1, 1), derivative(0, 2)].map(|s| dot(s, normal));
    let determinant = area * area;
    let mean = 0.5 * (e * n - 2.0 * f * m + g * l) / determinant;
    let gauss = (l * n - m * m) / determinant;
    let half = (mean * mean - gauss).max(0.0).sqrt();
    Some([mean - half, mean + half])
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::testing::{Random, interpolated, moved, refined_at_random};
    use point_cloud::vec3::sub;

    #[test]
    fn a_torus_has_the_radius_of_its_tube_and_a_plane_none() {
        let mut random = Random::new(21);
        for case in 0..8 {
            let (tube, ring) = (random.between(0.2, 1.0), random.between(2.5, 4.0));
            let torus = |u: f64, v: f64| {
                let ((sin, cos), (s, c)) = ((TAU * u).sin_cos(), (TAU * v).sin_cos());
                [(ring + tube * cos) * c, (ring + tube * cos) * s, tube * sin]
            };
            let map = interpolated([48, 64], [true, true], torus);
            let map = if case % 2 == 1 { refined_at_random(&map, &mut random) } else { map };
            let (map, motion) = moved(&map, &mut random);
            let size = norm(sub(motion([1.0, 0.0, 0.0]), motion([0.0; 3])));
            let radii = curvature_radii(&map, &Tessellation::new(&map, 1e-3 * size, 100_000).unwrap()).unwrap();
            assert!((radii.smallest / (tube * size) - 1.0).abs() < 0.01, "{} {}", radii.smallest, tube * size);
            assert!((radii.percentile / (tube * size) - 1.0).abs() < 0.01);
            assert_eq!(radii.share_below(0.9 * tube * size), 0.0);
            assert!((radii.share_below(1.1 * tube * size) - 1.0).abs() < 1e-9);
            // Away from the tube's middle it bends only on the inside of the ring, where the ring's radius is smallest.
            let mut sides = radii.sides.map(|side| side / size);
            sides.sort_by(f64::total_cmp);
            assert!((sides[0] / tube - 1.0).abs() < 0.01 && (sides[1] / (ring - tube) - 1.0).abs() < 0.05, "{sides:?}");
        }
        let plane = interpolated([4, 4], [false, false], |u, v| [u + 0.3 * u * u, v, 0.0]);
        let radii = curvature_radii(&plane, &Tessellation::new(&plane, 1e-3, 10_000).unwrap()).unwrap();
        assert!(radii.smallest > 1e9 && radii.percentile > 1e9);
    }

    #[test]
    fn a_ridge_is_found_with_its_share_and_place() {
        // A plane with a ridge across: radius of curvature of a (w² + (u − ½)²)^½ is w / a at its crest.
        for (w, a) in [(0.05, 1.0), (0.1, 0.5), (0.03, 0.3)] {
            let shape = |u: f64, v: f64| [u, v, -a * (w * w + (u - 0.5) * (u - 0.5)).sqrt()];
            let map = interpolated([160, 4], [false, false], shape);
            let radii = curvature_radii(&map, &Tessellation::new(&map, 1e-5, 200_000).unwrap()).unwrap();
            assert!((radii.smallest / (w / a) - 1.0).abs() < 0.03, "{} {}", radii.smallest, w / a);
            assert!((radii.place[0] - 0.5).abs() < 0.02 && (radii.parameters[0] - 0.5).abs() < 0.02);
            // It bends away from the normal only; where it is below twice the smallest one is known, too.
            assert!(radii.sides[0] > 1e3 * radii.smallest, "{:?}", radii.sides);
            let radius = |x: f64| {
                let slope = a * x / (w * w + x * x).sqrt();
                (1.0 + slope * slope).powf(1.5) * (w * w + x * x).powf(1.5) / (a * w * w)
            };
            let [mut below, mut all] = [0.0; 2];
            for k in 0..20_000 {
                let x = (f64::from(k) + 0.5) / 20_000.0 - 0.5;
                let length = (1.0 + a * a * x * x / (w * w + x * x)).sqrt();
                all += length;
                below += if radius(x) < 2.0 * w / a { length } else { 0.0 };
            }
            let share = radii.share_below(2.0 * w / a);
            assert!((share - below / all).abs() < 0.01, "{share} {}", below / all);
        }
    }

    #[test]
    fn a_surface_without_area_has_no_radii() {
        let line = interpolated([4, 4], [false, false], |u, _| [u, 0.0, 0.0]);
        let tessellation = Tessellation::new(&line, 0.1, 1000).unwrap();
        assert_eq!(curvature_radii(&line, &tessellation), Err(Error::NoArea));
    }
}
