//! Tests of the choice of corners.

use super::*;
use ndarray::Array2;
use proptest::prelude::*;

/// `per_side` points on each side of a polygon, off the line by `jag` in turns.
fn polygon(corners: &[[f64; 2]], per_side: usize, jag: f64) -> Array2<f64> {
    let n = corners.len() * per_side;
    Array2::from_shape_fn((n, 2), |(i, k)| {
        let (side, step) = (i / per_side, i % per_side);
        let (p, q) = (corners[side], corners[(side + 1) % corners.len()]);
        let t = step as f64 / per_side as f64;
        let normal = [q[1] - p[1], p[0] - q[0]];
        let length = normal[0].hypot(normal[1]);
        let off = if step == 0 { 0.0 } else { jag * [1.0, -1.0][step % 2] };
        p[k] + t * (q[k] - p[k]) + off * normal[k] / length
    })
}

#[test]
fn a_jagged_rectangle_has_its_four_corners_and_u_along_the_longer_sides() {
    let corners = [[1.0, 0.0], [1.0, 3.0], [0.0, 3.0], [0.0, 0.0]];
    for jag in [0.0, 0.02, 0.05] {
        let found = find_corners(polygon(&corners, 50, jag).view(), CornerParams::default()).unwrap();
        // Long sides: from (1,0) to (1,3) and from (0,3) to (0,0); (0,3) comes before (1,0).
        assert_eq!(found.positions, [100, 150, 0, 50], "jag {jag}");
        assert!(found.turning.iter().all(|t| (t - FRAC_PI_2).abs() < 0.2), "{:?}", found.turning);
    }
}

#[test]
fn a_notch_is_no_corner() {
    // A square with a small notch in its lower side: its two reentrant corners turn right, its outer ones left.
    let corners =
        [[0.0, 0.0], [0.45, 0.0], [0.45, 0.12], [0.55, 0.12], [0.55, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let found = find_corners(polygon(&corners, 30, 0.0).view(), CornerParams::default()).unwrap();
    let mut positions = found.positions;
    positions.sort_unstable();
    assert_eq!(positions, [0, 150, 180, 210]);
}

#[test]
fn an_ellipse_is_cut_into_balanced_sides_along_its_axes() {
    for (a, b) in [(1.0, 1.0), (2.0, 1.0), (1.0, 3.0)] {
        let n = 400;
        let ellipse = Array2::from_shape_fn((n, 2), |(i, k)| {
            let t = TAU * i as f64 / n as f64;
            [a * t.cos(), b * t.sin()][k]
        });
        let found = find_corners(ellipse.view(), CornerParams::default()).unwrap();
        let [s0, s1, s2, s3] = found.side_lengths;
        let perimeter = s0 + s1 + s2 + s3;
        assert!((s0 - s2).abs() < 0.05 * perimeter && (s1 - s3).abs() < 0.05 * perimeter);
        if a != b {
            // Symmetric about both axes: every side runs along one of them.
            let at = found.positions.map(|i| [ellipse[[i, 0]], ellipse[[i, 1]]]);
            for k in 0..4 {
                let [dx, dy] = [0, 1].map(|axis| (at[(k + 1) % 4][axis] - at[k][axis]).abs());
                assert!(dx.max(dy) > 4.0 * dx.min(dy), "{a}:{b} side {k}: {dx} by {dy}");
            }
        }
    }
}

#[test]
fn sides_cover_the_loop_and_share_its_corners() {
    let corners = Corners { positions: [7, 9, 1, 2], turning: [0.0; 4], side_lengths: [0.0; 4] };
    assert_eq!(corners.sides(10), [vec![7, 8, 9], vec![9, 0, 1], vec![1, 2], vec![2, 3, 4, 5, 6, 7]]);
}

#[test]
fn loops_without_corners_are_errors() {
    let three = Array2::from_shape_fn((3, 2), |(i, k)| (i * k) as f64);
    assert_eq!(find_corners(three.view(), CornerParams::default()), Err(CloudError::LoopTooShort { given: 3 }));
    assert_eq!(
        find_corners(Array2::ones((6, 3)).view(), CornerParams::default()),
        Err(CloudError::LoopWithoutLength { count: 6 })
    );
    let square = polygon(&[[0., 0.], [1., 0.], [1., 1.], [0., 1.]], 5, 0.0);
    let params = CornerParams { separation: 0.3, ..CornerParams::default() };
    assert!(matches!(find_corners(square.view(), params), Err(CloudError::BadOption { .. })));
}

proptest! {
    /// The choice depends neither on where the loop starts nor on where the rectangle lies in space.
    #[test]
    fn a_moved_rectangle_keeps_its_corners(
        start in 0usize..160, angle in 0.0..TAU, tilt in 0.0..TAU, ratio in 0.15..1.0f64,
    ) {
        let flat = polygon(&[[0., 0.], [1., 0.], [1., ratio], [0., ratio]], 40, 0.0);
        let n = flat.nrows();
        let moved = Array2::from_shape_fn((n, 3), |(i, k)| {
            let (x, y) = (flat[[(i + start) % n, 0]], flat[[(i + start) % n, 1]]);
            let (x, y) = (x * angle.cos() - y * angle.sin(), x * angle.sin() + y * angle.cos());
            [x + 5.0, y * tilt.cos() - 3.0, y * tilt.sin()][k]
        });
        let found = find_corners(moved.view(), CornerParams::default()).unwrap();
        let mut original = found.positions.map(|p| (p + start) % n);
        original.sort_unstable();
        prop_assert_eq!(original, [0, 40, 80, 120]);
        prop_assert!(found.side_lengths[0] >= found.side_lengths[1] - 1e-12);
    }
}
