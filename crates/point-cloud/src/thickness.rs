//! How thick a shape is where two of its sides face each other.

use ndarray::{Array2, ArrayView2};
use rayon::prelude::*;

use crate::box_tree::TriangleTree;
use crate::neighbours::rows;
use crate::noise::some_of;
use crate::vec3::{add, cross, dot, norm, scale, sub, unit};
use crate::{CloudError, LocalFrames, check_finite};

/// Share of the area that is thinner than what is told.
const QUANTILE: f64 = 0.05;

/// Places from which the other side is sought. Derived: a quantile of 5 % is then met to half a percent of the area.
const SAMPLES: usize = 2000;

/// Cosine of the angle between normals of sides that face each other, at most. Derived: −cos 45°; sides that are steeper
/// against each other, as of a right angle, are no wall.
const FACING: f64 = -0.707;

/// Cosine with the mean normal from which on normals cannot face each other. Derived: cos 67.5°, half of the 135° that are needed.
const UPRIGHT: f64 = 0.3827;

/// Radius of the triangle that stands for a point of a cloud, in spacings. Derived: its inner circle, half as wide, has the area of a point
/// in a hexagonal lattice.
const PATCH: f64 = 1.05;

/// Points of a cloud that are looked at. Limit: local fits of as many take a fraction of a second.
const MOST_POINTS: usize = 20_000;

/// Fewest points of local fits.
const FEWEST_POINTS: usize = 8;

/// The thickness that 5 % of the area of a mesh falls below, measured along the normal, to either side, up to where a side with an opposite
/// normal is met; `None` where fewer than 5 % of the area face another side. `points` have shape `(m, 3)`; triangles are oriented alike.
///
/// Both sides of the surface are looked at: walls are thin on the inside, gaps between folds of a sheet on the outside, and a
/// surface that may be moved across either could cross itself. O(t log t) for t triangles; O(t) for a height field.
///
/// # Errors
/// [`CloudError::WrongDimension`], those of [`check_finite`]. Triangles that name points that are not there are left out.
pub fn thickness(points: ArrayView2<'_, f64>, triangles: &[[u32; 3]]) -> Result<Option<f64>, CloudError> {
    check_finite(points)?;
    let points = rows(points)?;
    let is_known = |t: &&[u32; 3]| t.iter().all(|&i| (i as usize) < points.len());
    let corners: Vec<[[f64; 3]; 3]> =
        triangles.iter().filter(is_known).map(|t| t.map(|i| points[i as usize])).collect();
    Ok(of_triangles(&corners))
}

/// The same for a cloud, shape `(m, 3)`, by a small triangle for each point across its normal ([`LocalFrames`]); of many points a part is
/// taken. `None` for fewer than 8 points, too. O(m) beside the local fits.
///
/// # Errors
/// Those of [`LocalFrames::estimate`].
pub fn thickness_of_cloud(points: ArrayView2<'_, f64>) -> Result<Option<f64>, CloudError> {
    check_finite(points)?;
    let mut some = rows(points)?;
    some_of(&mut some, MOST_POINTS);
    if some.len() < FEWEST_POINTS {
        return Ok(None);
    }
    let some = Array2::from_shape_fn((some.len(), 3), |(i, k)| some[i][k]);
    let LocalFrames { normals, spacing, .. } = LocalFrames::estimate(some.view())?;
    let patch = |((point, normal), &spacing): ((&[f64; 3], &[f64; 3]), &f64)| {
        let axis = (0..3).min_by(|&a, &b| normal[a].abs().total_cmp(&normal[b].abs())).unwrap_or(0);
        let first = unit(cross(*normal, std::array::from_fn(|k| f64::from(u8::from(k == axis)))));
        let second = cross(*normal, first);
        [0.0, 1.0, 2.0].map(|third: f64| {
            let (sin, cos) = (third * std::f64::consts::TAU / 3.0).sin_cos();
            add(*point, scale(PATCH * spacing, add(scale(cos, first), scale(sin, second))))
        })
    };
    let (points, normals) = (rows(some.view())?, rows(normals.view())?);
    let corners: Vec<[[f64; 3]; 3]> = points.iter().zip(&normals).zip(&spacing).map(patch).collect();
    Ok(of_triangles(&corners))
}

fn of_triangles(corners: &[[[f64; 3]; 3]]) -> Option<f64> {
    let areas: Vec<[f64; 3]> = corners.iter().map(|&[a, b, c]| cross(sub(b, a), sub(c, a))).collect();
    let total: f64 = areas.iter().map(|n| norm(*n)).sum();
    let mean = unit(areas.iter().fold([0.0; 3], |sum, n| add(sum, *n)));
    let slanted: f64 = areas.iter().filter(|n| dot(**n, mean) < UPRIGHT * norm(**n)).map(|n| norm(*n)).sum();
    // Of two sides that face each other one at least is slanted.
    if !total.is_finite() || total <= 0.0 || slanted < 0.5 * QUANTILE * total {
        return None;
    }
    let tree = TriangleTree::new(corners);
    let found: Vec<f64> = sampled(corners, &areas, total)
        .par_iter()
        .map(|&(triangle, place)| {
            let normal = unit(areas[triangle]);
            let faces =
                |other: u32, _: f64| other as usize != triangle && dot(unit(areas[other as usize]), normal) <= FACING;
            let towards = |sign: f64| tree.first_hit(place, scale(sign, normal), faces).unwrap_or(f64::INFINITY);
            towards(1.0).min(towards(-1.0))
        })
        .collect();
    let mut sorted = found;
    sorted.sort_unstable_by(f64::total_cmp);
    let at = (QUANTILE * sorted.len() as f64) as usize;
    sorted.get(at).copied().filter(|thickness| thickness.is_finite())
}

/// Places evenly by area, with their triangles.
fn sampled(corners: &[[[f64; 3]; 3]], areas: &[[f64; 3]], total: f64) -> Vec<(usize, [f64; 3])> {
    let mut places = Vec::with_capacity(SAMPLES);
    let mut before = 0.0;
    for (triangle, area) in areas.iter().enumerate() {
        before += norm(*area);
        while places.len() < SAMPLES && (places.len() as f64 + 0.5) / SAMPLES as f64 * total <= before {
            // The R₂ sequence (Roberts 2018), folded into the triangle.
            let [mut u, mut v] =
                [0.754_877_666_246_693, 0.569_840_290_998_053].map(|step| (step * (places.len() + 1) as f64).fract());
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            let [a, b, c] = corners[triangle];
            places.push((triangle, add(a, add(scale(u, sub(b, a)), scale(v, sub(c, a))))));
        }
    }
    places
}
