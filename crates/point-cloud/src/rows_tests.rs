//! Tests of rows, of planted distances in any direction.

use super::*;
use ndarray::Array2;

/// Rows along a bent surface, turned in its plane by `turn`: `ratio` times as dense along them as across, shaken along the row by a share
/// of the step and across by `scatter` steps; `bend` is the curvature of the rows in the plane.
fn scan(ratio: f64, lines: usize, turn: f64, jitter: f64, scatter: f64, bend: f64) -> Array2<f64> {
    let (across, along) = (8.0, 8.0 / ratio);
    let count = (80.0 / along) as usize;
    let shake = |i: usize, k: f64| (f64::sin(12.9898 * i as f64 + 78.233 * k) * 43758.5453).fract();
    let mut places = Vec::new();
    for line in 0..lines {
        for k in 0..count {
            let i = line * count + k;
            let s = (k as f64 + jitter * shake(i, 0.0)) * along;
            let t = line as f64 * across + scatter * along * shake(i, 1.0) + 0.5 * bend * (s - 40.0).powi(2);
            let (x, y) = (turn.cos() * s - turn.sin() * t, turn.sin() * s + turn.cos() * t);
            places.push([x, y, 3.0 * (x / 30.0).sin() * (y / 25.0).cos()]);
        }
    }
    Array2::from_shape_fn((places.len(), 3), |(i, k)| places[i][k])
}

#[test]
fn rows_are_found_with_their_ratio_and_thinned_to_it() {
    for ratio in [5.0, 12.0, 30.0, 60.0, 100.0] {
        for (turn, jitter, scatter, bend) in
            [(0.0, 0.0, 0.0, 0.0), (0.7, 0.3, 0.05, 0.0), (1.3, 0.0, 0.1, 0.008), (2.2, 0.4, 0.02 * ratio, -0.01)]
        {
            let points = scan(ratio, 9, turn, jitter, scatter, bend);
            let case = format!("ratio {ratio}, turn {turn}, jitter {jitter}, scatter {scatter}, bend {bend}");
            let rows = find_rows(points.view()).unwrap().unwrap_or_else(|| panic!("no rows: {case}"));
            assert!((0.6..1.4).contains(&(rows.ratio() / ratio)), "{} {case}", rows.ratio());
            let kept = thin_rows(points.view(), rows.across / 4.0).unwrap();
            // Each of 9 rows of 80 and somewhat more keeps one in 2 to 4 units, and about its ends.
            assert!((150..=500).contains(&kept.len()), "{} {case}", kept.len());
            let count = points.nrows() / 9;
            for end in (0..9).flat_map(|line| [line * count, (line + 1) * count - 1]) {
                let nearest = |&i: &u32| (&points.row(i as usize) - &points.row(end)).mapv(|d| d * d).sum().sqrt();
                let gap = kept.iter().map(nearest).fold(f64::INFINITY, f64::min);
                assert!(gap <= 0.6 * rows.across / 4.0, "end {end} {gap} {case}");
            }
        }
    }
}

#[test]
fn even_clouds_have_no_rows() {
    for side in [12, 30, 60] {
        assert_eq!(find_rows(crate::thin::tests::sheet(side).view()).unwrap(), None);
    }
    assert_eq!(find_rows(Array2::from_elem((50, 3), 2.0).view()).unwrap(), None);
    assert!(matches!(thin_rows(Array2::zeros((5, 3)).view(), 0.0), Err(CloudError::BadOption { .. })));
}
