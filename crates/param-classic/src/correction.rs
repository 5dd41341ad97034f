//! The shape-preserving correction of a map of a cloud.

use ndarray::ArrayView2;
use rayon::prelude::*;

use crate::ParamError;
use crate::cloud_map::{BoundedCloud, CloudMap, Rows};
use crate::radius_graph::cut_off;
use crate::sides::BoundaryParameters;
use crate::triangulate::PlaneTriangulation;

/// Corrects the parameters `uv`, shape `(m, 2)`, of a cloud `points`, shape `(m, 3)`: their Delaunay triangulation in
/// the plane gives every interior point a ring of neighbours, the points in space give the ring shape-preserving
/// weights, and the linear system is solved once more (Imperatore 2024, §4.2.5).
///
/// It may be repeated, and stands still once the triangulation does. Where the map has folds the triangulation joins
/// points that are no neighbours on the surface; the correction cannot see this.
///
/// Points with equal parameters keep them equal. Points whose neighbours do not close a ring (they came to lie on a
/// side) get reciprocal distances and are counted in the report.
///
/// # Errors
/// Those of [`map_cloud`](crate::map_cloud) on the cloud and its boundary; [`ParamError::WrongShape`],
/// [`ParamError::Triangulation`], parameters not finite.
pub fn correct_shape(
    points: ArrayView2<'_, f64>,
    boundary: &BoundaryParameters,
    uv: ArrayView2<'_, f64>,
) -> Result<CloudMap, ParamError> {
    let span = tracing::info_span!("correct_shape", points = points.nrows());
    let _guard = span.enter();
    let cloud = BoundedCloud::new(points, boundary)?;
    let m = cloud.points.len();
    if uv.dim() != (m, 2) {
        return Err(ParamError::WrongShape { what: "uv", given: uv.dim().into(), required: [m, 2] });
    }
    point_cloud::check_finite(uv)?;
    // The boundary points where the system has them, whatever `uv` says.
    let mut uv = uv.to_owned();
    for (&point, parameters) in boundary.points.iter().zip(boundary.parameters.rows()) {
        uv.row_mut(point as usize).assign(&parameters);
    }
    let triangulation = PlaneTriangulation::new(uv.view())?;
    let row = |i: usize| {
        let first = triangulation.first_at(i);
        if cloud.fixed[i] {
            return (vec![], false);
        } else if first as usize != i {
            return (vec![(first, 1.0)], false);
        }
        let (ring, closed) = triangulation.ring(i);
        match cloud.shape_preserving(i, &ring).filter(|_| closed) {
            Some(row) => (row, false),
            None => (cloud.reciprocal_distances(i, &ring, 1.0), true),
        }
    };
    let rows = Rows::collect((0..m).into_par_iter().map(row).collect());
    let missing = cut_off(&cloud.fixed, &rows.entries, |e| e.0);
    if let Some(&first) = missing.first() {
        let reason = format!("{} points, the first is {first}, have no path to the boundary", missing.len());
        return Err(ParamError::Triangulation { points: m, reason });
    }
    let map = cloud.solve(rows, None, 0)?;
    tracing::debug!(report = ?map.report, "corrected");
    Ok(map)
}
