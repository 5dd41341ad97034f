//! Random spline curves.

use rand_chacha::ChaCha8Rng;

use super::fit::SplineSpace;
use crate::gridded::vector;

/// A curve on \[0, 1\].
pub(crate) struct SplineCurve {
    pub(crate) space: SplineSpace,
    pub(crate) control: Vec<[f64; 3]>,
}

impl SplineCurve {
    /// Normally distributed control points.
    pub(crate) fn random(space: SplineSpace, dimension: usize, random: &mut ChaCha8Rng) -> Self {
        Self { space, control: (0..space.functions()).map(|_| vector(dimension, random)).collect() }
    }

    pub(crate) fn point(&self, t: f64) -> [f64; 3] {
        let values = self.space.values(t);
        std::array::from_fn(|k| values.iter().zip(&self.control).map(|(b, c)| b * c[k]).sum())
    }
}
