//! Plates and blocks with round through holes.

use std::f64::consts::{PI, TAU};

use anyhow::{Result, ensure};
use rand_chacha::ChaCha8Rng;

use super::draw::{between, rotation};
use super::outline::{Section, area, rounded};
use super::part::{Made, Part, ROUND, ROW};
use super::planar::cap;
use super::rings::Ring;

/// Places that are drawn for a hole before there is none.
const DRAWS: usize = 10_000;
/// Least distance between holes, and from holes to the outline, in sizes of the part.
const APART: f64 = 0.06;
/// Points of a section from which holes keep away.
const LOOKED_AT: usize = 40;

/// A hole: middle and radius.
type Hole = ([f64; 2], f64);

/// The number-th one: rectangular, L-shaped, and both with rounded corners, as plates and blocks, with 1 to 5 holes.
pub(super) fn make(number: usize, random: &mut ChaCha8Rng) -> Result<Made> {
    let size = between(random, 30.0, 90.0);
    let depth = size * between(random, 0.6, 0.9);
    let arm = size * between(random, 0.38, 0.5);
    let rectangle = vec![[0.0, 0.0], [size, 0.0], [size, depth], [0.0, depth]];
    let bent = vec![[0.0, 0.0], [size, 0.0], [size, arm], [arm, arm], [arm, size], [0.0, size]];
    let corners = if number.is_multiple_of(2) { rectangle } else { bent };
    let radius = if number % 4 < 2 { 0.0 } else { size * between(random, 0.06, 0.12) };
    let outline = rounded(&corners, &vec![radius; corners.len()]);
    let count = 1 + number % 5;
    let holes = holes(&outline, size, count, random)?;
    // Plates and blocks by turns of three.
    let height = size * if number.is_multiple_of(3) { between(random, 0.3, 0.5) } else { between(random, 0.08, 0.2) };
    let edge = (size / between(random, 11.0, 20.0)).min(height);
    let part = meshed(&outline, &holes, height, edge, random)?;
    let drilled: f64 = holes.iter().map(|(_, radius)| PI * radius * radius).sum();
    let part = if number.is_multiple_of(2) { part } else { part.turned(rotation(random)) };
    Ok(Made { part, genus: count, volume: Some((area(&outline) - drilled) * height) })
}

/// Holes inside the outline that keep away from it and from each other.
fn holes(outline: &[Section], size: f64, count: usize, random: &mut ChaCha8Rng) -> Result<Vec<Hole>> {
    let rim: Vec<[f64; 2]> =
        outline.iter().flat_map(|section| (0..LOOKED_AT).map(|k| section.at(k as f64 / LOOKED_AT as f64))).collect();
    let winding = |p: [f64; 2]| {
        (0..rim.len())
            .map(|k| {
                let (a, b) = (rim[k], rim[(k + 1) % rim.len()]);
                let (a, b) = ([a[0] - p[0], a[1] - p[1]], [b[0] - p[0], b[1] - p[1]]);
                (a[0] * b[1] - a[1] * b[0]).atan2(a[0] * b[0] + a[1] * b[1])
            })
            .sum::<f64>()
    };
    let apart = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
    let mut holes: Vec<Hole> = Vec::new();
    for _ in 0..DRAWS {
        if holes.len() == count {
            break;
        }
        let middle = [between(random, 0.0, size), between(random, 0.0, size)];
        let radius = size * between(random, 0.05, 0.12);
        let clear = radius + APART * size;
        let is_free = winding(middle) > PI
            && rim.iter().all(|&p| apart(p, middle) > clear)
            && holes.iter().all(|&(other, its)| apart(other, middle) > clear + its);
        if is_free {
            holes.push((middle, radius));
        }
    }
    ensure!(holes.len() == count, "there is room for {} of {count} holes", holes.len());
    Ok(holes)
}

fn meshed(outline: &[Section], holes: &[Hole], height: f64, edge: f64, random: &mut ChaCha8Rng) -> Result<Part> {
    let mut part = Part::default();
    let least = outline.iter().fold(f64::INFINITY, |least, section| match section {
        Section::Arc { radius, .. } => least.min(*radius),
        Section::Line(..) => least,
    });
    let (mut bottoms, mut tops) = (Vec::new(), Vec::new());
    let mut wall = |outline: &[Section], lengths: [f64; 2], row: f64, part: &mut Part| {
        let rows = (height / row).round().max(1.0) as usize;
        let rings: Vec<Ring> = (0..=rows)
            .map(|k| Ring::outline(part, outline, height * k as f64 / rows as f64, lengths, k % 2 == 1))
            .collect();
        for two in rings.windows(2) {
            two[0].strip(&two[1], part);
            two[0].sharpen_corners(&two[1], outline, part);
        }
        let ends = [&rings[0], &rings[rows]];
        ends.iter().for_each(|ring| ring.sharpen(part));
        bottoms.push(ends[0].corners());
        tops.push(ends[1].corners());
    };
    wall(outline, [edge, edge.min(ROUND * least)], ROW * edge, &mut part);
    for &(centre, radius) in holes {
        let length = edge.min(ROUND * radius);
        // Clockwise: the wall looks at the axis.
        wall(&[Section::Arc { centre, radius, from: 0.0, to: -TAU }], [length; 2], length, &mut part);
    }
    cap(&mut part, &bottoms, edge, false, random)?;
    cap(&mut part, &tops, edge, true, random)?;
    Ok(part)
}
