//! Tests of the maps of meshes.

use super::*;
use ndarray::{Array2, array};
use point_cloud::{CloudError, TriangleMesh};
use proptest::prelude::*;

/// `n` by `n` cells; `diagonal` chooses how a cell is cut, `point` places the vertices over the unit lattice.
fn grid(n: usize, diagonal: impl Fn(usize) -> bool, point: impl Fn(f64, f64, usize) -> [f64; 3]) -> TriangleMesh {
    let at = |i: usize, j: usize| (i * (n + 1) + j) as u32;
    let mut triangles = Vec::new();
    for cell in 0..n * n {
        let (i, j) = (cell / n, cell % n);
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        triangles.extend(if diagonal(cell) { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] });
    }
    let vertices = Array2::from_shape_fn(((n + 1) * (n + 1), 3), |(v, k)| {
        let (i, j) = (v / (n + 1), v % (n + 1));
        point(i as f64 / n as f64, j as f64 / n as f64, v)[k]
    });
    TriangleMesh { vertices, triangles }
}

fn lattice_corners(n: u32) -> CornerChoice {
    CornerChoice::Given([0, n * (n + 1), n * (n + 2), n])
}

/// Pseudo-random in [0, 1), from an index.
fn scatter(index: usize) -> f64 {
    (index as f64 * 0.618_033_988_749_895).fract()
}

#[test]
fn mean_value_weights_reproduce_a_plane_rectangle() {
    let n = 12;
    // Abscissae u², v(v + 1)/2 and a shift of the interior vertices: any plane triangulation will do.
    let inside = |u: f64, v: f64| if u * v * (1.0 - u) * (1.0 - v) > 0.0 { 0.03 } else { 0.0 };
    let plane = |u: f64, v: f64, i: usize| {
        [u + inside(u, v) * scatter(i), v * (v + 3.0) / 4.0 + inside(u, v) * scatter(3 * i + 1)]
    };
    let mesh = grid(
        n,
        |cell| scatter(cell) < 0.5,
        |u, v, i| {
            let [x, y] = plane(u, v, i);
            [5.0 * x, 2.0 * y - 1.0, 3.0 - x]
        },
    );
    let disk = DiskMesh::new(mesh).unwrap();
    let map = map_disk(&disk, &MeshMapParams { corners: lattice_corners(12), ..Default::default() }).unwrap();
    for v in 0..disk.vertices().nrows() {
        let (i, j) = (v / (n + 1), v % (n + 1));
        let exact = plane(i as f64 / n as f64, j as f64 / n as f64, v);
        for k in 0..2 {
            assert!((map.parameters[[v, k]] - exact[k]).abs() < 1e-13, "vertex {v}: {exact:?}");
        }
    }
    let quality = &map.report.quality;
    assert_eq!((quality.collapsed, map.report.cut_off, map.report.holes), (0, 0, 0));
    assert!((quality.area.unwrap().max - 1.0).abs() < 1e-9);
}

#[test]
fn the_map_follows_the_orientation_of_the_mesh() {
    let mut mesh = grid(4, |_| true, |u, v, _| [u, v, u * v]);
    mesh.triangles.iter_mut().for_each(|t| t.swap(0, 1));
    let disk = DiskMesh::new(mesh).unwrap();
    let map = map_disk(&disk, &MeshMapParams { corners: lattice_corners(4), ..Default::default() }).unwrap();
    // Seen from below, the loop from (0,0) first comes to the corner with index 4.
    let corner = |v: usize| map.parameters.row(v).to_vec();
    assert_eq!([corner(0), corner(4), corner(24), corner(20)], [[0., 0.], [1., 0.], [1., 1.], [0., 1.]]);
}

#[test]
fn holes_are_closed_for_the_map() {
    let mut mesh = grid(9, |cell| cell % 2 == 0, |u, v, _| [u, v, (3.0 * u).sin() * v]);
    // Cells (2..4, 2..5) and the single cell (6, 6).
    let removed = |cell: usize| ((2..4).contains(&(cell / 9)) && (2..5).contains(&(cell % 9))) || cell == 60;
    let mut cells = (0..162).map(|t| !removed(t / 2));
    mesh.triangles.retain(|_| cells.next().unwrap());
    let whole = point_cloud::drop_unreferenced(&mesh).unwrap().mesh;
    let disk = DiskMesh::new(whole).unwrap();
    for weights in [Weights::Uniform, Weights::MeanValue] {
        let map = map_disk(&disk, &MeshMapParams { weights, ..Default::default() }).unwrap();
        assert_eq!((map.report.holes, map.report.quality.collapsed), (2, 0));
        assert_eq!(map.report.quality.folded, Vec::<u32>::new());
    }
}

#[test]
fn what_an_edge_cuts_off_collapses_into_the_side_and_is_reported() {
    // A fan round vertex 4 over the square 0..4, and below the edge 5-6 a triangle 5-7-6 with a vertex 8 in it.
    let vertices = array![
        [0.0, 0.0, 0.0],
        [3.0, 0.0, 0.0],
        [3.0, 3.0, 0.0],
        [0.0, 3.0, 0.0],
        [1.5, 1.5, 0.0],
        [1.0, 0.0, 0.0],
        [2.0, 0.0, 0.0],
        [1.5, -0.5, 0.0],
        [1.5, -0.2, 0.0],
    ];
    let triangles =
        vec![[0, 5, 4], [5, 6, 4], [6, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [5, 7, 8], [7, 6, 8], [6, 5, 8]];
    let disk = DiskMesh::new(TriangleMesh { vertices, triangles }).unwrap();
    // The edge 5-6 on each of the four sides in turn.
    for corners in [[0, 1, 2, 3], [1, 2, 3, 0], [2, 3, 0, 1], [3, 0, 1, 2]] {
        let corners = CornerChoice::Given(corners);
        let map = map_disk(&disk, &MeshMapParams { corners, ..Default::default() }).unwrap();
        assert_eq!((map.report.cut_off, map.report.quality.collapsed), (1, 3));
    }
}

#[test]
fn equal_neighbours_are_named() {
    let mut mesh = grid(3, |_| true, |u, v, _| [u, v, 0.0]);
    mesh.vertices[[5, 0]] = mesh.vertices[[10, 0]];
    mesh.vertices[[5, 1]] = mesh.vertices[[10, 1]];
    let disk = DiskMesh::new(mesh).unwrap();
    let params = MeshMapParams { corners: lattice_corners(3), ..Default::default() };
    assert_eq!(map_disk(&disk, &params), Err(ParamError::ShortEdge { vertices: [10, 5], length: 0.0 }));
    let uniform = MeshMapParams { weights: Weights::Uniform, ..params };
    assert!(map_disk(&disk, &uniform).is_ok());
    let inner = MeshMapParams { corners: CornerChoice::Given([0, 3, 5, 12]), ..params };
    assert_eq!(map_disk(&disk, &inner), Err(CloudError::CornerNotOnLoop { vertex: 5 }.into()));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Tutte's and Floater's theorem: no fold, no collapse, whatever the surface, for all rules and weights.
    #[test]
    fn the_map_is_one_to_one(
        n in 2usize..8,
        heights in prop::collection::vec(-2.0..2.0f64, 64),
        diagonals in prop::collection::vec(any::<bool>(), 49),
        uniform: bool,
        rule in prop::sample::select(vec![Rule::Uniform, Rule::ChordLength, Rule::Centripetal]),
    ) {
        let disk = DiskMesh::new(grid(n, |c| diagonals[c], |u, v, i| [u, 2.0 * v, heights[i % 64]])).unwrap();
        let params = MeshMapParams {
            weights: if uniform { Weights::Uniform } else { Weights::MeanValue },
            boundary: rule,
            corners: lattice_corners(n as u32),
        };
        let map = map_disk(&disk, &params).unwrap();
        prop_assert!(map.report.residual < 1e-13);
        prop_assert!(map.parameters.iter().all(|x| (0.0..=1.0).contains(x)));
        prop_assert_eq!(map.report.quality.collapsed, 0);
        let (angle, area) = (map.report.quality.angle.unwrap(), map.report.quality.area.unwrap());
        prop_assert!(angle.min >= 1.0 && area.min >= 1.0);
        let [p, q, r, s] = map.corners.vertices(disk.outer_loop()).map(|v| map.parameters.row(v as usize).to_vec());
        prop_assert_eq!([p, q, r, s], [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
    }
}
