//! From the map of a mesh to parameters of all points near it.

use ndarray::{Array2, ArrayView2};
use point_cloud::vec3::sub;
use point_cloud::{CloudError, check_finite};
use rayon::prelude::*;

use crate::ParamError;
use point_cloud::{Foot, TriangleTree, barycentric_in_plane};

/// Parameters of points near a mapped mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct ExtendedMap {
    /// Parameters (u, v), shape `(m, 2)`; those of points beyond the outer loop may lie outside of the unit square.
    pub parameters: Array2<f64>,
    /// Distance of each point from the mesh, shape `(m,)`, in the units of the points.
    pub distances: Vec<f64>,
    /// Points beyond a boundary of the mesh.
    pub beyond: usize,
}

/// How far beyond its triangle a parameter is extrapolated, in barycentric coordinates: by the height of the triangle. A
/// point farther away has little to do with the slope of the map there.
const MOST_EXTRAPOLATION: f64 = 1.0;

/// Carries the map of a mesh, `vertices` of shape `(n, 3)` with parameters `uv` of shape `(n, 2)` in the unit square, to
/// `points` of shape `(m, 3)`: each gets the parameters of the nearest point of the mesh, by linear interpolation.
///
/// Beyond a boundary of the mesh the map of the nearest triangle is extrapolated to the foot of the point in its plane, at
/// most by the height of the triangle: beside a hole that continues the map, outside the outer loop it leaves the unit
/// square, so that no two points fall together there.
///
/// The vertices themselves get their own parameters but for round-off. Exact search in O((n + m) log n), in parallel: a
/// million points take about a second; the result does not depend on the number of threads.
///
/// # Errors
/// [`ParamError::WrongShape`]; [`CloudError::NoTriangles`], [`CloudError::VertexOutOfRange`], coordinates or parameters not
/// finite.
pub fn extend_map(
    vertices: ArrayView2<'_, f64>,
    triangles: &[[u32; 3]],
    uv: ArrayView2<'_, f64>,
    points: ArrayView2<'_, f64>,
) -> Result<ExtendedMap, ParamError> {
    let span = tracing::info_span!("extend_map", triangles = triangles.len(), points = points.nrows());
    let _guard = span.enter();
    let (n, m) = (vertices.nrows(), points.nrows());
    for (what, array, required) in [("vertices", vertices, [n, 3]), ("uv", uv, [n, 2]), ("points", points, [m, 3])] {
        if <[usize; 2]>::from(array.dim()) != required {
            return Err(ParamError::WrongShape { what, given: array.dim().into(), required });
        }
        check_finite(array)?;
    }
    if triangles.is_empty() {
        return Err(CloudError::NoTriangles.into());
    }
    if let Some((triangle, &vertex)) =
        triangles.iter().enumerate().find_map(|(t, c)| c.iter().find(|&&v| v as usize >= n).map(|v| (t, v)))
    {
        return Err(CloudError::VertexOutOfRange { triangle, vertex, count: n }.into());
    }
    // Relative to a vertex and in units of the mesh, so that no square under- or overflows.
    let origin: [f64; 3] = std::array::from_fn(|k| vertices[[0, k]]);
    let unit =
        vertices.rows().into_iter().chain(points.rows()).flat_map(|p| (0..3).map(move |k| (p[k] - origin[k]).abs()));
    let unit = unit.fold(0.0, f64::max);
    let unit = if unit > 0.0 { unit } else { 1.0 };
    let row = |array: &ArrayView2<'_, f64>, i: usize| -> [f64; 3] {
        sub(std::array::from_fn(|k| array[[i, k]]), origin).map(|x| x / unit)
    };
    let corners: Vec<[[f64; 3]; 3]> = triangles.iter().map(|t| t.map(|v| row(&vertices, v as usize))).collect();
    let tree = TriangleTree::new(&corners);
    let rim = boundary_sides(triangles);
    let place = |i: usize| {
        let point = row(&points, i);
        let foot = tree.nearest(point);
        let beyond = is_on_rim(&foot, rim[foot.triangle as usize]);
        let weights =
            if beyond { extrapolated(&foot, point, corners[foot.triangle as usize]) } else { foot.barycentric };
        let corner = triangles[foot.triangle as usize];
        let at = |k: usize| (0..3).map(|c| weights[c] * uv[[corner[c] as usize, k]]).sum::<f64>();
        ([at(0), at(1)], unit * foot.squared_distance.sqrt(), beyond && foot.squared_distance > 0.0)
    };
    let placed: Vec<([f64; 2], f64, bool)> = (0..m).into_par_iter().map(place).collect();
    let map = ExtendedMap {
        parameters: Array2::from_shape_fn((m, 2), |(i, k)| placed[i].0[k]),
        distances: placed.iter().map(|p| p.1).collect(),
        beyond: placed.iter().filter(|p| p.2).count(),
    };
    tracing::debug!(beyond = map.beyond, "extended");
    Ok(map)
}

/// For each triangle which of its sides, opposite to each corner, no other triangle shares.
fn boundary_sides(triangles: &[[u32; 3]]) -> Vec<[bool; 3]> {
    let mut sides: Vec<([u32; 2], u32, u8)> = Vec::with_capacity(3 * triangles.len());
    for (t, corners) in (0u32..).zip(triangles) {
        for k in 0..3 {
            let (a, b) = (corners[(k + 1) % 3], corners[(k + 2) % 3]);
            sides.push(([a.min(b), a.max(b)], t, k as u8));
        }
    }
    sides.par_sort_unstable();
    let mut rim = vec![[false; 3]; triangles.len()];
    for alone in sides.chunk_by(|a, b| a.0 == b.0).filter(|edge| edge.len() == 1) {
        rim[alone[0].1 as usize][alone[0].2 as usize] = true;
    }
    rim
}

/// Whether the foot lies on a side of its triangle that is a boundary.
fn is_on_rim(foot: &Foot, rim: [bool; 3]) -> bool {
    (0..3).any(|k| rim[k] && foot.barycentric[k] == 0.0)
}

/// The foot moved towards the place of `point` in the plane of the triangle.
fn extrapolated(foot: &Foot, point: [f64; 3], corners: [[f64; 3]; 3]) -> [f64; 3] {
    let Some(target) = barycentric_in_plane(point, corners) else { return foot.barycentric };
    let farthest = (0..3).map(|k| (target[k] - foot.barycentric[k]).abs()).fold(0.0, f64::max);
    let share = if farthest > MOST_EXTRAPOLATION { MOST_EXTRAPOLATION / farthest } else { 1.0 };
    std::array::from_fn(|k| foot.barycentric[k] + share * (target[k] - foot.barycentric[k]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array2, array};

    /// A square of `n` by `n` cells in a tilted plane, mapped linearly, without its middle cell.
    fn plate(n: usize) -> (Array2<f64>, Vec<[u32; 3]>, Array2<f64>) {
        let at = |i: usize, j: usize| (i * (n + 1) + j) as u32;
        let cells = (0..n * n).map(|c| (c / n, c % n)).filter(|&c| c != (n / 2, n / 2));
        let triangles = cells
            .flat_map(|(i, j)| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]])
            .collect();
        let count = (n + 1) * (n + 1);
        let uv = Array2::from_shape_fn((count, 2), |(i, k)| [i / (n + 1), i % (n + 1)][k] as f64 / n as f64);
        (in_space(&uv), triangles, uv)
    }

    fn in_space(uv: &Array2<f64>) -> Array2<f64> {
        Array2::from_shape_fn((uv.nrows(), 3), |(i, k)| {
            let (u, v) = (uv[[i, 0]], uv[[i, 1]]);
            [2.0 * u - v, u + 2.0 * v, 5.0 + 0.3 * u][k]
        })
    }

    #[test]
    fn a_linear_map_is_continued_inside_and_into_a_hole() {
        let (vertices, triangles, uv) = plate(5);
        let exact = Array2::from_shape_fn((400, 2), |(i, k)| [i / 20, i % 20][k] as f64 / 20.0 + 0.025);
        for scale in [1e-80, 1.0, 1e80] {
            let points = in_space(&exact) * scale;
            let map = extend_map((&vertices * scale).view(), &triangles, uv.view(), points.view()).unwrap();
            assert!((&map.parameters - &exact).iter().all(|d| d.abs() < 1e-12));
            // 4 x 4 of the 20 x 20 points lie in the hole.
            assert_eq!(map.beyond, 16);
            assert_eq!(map.distances.iter().filter(|d| **d > 1e-3 * scale).count(), 16);
        }
    }

    #[test]
    fn the_map_goes_on_outside_and_points_above_get_their_foot() {
        let (vertices, triangles, uv) = plate(4);
        let outside = array![[-0.1, 0.3], [1.05, 0.7], [0.4, 1.2], [-0.02, -0.03], [5.0, 0.25]];
        let map = extend_map(vertices.view(), &triangles, uv.view(), in_space(&outside).view()).unwrap();
        assert!((&map.parameters - &outside).rows().into_iter().take(4).flatten().all(|d| d.abs() < 1e-12));
        // Far outside it goes on by one cell at most.
        assert!(map.beyond == 5 && (1.0..=1.25 + 1e-12).contains(&map.parameters[[4, 0]]));
        let place = array![[0.3, 0.1]];
        let (e, f) = ([2.0, 1.0, 0.3], [-1.0, 2.0, 0.0]);
        let normal = point_cloud::vec3::cross(e, f);
        let above = Array2::from_shape_fn((1, 3), |(_, k)| in_space(&place)[[0, k]] + 0.01 * normal[k]);
        let map = extend_map(vertices.view(), &triangles, uv.view(), above.view()).unwrap();
        assert!((&map.parameters - &place).iter().all(|d| d.abs() < 1e-12) && map.beyond == 0);
        assert!((map.distances[0] - 0.01 * point_cloud::vec3::norm(normal)).abs() < 1e-14);
    }

    #[test]
    fn wrong_input_is_named() {
        let (vertices, triangles, uv) = plate(3);
        let run = |triangles: &[[u32; 3]], points: Array2<f64>| {
            extend_map(vertices.view(), triangles, uv.view(), points.view()).map(|_| ())
        };
        assert_eq!(run(&[], Array2::zeros((1, 3))), Err(CloudError::NoTriangles.into()));
        let error = Err(CloudError::VertexOutOfRange { triangle: 0, vertex: 99, count: 16 }.into());
        assert_eq!(run(&[[0, 1, 99]], Array2::zeros((1, 3))), error);
        assert!(matches!(run(&triangles, Array2::zeros((1, 2))), Err(ParamError::WrongShape { what: "points", .. })));
        assert!(run(&triangles, Array2::from_elem((1, 3), f64::NAN)).is_err());
        assert!(run(&triangles, Array2::zeros((0, 3))).is_ok());
    }
}
