//! Points that occur more than once.

use ndarray::{Array2, ArrayView2, Axis};

use crate::{PointCloud, TriangleMesh};

/// Which points of a cloud are equal, coordinate by coordinate (`-0.0` equals `0.0`; no tolerance).
///
/// Built by sorting, in O(m log m), with the same result whatever the machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Duplicates {
    /// Rows of the points that stay: the first of each group of equal points, in increasing order.
    pub kept: Vec<usize>,
    /// For each point its row among the kept ones, shape `(m,)`.
    pub map: Vec<usize>,
}

impl Duplicates {
    /// Finds the equal points of `points`, shape `(m, N)`.
    pub fn find(points: ArrayView2<'_, f64>) -> Self {
        // Adding zero turns -0.0 into 0.0, which the total order tells apart.
        let key = |i: usize| points.row(i).into_iter().map(|x| x + 0.0);
        let compare = |a: usize, b: usize| {
            key(a).zip(key(b)).map(|(x, y)| x.total_cmp(&y)).find(|o| o.is_ne()).unwrap_or(std::cmp::Ordering::Equal)
        };
        let m = points.nrows();
        let mut order: Vec<usize> = (0..m).collect();
        // Ties by index, so the first of each group leads it.
        order.sort_unstable_by(|&a, &b| compare(a, b).then(a.cmp(&b)));
        let mut first_of: Vec<usize> = (0..m).collect();
        for group in order.chunk_by(|&a, &b| compare(a, b).is_eq()) {
            for &i in group {
                first_of[i] = group[0];
            }
        }
        Self::from_first(&first_of)
    }

    /// Number of points that a merge removes.
    pub fn count(&self) -> usize {
        self.map.len() - self.kept.len()
    }
}

/// The cloud with the first of each group of equal points, and the groups.
///
/// Parameters follow their points. A cloud that loses a point is no longer a full grid, so its grid order is dropped.
pub fn merge_duplicate_points(cloud: &PointCloud) -> (PointCloud, Duplicates) {
    let duplicates = Duplicates::find(cloud.points.view());
    let select = |a: &Array2<f64>| a.select(Axis(0), &duplicates.kept);
    let merged = PointCloud {
        points: select(&cloud.points),
        parameters: cloud.parameters.as_ref().map(select),
        grid: cloud.grid.filter(|_| duplicates.count() == 0),
    };
    (merged, duplicates)
}

/// The mesh with the first of each group of equal vertices, the groups, and the number of triangles that this dropped
/// because two of their vertices became one.
///
/// Vertex indices beyond the last vertex are left as they are, to be reported by the topology check.
pub fn merge_duplicate_vertices(mesh: &TriangleMesh) -> (TriangleMesh, Duplicates, usize) {
    let duplicates = Duplicates::find(mesh.vertices.view());
    let renamed = |v: u32| duplicates.map.get(v as usize).map_or(v, |&new| new as u32);
    let triangles: Vec<[u32; 3]> =
        mesh.triangles.iter().map(|t| t.map(renamed)).filter(|[a, b, c]| a != b && b != c && c != a).collect();
    let dropped = mesh.triangles.len() - triangles.len();
    let vertices = mesh.vertices.select(Axis(0), &duplicates.kept);
    (TriangleMesh { vertices, triangles }, duplicates, dropped)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;
    use proptest::prelude::*;

    #[test]
    fn merging_a_mesh_welds_triangles_and_drops_the_collapsed() {
        // A square as two triangles with their own vertices, and a triangle that collapses.
        let mesh = TriangleMesh {
            vertices: array![[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [-0.0, 0., 0.], [1., 1., 0.], [0., 1., 0.]],
            triangles: vec![[0, 1, 2], [3, 4, 5], [0, 3, 1]],
        };
        let (merged, duplicates, dropped) = merge_duplicate_vertices(&mesh);
        assert_eq!((duplicates.count(), dropped), (2, 1));
        assert_eq!(duplicates.kept, [0, 1, 2, 5]);
        assert_eq!(merged.triangles, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(merged.vertices.row(3), array![0., 1., 0.]);
    }

    proptest! {
        #[test]
        fn the_map_leads_each_point_to_the_first_equal_one(values in prop::collection::vec(0u8..3, 0..60)) {
            let m = values.len() / 2;
            let points = Array2::from_shape_fn((m, 2), |(i, k)| f64::from(values[2 * i + k]));
            let found = Duplicates::find(points.view());
            for i in 0..m {
                let first = (0..m).find(|&j| points.row(j) == points.row(i)).unwrap();
                prop_assert_eq!(found.kept[found.map[i]], first);
            }
            prop_assert!(found.kept.is_sorted());
            prop_assert_eq!(found.kept.len() + found.count(), m);
        }
    }
}
