//! Normals, curvatures, spacing and noise of a cloud from local fits.

use ndarray::{Array1, Array2, ArrayView2};
use rayon::prelude::*;

use crate::neighbour_lists::{Neighbour, order};
use crate::neighbours::rows;
use crate::orient_normals::orient;
use crate::quadric::{Quadric, principal_axes};
use crate::search::CloudTree;
use crate::vec3::{cross, dot, sub, unit};
use crate::{CloudError, check_surface_cloud};

/// Neighbours whose mean distance is the local spacing: the six of a hexagonal lattice.
pub const SPACING_NEIGHBOURS: usize = 6;

/// Fewest neighbours of a local fit: three times the six coefficients of a quadric.
const FEWEST_NEIGHBOURS: usize = 18;

/// Most neighbours of a local fit. Noise that needs more is several spacings thick; thin such a cloud first.
const MOST_NEIGHBOURS: usize = 320;

/// Neighbours that tell whether a point lies on a line of points. More would reach the points beside a densely sampled rim, fewer
/// line up by chance.
const LINE_NEIGHBOURS: usize = 9;

/// Points lie on a line when their variance across it is below this share of that along it: 0.28 on a straight rim of
/// even density, and below 0.02 by chance for one in some thousand normally distributed neighbourhoods.
const LINE_VARIANCE: f64 = 0.02;

/// Points on which the number of neighbours is chosen.
const SCALE_SAMPLE: usize = 400;

/// Median of the absolute value of a standard normal variable.
pub(crate) const NORMAL_MEDIAN: f64 = 0.6745;

/// What local fits tell about each point of a cloud; lengths in the units of the points.
#[derive(Clone, Debug, PartialEq)]
pub struct LocalFrames {
    /// Unit normals, shape `(m, 3)`, on one side of the surface in each connected part.
    pub normals: Array2<f64>,
    /// Principal curvatures, smaller first, shape `(m, 2)`; positive where the surface bends towards the normal.
    pub curvatures: Array2<f64>,
    /// Mean distance to the [`SPACING_NEIGHBOURS`] nearest points, shape `(m,)`.
    pub spacing: Array1<f64>,
    /// Each point moved along the normal of its fit onto the fit, shape `(m, 3)`.
    pub smoothed: Array2<f64>,
    /// Standard deviation of the noise along the normals, from the median of the residuals.
    pub noise: f64,
    /// Number of neighbours of each fit, but for points on a line.
    pub neighbours: usize,
}

impl LocalFrames {
    /// Fits a quadric over the tangent plane to the neighbours of each of `points`, shape `(m, 3)`.
    ///
    /// The number of neighbours is the one for which the neighbourhoods are flattest (median over a sample): small ones
    /// are thick from noise, large ones from curvature; points on a line of points, as a rim with more points than the inside,
    /// take more. Normals are those of the quadrics, oriented along a minimum spanning tree (Hoppe et al. 1992, §3.3), round
    /// sharp bends too; the sign of each connected part is such that the largest
    /// component of the sum of its normals is positive. O(m k log m).
    ///
    /// # Errors
    /// Those of [`check_surface_cloud`] for 8 points, [`CloudError::WrongDimension`].
    pub fn estimate(points: ArrayView2<'_, f64>) -> Result<Self, CloudError> {
        let rows = rows(points)?;
        // A quadric has six coefficients; two more points leave something to measure the residual by.
        check_surface_cloud(points, 8)?;
        let tree = CloudTree::new(&rows)?;
        let frames = Frames::unoriented(&tree).oriented(&tree);
        let array = |a: &[[f64; 3]]| Array2::from_shape_fn((a.len(), 3), |(i, k)| a[i][k]);
        Ok(Self {
            normals: array(&frames.normals),
            curvatures: Array2::from_shape_fn((rows.len(), 2), |(i, k)| frames.curvatures[i][k]),
            spacing: Array1::from_vec(frames.spacing),
            smoothed: array(&frames.smoothed),
            noise: frames.noise,
            neighbours: frames.neighbours,
        })
    }
}

/// [`LocalFrames`] as plain arrays.
pub(crate) struct Frames {
    pub(crate) normals: Vec<[f64; 3]>,
    pub(crate) curvatures: Vec<[f64; 2]>,
    pub(crate) spacing: Vec<f64>,
    pub(crate) smoothed: Vec<[f64; 3]>,
    /// Whether the nearest neighbours lie on a line, so that their distances tell nothing of the surface beside it.
    pub(crate) on_line: Vec<bool>,
    pub(crate) noise: f64,
    pub(crate) neighbours: usize,
}

impl Frames {
    /// Frames whose normals lie on either side.
    pub(crate) fn unoriented(tree: &CloudTree<'_>) -> Self {
        let points = tree.points;
        let k = flattest_neighbourhood(tree);
        let fits: Vec<(Fit, f64, bool)> = tree.map_nearest(k, |i, near| {
            let line = near.len().min(LINE_NEIGHBOURS);
            near.select_nth_unstable_by(line - 1, order);
            near[..line].sort_unstable_by(order);
            let nearest = &near[..line.min(SPACING_NEIGHBOURS)];
            let spacing = nearest.iter().map(|n| n.0).sum::<f64>() / nearest.len().max(1) as f64;
            match on_line(points, i, &near[..line]) {
                false => (Fit::at(points, i, near), spacing, false),
                true => (Fit::at(points, i, &beside_line(tree, i, k)), spacing, true),
            }
        });
        tracing::debug!(neighbours = k, "fitted quadrics");
        Self {
            normals: fits.iter().map(|f| f.0.normal).collect(),
            curvatures: fits.iter().map(|f| f.0.curvatures).collect(),
            on_line: fits.iter().map(|f| f.2).collect(),
            spacing: fits.iter().map(|f| f.1).collect(),
            smoothed: fits.iter().map(|f| f.0.foot).collect(),
            noise: median(fits.iter().map(|f| f.0.residual.abs()).collect()) / NORMAL_MEDIAN,
            neighbours: k,
        }
    }

    /// Turns the normals to one side.
    pub(crate) fn oriented(mut self, tree: &CloudTree<'_>) -> Self {
        let flipped = orient(tree, &mut self.normals);
        for (curvatures, _) in self.curvatures.iter_mut().zip(flipped).filter(|(_, flip)| *flip) {
            *curvatures = [-curvatures[1], -curvatures[0]];
        }
        self
    }
}

/// The local fit at one point.
struct Fit {
    normal: [f64; 3],
    curvatures: [f64; 2],
    foot: [f64; 3],
    residual: f64,
}

impl Fit {
    fn at(points: &[[f64; 3]], i: usize, near: &[Neighbour]) -> Self {
        let own = points[i];
        let offsets: Vec<[f64; 3]> =
            std::iter::once([0.0; 3]).chain(near.iter().map(|n| sub(points[n.1 as usize], own))).collect();
        let axes = principal_axes(&offsets);
        let [normal, first, _] = axes.directions;
        let second = cross(normal, first);
        let plane = dot(axes.centre, normal);
        let flat = Self {
            normal,
            curvatures: [0.0; 2],
            foot: std::array::from_fn(|c| own[c] + plane * normal[c]),
            residual: plane,
        };
        let local: Vec<[f64; 3]> = offsets.iter().map(|o| [first, second, normal].map(|axis| dot(*o, axis))).collect();
        let Some(quadric) = Quadric::fit(&local) else { return flat };
        let [gx, gy] = quadric.gradient();
        // A fit steeper than 60° against the plane of its points overshoots; the plane is the better normal.
        if gx.hypot(gy) > 3f64.sqrt() {
            return flat;
        }
        let height = quadric.height();
        Self {
            normal: unit(std::array::from_fn(|c| normal[c] - gx * first[c] - gy * second[c])),
            curvatures: quadric.principal_curvatures(),
            foot: std::array::from_fn(|c| own[c] + height * normal[c]),
            residual: height / (1.0 - quadric.leverage).max(f64::EPSILON).sqrt(),
        }
    }
}

/// Whether neighbours of point `i` lie on a line.
fn on_line(points: &[[f64; 3]], i: usize, near: &[Neighbour]) -> bool {
    let offsets: Vec<_> = near.iter().map(|n| sub(points[n.1 as usize], points[i])).collect();
    let [_, across, along] = principal_axes(&offsets).variances;
    across < LINE_VARIANCE * along
}

/// Neighbours of a point on a line, which determine no plane until they spread to both sides: twice as many as `k`, and so on.
fn beside_line(tree: &CloudTree<'_>, i: usize, k: usize) -> Vec<Neighbour> {
    let mut count = k;
    loop {
        count *= 2;
        let near = tree.nearest(i, count);
        if count >= MOST_NEIGHBOURS || !on_line(tree.points, i, &near) {
            return near;
        }
    }
}

/// The number of neighbours with the smallest median ratio of thickness to width.
fn flattest_neighbourhood(tree: &CloudTree<'_>) -> usize {
    let points = tree.points;
    let m = points.len();
    let stride = m.div_ceil(SCALE_SAMPLE);
    let sample: Vec<usize> = (0..m).step_by(stride).collect();
    // A neighbourhood of more than an eighth of the cloud is no longer local.
    let most = MOST_NEIGHBOURS.min(m / 8);
    let most = most.max(FEWEST_NEIGHBOURS);
    let offsets: Vec<Vec<[f64; 3]>> = sample
        .par_iter()
        .map(|&i| tree.nearest(i, most).into_iter().map(|n| sub(points[n.1 as usize], points[i])).collect())
        .collect();
    let mut best = (f64::INFINITY, FEWEST_NEIGHBOURS);
    let mut k = FEWEST_NEIGHBOURS;
    while k <= most {
        let thickness = |offsets: &Vec<[f64; 3]>| {
            let [thin, wide, _] = principal_axes(&offsets[..k.min(offsets.len())]).variances;
            if wide > 0.0 { (thin / wide).sqrt() } else { 1.0 }
        };
        let thickness = median(offsets.par_iter().map(thickness).collect());
        if thickness < best.0 {
            best = (thickness, k);
        }
        k = k * 4 / 3;
    }
    best.1
}

/// The median; zero without a value.
pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
#[path = "local_frame_tests.rs"]
mod tests;
