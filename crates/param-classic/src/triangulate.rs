//! Delaunay triangulation of the parameter plane.

use ndarray::ArrayView2;
use spade::{DelaunayTriangulation, Point2, Triangulation};

use crate::ParamError;

/// A Delaunay triangulation of the parameters `uv`, shape `(m, 2)`, counter-clockwise: with the points in space a mesh
/// of the cloud, as good as the map. Of points with equal parameters only the first is used.
///
/// # Errors
/// [`ParamError::WrongShape`], [`ParamError::Triangulation`], parameters not finite.
pub fn triangulate_parameters(uv: ArrayView2<'_, f64>) -> Result<Vec<[u32; 3]>, ParamError> {
    let (m, columns) = uv.dim();
    if columns != 2 {
        return Err(ParamError::WrongShape { what: "uv", given: [m, columns], required: [m, 2] });
    }
    point_cloud::check_finite(uv)?;
    Ok(PlaneTriangulation::new(uv)?.triangles())
}

/// Coordinates below this count as zero; the triangulation would refuse them.
const SMALLEST_COORDINATE: f64 = 1e-40;

/// A Delaunay triangulation of points that may repeat.
pub(crate) struct PlaneTriangulation {
    triangulation: DelaunayTriangulation<Point2<f64>>,
    /// Of each point its vertex.
    vertex_of: Vec<u32>,
    /// Of each vertex the first of its points.
    point_of: Vec<u32>,
}

impl PlaneTriangulation {
    /// Triangulates finite `uv`, shape `(m, 2)`.
    pub(crate) fn new(uv: ArrayView2<'_, f64>) -> Result<Self, ParamError> {
        // Adding 0 turns -0 into 0.
        let snap = |x: f64| if x.abs() < SMALLEST_COORDINATE { 0.0 } else { x + 0.0 };
        let places: Vec<[f64; 2]> = uv.rows().into_iter().map(|p| [snap(p[0]), snap(p[1])]).collect();
        let mut order: Vec<u32> = (0..places.len() as u32).collect();
        let key = |i: u32| places[i as usize];
        order.sort_unstable_by(|&i, &j| {
            let (a, b) = (key(i), key(j));
            a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])).then(i.cmp(&j))
        });
        // The triangulation drops repeated points without a word, which would shift the indices of those after them.
        let mut first = vec![0u32; places.len()];
        for equal in order.chunk_by(|&i, &j| key(i) == key(j)) {
            equal.iter().for_each(|&i| first[i as usize] = equal[0]);
        }
        let point_of: Vec<u32> = (0..places.len() as u32).filter(|&i| first[i as usize] == i).collect();
        let mut vertex_of = vec![0u32; places.len()];
        for (vertex, &point) in point_of.iter().enumerate() {
            vertex_of[point as usize] = vertex as u32;
        }
        for i in 0..places.len() {
            vertex_of[i] = vertex_of[first[i] as usize];
        }
        let vertices = point_of.iter().map(|&i| Point2::new(key(i)[0], key(i)[1])).collect();
        let triangulation = DelaunayTriangulation::bulk_load_stable(vertices)
            .map_err(|e| ParamError::Triangulation { points: places.len(), reason: e.to_string() })?;
        Ok(Self { triangulation, vertex_of, point_of })
    }

    /// The first point that lies where point `i` does.
    pub(crate) fn first_at(&self, i: usize) -> u32 {
        self.point_of[self.vertex_of[i] as usize]
    }

    /// The neighbours of point `i` in cyclic order, and whether they close a ring round it.
    pub(crate) fn ring(&self, i: usize) -> (Vec<u32>, bool) {
        let handle = spade::handles::FixedVertexHandle::from_index(self.vertex_of[i] as usize);
        let vertex = self.triangulation.vertex(handle);
        let closed = vertex.out_edges().all(|e| !e.is_outer_edge() && !e.rev().is_outer_edge());
        (vertex.out_edges().map(|e| self.point_of[e.to().index()]).collect(), closed)
    }

    /// The triangles, counter-clockwise, as points.
    pub(crate) fn triangles(&self) -> Vec<[u32; 3]> {
        self.triangulation.inner_faces().map(|face| face.vertices().map(|v| self.point_of[v.index()])).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    #[test]
    fn repeated_and_tiny_points_keep_their_places() {
        let uv = array![[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [0.5, 0.5], [1.0, 1.0], [-0.0, 1e-50], [1e-60, 1.0]];
        let triangulation = PlaneTriangulation::new(uv.view()).unwrap();
        assert_eq!((0..7).map(|i| triangulation.first_at(i)).collect::<Vec<_>>(), [0, 1, 1, 3, 4, 0, 6]);
        let (mut ring, closed) = triangulation.ring(3);
        ring.sort_unstable();
        assert_eq!((ring, closed), (vec![0, 1, 4, 6], true));
        assert!(!triangulation.ring(2).1);
        assert_eq!(triangulation.triangles().len(), 4);
    }
}
