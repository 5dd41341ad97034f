//! Shapes of genus 2 to 5: tori and rods along the edges of graphs, blended.

use std::f64::consts::{PI, TAU};

use anyhow::Result;
use point_cloud::vec3::{dot, norm, sub};
use rand_chacha::ChaCha8Rng;

use super::draw::{between, rotation, whole};
use super::implicit;
use super::part::{Made, Point, along};

/// Width of blends, in radii of the tubes.
const BLEND: f64 = 0.8;
/// Stretches of a bent rod.
const STRETCHES: usize = 6;
/// Triangles of the largest one.
const MOST_TRIANGLES: usize = 50_000;

/// What is blended.
#[derive(Clone, Copy)]
enum Piece {
    /// A rod with round ends.
    Rod(Point, Point),
    /// A ring of radius 1 round a middle, in the plane of x and y or that of x and z.
    Ring { middle: Point, upright: bool },
}

impl Piece {
    /// The distance from the middle of the tube.
    fn distance(self, p: Point) -> f64 {
        match self {
            Self::Rod(a, b) => {
                let (way, to) = (sub(b, a), sub(p, a));
                norm(sub(p, along(a, (dot(way, to) / dot(way, way)).clamp(0.0, 1.0), way)))
            }
            Self::Ring { middle, upright } => {
                let [x, y, z] = sub(p, middle);
                let (flat, up) = if upright { (x.hypot(z), y) } else { (x.hypot(y), z) };
                (flat - 1.0).hypot(up)
            }
        }
    }
}

/// The number-th one, and its genus: twelve, and again from the first.
pub(super) fn make(number: usize, random: &mut ChaCha8Rng) -> Result<Made> {
    let (pieces, genus) = match number % 12 {
        0 => rings(2, false),
        1 => strands(3),
        2 => rings(2, true),
        3 => rods(&tetrahedron(), &[[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]], random),
        4 => strands(4),
        5 => rings(3, false),
        6 => rods(&prism(3), &ladder(3), random),
        7 => rods(&pyramid(4), &spokes(4), random),
        8 => strands(5),
        9 => rods(&prism(4), &ladder(4), random),
        10 => rings(4, true),
        _ => rods(&pyramid(5), &spokes(5), random),
    };
    let tube = between(random, 0.17, 0.26);
    let width = BLEND * tube;
    let field = |p: Point| {
        let distances: Vec<f64> = pieces.iter().map(|piece| piece.distance(p) - tube).collect();
        let least = distances.iter().copied().fold(f64::INFINITY, f64::min);
        // A smooth least distance; the nearest is taken out, so that nothing overflows.
        least - width * distances.iter().map(|d| ((least - d) / width).exp()).sum::<f64>().ln()
    };
    let mut half = [0.0_f64; 3];
    for piece in &pieces {
        let ends = match *piece {
            Piece::Rod(a, b) => [a, b],
            Piece::Ring { middle, upright } => {
                let reach = if upright { [1.0, 0.0, 1.0] } else { [1.0, 1.0, 0.0] };
                [along(middle, 1.0, reach), along(middle, -1.0, reach)]
            }
        };
        ends.iter().for_each(|end| (0..3).for_each(|k| half[k] = half[k].max(end[k].abs())));
    }
    let half = half.map(|x| x + tube + 4.0 * width);
    let triangles = if number == 4 { MOST_TRIANGLES } else { whole(random, 6000, 20_000) };
    let mut part = implicit::meshed(&field, half, genus, triangles, random)?;
    let size = between(random, 5.0, 50.0);
    part.points.iter_mut().flatten().for_each(|x| *x *= size);
    Ok(Made { part: part.turned(rotation(random)), genus, volume: None })
}

/// Rings in a row that touch each other; every second one upright, if they are crossed.
fn rings(count: usize, crossed: bool) -> (Vec<Piece>, usize) {
    let ring = |k: usize| {
        let x = 2.0 * (k as f64 - 0.5 * (count - 1) as f64);
        Piece::Ring { middle: [x, 0.0, 0.0], upright: crossed && k % 2 == 1 }
    };
    ((0..count).map(ring).collect(), count)
}

/// Two poles, joined by bent rods.
fn strands(count: usize) -> (Vec<Piece>, usize) {
    let mut pieces = Vec::new();
    for strand in 0..count {
        let (sin, cos) = (TAU * strand as f64 / count as f64).sin_cos();
        let at = |k: usize| {
            let (out, up) = (PI * k as f64 / STRETCHES as f64).sin_cos();
            [1.2 * out * cos, 1.2 * out * sin, up]
        };
        pieces.extend((0..STRETCHES).map(|k| Piece::Rod(at(k), at(k + 1))));
    }
    (pieces, count - 1)
}

/// Rods along the edges of a graph, whose nodes are moved a little.
fn rods(nodes: &[Point], edges: &[[usize; 2]], random: &mut ChaCha8Rng) -> (Vec<Piece>, usize) {
    let moved: Vec<Point> = nodes.iter().map(|node| node.map(|x| x + between(random, -0.1, 0.1))).collect();
    (edges.iter().map(|&[a, b]| Piece::Rod(moved[a], moved[b])).collect(), edges.len() + 1 - nodes.len())
}

fn tetrahedron() -> Vec<Point> {
    vec![[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]]
}

fn polygon(sides: usize, radius: f64, z: f64) -> Vec<Point> {
    (0..sides)
        .map(|k| (TAU * k as f64 / sides as f64).sin_cos())
        .map(|(sin, cos)| [radius * cos, radius * sin, z])
        .collect()
}

fn prism(sides: usize) -> Vec<Point> {
    [polygon(sides, 1.2, -0.8), polygon(sides, 1.2, 0.8)].concat()
}

/// The edges of a prism.
fn ladder(sides: usize) -> Vec<[usize; 2]> {
    (0..sides).flat_map(|k| [[k, (k + 1) % sides], [sides + k, sides + (k + 1) % sides], [k, sides + k]]).collect()
}

fn pyramid(sides: usize) -> Vec<Point> {
    [polygon(sides, 1.7, -0.5), vec![[0.0, 0.0, 1.0]]].concat()
}

/// The edges of a pyramid.
fn spokes(sides: usize) -> Vec<[usize; 2]> {
    (0..sides).flat_map(|k| [[k, (k + 1) % sides], [k, sides]]).collect()
}
