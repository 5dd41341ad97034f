//! Clouds of a handful of points, too few to tell a rim or a density by.

use ndarray::Array2;
use param_classic::{map_mesh, triangulate_parameters};
use point_cloud::vec3::{dot, sub};
use point_cloud::{DiskMesh, SubMesh, TriangleMesh, drop_unreferenced, principal_axes};

use super::layout::{Cloud, Layout, map_params};
use crate::options::ParameterChoice;
use crate::{Error, ParameterOptions};

/// Clouds of fewer points are laid out by the plane they are nearest to.
///
/// Limit: a mesh cannot be spanned over fewer: see [`point_cloud::find_boundary`].
pub(super) const FEW: usize = 16;

/// Triangles along the outline lower than this share of their longest side are left out: points along a straight side.
///
/// Limit: round-off of coordinates with an offset of 10⁶ extents is far below, and so low a triangle has no shape.
const LEAST_HEIGHT: f64 = 1e-4;

/// Lays out a few points: triangulated in their plane, mapped as a mesh.
pub(super) fn lay_out(cloud: &Cloud, options: &ParameterOptions) -> Result<Layout, Error> {
    let points: Vec<[f64; 3]> = cloud.points.rows().into_iter().map(|p| [p[0], p[1], p[2]]).collect();
    let axes = principal_axes(&points);
    let [_, second, first] = axes.directions;
    let length = axes.variances[2].sqrt();
    let in_plane = Array2::from_shape_fn((points.len(), 2), |(i, d)| {
        dot(sub(points[i], axes.centre), if d == 0 { first } else { second }) / length
    });
    let mut triangles = triangulate_parameters(in_plane.view())?;
    trim_outline(&in_plane, &mut triangles);
    let SubMesh { mesh, kept } = drop_unreferenced(&TriangleMesh { vertices: cloud.points.clone(), triangles })?;
    let disk = DiskMesh::new(mesh)?;
    let place = |&corner: &u32| kept.binary_search(&(corner as usize)).ok().map(|at| at as u32);
    let outline = &disk.outer_loop().vertices;
    let corners = match (&cloud.corners, &outline[..]) {
        (Some(given), _) => {
            let mut places = [0; 4];
            for (at, corner) in places.iter_mut().zip(given) {
                *at = place(corner).ok_or(Error::CornerInside { row: *corner })?;
            }
            Some(places)
        }
        // Of four points each is a corner.
        (None, &[a, b, c, d]) => Some([a, b, c, d]),
        (None, _) => None,
    };
    let boundary = outline.clone();
    let map = map_mesh(disk, &map_params(ParameterChoice::MeanValue, corners, options))?;
    let mut layout = Layout {
        points: cloud.points.select(ndarray::Axis(0), &kept),
        rows: kept.iter().map(|&row| row as u32).collect(),
        boundary,
        method: "plane, mean-value",
        ..Layout::default()
    };
    layout.take(map);
    Ok(layout)
}

/// Takes low triangles off the outline, as long as there are any.
fn trim_outline(places: &Array2<f64>, triangles: &mut Vec<[u32; 3]>) {
    let at = |v: u32| [places[[v as usize, 0]], places[[v as usize, 1]]];
    let is_low = |t: &[u32; 3]| {
        let [a, b, c] = t.map(at);
        let doubled = ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs();
        let longest =
            [[a, b], [b, c], [c, a]].map(|[p, q]| (p[0] - q[0]).hypot(p[1] - q[1])).into_iter().fold(0.0, f64::max);
        doubled <= LEAST_HEIGHT * longest * longest
    };
    loop {
        let is_inner = |t: &[u32; 3], k: usize| {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            triangles.iter().filter(|o| o.contains(&a) && o.contains(&b)).count() > 1
        };
        let low = triangles.iter().position(|t| is_low(t) && (0..3).any(|k| !is_inner(t, k)));
        match low {
            Some(low) if triangles.len() > 1 => triangles.remove(low),
            _ => return,
        };
    }
}
