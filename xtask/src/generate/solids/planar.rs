//! Flat faces: triangles of about one size inside outlines.

use anyhow::{Context as _, Result, ensure};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation as _};

use super::part::{Part, ROW};

/// Least distance of vertices inside from outlines, in edges: nearer ones make flat triangles.
const FROM_OUTLINE: f64 = 0.65;
/// How far vertices are moved at random, in edges: triangles of a mesher are not all alike.
const JITTER: f64 = 0.12;

/// Adds the triangles of the plane region at height `z` inside the first ring of vertices and outside the others, looking up or down.
pub(super) fn cap(part: &mut Part, rings: &[Vec<usize>], edge: f64, up: bool, random: &mut ChaCha8Rng) -> Result<()> {
    let z = part.points[rings[0][0]][2];
    let flat = |part: &Part, v: usize| [part.points[v][0], part.points[v][1]];
    let outlines: Vec<Vec<[f64; 2]>> = rings.iter().map(|ring| ring.iter().map(|&v| flat(part, v)).collect()).collect();
    let mut numbers: Vec<usize> = rings.concat();
    let mut mesh = ConstrainedDelaunayTriangulation::<Point2<f64>>::new();
    for ring in &outlines {
        let handles = ring
            .iter()
            .map(|p| mesh.insert(Point2::new(p[0], p[1])))
            .collect::<Result<Vec<_>, _>>()
            .context("an outline cannot be triangulated")?;
        for k in 0..handles.len() {
            let (from, to) = (handles[k], handles[(k + 1) % handles.len()]);
            ensure!(mesh.can_add_constraint(from, to), "outlines cross each other");
            mesh.add_constraint(from, to);
        }
    }
    ensure!(mesh.num_vertices() == numbers.len(), "two vertices of outlines are in one place");
    for p in inside(&outlines, edge, random) {
        mesh.insert(Point2::new(p[0], p[1])).context("a flat face cannot be triangulated")?;
        numbers.push(part.add([p[0], p[1], z]));
    }
    ensure!(mesh.num_vertices() == numbers.len(), "two vertices of a flat face are in one place");
    let mut triangles = inner(&mesh);
    for t in &mut triangles {
        let smallest = (0..3).min_by_key(|&k| t[k]).unwrap_or(0);
        t.rotate_left(smallest);
    }
    triangles.sort_unstable();
    for t in triangles {
        let [a, b, c] = t.map(|v| numbers[v]);
        part.triangle(if up { [a, b, c] } else { [a, c, b] });
    }
    Ok(())
}

/// The triangles that outlines part from the outside, an odd number of times. (Their middles would not tell: what lies between an
/// outline that should be straight and the hull is as thin as round-off.)
fn inner(mesh: &ConstrainedDelaunayTriangulation<Point2<f64>>) -> Vec<[usize; 3]> {
    let mut is_inside: Vec<Option<bool>> = vec![None; mesh.num_all_faces()];
    is_inside[mesh.outer_face().index()] = Some(false);
    let mut open: Vec<_> = mesh.convex_hull().map(|edge| (edge.rev(), edge.is_constraint_edge())).collect();
    let mut triangles = Vec::new();
    while let Some((edge, inside)) = open.pop() {
        let face = edge.face();
        if is_inside[face.index()].is_some() {
            continue;
        }
        is_inside[face.index()] = Some(inside);
        let corners = [edge, edge.next(), edge.prev()];
        if inside {
            triangles.push(corners.map(|side| side.from().index()));
        }
        open.extend(corners.map(|side| (side.rev(), inside != side.is_constraint_edge())));
    }
    triangles
}

/// Places of an even triangulation, moved a little.
fn inside(outlines: &[Vec<[f64; 2]>], edge: f64, random: &mut ChaCha8Rng) -> Vec<[f64; 2]> {
    let bound = |k: usize, start: f64, pick: fn(f64, f64) -> f64| outlines[0].iter().map(|p| p[k]).fold(start, pick);
    let low = [0, 1].map(|k| bound(k, f64::INFINITY, f64::min));
    let high = [0, 1].map(|k| bound(k, f64::NEG_INFINITY, f64::max));
    let counts = [((high[0] - low[0]) / edge) as usize + 2, ((high[1] - low[1]) / (ROW * edge)) as usize + 2];
    let start = [low[0] - edge * random.random::<f64>(), low[1] - ROW * edge * random.random::<f64>()];
    let mut places = Vec::new();
    for j in 0..counts[1] {
        for i in 0..counts[0] {
            let mut moved = || JITTER * edge * (2.0 * random.random::<f64>() - 1.0);
            let x = start[0] + edge * (i as f64 + 0.5 * (j % 2) as f64) + moved();
            let y = start[1] + ROW * edge * j as f64 + moved();
            if contains(outlines, [x, y]) && from_outlines(outlines, [x, y]) > FROM_OUTLINE * edge {
                places.push([x, y]);
            }
        }
    }
    places
}

/// Whether a place is inside an odd number of outlines.
fn contains(outlines: &[Vec<[f64; 2]>], [x, y]: [f64; 2]) -> bool {
    sides(outlines)
        .filter(|[a, b]| (a[1] > y) != (b[1] > y) && x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]))
        .count()
        % 2
        == 1
}

fn from_outlines(outlines: &[Vec<[f64; 2]>], [x, y]: [f64; 2]) -> f64 {
    sides(outlines)
        .map(|[a, b]| {
            let (u, v) = ([b[0] - a[0], b[1] - a[1]], [x - a[0], y - a[1]]);
            let t = ((u[0] * v[0] + u[1] * v[1]) / (u[0] * u[0] + u[1] * u[1])).clamp(0.0, 1.0);
            (v[0] - t * u[0]).hypot(v[1] - t * u[1])
        })
        .fold(f64::INFINITY, f64::min)
}

fn sides(outlines: &[Vec<[f64; 2]>]) -> impl Iterator<Item = [[f64; 2]; 2]> {
    outlines.iter().flat_map(|ring| (0..ring.len()).map(|k| [ring[k], ring[(k + 1) % ring.len()]]))
}
