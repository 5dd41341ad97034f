//! Tori, round and flat, thin and thick, with wavy tubes.

use std::f64::consts::{PI, TAU};

use anyhow::Result;
use rand_chacha::ChaCha8Rng;

use super::draw::{between, rotation, whole};
use super::implicit;
use super::part::{Made, Part, Point, ROW};
use super::rings::Ring;

/// The section of the tube at an angle θ is an ellipse with half axes `flat` r and r, r = `tube` (1 + `swell` cos(n θ)), its middle
/// at a distance 1 from the axis and at the height `lift` sin(m θ).
#[derive(Clone, Copy)]
struct Torus {
    tube: f64,
    flat: f64,
    swell: (f64, f64),
    lift: (f64, f64),
}

impl Torus {
    fn field(self, [x, y, z]: Point) -> f64 {
        let angle = y.atan2(x);
        let out = (x.hypot(y) - 1.0) / self.flat;
        let up = z - self.lift.0 * (self.lift.1 * angle).sin();
        out.hypot(up) - self.tube * (1.0 + self.swell.0 * (self.swell.1 * angle).cos())
    }

    /// By Pappus: the area of the section times the way of its middle, which swells do not change.
    fn volume(self) -> f64 {
        TAU * PI * self.flat * self.tube.powi(2) * (1.0 + 0.5 * self.swell.0.powi(2))
    }
}

/// Every third one is plain, of rings; the others are cut out of a grid: wavy, flat or lifted.
pub(super) fn make(number: usize, random: &mut ChaCha8Rng) -> Result<Made> {
    // From thin to thick.
    let tube = [0.12, 0.3, 0.62, 0.2, 0.45, 0.25][number % 6] * between(random, 0.9, 1.1);
    let mut torus = Torus { tube, flat: 1.0, swell: (0.0, 1.0), lift: (0.0, 1.0) };
    let mut part = if number.is_multiple_of(3) {
        of_rings(torus, whole(random, 16, 32))
    } else {
        let waves = whole(random, 2, 5) as f64;
        match number % 4 {
            0 | 1 => torus.swell = (between(random, 0.1, 0.25), waves),
            2 => torus.lift = (between(random, 0.1, 0.25), waves.min(3.0)),
            _ => torus.flat = between(random, 0.6, 1.4),
        }
        let width = 1.0 + 1.05 * torus.tube * torus.flat.max(1.0) * (1.0 + torus.swell.0);
        let height = 1.05 * torus.tube * (1.0 + torus.swell.0) + torus.lift.0;
        let triangles = whole(random, 2500, 9000);
        implicit::meshed(&|p| torus.field(p), [width, width, height], 1, triangles, random)?
    };
    let size = between(random, 5.0, 50.0);
    part.points.iter_mut().flatten().for_each(|x| *x *= size);
    Ok(Made { part: part.turned(rotation(random)), genus: 1, volume: Some(torus.volume() * size.powi(3)) })
}

/// A plain torus with so many vertices round the tube.
fn of_rings(torus: Torus, around: usize) -> Part {
    let mut part = Part::default();
    let edge = TAU * torus.tube / around as f64 / ROW;
    // An even number of rings, so that the first and the last are turned by half an edge too.
    let around = around + around % 2;
    let mut rings: Vec<Ring> = (0..around)
        .map(|k| {
            let (sin, cos) = (TAU * k as f64 / around as f64).sin_cos();
            Ring::circle(&mut part, 1.0 + torus.tube * cos, torus.tube * sin, edge, k % 2 == 1)
        })
        .collect();
    rings.push(rings[0].clone());
    rings.windows(2).for_each(|two| two[0].strip(&two[1], &mut part));
    part
}
