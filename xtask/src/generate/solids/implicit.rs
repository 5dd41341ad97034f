//! Meshes of a given number of triangles over surfaces where a function is 0.

use anyhow::Result;
use point_cloud::vec3::norm;
use rand_chacha::ChaCha8Rng;

use super::draw::between;
use super::nets;
use super::part::{Part, Point};
use super::relax::relax;

/// Edges of the grid that the number of triangles is estimated with, a diagonal of the box.
const FIRST_EDGES: f64 = 60.0;
/// Share of an edge by which the grid is moved at most.
const SHIFT: f64 = 0.9;
/// Grids that are tried after the first.
///
/// Limit: few fail; a shape that is too fine for its number of triangles fails always.
const MOST_TRIES: usize = 30;

/// The surface of a genus inside the box from −half to half, in about so many triangles.
pub(super) fn meshed(
    field: &dyn Fn(Point) -> f64,
    half: Point,
    genus: usize,
    triangles: usize,
    random: &mut ChaCha8Rng,
) -> Result<Part> {
    let diagonal = 2.0 * norm(half);
    let at = |edge: f64, shift: Point| {
        let low = [0, 1, 2].map(|k| -half[k] - edge * (1.0 + shift[k]));
        nets::surface(field, low, half.map(|x| x + 2.0 * edge), edge)
    };
    let first = diagonal / FIRST_EDGES;
    let found = at(first, [0.0; 3])?.triangles.len();
    let edge = first * (found as f64 / triangles as f64).sqrt();
    // A cell may hold two sheets, which touch in its one vertex: the grid is moved.
    let mut tried = 0;
    let mut part = loop {
        let shift = [(); 3].map(|()| between(random, 0.0, SHIFT));
        match at(edge, shift)?.checked(genus) {
            Ok(part) => break part,
            Err(error) if tried == MOST_TRIES => return Err(error),
            Err(_) => tried += 1,
        }
    };
    relax(&mut part, field, diagonal);
    Ok(part)
}
