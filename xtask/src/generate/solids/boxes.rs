//! Boxes with rounded edges; their faces are flat.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use anyhow::Result;
use rand_chacha::ChaCha8Rng;

use super::draw::{between, rotation};
use super::outline::{Section, rounded};
use super::part::{Made, Part, ROUND, ROW};
use super::planar::cap;
use super::rings::Ring;

/// Rows over a rounded edge.
const ROWS: usize = 4;
/// Longest edge, in radii of the rounding: triangles there are not drawn out by more than 1 : 4.
const MOST_RADII: f64 = 1.5;

/// A box whose upright edges are rounded by one radius, and the edges of bottom and top by others, which are no larger.
#[derive(Clone, Copy, Debug)]
struct Rounded {
    sides: [f64; 3],
    upright: f64,
    bottom: f64,
    top: f64,
}

impl Rounded {
    /// The section, `inset` inside the walls.
    fn outline(&self, inset: f64) -> Vec<Section> {
        let [x, y] = [0.5 * self.sides[0], 0.5 * self.sides[1]];
        let corners = [[-x, -y], [x, -y], [x, y], [-x, y]];
        if self.upright == 0.0 {
            return rounded(&corners, &[0.0; 4]);
        }
        let mut outline = rounded(&corners, &[self.upright; 4]);
        for (k, section) in outline.iter_mut().enumerate() {
            match section {
                Section::Arc { radius, .. } => *radius -= inset,
                Section::Line(a, b) => {
                    // Lines follow arcs, that of the front first.
                    let into = [[0.0, 1.0], [-1.0, 0.0], [0.0, -1.0], [1.0, 0.0]][k / 2];
                    for end in [a, b] {
                        *end = [end[0] + inset * into[0], end[1] + inset * into[1]];
                    }
                }
            }
        }
        outline
    }

    /// Area of the section: with d the inset and R the radius, (a − 2 d)(b − 2 d) − (4 − π)(R − d)², integrated over the height.
    /// Over a rounded edge d = r (1 − cos φ), z = r sin φ.
    fn volume(&self) -> f64 {
        let [a, b, c] = self.sides;
        let missing = |r: f64| {
            let (first, second) = (r * r * (1.0 - FRAC_PI_4), r.powi(3) * (5.0 / 3.0 - FRAC_PI_2));
            let rest = (4.0 - PI) * (second - 2.0 * self.upright * first);
            2.0 * (a + b) * first - 4.0 * second + rest
        };
        (a * b - (4.0 - PI) * self.upright.powi(2)) * c - missing(self.bottom) - missing(self.top)
    }

    /// Insets and heights of the rings, from below.
    fn rows(&self, edge: f64) -> Vec<[f64; 2]> {
        let height = self.sides[2];
        let fillet = |r: f64, k: usize| {
            // A corner of the same radius ends as a point: without round-off.
            if k == ROWS {
                return [r, 0.0];
            }
            let (sin, cos) = (FRAC_PI_2 * k as f64 / ROWS as f64).sin_cos();
            [r * (1.0 - cos), r * (1.0 - sin)]
        };
        let mut rows = Vec::new();
        if self.bottom > 0.0 {
            rows.extend((1..=ROWS).rev().map(|k| fillet(self.bottom, k)));
        }
        let wall = height - self.bottom - self.top;
        let count = (wall / (ROW * edge)).round().max(1.0) as usize;
        rows.extend((0..=count).map(|k| [0.0, self.bottom + wall * k as f64 / count as f64]));
        if self.top > 0.0 {
            rows.extend((1..=ROWS).map(|k| fillet(self.top, k)).map(|[inset, z]| [inset, height - z]));
        }
        rows
    }
}

/// The number-th one: sharp, rounded all over by one radius or by two, only upright edges, only the top.
pub(super) fn make(number: usize, random: &mut ChaCha8Rng) -> Result<Made> {
    let size = between(random, 20.0, 80.0);
    let sides = [size, size * between(random, 0.5, 1.0), size * between(random, 0.3, 0.9)];
    let least = sides[1].min(sides[2]);
    let large = least * between(random, 0.2, 0.4);
    let small = large * between(random, 0.35, 0.7);
    let [upright, bottom, top] = match number % 6 {
        0 if number == 0 => [0.0; 3],
        0 => [large, 0.0, large],
        1 => [large; 3],
        2 => [large, small, small],
        3 => [large, 0.0, 0.0],
        4 => [large, 0.5 * small, small],
        _ => [large, 0.0, small],
    };
    let shape = Rounded { sides, upright, bottom, top };
    let least_radius = [upright, bottom, top].into_iter().filter(|&r| r > 0.0).fold(f64::INFINITY, f64::min);
    let edge = (size / between(random, 10.0, 18.0)).min(MOST_RADII * least_radius);
    let part = meshed(&shape, edge, random)?;
    // Half of them stand straight.
    let part = if number.is_multiple_of(2) { part } else { part.turned(rotation(random)) };
    Ok(Made { part, genus: 0, volume: Some(shape.volume()) })
}

fn meshed(shape: &Rounded, edge: f64, random: &mut ChaCha8Rng) -> Result<Part> {
    let mut part = Part::default();
    let lengths = [edge, edge.min(ROUND * shape.upright)];
    let rings: Vec<(Ring, Vec<Section>)> = shape
        .rows(edge)
        .into_iter()
        .enumerate()
        .map(|(k, [inset, z])| {
            let outline = shape.outline(inset);
            (Ring::outline(&mut part, &outline, z, lengths, k % 2 == 1), outline)
        })
        .collect();
    for two in rings.windows(2) {
        let [(below, outline), (above, _)] = two else { continue };
        below.strip(above, &mut part);
        below.sharpen_corners(above, outline, &mut part);
    }
    let ends = [(&rings[0].0, shape.bottom, false), (&rings[rings.len() - 1].0, shape.top, true)];
    for (ring, radius, up) in ends {
        if radius == 0.0 {
            ring.sharpen(&mut part);
        }
        cap(&mut part, &[ring.corners()], edge, up, random)?;
    }
    Ok(part)
}
