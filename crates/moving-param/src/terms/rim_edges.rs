//! The rim of triangles over the points.

use std::collections::{HashMap, HashSet};

use crate::points::vector::{Vector, difference, dot, unit};

/// Cosine of the angle between two edges of the rim from which on there is a corner.
const CORNER: f64 = 0.5;

/// An edge of one triangle only, in its sense, by indices of points.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RimEdge {
    pub(crate) ends: [u32; 2],
    /// The point before the first on the rim.
    pub(crate) before: Option<u32>,
    /// The point after the second.
    pub(crate) after: Option<u32>,
}

/// The rim of triangles over the points, by index.
pub(crate) fn rim(triangles: &[[u32; 3]]) -> Vec<RimEdge> {
    let mut edges: Vec<[u32; 2]> = triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
    let all: HashSet<[u32; 2]> = edges.iter().copied().collect();
    edges.retain(|&[a, b]| !all.contains(&[b, a]));
    let before: HashMap<u32, u32> = edges.iter().map(|&[a, b]| (b, a)).collect();
    let after: HashMap<u32, u32> = edges.iter().map(|&[a, b]| (a, b)).collect();
    let edge =
        |ends: [u32; 2]| RimEdge { ends, before: before.get(&ends[0]).copied(), after: after.get(&ends[1]).copied() };
    edges.into_iter().map(edge).collect()
}

/// The middle of the cubic over an edge whose directions at its ends are those of parabolas through the points beside it; the
/// edge's own at corners of the rim.
pub(crate) fn curved_middle(before: Option<Vector>, [a, b]: [Vector; 2], after: Option<Vector>) -> Vector {
    let edge = difference(&b, &a);
    let length = dot(&edge, &edge).sqrt();
    let along = unit(edge);
    let direction = |beside: Option<Vector>| {
        let Some(beside) = beside else { return along };
        let far = dot(&beside, &beside).sqrt();
        let other = unit(beside);
        if dot(&other, &along) < CORNER || far + length == 0.0 {
            return along;
        }
        std::array::from_fn(|k| (other[k] * length + along[k] * far) / (far + length))
    };
    let (start, end) = (direction(before.map(|p| difference(&a, &p))), direction(after.map(|p| difference(&p, &b))));
    std::array::from_fn(|k| 0.5 * (a[k] + b[k]) + length / 8.0 * (start[k] - end[k]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn middles_of_edges_lie_on_the_parabola_of_the_rim() {
        let on = |x: f64| [x, 0.1 * x * x, 0.0, 0.0];
        // Slopes at both ends are exact; lengths and abscissae differ in second order.
        let middle = curved_middle(Some(on(-1.0)), [on(0.0), on(0.5)], Some(on(2.0)));
        assert!((middle[1] - 0.1 * 0.25 * 0.25).abs() < 1e-3, "{middle:?}");
        assert!((0.1 * 0.5 * 0.5 / 2.0 - middle[1]) > 5e-3);
        // A right angle is a corner; without neighbours the edge is straight.
        let middle = curved_middle(Some([0.0, 1.0, 0.0, 0.0]), [on(0.0), [1.0, 0.0, 0.0, 0.0]], None);
        assert_eq!(middle, [0.5, 0.0, 0.0, 0.0]);
    }
}
