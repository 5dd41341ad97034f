//! Which edges of a mesh are creases, and whether it has any.

use std::collections::{BTreeMap, BTreeSet};

use point_cloud::vec3::{cross, dot, norm};

use super::mesh::WorkMesh;
use crate::edge::edge;

/// Which edges of a mesh are creases.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CreaseRule {
    /// Those sharper than 40°, if few edges have angles between those of smooth faces and those of creases, or if all of them stand out
    /// among the edges beside them; and blunter ones between facets so large that a smooth surface would bulge far; none otherwise.
    Auto,
    /// Those sharper than this, in degrees.
    Angle(f64),
    /// None.
    Off,
}

/// Edges at which facets meet at more than this, in degrees, are creases if the mesh has any.
const SHARP: f64 = 40.0;

/// Angles between these, in degrees, are rare where a mesh has creases: they lie between those of facets of one smooth face and those of
/// creases. Their length counts against that of edges sharper than [`VERY_SHARP`], or of all that are sharp.
const VALLEY: [f64; 2] = [30.0, 50.0];
const BELOW_SHARP: [f64; 2] = [20.0, 40.0];
const VERY_SHARP: f64 = 60.0;

/// Largest shares of the lengths in the ranges above that a mesh with creases has.
///
/// Calibrated: of 26 meshes, parts with creases have at most 0.05 and 0.61, smooth coarse ones and bones at least 1.4 and 0.9.
const MOST_IN_VALLEY: f64 = 0.4;
const MOST_BELOW_SHARP: f64 = 0.5;

/// A sharp edge stands out if three of the four other edges of its two facets have less than this share of its angle; a mesh in which
/// more than this share of the length of sharp edges stands out has creases, however coarse its roundings are.
///
/// Calibrated: `xtask generate solids`: all edges of every part with creases but two of drilled plates (0.94) stand out; of 11 meshes
/// without creases that have edges above 40°, at most 0.884 of their length (camel).
const STANDS_OUT: f64 = 0.4;
const MOST_STAND_OUT: f64 = 0.92;

/// A surface that is smooth across an edge, at which facets meet at an angle θ and are at least h wide, bulges by h θ / 8. An edge is a
/// crease if that is more than this share of the diagonal, and more than this times the median of all edges within the angles, by length.
///
/// Calibrated: in parts with creases the most that is right is 4.0 medians (dragknob), the least that a wall's edge has is 5.6 (part).
const BULGE: f64 = 0.0025;
const BULGE_OUTLIES: f64 = 5.0;
const BULGING: [f64; 2] = [5.0, 40.0];

/// A crease that ends in a smooth place and is shorter than this share of the diagonal is none.
const SHORT_END: f64 = 0.05;

/// Creases without a closed line are none if they are shorter, as a share of the diagonal.
const SHORT_PIECE: f64 = 0.12;

/// The edges of a mesh, of diagonal 1, that are creases.
pub(super) fn creases(mesh: &WorkMesh, rule: CreaseRule) -> BTreeSet<[u32; 2]> {
    let angles = angles(mesh);
    let least = match rule {
        CreaseRule::Off => return BTreeSet::new(),
        CreaseRule::Angle(degrees) => degrees,
        CreaseRule::Auto if has_creases(mesh, &angles) => SHARP,
        CreaseRule::Auto => return BTreeSet::new(),
    };
    let mut sharp: BTreeSet<[u32; 2]> =
        angles.iter().filter(|(_, angle)| **angle > least).map(|(&side, _)| side).collect();
    if rule == CreaseRule::Auto {
        sharp.extend(blunt_creases(mesh, &angles));
    }
    without_short_ends(mesh, sharp)
}

/// Edges of moderate angles across which a smooth surface would bulge far more than across most.
fn blunt_creases(mesh: &WorkMesh, angles: &BTreeMap<[u32; 2], f64>) -> Vec<[u32; 2]> {
    let mut widths: BTreeMap<[u32; 2], f64> = BTreeMap::new();
    for (face, corners) in mesh.faces.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            let width = 2.0 * mesh.area(face) / mesh.length(a, b).max(f64::MIN_POSITIVE);
            let least = widths.entry(edge(a, b)).or_insert(f64::INFINITY);
            *least = least.min(width);
        }
    }
    let bulging = angles.iter().filter(|(_, angle)| (BULGING[0]..=BULGING[1]).contains(*angle));
    let mut bulges: Vec<(f64, [u32; 2])> =
        bulging.map(|(&side, angle)| (widths[&side] * angle.to_radians() / 8.0, side)).collect();
    bulges.sort_by(|a, b| a.0.total_cmp(&b.0));
    let length = |&(_, [a, b]): &(f64, [u32; 2])| mesh.length(a, b);
    let all: f64 = bulges.iter().map(length).sum();
    let mut below = 0.0;
    let median = bulges.iter().find(|bulge| {
        below += length(bulge);
        below >= 0.5 * all
    });
    let Some(&(median, _)) = median else { return Vec::new() };
    let least = BULGE.max(BULGE_OUTLIES * median);
    bulges.iter().filter(|(bulge, _)| *bulge > least).map(|&(_, side)| side).collect()
}

/// The angle, in degrees, at which facets meet in each edge.
fn angles(mesh: &WorkMesh) -> BTreeMap<[u32; 2], f64> {
    let mut beside: BTreeMap<[u32; 2], Vec<[f64; 3]>> = BTreeMap::new();
    for (face, corners) in mesh.faces.iter().enumerate() {
        for k in 0..3 {
            let side = edge(corners[k], corners[(k + 1) % 3]);
            beside.entry(side).or_default().push(mesh.area_vector(face));
        }
    }
    let angle = |sides: &[[f64; 3]]| match sides {
        [a, b] => norm(cross(*a, *b)).atan2(dot(*a, *b)).to_degrees(),
        _ => 0.0,
    };
    beside.iter().map(|(&side, sides)| (side, angle(sides))).collect()
}

/// Whether few edges have angles between those of smooth faces and those of creases.
fn has_creases(mesh: &WorkMesh, angles: &BTreeMap<[u32; 2], f64>) -> bool {
    let length = |from: f64, to: f64| -> f64 {
        let within = angles.iter().filter(|(_, angle)| (from..to).contains(*angle));
        within.map(|(&[a, b], _)| mesh.length(a, b)).sum()
    };
    let very_sharp = length(VERY_SHARP, 181.0);
    let sharp = length(SHARP, 181.0);
    let gap = length(VALLEY[0], VALLEY[1]) < MOST_IN_VALLEY * very_sharp;
    let has_gap = gap || length(BELOW_SHARP[0], BELOW_SHARP[1]) < MOST_BELOW_SHARP * sharp;
    sharp > SHORT_PIECE && (has_gap || standing_out(mesh, angles) > MOST_STAND_OUT * sharp)
}

/// The length of sharp edges whose angle is far above those of the edges beside them.
fn standing_out(mesh: &WorkMesh, angles: &BTreeMap<[u32; 2], f64>) -> f64 {
    let mut beside: BTreeMap<[u32; 2], Vec<f64>> = BTreeMap::new();
    for corners in &mesh.faces {
        let sides = [0, 1, 2].map(|k| edge(corners[k], corners[(k + 1) % 3]));
        for (k, side) in sides.iter().enumerate().filter(|(_, side)| angles[*side] > SHARP) {
            beside.entry(*side).or_default().extend([1, 2].map(|j| angles[&sides[(k + j) % 3]]));
        }
    }
    let stands_out = |side: &[u32; 2], others: &mut Vec<f64>| {
        others.sort_by(f64::total_cmp);
        matches!(others[..], [_, _, third, _] if third < STANDS_OUT * angles[side])
    };
    beside.iter_mut().filter_map(|(side, others)| stands_out(side, others).then(|| mesh.length(side[0], side[1]))).sum()
}

/// Takes away chains of edges that end in a smooth place, if they are short, and pieces without a closed line, if they are short.
fn without_short_ends(mesh: &WorkMesh, mut sharp: BTreeSet<[u32; 2]>) -> BTreeSet<[u32; 2]> {
    loop {
        let mut at: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for &[a, b] in &sharp {
            at.entry(a).or_default().push(b);
            at.entry(b).or_default().push(a);
        }
        let mut removed = Vec::new();
        for (&end, others) in at.iter().filter(|(_, others)| others.len() == 1) {
            let (mut chain, mut length) = (vec![[end, others[0]]], mesh.length(end, others[0]));
            let (mut before, mut now) = (end, others[0]);
            while let [a, b] = at[&now][..] {
                let next = if a == before { b } else { a };
                length += mesh.length(now, next);
                chain.push([now, next]);
                (before, now) = (now, next);
            }
            let is_piece = at[&now].len() == 1;
            if length < if is_piece { SHORT_PIECE } else { SHORT_END } {
                removed.extend(chain.into_iter().map(|[a, b]| edge(a, b)));
            }
        }
        if removed.is_empty() {
            return sharp;
        }
        removed.iter().for_each(|side| {
            sharp.remove(side);
        });
    }
}
