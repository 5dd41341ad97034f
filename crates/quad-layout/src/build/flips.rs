//! Edges turned over, so that triangles are even: paths along edges and distances across faces are wrong on slivers.

use std::collections::BTreeSet;

use point_cloud::vec3::{cross, dot, norm, sub};

use super::mesh::{WorkMesh, angle_at};
use crate::edge::{edge, sides};

/// Passes over all edges. Limit: a pass leaves few edges to turn over.
const PASSES: usize = 12;

/// Cosine of the angle between facets up to which the edge between them may be turned over: the surface moves by a part of the height
/// of one over the other.
///
/// Limit: layouts are drawn on these triangles, surfaces are fitted to those of the mesh.
const NEARLY_FLAT: f64 = 0.94;

/// By how much, in radians, the angles across an edge must exceed two right angles.
const MARGIN: f64 = 1e-3;

impl WorkMesh {
    /// Turns edges over where the angles across sum to more than two right angles (Delaunay) and the surface is nearly flat.
    pub(super) fn flip(&mut self) {
        for _ in 0..PASSES {
            let neighbours = self.neighbours();
            let mut edges: BTreeSet<[u32; 2]> = self.faces.iter().flat_map(|&t| sides(t)).collect();
            let mut touched = vec![false; self.faces.len()];
            let mut flipped = 0;
            for face in 0..self.faces.len() {
                for k in 0..3 {
                    let other = neighbours.across[face][k] as usize;
                    if touched[face] || other >= self.faces.len() || other < face || touched[other] {
                        continue;
                    }
                    if let Some(pair) = self.flipped(face, k, other, &edges) {
                        edges.remove(&edge(self.faces[face][k], self.faces[face][(k + 1) % 3]));
                        edges.insert(edge(pair[0][0], pair[0][1]));
                        (self.faces[face], self.faces[other]) = (pair[0], pair[1]);
                        (touched[face], touched[other]) = (true, true);
                        flipped += 1;
                    }
                }
            }
            if flipped == 0 {
                return;
            }
        }
    }

    /// The two faces after the edge of side `k` is turned over, if that is better and possible; the first begins with the new edge.
    fn flipped(&self, face: usize, k: usize, other: usize, edges: &BTreeSet<[u32; 2]>) -> Option<[[u32; 3]; 2]> {
        let [a, b, c] = [0, 1, 2].map(|i| self.faces[face][(k + i) % 3]);
        let d = *self.faces[other].iter().find(|&&v| v != a && v != b)?;
        if self.sharp.contains(&edge(a, b)) || c == d || edges.contains(&edge(c, d)) {
            return None;
        }
        let [p, q, r, s] = [a, b, c, d].map(|v| self.points[v as usize]);
        if angle_at(r, p, q) + angle_at(s, p, q) < std::f64::consts::PI + MARGIN {
            return None;
        }
        let normal = |x, y, z| cross(sub(y, x), sub(z, x));
        let is_near = |m: [f64; 3], n: [f64; 3]| dot(m, n) > NEARLY_FLAT * norm(m) * norm(n) && norm(n) > 0.0;
        let before = [normal(p, q, r), normal(q, p, s)];
        let after = [normal(r, s, q), normal(s, r, p)];
        let mean: [f64; 3] = std::array::from_fn(|i| before[0][i] + before[1][i]);
        // A facet without area has no normal of its own.
        let is_flat = before.iter().all(|&n| norm(n) < 1e-9 * norm(mean) || is_near(mean, n));
        (is_flat && after.iter().all(|&n| is_near(mean, n))).then_some([[c, d, b], [d, c, a]])
    }
}
