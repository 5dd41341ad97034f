//! The size of a shape across itself: relief over the best plane, radius of a tube.

use ndarray::ArrayView2;

use crate::local_frame::median;
use crate::neighbours::rows;
use crate::quadric::principal_axes;
use crate::vec3::{dot, norm, scale, sub, unit};
use crate::{CloudError, check_finite};

/// Share of the points on either side that relief leaves out. Limit: the 1 % of them that may be anything.
const LEFT_OUT: f64 = 0.01;

/// Times that the best plane is sought, each time but the first without the points farthest from the plane before.
const PLANES: usize = 3;

/// Bins of points along a tube. Calibrated: of 8, 16 and 32 on blades and pipes the radius hardly differs; rings of fewer points are
/// no circles, and wider ones are bent.
const RINGS: usize = 16;

/// Height of a shape over its best plane, in the units of its points, shape `(m, 3)`, without 1 % of the points on either side of it.
/// The plane is that through the mean with the smallest sum of squared distances, again without the farthest 2 %. O(m).
///
/// # Errors
/// [`CloudError::WrongDimension`], [`CloudError::TooFewPoints`] without a point, those of [`check_finite`].
pub fn relief(points: ArrayView2<'_, f64>) -> Result<f64, CloudError> {
    check_finite(points)?;
    let points = rows(points)?;
    if points.is_empty() {
        return Err(CloudError::TooFewPoints { given: 0, required: 1 });
    }
    let mut kept = points.clone();
    let left_out = (LEFT_OUT * points.len() as f64) as usize;
    let mut heights = Vec::new();
    for _ in 0..PLANES {
        let axes = principal_axes(&kept);
        let height = |p: &[f64; 3]| dot(sub(*p, axes.centre), axes.directions[0]);
        heights = points.iter().map(height).collect::<Vec<f64>>();
        heights.sort_unstable_by(f64::total_cmp);
        let within = heights[left_out]..=heights[heights.len() - 1 - left_out];
        kept = points.iter().filter(|p| within.contains(&height(p))).copied().collect();
    }
    Ok(heights[heights.len() - 1 - left_out] - heights[left_out])
}

/// The radius of a tube, in the units of its points, shape `(m, 3)`, given how far along it each point lies, `(m)`: of sixteen rings
/// with the same number of points the median distance to the line through the mean of the ring along the tube, which is the direction
/// between the means of the rings beside it; of these the second smallest, so that one end that is all but closed does not count. 0
/// without points. O(m log m).
///
/// # Errors
/// [`CloudError::WrongDimension`], those of [`check_finite`].
pub fn ring_radius(points: ArrayView2<'_, f64>, along: &[f64]) -> Result<f64, CloudError> {
    check_finite(points)?;
    let points = rows(points)?;
    let mut order: Vec<usize> = (0..points.len().min(along.len())).collect();
    order.sort_unstable_by(|&a, &b| along[a].total_cmp(&along[b]).then(a.cmp(&b)));
    let rings: Vec<&[usize]> = order.chunks(order.len().div_ceil(RINGS).max(1)).collect();
    let mean = |ring: &&[usize]| -> [f64; 3] {
        std::array::from_fn(|k| ring.iter().map(|&i| points[i][k]).sum::<f64>() / ring.len() as f64)
    };
    let means: Vec<[f64; 3]> = rings.iter().map(mean).collect();
    let radius = |at: usize| {
        let axis = unit(sub(means[(at + 1).min(means.len() - 1)], means[at.saturating_sub(1)]));
        let distance = |&i: &usize| {
            let offset = sub(points[i], means[at]);
            norm(sub(offset, scale(dot(offset, axis), axis)))
        };
        median(rings[at].iter().map(distance).collect())
    };
    let mut radii: Vec<f64> = (0..rings.len()).map(radius).collect();
    radii.sort_unstable_by(f64::total_cmp);
    Ok(radii.get(1).or(radii.first()).copied().unwrap_or(0.0))
}
