//! A cloud in the unit cube.

use ndarray::{Array1, Array2, ArrayView2};

use crate::{BoundingBox, CloudError, check_curve_cloud};

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
    /// Those of [`check_curve_cloud`] for one point: coordinates not finite, no point, all points equal.
    pub fn of(points: ArrayView2<'_, f64>) -> Result<Self, CloudError> {
        check_curve_cloud(points, 1)?;
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
    use proptest::prelude::*;

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
