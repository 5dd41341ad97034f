//! Revolved parts: stepped profiles with sharp and rounded corners, with and without a bore.

use std::f64::consts::PI;

use anyhow::Result;
use rand_chacha::ChaCha8Rng;

use super::draw::{between, rotation};
use super::outline::{Section, rounded};
use super::part::{Made, Part, ROW};
use super::rings::Ring;

/// Edges of a ring are at most that many times as long as the rows beside it are high.
const MOST_DRAWN_OUT: f64 = 3.0;
/// Largest radius of a rounded corner, in the shorter of both sides: two corners leave some of it.
const MOST_OF_SIDE: f64 = 0.4;
/// Parts in which a section is integrated, by Simpson's rule.
const PARTS: usize = 400;

/// The number-th one; every second has a bore.
pub(super) fn make(number: usize, random: &mut ChaCha8Rng) -> Result<Made> {
    let bored = number % 2 == 1;
    let steps = 1 + number % 4;
    let size = between(random, 10.0, 40.0);
    let mut points = Vec::new();
    let (mut z, mut least) = (0.0, f64::INFINITY);
    let mut radius = size * between(random, 0.6, 1.0);
    for step in 0..steps {
        points.push([radius, z]);
        z += size * between(random, 0.4, 0.9);
        points.push([radius, z]);
        least = least.min(radius);
        // Steps go in and out by turns.
        radius *= if step.is_multiple_of(2) { between(random, 0.45, 0.7) } else { between(random, 1.3, 1.7) };
    }
    let (count, inner) = (points.len(), if bored { least * between(random, 0.35, 0.65) } else { 0.0 });
    points.extend([[inner, z], [inner, 0.0]]);
    // Sharp and rounded corners by turns; those on the axis or in the bore stay sharp.
    let side = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
    let radii: Vec<f64> = (0..points.len())
        .map(|k| {
            if k >= count || (k + number / 2).is_multiple_of(3) || number.is_multiple_of(5) {
                return 0.0;
            }
            let before = points[(k + points.len() - 1) % points.len()];
            let shorter = side(before, points[k]).min(side(points[k], points[k + 1]));
            (size * between(random, 0.06, 0.12)).min(MOST_OF_SIDE * shorter)
        })
        .collect();
    let mut profile = rounded(&points, &radii);
    if !bored {
        // The last section but one lies on the axis, and the last one, the bottom, is where the profile begins.
        profile.remove(profile.len() - 2);
        profile.rotate_right(1);
    }
    let edge = size / between(random, 7.0, 12.0);
    let part = meshed(&profile, bored, edge);
    let part = if number % 4 < 2 { part } else { part.turned(rotation(random)) };
    Ok(Made { part, genus: usize::from(bored), volume: Some(profile.iter().map(inside).sum()) })
}

/// π ∫ r² dz along a section.
fn inside(section: &Section) -> f64 {
    let rate = |t: f64| {
        let [r, _] = section.at(t);
        r * r * section.direction(t)[1] * section.length()
    };
    let h = 1.0 / PARTS as f64;
    let part = |k: usize| {
        let t = k as f64 * h;
        (rate(t) + 4.0 * rate(t + 0.5 * h) + rate(t + h)) * h / 6.0
    };
    PI * (0..PARTS).map(part).sum::<f64>()
}

/// A ring of the part: radius, height, height of the row that follows, and whether it is a crease.
struct Row {
    place: [f64; 2],
    next: f64,
    sharp: bool,
}

fn meshed(profile: &[Section], closed: bool, edge: f64) -> Part {
    let mut rows: Vec<Row> = Vec::new();
    for (number, section) in profile.iter().enumerate() {
        let fine = match section {
            Section::Arc { radius, .. } => (ROW * edge).min(0.5 * radius),
            Section::Line(..) => ROW * edge,
        };
        let inner = section.inner([fine; 2], false);
        let next = section.length() / (inner.len() + 1) as f64;
        let before = &profile[(number + profile.len() - 1) % profile.len()];
        let on_axis = section.at(0.0)[0] == 0.0;
        let sharp = !on_axis && section.starts_sharp(before);
        rows.push(Row { place: section.at(0.0), next, sharp });
        rows.extend(inner.into_iter().map(|t| Row { place: section.at(t), next, sharp: false }));
    }
    if !closed {
        let end = profile[profile.len() - 1].at(1.0);
        rows.push(Row { place: end, next: f64::INFINITY, sharp: false });
    }
    let mut part = Part::default();
    let mut rings: Vec<Ring> = Vec::new();
    for (k, row) in rows.iter().enumerate() {
        let before = rows[(k + rows.len() - 1) % rows.len()].next;
        let length = edge.min(MOST_DRAWN_OUT * before.min(row.next));
        let ring = Ring::circle(&mut part, row.place[0], row.place[1], length, k % 2 == 1);
        if row.sharp {
            ring.sharpen(&mut part);
        }
        rings.push(ring);
    }
    if closed {
        rings.push(rings[0].clone());
    }
    rings.windows(2).for_each(|two| two[0].strip(&two[1], &mut part));
    part
}
