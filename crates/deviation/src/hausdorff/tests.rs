//! Hausdorff distances against closed forms.

use ndarray::Array2;

use super::*;
use crate::testing::{Random, interpolated};

/// A bicubic surface that equals a polynomial of degree 3 or less per direction.
fn surface(shape: impl Fn(f64, f64) -> [f64; 3]) -> SplineMap<2> {
    interpolated([5, 5], [false; 2], shape)
}

fn unit_square() -> SplineMap<2> {
    surface(|u, v| [u, v, 0.0])
}

/// Numbers between 0 and 1.
fn numbers(random: &mut Random, rows: usize, columns: usize) -> Array2<f64> {
    Array2::from_shape_simple_fn((rows, columns), || random.between(0.0, 1.0))
}

/// A paraboloid with curvature at most 1.
fn paraboloid(u: f64, v: f64) -> [f64; 3] {
    let (x, y) = (2.0 * u - 1.0, 2.0 * v - 1.0);
    [x, y, 0.5 * (x * x + y * y)]
}

/// Points of the paraboloid, moved along its normals by given lengths.
fn offset(parameters: &Array2<f64>, length: impl Fn(usize) -> f64) -> Array2<f64> {
    let mut points = Array2::zeros((parameters.nrows(), 3));
    for i in 0..parameters.nrows() {
        let [x, y, z] = paraboloid(parameters[[i, 0]], parameters[[i, 1]]);
        let norm = (1.0 + x * x + y * y).sqrt();
        let normal = [-x / norm, -y / norm, 1.0 / norm];
        for k in 0..3 {
            points[[i, k]] = [x, y, z][k] + length(i) * normal[k];
        }
    }
    points
}

#[test]
fn points_at_known_distances_from_a_plane() {
    let plane = unit_square();
    let mut random = Random::new(1);
    let parameters = numbers(&mut random, 500, 2);
    let heights: Vec<f64> = (0..500).map(|_| random.between(-0.1, 0.1)).collect();
    let largest = heights.iter().fold(0.0_f64, |m, h| m.max(h.abs()));
    let points = Array2::from_shape_fn((500, 3), |(i, k)| if k < 2 { parameters[[i, k]] } else { heights[i] });
    let found = directed_hausdorff(&plane, parameters.view(), points.view()).unwrap();
    assert!((found - largest).abs() < 1e-12, "{found} instead of {largest}");
    // The parameters are only where the search begins.
    let elsewhere = numbers(&mut random, 500, 2);
    let found = directed_hausdorff(&plane, elsewhere.view(), points.view()).unwrap();
    assert!((found - largest).abs() < 1e-12, "{found} instead of {largest}");
    assert!((hausdorff(&plane, points.view(), 3).unwrap().points_to_map - largest).abs() < 1e-12);
}

#[test]
fn points_offset_along_the_normals_of_a_paraboloid() {
    let map = surface(paraboloid);
    let mut random = Random::new(2);
    // Parameters away from the sides, so that the nearest point is the foot of the normal.
    let parameters = numbers(&mut random, 400, 2);
    let lengths: Vec<f64> = (0..400).map(|i| if i == 137 { -0.4 } else { random.between(-0.3, 0.3) }).collect();
    let points = offset(&parameters, |i| lengths[i]);
    let found = directed_hausdorff(&map, parameters.view(), points.view()).unwrap();
    assert!((found - 0.4).abs() < 1e-10, "{found}");
    let both = hausdorff(&map, points.view(), 4).unwrap();
    assert!((both.points_to_map - 0.4).abs() < 1e-10, "{both:?}");
    assert_eq!(both.two_sided(), both.points_to_map.max(both.map_to_points));
}

#[test]
fn the_distance_from_the_surface_to_points() {
    // Points on one half of the unit square: the far side of the square is ½ away from them, the near one on them.
    let plane = unit_square();
    let n = 41_usize;
    let points = Array2::from_shape_fn((n * n, 3), |(i, k)| match k {
        0 => 0.5 * (i % n) as f64 / (n - 1) as f64,
        1 => (i / n) as f64 / (n - 1) as f64,
        _ => 0.0,
    });
    let both = hausdorff(&plane, points.view(), 6).unwrap();
    assert!(both.points_to_map < 1e-12);
    // Samples of the far side miss the nearest point by at most half a step of the points across it.
    let miss = 0.5 / (n - 1) as f64;
    assert!((0.5..=0.5_f64.hypot(miss) + 1e-12).contains(&both.map_to_points), "{both:?}");
    assert_eq!(both.two_sided(), both.map_to_points);
}

#[test]
fn wrong_shapes_are_typed_errors() {
    let plane = unit_square();
    let (none, flat) = (Array2::zeros((0, 3)), Array2::zeros((4, 2)));
    assert_eq!(hausdorff(&plane, none.view(), 3), Err(Error::NoPoints));
    assert!(matches!(hausdorff(&plane, flat.view(), 3), Err(Error::Count { given: 2, expected: 3, .. })));
    let points = Array2::zeros((4, 3));
    let few = Array2::zeros((3, 2));
    assert!(matches!(directed_hausdorff(&plane, few.view(), points.view()), Err(Error::Count { given: 3, .. })));
    let outside = Array2::from_elem((4, 2), 1.5);
    assert!(matches!(
        directed_hausdorff(&plane, outside.view(), points.view()),
        Err(Error::Parameter { index: 0, .. })
    ));
}
