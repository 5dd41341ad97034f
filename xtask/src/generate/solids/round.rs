//! Spheres and ellipsoids: geodesic ones, and ones cut out of a grid.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use anyhow::Result;
use point_cloud::vec3::{cross, dot, unit};
use rand_chacha::ChaCha8Rng;

use super::draw::{between, rotation, whole};
use super::implicit;
use super::part::{Made, Part, Point};

/// The number-th one: every third a sphere, the others ellipsoids with axes of up to 1 : 2.5; every second cut out of a grid.
pub(super) fn make(number: usize, random: &mut ChaCha8Rng) -> Result<Made> {
    let axes = if number.is_multiple_of(3) {
        [between(random, 5.0, 40.0); 3]
    } else {
        let size = between(random, 5.0, 40.0);
        [size, size * between(random, 0.6, 1.0), size * between(random, 0.4, 1.0)]
    };
    let part = if number.is_multiple_of(2) {
        let mut part = geodesic(whole(random, 6, 20));
        part.points.iter_mut().for_each(|p| (0..3).for_each(|k| p[k] *= axes[k]));
        part
    } else {
        let field = move |p: Point| (0..3).map(|k| (p[k] / axes[k]).powi(2)).sum::<f64>().sqrt() - 1.0;
        implicit::meshed(&field, axes.map(|a| 1.1 * a), 0, whole(random, 800, 8000), random)?
    };
    let part = part.turned(rotation(random));
    Ok(Made { part, genus: 0, volume: Some(4.0 / 3.0 * PI * axes.iter().product::<f64>()) })
}

/// The unit sphere of 20 n² triangles: those of an icosahedron cut into n² each.
fn geodesic(n: usize) -> Part {
    let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
    let mut corners: Vec<Point> = Vec::new();
    for k in 0..3 {
        for signs in 0..4 {
            let mut p = [0.0; 3];
            p[k] = if signs & 1 == 0 { 1.0 } else { -1.0 };
            p[(k + 1) % 3] = if signs & 2 == 0 { golden } else { -golden };
            corners.push(p);
        }
    }
    let apart = |a: Point, b: Point| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>();
    let mut part = Part::default();
    let mut known: BTreeMap<[i64; 3], usize> = BTreeMap::new();
    for i in 0..12 {
        for j in 0..12 {
            for k in 0..12 {
                // Edges are 2 long; each face once, from its smallest corner, counter-clockwise from outside.
                let sides = [(i, j), (j, k), (k, i)];
                let is_face = sides.iter().all(|&(a, b)| (apart(corners[a], corners[b]) - 4.0).abs() < 1e-9);
                let [a, b, c] = [i, j, k].map(|v| corners[v]);
                let looks_out = dot(a, cross(b, c)) > 0.0;
                if is_face && looks_out && i < j && i < k {
                    divide(&mut part, &mut known, [a, b, c], n);
                }
            }
        }
    }
    part
}

/// Adds a face in n² triangles, with vertices in one place as one.
fn divide(part: &mut Part, known: &mut BTreeMap<[i64; 3], usize>, [a, b, c]: [Point; 3], n: usize) {
    let mut vertex = |i: usize, j: usize| {
        let (u, v) = (i as f64 / n as f64, j as f64 / n as f64);
        let p = unit([0, 1, 2].map(|k| a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k])));
        let place = p.map(|x| (x * 1e8).round() as i64);
        *known.entry(place).or_insert_with(|| part.add(p))
    };
    let mut triangles = Vec::new();
    for i in 0..n {
        for j in 0..n - i {
            triangles.push([vertex(i, j), vertex(i + 1, j), vertex(i, j + 1)]);
            if i + j + 1 < n {
                triangles.push([vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)]);
            }
        }
    }
    part.triangles.extend(triangles);
}
