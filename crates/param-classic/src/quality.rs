//! How much a map from a triangle mesh to the plane distorts.

use ndarray::ArrayView2;
use robust::{Coord, orient2d};

use crate::ParamError;
use point_cloud::vec3::{cross, dot, norm, sub};

/// Smallest, largest and mean value over the triangles, the mean weighted by area on the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distortion {
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
    /// Mean value, weighted by area on the surface.
    pub mean: f64,
}

/// Quality of a piecewise linear map from a mesh to the plane.
#[derive(Clone, Debug, PartialEq)]
pub struct MapQuality {
    /// Number of triangles.
    pub triangles: usize,
    /// Triangles whose image is clockwise, by an exact predicate (Shewchuk 1997), increasing.
    pub folded: Vec<u32>,
    /// Triangles whose image has no area, by the same predicate.
    pub collapsed: usize,
    /// Triangles without area on the surface; like the collapsed ones they have no distortion.
    pub degenerate: usize,
    /// Ratio σ₁/σ₂ ≥ 1 of the singular values of the map on each triangle; 1 where angles are kept. `None` if no
    /// triangle has area on both sides.
    pub angle: Option<Distortion>,
    /// `max(r, 1/r)` ≥ 1 with the ratio `r` of a triangle's share of the whole area in the plane to its share on
    /// the surface; 1 where areas are kept.
    pub area: Option<Distortion>,
}

/// Number of folded triangles that an error names.
const FOLDED_NAMED: usize = 5;

impl MapQuality {
    /// An error if a triangle is folded.
    pub(crate) fn check_folds(&self) -> Result<(), ParamError> {
        if self.folded.is_empty() {
            return Ok(());
        }
        Err(ParamError::FoldedTriangles {
            count: self.folded.len(),
            triangles: self.triangles,
            first: self.folded.iter().take(FOLDED_NAMED).copied().collect(),
        })
    }
}

/// Measures the map that takes `vertices`, shape `(m, 3)`, to `uv`, shape `(m, 2)`.
///
/// # Errors
/// [`ParamError::WrongShape`]; [`point_cloud::CloudError::VertexOutOfRange`].
pub fn map_quality(
    vertices: ArrayView2<'_, f64>,
    triangles: &[[u32; 3]],
    uv: ArrayView2<'_, f64>,
) -> Result<MapQuality, ParamError> {
    let m = vertices.nrows();
    for (what, given, required) in [("vertices", vertices.dim(), [m, 3]), ("uv", uv.dim(), [m, 2])] {
        if <[usize; 2]>::from(given) != required {
            return Err(ParamError::WrongShape { what, given: given.into(), required });
        }
    }
    let mut quality =
        MapQuality { triangles: triangles.len(), folded: vec![], collapsed: 0, degenerate: 0, angle: None, area: None };
    // Of each measurable triangle: areas in space and in the plane, angle distortion.
    let mut measured: Vec<[f64; 3]> = Vec::with_capacity(triangles.len());
    for (index, triangle) in triangles.iter().enumerate() {
        if let Some(&vertex) = triangle.iter().find(|&&v| v as usize >= m) {
            return Err(point_cloud::CloudError::VertexOutOfRange { triangle: index, vertex, count: m }.into());
        }
        let [p, q, r] = triangle.map(|v| std::array::from_fn(|k| vertices[[v as usize, k]]));
        let [a, b, c] = triangle.map(|v| Coord { x: uv[[v as usize, 0]], y: uv[[v as usize, 1]] });
        let turn = orient2d(a, b, c);
        if turn < 0.0 {
            quality.folded.push(index as u32);
        } else if turn == 0.0 {
            quality.collapsed += 1;
        }
        let (e, f) = (sub(q, p), sub(r, p));
        let (d, g) = ([b.x - a.x, b.y - a.y, 0.0], [c.x - a.x, c.y - a.y, 0.0]);
        let area = norm(cross(e, f));
        if area == 0.0 {
            quality.degenerate += 1;
        } else if turn != 0.0 {
            // (σ₁² + σ₂²) / (2 σ₁σ₂) without inverting a matrix.
            let trace = dot(e, e) * dot(g, g) + dot(f, f) * dot(d, d) - 2.0 * dot(e, f) * dot(d, g);
            let half_sum = (trace / (2.0 * area * turn.abs())).max(1.0);
            measured.push([area, turn.abs(), half_sum + (half_sum * half_sum - 1.0).sqrt()]);
        }
    }
    let [area_in_space, area_in_plane] = [0, 1].map(|k| measured.iter().map(|t| t[k]).sum::<f64>());
    let summary = |value: &dyn Fn(&[f64; 3]) -> f64| {
        (!measured.is_empty()).then(|| Distortion {
            min: measured.iter().map(value).fold(f64::INFINITY, f64::min),
            max: measured.iter().map(value).fold(0.0, f64::max),
            mean: measured.iter().map(|t| t[0] / area_in_space * value(t)).sum(),
        })
    };
    quality.angle = summary(&|t| t[2]);
    quality.area = summary(&|t| {
        let ratio = (t[1] / area_in_plane) / (t[0] / area_in_space);
        ratio.max(ratio.recip())
    });
    Ok(quality)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array2, array};

    #[test]
    fn a_linear_stretch_has_its_ratio_as_angle_distortion_and_keeps_area_shares() {
        let uv = array![[0.0, 0.0], [1.0, 0.1], [0.9, 1.0], [0.1, 0.7]];
        let stretched = Array2::from_shape_fn((4, 3), |(i, k)| [3.0 * uv[[i, 0]], 2.0, 0.5 * uv[[i, 1]]][k]);
        let quality = map_quality(stretched.view(), &[[0, 1, 2], [0, 2, 3]], uv.view()).unwrap();
        let (angle, area) = (quality.angle.unwrap(), quality.area.unwrap());
        assert!([angle.min, angle.max, angle.mean].iter().all(|a| (a - 6.0).abs() < 1e-12), "{angle:?}");
        assert!([area.min, area.max, area.mean].iter().all(|a| (a - 1.0).abs() < 1e-12), "{area:?}");
        assert_eq!((quality.folded, quality.collapsed), (vec![], 0));
    }

    #[test]
    fn folded_collapsed_and_degenerate_triangles_are_counted_apart() {
        let uv = array![[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 0.5]];
        let vertices = array![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
        let quality = map_quality(vertices.view(), &[[0, 1, 2], [0, 2, 1], [1, 3, 2]], uv.view()).unwrap();
        assert_eq!((quality.folded, quality.collapsed, quality.degenerate), (vec![1], 1, 0));
        let line = map_quality(uv.dot(&array![[1.0, 1.0, 0.0], [1.0, 1.0, 0.0]]).view(), &[[0, 1, 2]], uv.view());
        let line = line.unwrap();
        assert_eq!((line.degenerate, line.angle), (1, None));
    }
}
