//! Tests of noise, rounding, relief and thickness on planted truth.

use ndarray::{Array2, Axis};

use super::*;
use crate::{BoundingBox, relief, ring_radius, rounding_step, thickness, thickness_of_cloud};

pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        // Box and Muller; 1 − u is never 0.
        (-2.0 * (1.0 - self.next()).ln()).sqrt() * (2.0 * std::f64::consts::PI * self.next()).cos()
    }
}

const PI: f64 = std::f64::consts::PI;

/// A name, and the point of a shape at a place of the unit square.
type Shape = (&'static str, fn(f64, f64) -> [f64; 3]);

/// Shapes over the unit square.
const SHAPES: [Shape; 5] = [
    ("plane", |u, v| [3.0 * u, 2.0 * v, u + 0.3 * v]),
    ("wave", |u, v| [u, v, 0.2 * (3.0 * u + 0.5).sin() * (2.0 * v).cos()]),
    ("cylinder", |u, v| [(3.0 * u).cos(), (3.0 * u).sin(), 2.0 * v]),
    ("sphere", |u, v| {
        let (z, t) = (1.0 - 2.0 * u, 2.0 * PI * v);
        [(1.0 - z * z).sqrt() * t.cos(), (1.0 - z * z).sqrt() * t.sin(), z]
    }),
    ("strip", |u, v| [10.0 * u, v, u * u]),
];

/// About `m` points of a shape, on a lattice or scattered.
fn shape(of: fn(f64, f64) -> [f64; 3], m: usize, lattice: bool, random: &mut Random) -> Array2<f64> {
    let side = (m as f64).sqrt() as usize;
    let count = if lattice { side * side } else { m };
    let mut points = Array2::zeros((count, 3));
    for (i, mut row) in points.outer_iter_mut().enumerate() {
        let uv = if lattice {
            [i % side, i / side].map(|k| (k as f64 + 0.5) / side as f64)
        } else {
            [random.next(), random.next()]
        };
        row.iter_mut().zip(of(uv[0], uv[1])).for_each(|(x, y)| *x = y);
    }
    points
}

fn diagonal(points: &Array2<f64>) -> f64 {
    BoundingBox::of(points.view()).unwrap().diagonal()
}

#[test]
fn planted_noise_is_found_within_a_fifth() {
    for (seed, (name, of)) in SHAPES.iter().enumerate() {
        for m in [1500, 10_000] {
            for lattice in [false, true] {
                let mut random = Random::new(seed as u64);
                let exact = shape(*of, m, lattice, &mut random);
                let size = diagonal(&exact);
                let found = noise_sigma(exact.view()).unwrap();
                assert!(found < 4e-5 * size, "{name}, {m}, {lattice}: {:e} of exact points", found / size);
                for sigma in [2e-4, 1e-3, 5e-3] {
                    let noisy = exact.mapv(|x| x + sigma * size * random.normal());
                    let found = noise_sigma(noisy.view()).unwrap() / (sigma * size);
                    assert!((0.8..1.2).contains(&found), "{name}, {m}, {lattice}, {sigma:e}: {found}");
                }
            }
        }
    }
}

#[test]
fn noise_is_told_in_spite_of_outliers_copies_order_and_place() {
    let mut random = Random::new(5);
    let mut points = shape(SHAPES[1].1, 3000, false, &mut random).mapv(|x| x + 1e-3 * random.normal());
    let plain = noise_sigma(points.view()).unwrap();
    assert!((0.85..1.15).contains(&(plain / 1e-3)), "{plain}");
    let twice = ndarray::concatenate![Axis(0), points.select(Axis(0), &(0..3000).rev().collect::<Vec<_>>()), points];
    assert_eq!(noise_sigma(twice.view()).unwrap(), plain);
    let moved = points.mapv(|x| 1e3 * (x + 1e4));
    assert!((noise_sigma(moved.view()).unwrap() / (1e3 * plain) - 1.0).abs() < 1e-2);
    let mut spoiled = points.clone();
    spoiled.outer_iter_mut().step_by(50).for_each(|mut row| row[2] += 0.3 * random.next());
    let found = noise_sigma(spoiled.view()).unwrap();
    assert!((0.8..1.3).contains(&(found / 1e-3)), "{found}");
    // With a fifth of outliers nothing can be told, and nothing is.
    points.outer_iter_mut().step_by(5).for_each(|mut row| row[2] += 0.3 * random.next());
    let found = noise_sigma(points.view()).unwrap();
    assert!(found < 1.3e-3, "{found}");
    for few in [1, 4, 11, 21] {
        let found = noise_sigma(points.select(Axis(0), &(0..few).collect::<Vec<_>>()).view()).unwrap();
        assert!(found.is_finite(), "{few}: {found}");
    }
    assert!(noise_sigma(Array2::zeros((0, 3)).view()).is_err());
}

#[test]
fn relief_finer_than_the_fits_is_not_taken_for_noise() {
    // Twelve waves a side, by 30 points a side: quadrics over ten points leave most of it.
    let rough = |u: f64, v: f64| [u, v, 0.02 * (38.0 * u).sin() * (38.0 * v).cos()];
    let points = shape(rough, 900, true, &mut Random::new(1));
    let found = noise_sigma(points.view()).unwrap() / 0.01;
    assert!(found < 0.5, "{found} of the relief's standard deviation");
}

#[test]
fn a_large_cloud_is_judged_by_a_part_of_it() {
    let mut random = Random::new(9);
    let points = shape(SHAPES[1].1, 250_000, true, &mut random).mapv(|x| x + 3e-4 * random.normal());
    let found = noise_sigma(points.view()).unwrap() / 3e-4;
    assert!((0.8..1.2).contains(&found), "{found}");
}

#[test]
fn the_rounding_of_coordinates_is_found_and_a_lattice_is_none() {
    let mut random = Random::new(2);
    for (step, places) in [(0.1, 1_i32), (1.0, 0), (0.05, 2), (1e-4, 4)] {
        for offset in [0.0, 5e5] {
            let points =
                shape(SHAPES[1].1, 900, false, &mut random).mapv(|x| ((50.0 * x) / step).round() * step + offset);
            // As a reader would have it: the nearest double of the decimal number.
            let read = |x: f64| format!("{x:.0$}", places as usize).parse::<f64>().unwrap();
            let found = rounding_step(points.mapv(read).view()).unwrap();
            assert!((found / step - 1.0).abs() < 1e-9, "{step} at {offset}: {found}");
        }
    }
    // Heights in whole units over a lattice of any step; the lattice alone; and single precision.
    let grid = Array2::from_shape_fn((1600, 3), |(i, k)| {
        let [x, y] = [i % 40, i / 40].map(|k| 30.0 * k as f64);
        [x, y, 100.0 * (0.005 * x).sin() * (0.004 * y).cos()][k]
    });
    assert_eq!(rounding_step(grid.view()).unwrap(), 0.0);
    let mut whole = grid.clone();
    whole.column_mut(2).mapv_inplace(f64::round);
    assert_eq!(rounding_step(whole.view()).unwrap(), 1.0);
    let single = shape(SHAPES[1].1, 900, false, &mut random).mapv(|x| f64::from((1000.0 + x) as f32));
    assert_eq!(rounding_step(single.view()).unwrap(), 2_f64.powi(9 - 23));
    let exact = shape(SHAPES[1].1, 900, false, &mut random);
    assert_eq!(rounding_step(exact.view()).unwrap(), 0.0);
    // Few steps of many points are rounding, whatever the lattice.
    let mut coarse = grid.clone();
    coarse.column_mut(2).mapv_inplace(|z| (z / 20.0).round() * 20.0);
    assert_eq!(rounding_step(coarse.view()).unwrap(), 20.0);
    // Few steps of few points are the shape.
    let saddle = Array2::from_shape_fn((18, 3), |(i, k)| {
        let [u, v] = [(i / 3) as f64 / 5.0, (i % 3) as f64 / 2.0];
        [u, v, u * v][k]
    });
    assert_eq!(rounding_step(saddle.view()).unwrap(), 0.0);
}

#[test]
fn relief_is_measured_over_the_best_plane_without_the_few() {
    for (seed, height) in [0.0, 1e-3, 0.2].into_iter().enumerate() {
        let mut random = Random::new(seed as u64);
        let mut points = Array2::from_shape_fn((4000, 3), |_| random.next());
        points.column_mut(2).mapv_inplace(|z| height * z);
        // Turned, and one point in 500 far off.
        let (c, s) = (0.8, 0.6);
        for (i, mut row) in points.outer_iter_mut().enumerate() {
            let [x, z] = [5.0 * row[0], row[2] + if i % 500 == 3 { 3.0 } else { 0.0 }];
            (row[0], row[1], row[2]) = (c * x - s * z, 4.0 * row[1], s * x + c * z);
        }
        let found = relief(points.view()).unwrap();
        assert!((found - 0.98 * height).abs() < 0.03 * height + 0.002, "{height}: {found}");
    }
}

/// A lattice of triangles over points in rows, open, or closed along the rows.
fn lattice_triangles(rows: u32, columns: u32, closed: bool) -> Vec<[u32; 3]> {
    let last = if closed { columns } else { columns - 1 };
    let mut triangles = Vec::new();
    for (i, j) in (0..rows - 1).flat_map(|i| (0..last).map(move |j| (i, j))) {
        let at = |i: u32, j: u32| i * columns + j % columns;
        triangles.push([at(i, j), at(i, j + 1), at(i + 1, j + 1)]);
        triangles.push([at(i, j), at(i + 1, j + 1), at(i + 1, j)]);
    }
    triangles
}

/// An elliptic tube of two half axes and a length.
fn tube(a: f64, b: f64, length: f64, rows: usize, columns: usize) -> Array2<f64> {
    Array2::from_shape_fn((rows * columns, 3), |(i, k)| {
        let t = 2.0 * PI * (i % columns) as f64 / columns as f64;
        [a * t.cos(), b * t.sin(), length * (i / columns) as f64 / (rows - 1) as f64][k]
    })
}

#[test]
fn the_thickness_of_flat_tubes_and_folded_sheets_is_found() {
    for (a, b) in [(1.0, 0.02), (0.5, 0.05), (0.3, 0.3)] {
        let points = tube(a, b, 4.0, 60, 120);
        let found = thickness(points.view(), &lattice_triangles(60, 120, true)).unwrap().unwrap();
        // Over x = a cos t an ellipse is 2 b sin t thick, and the area of a flat one is even in x. Near its edges the two sides are too
        // steep against each other to be a wall. A circle is as thick everywhere.
        let expected = if a == b { 2.0 * b } else { 2.0 * b * (1.0_f64 - 0.95 * 0.95).sqrt() };
        assert!((0.5..2.0).contains(&(found / expected)), "{a} by {b}: {found} for {expected}");
        if b >= 0.1 {
            let of_cloud = thickness_of_cloud(points.view()).unwrap().unwrap();
            assert!((0.5..2.0).contains(&(of_cloud / expected)), "{a} by {b}: {of_cloud} for {expected}");
        }
    }
    // A sheet bent round by 180°: two halves, 0.2 apart.
    let folded = Array2::from_shape_fn((40 * 200, 3), |(i, k)| {
        let s = 3.0 * ((i % 200) as f64 / 199.0 - 0.5);
        let (x, z) = match s {
            s if s.abs() < 0.05 * PI => (-0.1 * (s / 0.1).cos(), 0.1 * (s / 0.1).sin()),
            s => (s.abs() - 0.05 * PI, 0.1 * s.signum()),
        };
        [x, (i / 200) as f64 / 39.0, z][k]
    });
    let found = thickness(folded.view(), &lattice_triangles(40, 200, false)).unwrap().unwrap();
    assert!((found - 0.2).abs() < 0.01, "{found}");
}

#[test]
fn a_sheet_whose_sides_do_not_face_each_other_has_no_thickness() {
    for (name, of) in &SHAPES[..2] {
        let points = shape(*of, 2500, true, &mut Random::new(0));
        assert_eq!(thickness(points.view(), &lattice_triangles(50, 50, false)).unwrap(), None, "{name}");
        assert_eq!(thickness_of_cloud(points.view()).unwrap(), None, "{name}");
    }
}

#[test]
fn the_radius_of_a_tube_is_that_of_its_thin_rings() {
    for radius in [0.01, 0.5] {
        let mut points = tube(1.0, 1.0, 10.0, 80, 60);
        let along: Vec<f64> = points.column(2).iter().map(|z| z / 10.0).collect();
        for (mut row, t) in points.outer_iter_mut().zip(&along) {
            // A cone that is bent.
            let r = radius * (1.0 + t);
            (row[0], row[1]) = (r * row[0] + 0.1 * t * t, r * row[1]);
        }
        let found = ring_radius(points.view(), &along).unwrap();
        assert!((found / radius - 1.0).abs() < 0.2, "{radius}: {found}");
    }
}
