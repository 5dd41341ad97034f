//! Tests of the boundary of a cloud.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use super::*;
use crate::vec3::{norm, sub};
use crate::{CornerChoice, LocalFrames, disk_corners};
use ndarray::Array2;

/// A generator of uniform numbers in [0, 1).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Close to normal: the sum of twelve uniform numbers.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.next()).sum::<f64>() - 6.0
    }
}

/// A planted surface: a planar outline and a map of the plane to space.
struct Planted {
    outline: fn(f64) -> [f64; 2],
    map: fn([f64; 2]) -> [f64; 3],
    /// Density at a place against the largest, in (0, 1].
    density: fn([f64; 2]) -> f64,
}

fn even(_: [f64; 2]) -> f64 {
    1.0
}

fn polygon(corners: &[[f64; 2]], t: f64) -> [f64; 2] {
    let s = t * corners.len() as f64;
    let k = (s as usize).min(corners.len() - 1);
    let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
    std::array::from_fn(|c| a[c] + (s - k as f64) * (b[c] - a[c]))
}

fn square(t: f64) -> [f64; 2] {
    polygon(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]], t)
}

fn disk(t: f64) -> [f64; 2] {
    [(TAU * t).cos(), (TAU * t).sin()]
}

fn hills([x, y]: [f64; 2]) -> [f64; 3] {
    [x, y, 0.15 * (4.0 * x).sin() * (3.0 * y).cos()]
}

const GRAPH: Planted = Planted { outline: square, map: hills, density: even };
const UNEVEN: Planted = Planted { outline: square, map: hills, density: |[x, _]| 0.2 + 0.8 * x };
const HALF_CYLINDER: Planted =
    Planted { outline: square, map: |[x, y]| [(PI * x).cos(), (PI * x).sin(), 2.0 * y], density: even };
/// Three quarters of a sphere by area, in the equal-area map of Lambert.
const CAP: Planted = Planted {
    outline: disk,
    map: |[x, y]| {
        let r2 = 0.75 * (x * x + y * y);
        let lift = 2.0 * (0.75 * (1.0 - r2)).sqrt();
        [x * lift, y * lift, 1.0 - 2.0 * r2]
    },
    density: even,
};
const ELL: Planted = Planted {
    outline: |t| polygon(&[[0.0, 0.0], [1.0, 0.0], [1.0, 0.4], [0.4, 0.4], [0.4, 1.0], [0.0, 1.0]], t),
    map: hills,
    density: even,
};
const STAR: Planted = Planted {
    outline: |t| {
        let r = 0.6 + 0.25 * (5.0 * TAU * t).cos();
        [r * (TAU * t).cos(), r * (TAU * t).sin()]
    },
    map: hills,
    density: even,
};

impl Planted {
    const CURVE_POINTS: usize = 600;

    fn curve(&self) -> Vec<[f64; 2]> {
        (0..Self::CURVE_POINTS).map(|k| (self.outline)(k as f64 / Self::CURVE_POINTS as f64)).collect()
    }

    /// `m` points, `4√m` of them on the outline, with normal noise of `noise` diagonals in each coordinate.
    fn sample(&self, m: usize, noise: f64) -> Array2<f64> {
        let curve = self.curve();
        let mut random = Random(m as u64);
        let on_curve = (4.0 * (m as f64).sqrt()) as usize;
        let mut flat: Vec<[f64; 2]> = (0..on_curve).map(|k| (self.outline)(k as f64 / on_curve as f64)).collect();
        let bound = |f: fn(f64, f64) -> f64, c: usize| curve.iter().map(|p| p[c]).fold(curve[0][c], f);
        let (low, high) = ([bound(f64::min, 0), bound(f64::min, 1)], [bound(f64::max, 0), bound(f64::max, 1)]);
        while flat.len() < m {
            let p: [f64; 2] = std::array::from_fn(|c| low[c] + (high[c] - low[c]) * random.next());
            if inside(p, &curve) && random.next() < (self.density)(p) {
                flat.push(p);
            }
        }
        // Order must not matter.
        for i in (1..m).rev() {
            flat.swap(i, (random.next() * (i + 1) as f64) as usize);
        }
        let exact = Array2::from_shape_fn((m, 3), |(i, k)| (self.map)(flat[i])[k]);
        let sigma = noise * BoundingBox::of(exact.view()).unwrap().diagonal();
        exact.mapv(|x| x + if sigma > 0.0 { sigma * random.normal() } else { 0.0 })
    }

    /// Recall, precision and turns of the detected loop against the planted curve.
    fn judge(&self, points: &Array2<f64>) -> (f64, f64, CloudBoundary) {
        let found = find_boundary(points.view(), &BoundaryParams::default()).unwrap();
        let frames = LocalFrames::estimate(points.view()).unwrap();
        let curve: Vec<[f64; 3]> = self.curve().into_iter().map(self.map).collect();
        let at = |v: u32| std::array::from_fn(|k| points[[v as usize, k]]);
        let detected: Vec<([f64; 3], f64)> =
            found.outer.iter().map(|&v| (at(v), 2.0 * frames.spacing[v as usize])).collect();
        let near = |a: [f64; 3], b: [f64; 3], r: f64| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>() <= r * r;
        let right = detected.iter().filter(|(p, r)| curve.iter().any(|c| near(*p, *c, *r))).count();
        let met = curve.iter().filter(|c| detected.iter().any(|(p, r)| near(*p, **c, *r))).count();
        (met as f64 / curve.len() as f64, right as f64 / detected.len() as f64, found)
    }

    /// Whether the loop passes once round the curve: nearest curve parameters add up to one turn.
    fn goes_round_once(&self, points: &Array2<f64>, found: &CloudBoundary) -> bool {
        let curve: Vec<[f64; 3]> = self.curve().into_iter().map(self.map).collect();
        let parameter = |v: u32| {
            let d = |c: &[f64; 3]| (0..3).map(|k| (c[k] - points[[v as usize, k]]).powi(2)).sum::<f64>();
            let best = (0..curve.len()).min_by(|&a, &b| d(&curve[a]).total_cmp(&d(&curve[b]))).unwrap();
            best as f64 / curve.len() as f64
        };
        let t: Vec<f64> = found.outer.iter().map(|&v| parameter(v)).collect();
        let turns: f64 = (0..t.len())
            .map(|k| {
                let step = t[(k + 1) % t.len()] - t[k];
                step - step.round()
            })
            .sum();
        (turns.abs() - 1.0).abs() < 1e-9
    }
}

fn inside([x, y]: [f64; 2], polygon: &[[f64; 2]]) -> bool {
    let n = polygon.len();
    (0..n)
        .filter(|&k| {
            let ([ax, ay], [bx, by]) = (polygon[k], polygon[(k + 1) % n]);
            (ay > y) != (by > y) && x < ax + (y - ay) / (by - ay) * (bx - ax)
        })
        .count()
        % 2
        == 1
}

const PLANTED: [(&str, Planted); 6] = [
    ("graph", GRAPH),
    ("uneven", UNEVEN),
    ("half cylinder", HALF_CYLINDER),
    ("cap", CAP),
    ("ell", ELL),
    ("star", STAR),
];

#[test]
fn planted_boundaries_are_found_without_noise() {
    for (name, planted) in PLANTED {
        // Large clouds where the build is fast enough for them.
        let large = if cfg!(debug_assertions) { 3000 } else { 10_000 };
        for m in [1000, large] {
            let points = planted.sample(m, 0.0);
            let (recall, precision, found) = planted.judge(&points);
            assert!(recall >= 0.98 && precision >= 0.95, "{name} {m}: {recall} {precision}");
            assert!(planted.goes_round_once(&points, &found), "{name} {m}");
            let (disk, kept) = found.disk_mesh(points.view()).unwrap();
            assert!(kept.len() as f64 > 0.99 * m as f64, "{name} {m}: {}", kept.len());
            // One orientation for the mesh and the loop.
            let outer: Vec<u32> = disk.outer_loop().vertices.iter().map(|&v| kept[v as usize] as u32).collect();
            let shift = outer.iter().position(|v| *v == found.outer[0]).unwrap();
            assert!((0..outer.len()).all(|k| outer[(k + shift) % outer.len()] == found.outer[k]), "{name} {m}");
        }
    }
}

#[test]
fn planted_boundaries_are_found_in_noise() {
    for (name, planted) in PLANTED {
        let large = if cfg!(debug_assertions) { 2500 } else { 10_000 };
        for (m, noise) in [(1000, 0.005), (1000, 0.01), (large, 0.005), (large, 0.01)] {
            let points = planted.sample(m, noise);
            let (recall, precision, found) = planted.judge(&points);
            assert!(recall >= 0.9 && precision >= 0.9, "{name} {m} {noise}: {recall} {precision}");
            assert!(planted.goes_round_once(&points, &found), "{name} {m} {noise}");
            assert!(found.triangles.is_some(), "{name} {m} {noise}");
        }
    }
}

#[test]
fn planted_corners_come_back_from_the_detected_loop() {
    for (name, planted) in &PLANTED[..3] {
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(planted.map);
        for noise in [0.0, 0.01] {
            let points = planted.sample(1000, noise);
            let found = find_boundary(points.view(), &BoundaryParams::default()).unwrap();
            let (disk, _) = found.disk_mesh(points.view()).unwrap();
            let chosen = disk_corners(&disk, CornerChoice::default()).unwrap().vertices(disk.outer_loop());
            let curve: Vec<[f64; 3]> = planted.curve().into_iter().map(planted.map).collect();
            let distance = |a: [f64; 3], b: [f64; 3]| norm(sub(a, b));
            let perimeter: f64 = (0..curve.len()).map(|k| distance(curve[k], curve[(k + 1) % curve.len()])).sum();
            for corner in corners {
                let place = |k: usize| std::array::from_fn(|c| disk.vertices()[[chosen[k] as usize, c]]);
                let nearest = (0..4).map(|k| distance(place(k), corner)).fold(f64::INFINITY, f64::min);
                assert!(nearest < 0.02 * perimeter, "{name} {noise}: {}", nearest / perimeter);
            }
        }
    }
}

#[test]
fn a_hole_is_reported_and_not_taken_for_the_boundary() {
    let all = GRAPH.sample(4000, 0.0);
    let kept: Vec<usize> = (0..4000).filter(|&i| (all[[i, 0]] - 0.4f64).hypot(all[[i, 1]] - 0.6) > 0.15).collect();
    let points = all.select(Axis(0), &kept);
    let found = find_boundary(points.view(), &BoundaryParams::default()).unwrap();
    assert_eq!(found.holes.len(), 1);
    let rim = |v: &u32| (points[[*v as usize, 0]] - 0.4).hypot(points[[*v as usize, 1]] - 0.6);
    assert!(found.holes[0].iter().all(|v| rim(v) < 0.15 + 2.0 * found.spacing));
    assert!(found.outer.iter().all(|v| rim(v) > 0.3));
}

#[test]
fn closed_and_torn_clouds_are_errors() {
    let golden = PI * (3.0 - 5f64.sqrt());
    let mut random = Random(7);
    let sphere = Array2::from_shape_fn((1500, 3), |(i, k)| {
        let z = 1.0 - (2 * i + 1) as f64 / 1500.0;
        let (r, t) = ((1.0 - z * z).sqrt(), golden * i as f64);
        [r * t.cos(), r * t.sin(), z][k] + 1e-3 * random.next()
    });
    assert_eq!(find_boundary(sphere.view(), &BoundaryParams::default()), Err(CloudError::ClosedCloud { points: 1500 }));
    let sheet = GRAPH.sample(1000, 0.0);
    let two =
        Array2::from_shape_fn((1500, 3), |(i, k)| if i < 1000 { sheet[[i, k]] } else { 3.0 + sheet[[i - 1000, k]] });
    let Err(CloudError::CloudPieces { sizes, .. }) = find_boundary(two.view(), &BoundaryParams::default()) else {
        panic!("two pieces were not noticed");
    };
    assert!(sizes.len() >= 2 && sizes[0] > 900, "{sizes:?}");
}

#[test]
fn lattices_duplicates_shift_and_scale_do_no_harm() {
    let quarter = Array2::from_shape_fn((900, 3), |(i, k)| {
        let t = FRAC_PI_2 * (i / 30) as f64 / 29.0;
        [t.cos(), t.sin(), (i % 30) as f64 / 19.0][k]
    });
    for (scale, shift) in [(1.0, 0.0), (1e-60, 0.0), (1e60, 0.0), (30.0, 5e6)] {
        let mut points = &quarter * scale + shift;
        points.row_mut(899).assign(&(&quarter.row(898) * scale + shift));
        let found = find_boundary(points.view(), &BoundaryParams::default()).unwrap();
        assert_eq!(found.left_out, [899]);
        assert!(found.holes.is_empty() && found.triangles.is_some());
        assert!((110..=116).contains(&found.outer.len()), "{}", found.outer.len());
    }
    assert!(matches!(
        find_boundary(quarter.view(), &BoundaryParams { reach: 0.5, ..Default::default() }),
        Err(CloudError::BadOption { name: "reach", .. })
    ));
}

#[test]
fn every_point_of_a_dense_rim_is_on_the_loop() {
    // A round dome; on its rim the points are about ten times as dense as inside, at uneven steps.
    let mut random = Random(5);
    let mut points = Vec::new();
    let mut angles: Vec<f64> = (0..600).map(|_| TAU * random.next()).collect();
    angles.sort_by(f64::total_cmp);
    angles.iter().for_each(|t| points.extend([10.0 * t.cos(), 10.0 * t.sin(), 0.0]));
    for i in 0..21 * 21 {
        let place = |k: usize, shake: f64| k as f64 - 10.0 + 0.6 * (shake - 0.5);
        let (x, y) = (place(i / 21, random.next()), place(i % 21, random.next()));
        if x.hypot(y) < 9.4 {
            points.extend([x, y, 2.0 - 0.02 * (x * x + y * y)]);
        }
    }
    let points = Array2::from_shape_vec((points.len() / 3, 3), points).unwrap();
    let found = find_boundary(points.view(), &BoundaryParams::default()).unwrap();
    assert_eq!(found.left_out, []);
    assert!(found.holes.is_empty() && found.triangles.is_some());
    let mut outer = found.outer;
    outer.sort_unstable();
    assert_eq!(outer, (0..600).collect::<Vec<u32>>());
}

#[test]
fn points_along_a_curve_are_told() {
    for (m, bend) in [(20, 0.05), (40, 0.1), (300, 1.0)] {
        let curve = Array2::from_shape_fn((m, 3), |(i, k)| {
            let t = i as f64;
            [t, t, bend * t * t][k]
        });
        let found = find_boundary(curve.view(), &BoundaryParams::default());
        assert_eq!(found, Err(CloudError::AlongCurve { points: m }), "{m} {bend}");
    }
}
