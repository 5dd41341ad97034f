//! Tests of maps through a spanned mesh.

use super::*;
use crate::{Rule, Weights, map_quality};
use point_cloud::{BoundaryParams, find_boundary};

/// A wavy sheet of `n` by `n` points, shaken by irrational steps inside.
fn sheet(n: usize) -> Array2<f64> {
    Array2::from_shape_fn((n * n, 3), |(i, k)| {
        let place = [i / n, i % n];
        let inner = place.iter().all(|p| (1..n - 1).contains(p));
        let [x, y] = [0, 1].map(|c| {
            let shake = if inner { 0.3 * ((7.1 + c as f64) * i as f64).sin() } else { 0.0 };
            (place[c] as f64 + shake) / (n - 1) as f64
        });
        [2.0 * x, y, 0.1 * (5.0 * x).sin() * (4.0 * y).cos()][k]
    })
}

#[test]
fn every_point_gets_parameters_and_repeated_ones_the_same() {
    let mut points = sheet(25);
    let first = points.row(300).to_owned();
    points.row_mut(301).assign(&first);
    let boundary = find_boundary(points.view(), &BoundaryParams::default()).unwrap();
    let map = map_spanned(points.view(), &boundary, &SpannedMapParams::default()).unwrap();
    assert_eq!((map.report.off_mesh.as_slice(), map.report.shrunk), (&[301][..], 0));
    assert!(map.report.distances.iter().all(|d| *d < 1e-12));
    assert!((&map.parameters.row(300) - &map.parameters.row(301)).iter().all(|d| d.abs() < 1e-12));
    let quality = map_quality(points.view(), &map.triangles, map.parameters.view()).unwrap();
    assert!(quality.folded.is_empty() && quality.collapsed == 0);
    for (corner, uv) in map.corners.into_iter().zip([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]) {
        assert_eq!(map.parameters.row(corner as usize).to_vec(), uv);
        assert!([0, 24, 600, 624].contains(&corner));
    }
    // The corners may be given, as rows.
    let mut given = map.corners;
    given.rotate_left(1);
    let corners = CornerChoice::Given(given);
    let options = MeshMapParams { weights: Weights::Uniform, boundary: Rule::Uniform, corners };
    let params = SpannedMapParams { map: options, refinement: None, ..Default::default() };
    assert_eq!(map_spanned(points.view(), &boundary, &params).unwrap().corners, given);
}

#[test]
fn a_deep_pocket_is_taken_out_and_projected() {
    // A disk with a test tube of circumference 1 and length 4 hanging from its middle.
    let (rings, around, deep) = (12, 24, 40);
    let ring = |j: usize, k: usize| {
        let (s, c) = (std::f64::consts::TAU * k as f64 / around as f64).sin_cos();
        let radius = 0.16 * if j <= deep { 1.0 } else { 1.0 + (j - deep) as f64 * 0.5 };
        [radius * c, radius * s, -0.1 * deep.saturating_sub(j) as f64]
    };
    let count = (deep + rings) * around;
    let points = Array2::from_shape_fn((count + 1, 3), |(i, k)| {
        if i == count { [0.0, 0.0, -4.1][k] } else { ring(i / around, i % around)[k] }
    });
    let at = |j: usize, k: usize| (j * around + k % around) as u32;
    let mut triangles: Vec<[u32; 3]> = (0..around).map(|k| [count as u32, at(0, k), at(0, k + 1)]).collect();
    for c in 0..count - around {
        let (j, k) = (c / around, c % around);
        triangles.extend([[at(j, k), at(j + 1, k), at(j + 1, k + 1)], [at(j, k), at(j + 1, k + 1), at(j, k + 1)]]);
    }
    let outer = (0..around).map(|k| at(deep + rings - 1, k)).collect();
    let boundary = CloudBoundary {
        outer,
        holes: vec![],
        triangles: Some(triangles),
        left_out: vec![],
        spacing: 0.1,
        noise: 0.0,
        reach: 2.0,
    };
    // The refinement opens the tube without a fold, so nothing has to go.
    let map = map_spanned(points.view(), &boundary, &SpannedMapParams::default()).unwrap();
    assert!(map.report.shrunk == 0 && map.report.refinement.unwrap().quality.area.unwrap().max < 100.0);
    let params = SpannedMapParams { refinement: None, ..Default::default() };
    let map = map_spanned(points.view(), &boundary, &params).unwrap();
    let report = &map.report;
    assert!(report.shrunk > 10 * around && report.shrunk < count - rings * around, "{report:?}");
    assert!(report.distances.iter().any(|d| *d > 1.0) && report.off_mesh.len() == report.shrunk);
    // Every triangle is either mapped or told to be left out.
    let given = boundary.triangles.as_ref().unwrap();
    let sorted = |triangles: &[[u32; 3]]| -> std::collections::BTreeSet<[u32; 3]> {
        let of = |mut t: [u32; 3]| {
            t.sort_unstable();
            t
        };
        triangles.iter().map(|&t| of(t)).collect()
    };
    assert!(map.left_out.len() > 10 * around && map.left_out.len() + map.triangles.len() == given.len());
    assert!(sorted(&[map.left_out.clone(), map.triangles.clone()].concat()) == sorted(given));
    assert!(report.map.quality.area.unwrap().max < 3e3 && report.map.quality.folded.is_empty());
    assert!(map.parameters.iter().all(|x| (0.0..=1.0).contains(x)));
    // The bottom of the tube lies in the middle.
    assert!((0..2).all(|k| (map.parameters[[count, k]] - 0.5).abs() < 0.1), "{}", map.parameters.row(count));
    // The same for the mesh itself.
    let (disk, rows) = boundary.disk_mesh(points.view()).unwrap();
    assert_eq!(rows.len(), points.nrows());
    assert_eq!(map_mesh(disk, &params).unwrap(), map);
    let bad = SpannedMapParams { most_shrinkage: 0.5, ..Default::default() };
    assert!(map_spanned(points.view(), &boundary, &bad).is_err());
}
