//! Bounding box and normalization.

use ndarray::{Array1, Array2, ArrayView1, ArrayView2};

use crate::CloudError;

/// The smallest box with sides along the axes that holds a cloud.
#[derive(Clone, Debug, PartialEq)]
pub struct BoundingBox {
    /// Smallest coordinates, shape `(N,)`.
    pub lower: Array1<f64>,
    /// Largest coordinates, shape `(N,)`.
    pub upper: Array1<f64>,
}

impl BoundingBox {
    /// The box of `points`, shape `(m, N)`; coordinates must be finite (see [`crate::check_finite`]).
    ///
    /// # Errors
    /// [`CloudError::TooFewPoints`] without a point.
    pub fn of(points: ArrayView2<'_, f64>) -> Result<Self, CloudError> {
        Self::of_rows(points.rows().into_iter())
    }

    /// The same for points one by one.
    ///
    /// # Errors
    /// As there.
    pub(crate) fn of_rows<'a>(mut points: impl Iterator<Item = ArrayView1<'a, f64>>) -> Result<Self, CloudError> {
        let first = points.next().ok_or(CloudError::TooFewPoints { given: 0, required: 1 })?;
        let (mut lower, mut upper) = (first.to_owned(), first.to_owned());
        for point in points {
            for ((lower, upper), &x) in lower.iter_mut().zip(&mut upper).zip(point) {
                (*lower, *upper) = (lower.min(x), upper.max(x));
            }
        }
        Ok(Self { lower, upper })
    }

    /// Length of the diagonal, in the units of the points.
    pub fn diagonal(&self) -> f64 {
        let unit = self.longest_side();
        if unit == 0.0 {
            return 0.0;
        }
        // In units of the longest side no square under- or overflows.
        unit * self.sides().map(|s| (s / unit).powi(2)).sum::<f64>().sqrt()
    }

    /// Length of the longest side, in the units of the points.
    pub fn longest_side(&self) -> f64 {
        self.sides().fold(0.0, f64::max)
    }

    fn sides(&self) -> impl Iterator<Item = f64> {
        self.upper.iter().zip(&self.lower).map(|(u, l)| u - l)
    }
}

/// Shift and one common scale that take a cloud into the unit cube: `x ↦ (x − shift) / scale`.
///
/// The longest side of the bounding box becomes \[0, 1\]; the scale is common, so that angles and ratios of lengths stay.
#[derive(Clone, Debug, PartialEq)]
pub struct Normalization {
    shift: Array1<f64>,
    scale: f64,
}

impl Normalization {
    /// The normalization of `points`, shape `(m, N)`.
    ///
    /// # Errors
    /// Those of [`crate::check_curve_cloud`] for one point: coordinates not finite, no point, all points equal.
    pub fn of(points: ArrayView2<'_, f64>) -> Result<Self, CloudError> {
        crate::check_curve_cloud(points, 1)?;
        let bounds = BoundingBox::of(points)?;
        let scale = bounds.longest_side();
        Ok(Self { shift: bounds.lower, scale })
    }

    /// The shift, shape `(N,)`: the lower corner of the bounding box.
    pub fn shift(&self) -> &Array1<f64> {
        &self.shift
    }

    /// Length in units of the input of a unit length in the cube; multiply errors by it to return to the input's units.
    pub fn scale(&self) -> f64 {
        self.scale
    }

    /// `points`, shape `(m, N)`, in the unit cube.
    ///
    /// # Errors
    /// [`CloudError::WrongDimension`] if `N` differs from the cloud's.
    pub fn apply(&self, points: ArrayView2<'_, f64>) -> Result<Array2<f64>, CloudError> {
        self.check_dimension(points)?;
        Ok((&points - &self.shift) / self.scale)
    }

    /// Points of the unit cube, shape `(m, N)`, back in the units of the input.
    ///
    /// # Errors
    /// [`CloudError::WrongDimension`] if `N` differs from the cloud's.
    pub fn invert(&self, points: ArrayView2<'_, f64>) -> Result<Array2<f64>, CloudError> {
        self.check_dimension(points)?;
        Ok(&points * self.scale + &self.shift)
    }

    fn check_dimension(&self, points: ArrayView2<'_, f64>) -> Result<(), CloudError> {
        let (given, required) = (points.ncols(), self.shift.len());
        if given == required { Ok(()) } else { Err(CloudError::WrongDimension { given, required }) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;
    use proptest::prelude::*;

    #[test]
    fn the_diagonal_of_a_box_of_sides_2_3_6_is_7_at_any_scale() {
        for scale in [1e-90, 1.0, 1e90] {
            let points = array![[1.0, 0.0, 6.0], [-1.0, 3.0, 0.0]] * scale;
            let diagonal = BoundingBox::of(points.view()).unwrap().diagonal();
            assert!((diagonal / scale - 7.0).abs() < 1e-14);
        }
    }

    proptest! {
        #[test]
        fn normalization_fills_the_unit_cube_and_inverts(
            coordinates in prop::collection::vec(-1e3..1e3, 6..60),
            shift in -1e6..1e6,
        ) {
            let m = coordinates.len() / 3;
            let points = Array2::from_shape_fn((m, 3), |(i, k)| coordinates[3 * i + k] + shift);
            let normalization = Normalization::of(points.view()).unwrap();
            let unit = normalization.apply(points.view()).unwrap();
            prop_assert!(unit.iter().all(|x| (0.0..=1.0).contains(x)));
            prop_assert_eq!(BoundingBox::of(unit.view()).unwrap().longest_side(), 1.0);
            let back = normalization.invert(unit.view()).unwrap();
            // Shifts of 1e6 leave 1e-10 of absolute accuracy.
            prop_assert!((&back - &points).iter().all(|d| d.abs() < 1e-9));
        }
    }
}
