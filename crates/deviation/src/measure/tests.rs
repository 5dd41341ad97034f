//! Planted figures.

use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

use ndarray::Array2;
use thb_core::{HierarchicalSpace, Kind, KnotVector};

use super::*;
use crate::testing::{Random, interpolated};

/// A surface of degree 3 with `n × n` elements whose control points are those of `at` at the Greville sites.
fn surface(n: usize, at: impl Fn(f64, f64) -> [f64; 3]) -> SplineMap<2> {
    let knots = KnotVector::uniform(3, n).unwrap();
    let sites = knots.greville();
    let m = sites.len();
    let space = HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap();
    let rows = Array2::from_shape_fn((m * m, 3), |(i, k)| at(sites[i % m], sites[i / m])[k]);
    SplineMap::new(Arc::new(space), rows).unwrap()
}

/// A grid of `(n + 1)²` points of `at` over the unit square, and its triangles.
fn grid(n: usize, at: impl Fn(f64, f64) -> [f64; 3]) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let side = n + 1;
    let points = (0..side * side).map(|k| at((k % side) as f64 / n as f64, (k / side) as f64 / n as f64)).collect();
    let quad = |k: usize| {
        let a = (k / n * side + k % n) as u32;
        let (b, c, d) = (a + 1, a + side as u32 + 1, a + side as u32);
        [[a, b, c], [a, c, d]]
    };
    (points, (0..n * n).flat_map(quad).collect())
}

fn deviation(map: &SplineMap<2>, scan: &Scan<'_>, tolerance: f64) -> Deviation {
    measure(map, scan, None, tolerance, &Thresholds::default()).unwrap()
}

#[test]
fn a_sheet_beside_a_sheet_has_one_distance() {
    let flat = surface(2, |u, v| [u, v, 0.0]);
    let (points, triangles) = grid(7, |u, v| [u, v, 0.02]);
    let found = deviation(&flat, &Scan::mesh(&points, &triangles).unwrap(), 0.01);
    for distances in [found.scan_to_surface, found.facets_to_surface.unwrap(), found.surface_to_scan] {
        assert_eq!(distances.within, 0.0);
        for figure in [distances.mean, distances.rms, distances.median, distances.p99, distances.max] {
            assert!((figure - 0.02).abs() < 1e-12, "{distances:?}");
        }
    }
    assert!((found.signed_mean.unwrap() - 0.02).abs() < 1e-12);
    assert!((found.gathered.largest - 1.0).abs() < 1e-9 && found.folded == Some(0.0));
    assert!(found.normal_angles.unwrap().max < 1e-3 && (found.area - 1.0).abs() < 1e-12);
    // The same seen from below, and within a larger tolerance.
    let turned: Vec<[u32; 3]> = triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
    let found = deviation(&flat, &Scan::mesh(&points, &turned).unwrap(), 0.03);
    assert!((found.signed_mean.unwrap() + 0.02).abs() < 1e-12 && found.scan_to_surface.within == 1.0);
    assert_eq!((found.folded, found.gathered.largest), (Some(0.0), 0.0));
    assert!(Thresholds::default().reasons(&found).is_empty());
}

#[test]
fn what_is_lost_of_a_scan_gathers() {
    // A bump over a hundredth of the area, with all else exact: the share within is above what is asked for.
    let flat = surface(2, |u, v| [u, v, 0.0]);
    let is_bump = |u: f64, v: f64| (0.4..0.499).contains(&u) && (0.6..0.699).contains(&v);
    let (points, triangles) = grid(100, |u, v| [u, v, if is_bump(u, v) { 0.05 } else { 0.0 }]);
    let found = deviation(&flat, &Scan::mesh(&points, &triangles).unwrap(), 0.01);
    assert!(found.scan_to_surface.within > 0.95);
    let patch = found.gathered.patches[0];
    assert!((0.008..0.03).contains(&found.gathered.largest), "{}", found.gathered.largest);
    assert!((patch.distance - 0.05).abs() < 1e-12 && is_bump(patch.place[0], patch.place[1]));
    let reasons = Thresholds::default().reasons(&found);
    assert!(reasons.iter().any(|reason| reason.code == "misses-gather" && reason.verdict == crate::Verdict::Usable));
}

#[test]
fn points_of_a_cloud_beyond_the_rim_count_across_the_surface_only() {
    let flat = surface(2, |u, v| [u, v, 0.0]);
    // A spacing of 0.05; the outermost columns lie beyond the surface by one and by four spacings.
    let cloud = |width: f64| -> Vec<[f64; 3]> {
        let columns = (20.0 * width).round() as usize;
        (0..=columns * 21)
            .map(|k| [0.05 * (k % (columns + 1)) as f64, 0.05 * (k / (columns + 1)) as f64, 1e-4])
            .collect()
    };
    let near = cloud(1.05);
    let found = deviation(&flat, &Scan::cloud(&near).unwrap(), 0.001);
    assert!((found.scan_to_surface.max - 1e-4).abs() < 1e-12, "{:?}", found.scan_to_surface);
    assert_eq!(found.beyond_rim, 0.0);
    let far = cloud(1.2);
    let found = deviation(&flat, &Scan::cloud(&far).unwrap(), 0.001);
    assert!((0.05..0.15).contains(&found.beyond_rim), "{}", found.beyond_rim);
    assert!(Thresholds::default().reasons(&found).iter().any(|reason| reason.code == "not-covered"));
}

#[test]
fn a_surface_that_bulges_between_the_points_does_not_pass() {
    // A box-like fold of long triangles, which a surface through its vertices rounds off.
    let fold = |u: f64, v: f64| [u, v, (u - 0.5).abs()];
    let (points, triangles) = grid(2, fold);
    let round = surface(4, |u, v| [u, v, ((u - 0.5).powi(2) + 0.01).sqrt()]);
    let found = deviation(&round, &Scan::mesh(&points, &triangles).unwrap(), 0.01);
    assert!(found.scan_to_surface.within < 0.9 && found.surface_to_scan.within < 0.9, "{found:?}");
    let reasons = Thresholds::default().reasons(&found);
    let codes: Vec<&str> = reasons.iter().map(|reason| &*reason.code).collect();
    assert!(codes.contains(&"scan-not-within") && codes.contains(&"surface-not-within"), "{codes:?}");
}

#[test]
fn facets_of_something_round_are_known_up_to_their_sagitta() {
    // A quarter of a cylinder in 8 facets, their sagitta 1 − cos(π/32) = 0.0048, and a surface close to the cylinder.
    let bend = |u: f64, v: f64| [(FRAC_PI_2 * u).cos(), (FRAC_PI_2 * u).sin(), v];
    // One row of quads: four and more facets in one plane would be a plane.
    let (points, triangles) = grid(8, bend);
    let triangles: Vec<[u32; 3]> = triangles.into_iter().take(16).collect();
    let points: Vec<[f64; 3]> = points.into_iter().take(18).collect();
    let knots = 16;
    // Control points at Greville sites lie inside; moved out so that the middle of a leg is on the circle.
    let leg = 1.0 + (FRAC_PI_2 / knots as f64).powi(2) / 6.0;
    let round = surface(knots, |u, v| {
        let [x, y, z] = bend(u, v / 8.0);
        [leg * x, leg * y, z]
    });
    let found = deviation(&round, &Scan::mesh(&points, &triangles).unwrap(), 0.002);
    assert!(found.facets_to_surface.unwrap().within < 0.5 && found.surface_to_facets.unwrap().within < 0.5);
    // In the outermost columns normals are those of one facet.
    assert!(found.scan_to_surface.within > 0.8 && found.surface_to_scan.within > 0.8, "{found:?}");
    assert!((0.0024..0.0052).contains(&found.sagitta_p95.unwrap()), "{:?}", found.sagitta_p95);
}

#[test]
fn folds_are_those_that_the_scan_has_not() {
    // The sheet runs back between u = 0.4 and 0.6.
    let back = |u: f64| {
        if u < 0.4 {
            u
        } else if u < 0.6 {
            0.8 - u
        } else {
            u - 0.4
        }
    };
    let folded = surface(40, |u, v| [back(u), v, 0.01 * (8.0 * u).sin()]);
    let (points, triangles) = grid(10, |u, v| [0.6 * u, v, 0.0]);
    let found = deviation(&folded, &Scan::mesh(&points, &triangles).unwrap(), 0.001);
    assert!((0.1..0.3).contains(&found.folded.unwrap()), "{:?}", found.folded);
    assert!(Thresholds::default().reasons(&found).iter().any(|reason| reason.code == "folded"));
    // A scan with that fold: a bent sheet whose sides face each other.
    let bend = |u: f64, v: f64| [0.2 * (3.0 * u).cos(), 0.2 * (3.0 * u).sin(), v];
    let (points, triangles) = grid(60, bend);
    let found = deviation(&surface(40, bend), &Scan::mesh(&points, &triangles).unwrap(), 0.001);
    assert_eq!(found.folded, Some(0.0));
}

#[test]
fn parameters_to_start_from_change_nothing() {
    let wave = |u: f64, v: f64| [u, v, 0.1 * (6.0 * u).sin() * (5.0 * v).cos()];
    let map = surface(6, wave);
    let (points, triangles) = grid(30, |u, v| [u, v, wave(u, v)[2] + 0.01 * (9.0 * v).sin()]);
    let parameters = Array2::from_shape_fn((points.len(), 2), |(i, k)| points[i][k]);
    for scan in [Scan::mesh(&points, &triangles).unwrap(), Scan::cloud(&points).unwrap()] {
        let free = measure(&map, &scan, None, 0.005, &Thresholds::default()).unwrap().scan_to_surface;
        let started =
            measure(&map, &scan, Some(parameters.view()), 0.005, &Thresholds::default()).unwrap().scan_to_surface;
        for (a, b) in [(free.within, started.within), (free.rms, started.rms), (free.max, started.max)] {
            assert!((a - b).abs() < 1e-6 * a, "{a} {b}");
        }
    }
}

#[test]
fn a_surface_may_pass_through_itself_where_the_scan_does() {
    // Sweeps of a lemniscate: the sheet passes through itself along the middle of its length, at x = y = 0. Families of widths,
    // heights and slants; as a mesh, as a cloud of known neighbours, and as a mere cloud.
    let mut random = Random::new(5);
    for case in 0..12 {
        let (width, height, slant) = (random.between(0.5, 2.0), random.between(0.3, 1.0), random.between(-0.4, 0.4));
        let sweep = |u: f64, v: f64| {
            let t = -0.5 + 4.2 * u;
            [width * t.sin(), height * (2.0 * t).sin() + slant * v, 2.0 * v]
        };
        let (map, (points, triangles)) = (interpolated([24, 3], [false, false], sweep), grid(60, sweep));
        let tessellation = tessellate(&map, 0.01).unwrap();
        let found =
            crate::self_crossings(&[crate::TessellatedPatch { map: &map, tessellation: &tessellation }], 0.0).unwrap();
        assert!(found.places.len() == 1 && found.places[0].extent > 1.9, "case {case}: {found:?}");
        let [x, y, z] = found.places[0].place;
        assert!(x.abs() < 0.02 && (y - 0.5 * slant * z).abs() < 0.02, "case {case}: {:?}", found.places[0]);
        let cloud = |known: bool| Scan::cloud(&points).unwrap().with_spanned(&triangles, known);
        for (scan, places) in [(Scan::mesh(&points, &triangles).unwrap(), 0), (cloud(true), 0), (cloud(false), 1)] {
            let found = deviation(&map, &scan, 0.01);
            assert_eq!(found.crossings.places.len(), places, "case {case}");
            let fails = Thresholds::default().reasons(&found).iter().any(|reason| reason.code == "crosses-itself");
            assert_eq!(fails, places > 0);
        }
    }
}
