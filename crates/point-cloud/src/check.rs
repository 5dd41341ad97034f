//! Conditions on a cloud that every later step relies on.

use ndarray::{ArrayView1, ArrayView2};

use crate::{BoundingBox, CloudError};

/// Largest absolute coordinate. Its square, summed over millions of points, stays far below the largest `f64`;
/// beyond it squared distances would turn into infinities.
pub const MAX_COORDINATE: f64 = 1e100;

/// Smallest extent of a cloud. The squares of distances a million times smaller are still normal numbers; below it
/// errors of a fit would vanish.
pub const MIN_EXTENT: f64 = 1e-100;

/// A cloud narrower than this share of its length counts as a line: of the 16 digits of a coordinate fewer than six
/// would be left to tell the second direction. Thin but real surfaces are far wider (a sheet 1 mm by 1 km: 1e-6).
pub const LINE_TOLERANCE: f64 = 1e-10;

/// Checks that every coordinate of `points`, shape `(m, N)`, is finite and at most [`MAX_COORDINATE`] in size.
///
/// # Errors
/// [`CloudError::NonFinite`], [`CloudError::TooLarge`].
pub fn check_finite(points: ArrayView2<'_, f64>) -> Result<(), CloudError> {
    for ((point, column), &value) in points.indexed_iter() {
        if !value.is_finite() {
            return Err(CloudError::NonFinite { point, column, value });
        }
        if value.abs() > MAX_COORDINATE {
            return Err(CloudError::TooLarge { point, column, value, limit: MAX_COORDINATE });
        }
    }
    Ok(())
}

/// Checks a cloud, shape `(m, N)`, that a curve shall be fitted to: coordinates finite, `required` points or more, not
/// all of them equal.
///
/// # Errors
/// Those of [`check_finite`], [`CloudError::TooFewPoints`], [`CloudError::AllEqual`], [`CloudError::TooSmall`].
pub fn check_curve_cloud(points: ArrayView2<'_, f64>, required: usize) -> Result<(), CloudError> {
    check_finite(points)?;
    let given = points.nrows();
    // One point at least, whatever was asked for: an empty cloud has no extent.
    let required = required.max(1);
    if given < required {
        return Err(CloudError::TooFewPoints { given, required });
    }
    let extent = BoundingBox::of(points)?.longest_side();
    if extent == 0.0 {
        return Err(CloudError::AllEqual { count: given });
    }
    if extent < MIN_EXTENT {
        return Err(CloudError::TooSmall { extent, limit: MIN_EXTENT });
    }
    Ok(())
}

/// Checks a cloud, shape `(m, N)`, that a surface shall be fitted to: as [`check_curve_cloud`], and the points do not
/// lie on a line.
///
/// The line runs from the point farthest from the first point to the point farthest from that one; its length is at
/// least half the diameter of the cloud, so the width measured from it is within a factor of four of the smallest.
///
/// # Errors
/// Those of [`check_curve_cloud`], [`CloudError::Collinear`] (tolerance [`LINE_TOLERANCE`]).
pub fn check_surface_cloud(points: ArrayView2<'_, f64>, required: usize) -> Result<(), CloudError> {
    check_curve_cloud(points, required)?;
    // In units of the longest side no square under- or overflows.
    let unit = BoundingBox::of(points)?.longest_side();
    let from = farthest(points, points.row(0), unit);
    let to = farthest(points, points.row(from), unit);
    let (origin, end) = (points.row(from), points.row(to));
    let length = squared_distance(origin, end, unit).sqrt();
    let direction: Vec<f64> = end.iter().zip(origin).map(|(e, o)| (e - o) / unit / length).collect();
    let width = points
        .rows()
        .into_iter()
        .map(|p| {
            let offset = || p.iter().zip(origin).map(|(x, o)| (x - o) / unit);
            let along: f64 = offset().zip(&direction).map(|(x, d)| x * d).sum();
            // Subtracting the foot vector, not the squares, keeps small widths exact.
            offset().zip(&direction).map(|(x, d)| (x - along * d).powi(2)).sum::<f64>()
        })
        .fold(0.0, f64::max)
        .sqrt();
    if width <= LINE_TOLERANCE * length {
        return Err(CloudError::Collinear { count: points.nrows(), width: width * unit, length: length * unit });
    }
    Ok(())
}

fn farthest(points: ArrayView2<'_, f64>, from: ArrayView1<'_, f64>, unit: f64) -> usize {
    let mut best = (0, -1.0);
    for (i, p) in points.rows().into_iter().enumerate() {
        let d = squared_distance(p, from, unit);
        if d > best.1 {
            best = (i, d);
        }
    }
    best.0
}

fn squared_distance(a: ArrayView1<'_, f64>, b: ArrayView1<'_, f64>, unit: f64) -> f64 {
    a.iter().zip(b).map(|(x, y)| ((x - y) / unit).powi(2)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array2, array};

    #[test]
    fn non_finite_coordinates_are_named() {
        let points = array![[0.0, 1.0], [2.0, f64::NEG_INFINITY]];
        assert_eq!(
            check_finite(points.view()),
            Err(CloudError::NonFinite { point: 1, column: 1, value: f64::NEG_INFINITY })
        );
        assert!(matches!(
            check_finite(array![[f64::NAN]].view()),
            Err(CloudError::NonFinite { point: 0, column: 0, .. })
        ));
        assert!(matches!(check_finite(array![[-1e200]].view()), Err(CloudError::TooLarge { .. })));
    }

    #[test]
    fn empty_and_equal_clouds_are_errors() {
        let empty = Array2::<f64>::zeros((0, 3));
        assert_eq!(check_curve_cloud(empty.view(), 0), Err(CloudError::TooFewPoints { given: 0, required: 1 }));
        let equal = Array2::from_elem((5, 3), 1e6 / 3.0);
        assert_eq!(check_curve_cloud(equal.view(), 4), Err(CloudError::AllEqual { count: 5 }));
        let tiny = Array2::from_shape_fn((5, 3), |(i, _)| i as f64 * 1e-160);
        assert!(matches!(check_curve_cloud(tiny.view(), 4), Err(CloudError::TooSmall { .. })));
    }

    #[test]
    fn a_line_in_general_position_is_recognized_and_a_thin_strip_is_not() {
        let line = |noise: f64, scale: f64| {
            Array2::from_shape_fn((40, 3), |(i, k)| {
                let t = i as f64 / 7.0;
                let side = if i % 2 == 0 { noise } else { -noise };
                scale * ([5.0, -3.0, 1e3][k] + t * [1.0, 2.0, -0.3][k] + side * [2.0, -1.0, 0.0][k])
            })
        };
        for scale in [1e-90, 1.0, 1e90] {
            assert!(matches!(
                check_surface_cloud(line(0.0, scale).view(), 4),
                Err(CloudError::Collinear { count: 40, .. })
            ));
            assert_eq!(check_surface_cloud(line(1e-6, scale).view(), 4), Ok(()));
        }
    }
}
