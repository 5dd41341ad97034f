//! Tests of disk meshes.

use super::*;
use ndarray::Array2;
use proptest::prelude::*;

/// A mesh with vertices on a parabola in space, all different.
fn mesh(count: usize, triangles: Vec<[u32; 3]>) -> TriangleMesh {
    let vertices = Array2::from_shape_fn((count, 3), |(i, k)| (i as f64).powi(k as i32 + 1));
    TriangleMesh { vertices, triangles }
}

/// `n_u` by `n_v` cells of two triangles each; `wrap` joins the ends of the directions.
fn grid(n_u: u32, n_v: u32, wrap: [bool; 2]) -> TriangleMesh {
    let size = [n_u + u32::from(!wrap[0]), n_v + u32::from(!wrap[1])];
    let at = |i: u32, j: u32| (i % size[0]) * size[1] + j % size[1];
    let mut triangles = Vec::new();
    for (i, j) in (0..n_u).flat_map(|i| (0..n_v).map(move |j| (i, j))) {
        triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
        triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
    }
    let vertices = Array2::from_shape_fn(((size[0] * size[1]) as usize, 3), |(v, k)| {
        let (i, j) = (v as u32 / size[1], v as u32 % size[1]);
        [f64::from(i), f64::from(j), 0.0][k]
    });
    TriangleMesh { vertices, triangles }
}

#[test]
fn the_boundary_runs_with_the_surface_on_its_left() {
    let disk = DiskMesh::new(grid(2, 1, [false, false])).unwrap();
    // Vertices: 0 = (0,0), 1 = (0,1), 2 = (1,0), 3 = (1,1), 4 = (2,0), 5 = (2,1); counter-clockwise seen from +z.
    assert_eq!(disk.outer_loop().vertices, [0, 2, 4, 5, 3, 1]);
    assert_eq!(disk.outer_loop().length, 6.0);
    assert!(disk.holes().is_empty());
}

#[test]
fn a_hole_is_the_shorter_loop_and_runs_the_other_way() {
    let mut with_hole = grid(3, 3, [false, false]);
    with_hole.triangles.drain(8..10);
    let disk = DiskMesh::new(with_hole).unwrap();
    assert_eq!(disk.outer_loop().length, 12.0);
    assert_eq!(disk.holes().len(), 1);
    assert_eq!(disk.holes()[0].vertices, [5, 6, 10, 9]);
}

#[test]
fn a_cylinder_has_two_loops() {
    let disk = DiskMesh::new(grid(5, 2, [true, false])).unwrap();
    assert_eq!((disk.outer_loop().vertices.len(), disk.holes().len()), (5, 1));
}

#[test]
fn each_wrong_topology_has_its_own_error() {
    let tetrahedron = vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
    assert_eq!(DiskMesh::new(mesh(4, tetrahedron)), Err(CloudError::Closed { triangles: 4 }));

    let mut torus = grid(4, 4, [true, true]);
    assert_eq!(DiskMesh::new(torus.clone()), Err(CloudError::Closed { triangles: 32 }));
    torus.triangles.pop();
    assert_eq!(DiskMesh::new(torus), Err(CloudError::Handles { handles: 1, euler: -1, loops: 1 }));

    let three_wings = vec![[0, 1, 2], [1, 0, 3], [0, 1, 4]];
    assert_eq!(
        DiskMesh::new(mesh(5, three_wings)),
        Err(CloudError::NonManifoldEdges { count: 1, vertices: [0, 1], triangles: 3 })
    );

    let bow_tie = vec![[0, 1, 2], [2, 3, 4]];
    assert_eq!(DiskMesh::new(mesh(5, bow_tie)), Err(CloudError::SeveralPieces { count: 2, sizes: vec![1, 1] }));

    // A ring of triangles whose first and last touch in vertex 0 only.
    let pinched = vec![[0, 1, 2], [2, 1, 3], [2, 3, 4], [4, 3, 5], [4, 5, 0]];
    assert_eq!(DiskMesh::new(mesh(6, pinched)), Err(CloudError::PinchedVertices { count: 1, vertex: 0, fans: 2 }));

    let moebius = vec![[0, 1, 2], [1, 2, 3], [2, 3, 4], [3, 4, 0], [4, 0, 1]];
    assert!(matches!(DiskMesh::new(mesh(5, moebius)), Err(CloudError::NotOrientable { .. })));

    assert_eq!(DiskMesh::new(mesh(5, vec![[0, 1, 4]])), Err(CloudError::UnreferencedVertices { count: 2, first: 2 }));
}

proptest! {
    /// Whatever fewer than half of the triangles are flipped, exactly these are flipped back.
    #[test]
    fn flipped_triangles_are_found(flips in prop::collection::vec(any::<bool>(), 24)) {
        let clean = grid(4, 3, [false, false]);
        let count = flips.iter().filter(|f| **f).count();
        prop_assume!(count < 12);
        let mut mixed = clean.clone();
        mixed.triangles.iter_mut().zip(&flips).filter(|(_, f)| **f).for_each(|(t, _)| t.swap(0, 1));
        let disk = DiskMesh::new(mixed).unwrap();
        prop_assert_eq!(disk.flipped(), count);
        let normalized = |t: [u32; 3]| {
            let k = (0..3).min_by_key(|&k| t[k]).unwrap();
            [t[k], t[(k + 1) % 3], t[(k + 2) % 3]]
        };
        for (found, truth) in disk.triangles().iter().zip(&clean.triangles) {
            prop_assert_eq!(normalized(*found), normalized(*truth));
        }
    }
}
