//! Better triangles on a surface where a function is 0: vertices go towards the middle of their neighbours along the surface and back
//! onto it, and edges are turned over until they are Delaunay's.

use std::collections::{BTreeMap, BTreeSet};

use point_cloud::vec3::{cross, dot, norm, sub, unit};

use super::part::{Part, Point, along};

/// Rounds of moving and turning.
const ROUNDS: usize = 12;
/// How far a vertex goes to the middle of its neighbours in a round.
const STEP: f64 = 0.5;
/// Newton steps back onto the surface in a round.
const NEWTON: usize = 4;
/// Step of differences, as a share of the size.
const DIFFERENCE: f64 = 1e-6;
/// Sum of the cotangents of the angles across an edge below which it is turned over.
///
/// Derived: Delaunay's is 0; less, by more than round-off, so that edges do not turn for ever.
const TURN_BELOW: f64 = -1e-6;

/// Improves the triangles; `size` is about the size of the part.
pub(super) fn relax(part: &mut Part, field: &dyn Fn(Point) -> f64, size: f64) {
    onto(part, field, size);
    for _ in 0..ROUNDS {
        turn_edges(part);
        let middles = middles(part);
        for (p, middle) in part.points.iter_mut().zip(middles) {
            let normal = unit(gradient(field, *p, size));
            let way = sub(middle, *p);
            let flat = along(way, -dot(way, normal), normal);
            *p = along(*p, STEP, flat);
        }
        onto(part, field, size);
    }
    turn_edges(part);
}

fn gradient(field: &dyn Fn(Point) -> f64, p: Point, size: f64) -> Point {
    let step = DIFFERENCE * size;
    [0, 1, 2].map(|k| {
        let (mut a, mut b) = (p, p);
        a[k] -= step;
        b[k] += step;
        (field(b) - field(a)) / (2.0 * step)
    })
}

/// Moves all vertices onto the surface.
fn onto(part: &mut Part, field: &dyn Fn(Point) -> f64, size: f64) {
    for p in &mut part.points {
        for _ in 0..NEWTON {
            let slope = gradient(field, *p, size);
            *p = along(*p, -field(*p) / dot(slope, slope).max(f64::MIN_POSITIVE), slope);
        }
    }
}

/// The middle of each vertex's triangles, by area.
fn middles(part: &Part) -> Vec<Point> {
    let mut sums = vec![([0.0; 3], 0.0); part.points.len()];
    for t in &part.triangles {
        let [a, b, c] = t.map(|v| part.points[v]);
        let area = norm(cross(sub(b, a), sub(c, a)));
        let middle = [0, 1, 2].map(|k| (a[k] + b[k] + c[k]) / 3.0);
        for &v in t {
            sums[v] = (along(sums[v].0, area, middle), sums[v].1 + area);
        }
    }
    sums.into_iter().map(|(sum, area)| sum.map(|x| x / area)).collect()
}

/// Turns edges over until all are Delaunay's, or for as many rounds as there is any use in.
fn turn_edges(part: &mut Part) {
    for _ in 0..ROUNDS {
        let mut owners: BTreeMap<[usize; 2], [usize; 2]> = BTreeMap::new();
        for (number, t) in part.triangles.iter().enumerate() {
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                owners.entry([a.min(b), a.max(b)]).or_insert([usize::MAX; 2])[usize::from(a > b)] = number;
            }
        }
        let mut known: BTreeSet<[usize; 2]> = owners.keys().copied().collect();
        let mut touched = vec![false; part.triangles.len()];
        let mut turned = false;
        for ([a, b], [left, right]) in owners {
            if left == usize::MAX || right == usize::MAX || touched[left] || touched[right] {
                continue;
            }
            let across = |t: [usize; 3]| t.into_iter().find(|&v| v != a && v != b);
            let (Some(c), Some(d)) = (across(part.triangles[left]), across(part.triangles[right])) else { continue };
            let new = [c.min(d), c.max(d)];
            if c == d || known.contains(&new) || !is_better(part, [a, b, c, d]) {
                continue;
            }
            // Left is (a, b, c), right (b, a, d).
            part.triangles[left] = [a, d, c];
            part.triangles[right] = [d, b, c];
            known.remove(&[a, b]);
            known.insert(new);
            touched[left] = true;
            touched[right] = true;
            turned = true;
        }
        if !turned {
            break;
        }
    }
}

/// Whether the edge from c to d is Delaunay's rather than that from a to b, and both triangles then look the way that they did.
fn is_better(part: &Part, [a, b, c, d]: [usize; 4]) -> bool {
    let [a, b, c, d] = [a, b, c, d].map(|v| part.points[v]);
    let cotangent = |at: Point, u: Point, v: Point| {
        let (u, v) = (sub(u, at), sub(v, at));
        dot(u, v) / norm(cross(u, v)).max(f64::MIN_POSITIVE)
    };
    let normal = |a: Point, b: Point, c: Point| cross(sub(b, a), sub(c, a));
    let before = along(unit(normal(a, b, c)), 1.0, unit(normal(b, a, d)));
    cotangent(c, a, b) + cotangent(d, a, b) < TURN_BELOW
        && dot(normal(a, d, c), before) > 0.0
        && dot(normal(d, b, c), before) > 0.0
}
