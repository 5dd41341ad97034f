//! The bounding box.

use ndarray::{Array1, ArrayView1, ArrayView2};

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

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    #[test]
    fn the_diagonal_of_a_box_of_sides_2_3_6_is_7_at_any_scale() {
        for scale in [1e-90, 1.0, 1e90] {
            let points = array![[1.0, 0.0, 6.0], [-1.0, 3.0, 0.0]] * scale;
            let diagonal = BoundingBox::of(points.view()).unwrap().diagonal();
            assert!((diagonal / scale - 7.0).abs() < 1e-14);
        }
    }
}
