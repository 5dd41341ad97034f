//! Splits triangles, and evens them out, until there are enough to draw a layout on.

use std::collections::BTreeSet;

use super::mesh::WorkMesh;
use crate::edge::sides;

/// Triangles that a layout is drawn on, at least: arcs between patches follow edges first.
///
/// Limit: with 40 patches an arc has some 10 edges.
const TRIANGLES: f64 = 5_000.0;

/// Rounds of halving. Limit: each halves edges that are the longest of both their faces, of which some are left in each round.
const ROUNDS: usize = 60;

/// Edges longer than this times the side of an even triangulation of [`TRIANGLES`] are halved.
const LONG: f64 = 1.5;

/// Halves long edges.
pub(super) fn refine(mesh: &mut WorkMesh) {
    let area: f64 = (0..mesh.faces.len()).map(|face| mesh.area(face)).sum();
    let longest = LONG * (4.0 * area / (3.0_f64.sqrt() * TRIANGLES)).sqrt();
    mesh.flip();
    for _ in 0..ROUNDS {
        let long = longest_of_both(mesh, longest);
        if long.is_empty() {
            return;
        }
        mesh.halve(&long);
        mesh.flip();
    }
}

/// Edges longer than a length that are the longest of both their faces. To halve others too would leave slivers slivers.
fn longest_of_both(mesh: &WorkMesh, least: f64) -> BTreeSet<[u32; 2]> {
    let longest = |&face: &[u32; 3]| {
        let sides = sides(face).map(|side| (mesh.length(side[0], side[1]), side));
        sides.into_iter().reduce(|p, q| if (q.0, q.1) > (p.0, p.1) { q } else { p })
    };
    let mut found: Vec<[u32; 2]> =
        mesh.faces.iter().filter_map(longest).filter(|(length, _)| *length > least).map(|(_, side)| side).collect();
    found.sort_unstable();
    found.chunk_by(|a, b| a == b).filter(|run| run.len() == 2).map(|run| run[0]).collect()
}

/// Splits until each face touches creases in a vertex or in one sharp edge and nowhere else.
pub(super) fn part_from_creases(mesh: &mut WorkMesh) {
    let on_crease: BTreeSet<u32> = mesh.sharp.iter().flatten().copied().collect();
    let is_bridge = |side: &[u32; 2]| side.iter().all(|v| on_crease.contains(v)) && !mesh.sharp.contains(side);
    let bridges = mesh.faces.iter().flat_map(|&face| sides(face)).filter(is_bridge).collect();
    mesh.halve(&bridges);
    for face in 0..mesh.faces.len() {
        let sharp = sides(mesh.faces[face]).iter().filter(|side| mesh.sharp.contains(*side)).count();
        if sharp > 1 {
            mesh.cut_at_centre(face);
        }
    }
}
