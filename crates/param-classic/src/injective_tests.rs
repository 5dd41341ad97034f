//! Tests of the injective refinement.

use super::*;
use crate::{MeshMapParams, map_disk};
use point_cloud::{DiskMesh, TriangleMesh};
use proptest::prelude::*;

/// `n` by `n` cells over the unit lattice; `shift` moves the inner vertices of the plane.
fn lattice(n: usize, shift: impl Fn(usize) -> [f64; 2]) -> (Array2<f64>, Vec<[u32; 3]>) {
    let at = |i: usize, j: usize| (i * (n + 1) + j) as u32;
    let mut triangles = Vec::new();
    for cell in 0..n * n {
        let (i, j) = (cell / n, cell % n);
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        triangles.extend(if cell % 3 == 0 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] });
    }
    let uv = Array2::from_shape_fn(((n + 1) * (n + 1), 2), |(v, k)| {
        let place = [v / (n + 1), v % (n + 1)];
        let inner = place.iter().all(|p| (1..n).contains(p));
        place[k] as f64 / n as f64 + if inner { shift(v)[k] / n as f64 } else { 0.0 }
    });
    (uv, triangles)
}

fn over(uv: &Array2<f64>, surface: impl Fn(f64, f64) -> [f64; 3]) -> Array2<f64> {
    Array2::from_shape_fn((uv.nrows(), 3), |(i, k)| surface(uv[[i, 0]], uv[[i, 1]])[k])
}

/// A stretched rectangle: the isometry is in reach, boundary vertices included.
#[test]
fn a_distorted_map_of_a_rectangle_becomes_an_isometry() {
    let n = 8;
    let (truth, triangles) = lattice(n, |_| [0.0; 2]);
    let vertices = over(&truth, |u, v| [6.0 * u, 1.0, 1.5 * v]);
    // Squares of the coordinates: boundary vertices have to slide back.
    let uv = truth.mapv(|x| x * x);
    let params = InjectiveParams { iterations: 60, tolerance: 1e-12, slide: true };
    let map = refine_injective(vertices.view(), &triangles, uv.view(), &params).unwrap();
    let report = &map.report;
    assert!(report.energy_before > 5.0 && (report.energy_after - 4.0).abs() < 1e-6, "{report:?}");
    assert!((report.aspect - 4.0).abs() < 1e-3 && report.held == 4, "{report:?}");
    assert!((&map.parameters - &truth).iter().all(|d| d.abs() < 1e-3));
    let fixed = InjectiveParams { slide: false, ..params };
    let map = refine_injective(vertices.view(), &triangles, uv.view(), &fixed).unwrap();
    for (v, p) in map.parameters.rows().into_iter().enumerate() {
        if v / (n + 1) % n == 0 || v % (n + 1) % n == 0 {
            assert_eq!(p, uv.row(v));
        }
    }
}

/// Mean-value maps shrink what stands out; that is what the refinement is for.
#[test]
fn the_area_stretch_of_a_mean_value_map_is_cut() {
    let (uv, triangles) = lattice(16, |_| [0.0; 2]);
    let bump = |u: f64, v: f64| [u, v, 2.0 * (-12.0 * ((u - 0.5).powi(2) + (v - 0.5).powi(2))).exp()];
    let disk = DiskMesh::new(TriangleMesh { vertices: over(&uv, bump), triangles }).unwrap();
    let map = map_disk(&disk, &MeshMapParams::default()).unwrap();
    let refined =
        refine_injective(disk.vertices(), disk.triangles(), map.parameters.view(), &InjectiveParams::default())
            .unwrap();
    let (before, after) = (map.report.quality.area.unwrap(), refined.report.quality.area.unwrap());
    assert!(after.max < 0.5 * before.max && after.mean < 0.5 * before.mean, "{before:?} {after:?}");
}

#[test]
fn collapsed_triangles_stay_and_folded_ones_are_an_error() {
    let (mut uv, triangles) = lattice(3, |_| [0.0; 2]);
    let vertices = over(&uv, |u, v| [u, v, u * v]);
    // Vertex 5 onto the side u = 0 between vertices 1 and 2 collapses a triangle or folds it, by the diagonal there.
    uv[[5, 0]] = 0.0;
    uv[[5, 1]] = 1.0 / 3.0;
    let quality = map_quality(vertices.view(), &triangles, uv.view()).unwrap();
    assert!(quality.collapsed > 0 && quality.folded.is_empty(), "{quality:?}");
    let map = refine_injective(vertices.view(), &triangles, uv.view(), &InjectiveParams::default()).unwrap();
    assert_eq!(map.parameters.row(5), uv.row(5));
    assert_eq!(map.report.quality.collapsed, quality.collapsed);
    uv[[5, 0]] = -0.1;
    let error = refine_injective(vertices.view(), &triangles, uv.view(), &InjectiveParams::default());
    assert!(matches!(error, Err(ParamError::FoldedTriangles { .. })));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Whatever the surface and the fold-free start: no fold, all in the square, the energy falls.
    #[test]
    fn it_never_folds_and_lowers_the_energy(
        n in 2usize..7,
        heights in prop::collection::vec(-1.0..1.0f64, 49),
        shifts in prop::collection::vec((-0.24..0.24f64, -0.24..0.24f64), 49),
        slide: bool,
    ) {
        let (uv, triangles) = lattice(n, |v| [shifts[v % 49].0, shifts[v % 49].1]);
        let vertices = Array2::from_shape_fn((uv.nrows(), 3), |(i, k)| [uv[[i, 0]], uv[[i, 1]], heights[i % 49]][k]);
        let params = InjectiveParams { slide, ..Default::default() };
        let map = refine_injective(vertices.view(), &triangles, uv.view(), &params).unwrap();
        prop_assert!(map.report.quality.folded.is_empty());
        prop_assert_eq!(map.report.quality.collapsed, 0);
        prop_assert!(map.report.energy_after <= map.report.energy_before);
        prop_assert!(map.report.energy_after >= 4.0 - 1e-12);
        prop_assert!(map.parameters.iter().all(|x| (0.0..=1.0).contains(x)));
    }
}
