//! The noise of a scan.

use ndarray::ArrayView2;
use rayon::prelude::*;

use crate::local_frame::median;
use crate::neighbours::rows;
use crate::quadric::{Quadric, principal_axes};
use crate::search::CloudTree;
use crate::vec3::{cross, dot, sub};
use crate::{CloudError, check_finite};

/// Neighbours of the smallest local fits. Limit: a quadric has six coefficients; five residuals are then left to judge by.
const FEWEST_NEIGHBOURS: usize = 10;

/// Factor between the numbers of neighbours of one scale and the next. Derived: neighbourhoods are then wider by its root.
const SCALE_STEP: usize = 2;

/// Scales at most. Limit: the largest neighbourhoods have 1280 points, whose radius is twenty spacings.
const MOST_SCALES: usize = 8;

/// Points whose neighbourhoods are looked at. Derived: the median of as many estimates with five degrees of freedom each has a
/// relative standard error of 1.5 %.
const SAMPLE: usize = 2000;

/// Points among which neighbours are sought; of more a random part is taken. Limit: so that a search tree costs a fraction of a second.
const MOST_POINTS: usize = 200_000;

/// Thickness of a neighbourhood, as a share of its width (standard deviations along its principal axes), up to which it is flat.
/// Calibrated: on planes, waves, cylinders, spheres and strips of 400 to 100,000 points with noise of 0.02 % to 0.5 % of the
/// diagonal: with 0.35 the noise of dense clouds is found 16 % too small, because balls cut off the points farthest from the
/// surface; with 0.3 it is within 10 %, and smaller values need neighbourhoods in which curvature counts.
const FLAT: f64 = 0.3;

/// Quantile of a normal variable at 5 %. Derived.
const LOW_QUANTILE: (f64, f64) = (0.05, -1.644_85);

/// Share of the noise by the median that the noise by the neighbourhoods with the smallest residuals must have for the median to hold.
/// Derived: noise that is alike everywhere gives 1, noise along one axis on slopes up to 60° a half; less means that most neighbourhoods
/// hold an outlier or a detail, which is the case with 20 % of outliers among the points.
const ALIKE: f64 = 0.5;

/// Growth of the squared deviations of a shape from quadrics when the number of neighbours doubles: at most that of third-order terms,
/// which grow with the cube of the width, at least that of creases, which grow with the width. Derived: (2^½)^(2·3) and (2^½)^(2·1).
const GROWTH: (f64, f64) = (2.0, 8.0);

/// Standard deviation, in the units of the points, of the noise of a scan across its surface, shape `(m, 3)`; 0 where none can be told
/// from the shape, and for fewer than 22 points.
///
/// Quadrics are fitted to the nearest neighbours of points, at three scales from the smallest one on at which neighbourhoods are flat.
/// Noise that differs from point to point leaves the same variance `s²` at all scales. What the shape leaves grows with the number k
/// of neighbours: `s²(k) = σ² + b k^q`. Three scales give σ², b and q; q is held between 1, for creases, and 3, for smooth shapes.
/// Medians over the points, so that creases, rims and outliers count for nothing as long as most neighbourhoods are without them; where
/// the 5 % with the smallest residuals tell of less than half the noise, what they tell. The order of the points does not matter.
/// O(m) beside the search tree.
///
/// # Errors
/// [`CloudError::WrongDimension`], [`CloudError::TooFewPoints`] without a point, those of [`check_finite`].
pub fn noise_sigma(points: ArrayView2<'_, f64>) -> Result<f64, CloudError> {
    check_finite(points)?;
    let points = distinct(rows(points)?);
    let tree = CloudTree::new(&points)?;
    let step = points.len().div_ceil(SAMPLE);
    let sample: Vec<usize> = (0..points.len()).step_by(step).collect();
    // A neighbourhood of more than a quarter of the cloud is no longer local.
    let most = (points.len() / 4).max(SCALE_STEP * FEWEST_NEIGHBOURS).min(points.len().saturating_sub(2));
    let mut scales: Vec<Scale> = Vec::new();
    let mut flat = None;
    for k in (0..MOST_SCALES).map(|scale| FEWEST_NEIGHBOURS * SCALE_STEP.pow(scale as u32)).take_while(|k| *k <= most) {
        scales.push(at_scale(&tree, &sample, k));
        if flat.is_none() && scales[scales.len() - 1].thickness <= FLAT {
            flat = Some(scales.len() - 1);
        }
        if flat.is_some_and(|flat| scales.len() == flat + 3) {
            break;
        }
    }
    // Without any that is flat, the flattest one that has two larger ones beside it.
    let last = scales.len().saturating_sub(2).max(1).min(scales.len());
    let flattest = (0..last).min_by(|&a, &b| scales[a].thickness.total_cmp(&scales[b].thickness));
    let (Some(flat), true) = (flat.or(flattest), scales.len() > 1) else { return Ok(0.0) };
    tracing::debug!(?scales, flat, "noise");
    let of = |pick: fn(&Scale) -> f64| without_shape(&scales[flat..].iter().map(pick).collect::<Vec<f64>>()).sqrt();
    let (usual, least) = (of(|scale| scale.median), of(|scale| scale.low));
    Ok(if least < ALIKE * usual { least } else { usual })
}

/// What neighbourhoods of one size tell.
#[derive(Clone, Copy, Debug)]
struct Scale {
    /// Variance of the noise by the median neighbourhood.
    median: f64,
    /// The same by those with small residuals.
    low: f64,
    /// Median of thickness over width.
    thickness: f64,
}

/// The part of the variances at successive scales that does not grow, from the smallest one on.
fn without_shape(variances: &[f64]) -> f64 {
    let [first, second, ..] = *variances else { return variances.first().copied().unwrap_or(0.0) };
    let rise = (second - first).max(0.0);
    // Two scales alone do not tell how the shape's part grows.
    let growth = variances.get(2).map_or(GROWTH.0, |third| ((third - second) / rise).clamp(GROWTH.0, GROWTH.1));
    if rise > 0.0 { (first - rise / (growth - 1.0)).max(0.0) } else { first }
}

/// Residuals of quadrics over `k` neighbours, and the thickness of the neighbourhoods.
fn at_scale(tree: &CloudTree<'_>, sample: &[usize], k: usize) -> Scale {
    let of = |&i: &usize| {
        let own = tree.points[i];
        let near = tree.nearest(i, k);
        let offsets: Vec<[f64; 3]> =
            std::iter::once([0.0; 3]).chain(near.iter().map(|n| sub(tree.points[n.1 as usize], own))).collect();
        let axes = principal_axes(&offsets);
        let [thin, wide, _] = axes.variances;
        let thickness = if wide > 0.0 { (thin / wide).sqrt() } else { 1.0 };
        let [normal, first, _] = axes.directions;
        let frame = [first, cross(normal, first), normal];
        let local: Vec<[f64; 3]> = offsets.iter().map(|o| frame.map(|axis| dot(*o, axis))).collect();
        let quadric = Quadric::fit(&local)?;
        let squares: f64 = local.iter().map(|p| (p[2] - quadric.at(p[0], p[1])).powi(2)).sum();
        Some((squares / (local.len() - 6) as f64, thickness))
    };
    let found: Vec<(f64, f64)> = sample.par_iter().filter_map(of).collect();
    if found.is_empty() {
        return Scale { median: 0.0, low: 0.0, thickness: 1.0 };
    }
    let mut variances: Vec<f64> = found.iter().map(|f| f.0).collect();
    variances.sort_unstable_by(f64::total_cmp);
    // Quantiles of χ² with ν degrees of freedom over ν (Wilson and Hilferty 1931).
    let spread = 2.0 / (9.0 * (k + 1 - 6) as f64);
    let quantile = |share: f64, normal: f64| {
        variances[(share * variances.len() as f64) as usize] / (1.0 - spread + normal * spread.sqrt()).powi(3)
    };
    Scale {
        median: quantile(0.5, 0.0),
        low: quantile(LOW_QUANTILE.0, LOW_QUANTILE.1),
        thickness: median(found.iter().map(|f| f.1).collect()),
    }
}

/// The different points, sorted; of many a part that does not depend on their order.
pub(crate) fn distinct(mut points: Vec<[f64; 3]>) -> Vec<[f64; 3]> {
    some_of(&mut points, MOST_POINTS);
    let order = |a: &[f64; 3], b: &[f64; 3]| {
        a[0].total_cmp(&b[0]).then_with(|| a[1].total_cmp(&b[1])).then_with(|| a[2].total_cmp(&b[2]))
    };
    points.par_sort_unstable_by(order);
    points.dedup();
    points
}

/// Keeps about `most` points of more, chosen by their coordinates as if at random.
pub(crate) fn some_of(points: &mut Vec<[f64; 3]>, most: usize) {
    if points.len() <= most {
        return;
    }
    let limit = (most as f64 / points.len() as f64 * u64::MAX as f64) as u64;
    // The finalizer of MurmurHash3 over the bits of the coordinates.
    let mix = |hash: u64, x: f64| {
        let mut h = hash ^ x.to_bits();
        h = (h ^ (h >> 33)).wrapping_mul(0xff51_afd7_ed55_8ccd);
        h = (h ^ (h >> 33)).wrapping_mul(0xc4ce_b9fe_1a85_ec53);
        h ^ (h >> 33)
    };
    points.retain(|p| p.iter().fold(0x9e37_79b9_7f4a_7c15, |hash, x| mix(hash, *x)) <= limit);
}

#[cfg(test)]
#[path = "noise_tests.rs"]
mod tests;
