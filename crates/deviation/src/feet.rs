//! Signed distances of points from a surface.

use ndarray::ArrayView2;
use point_cloud::vec3::dot;
use rayon::prelude::*;

use crate::Measured;
use crate::measure::NEAR_ENOUGH;

/// How far a point is from a surface, and on which side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SignedDistance {
    /// Positive on the side of `normal`.
    pub distance: f64,
    /// Unit normal of the surface at the nearest point, along `S_u × S_v`; zero where there is none.
    pub normal: [f64; 3],
}

impl SignedDistance {
    /// The same from the other side.
    #[must_use]
    pub fn turned(self) -> Self {
        Self { distance: -self.distance, normal: self.normal.map(|x| -x) }
    }
}

impl Measured<'_> {
    /// The distance of each point of a scan from the surface, positive on the side of `S_u × S_v`. Of a point of a cloud beyond the rim of
    /// the surface it is that across the surface, as everywhere: where a scanned region ends is not known better than the spacing of
    /// its points. `parameters`, one row for each point, are where searches begin.
    pub fn signed_distances(
        &self,
        points: &[[f64; 3]],
        scan_is_mesh: bool,
        parameters: ArrayView2<'_, f64>,
        tolerance: f64,
    ) -> Vec<SignedDistance> {
        let of_point = |(i, &point): (usize, &[f64; 3])| {
            let start = parameters.get([i, 0]).zip(parameters.get([i, 1])).map(|(&u, &v)| [u, v]);
            let foot = self.search.nearest(point, start, NEAR_ENOUGH * tolerance);
            let height = dot(foot.offset, foot.normal);
            let distance = if foot.on_rim && !scan_is_mesh { height } else { foot.distance.copysign(height) };
            SignedDistance { distance, normal: foot.normal }
        };
        points.par_iter().enumerate().map(of_point).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tessellate;
    use crate::testing::interpolated;

    #[test]
    fn signs_tell_the_side_and_clouds_reach_beyond_the_rim() {
        let map = interpolated([2, 2], [false; 2], |u, v| [u, v, 0.0]);
        let tessellation = tessellate(&map, 0.01).unwrap();
        let measured = Measured::new(&map, &tessellation).unwrap();
        let points = [[0.5, 0.5, 0.2], [0.25, 0.5, -0.1], [-0.3, 0.5, 0.4]];
        let parameters = ndarray::array![[0.5, 0.5], [0.2, 0.5], [0.0, 0.5]];
        let near = |found: Vec<SignedDistance>, expected: [f64; 3]| {
            let off = found.iter().zip(expected).map(|(a, b)| (a.distance - b).abs()).fold(0.0, f64::max);
            assert!(off < 1e-9, "{found:?}");
        };
        near(measured.signed_distances(&points, true, parameters.view(), 0.01), [0.2, -0.1, 0.5]);
        near(measured.signed_distances(&points, false, parameters.view(), 0.01), [0.2, -0.1, 0.4]);
    }
}
