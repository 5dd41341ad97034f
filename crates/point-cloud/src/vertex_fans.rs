//! The fans of triangles round the vertices of a mesh.

use crate::TriangleMesh;
use crate::edges::{DisjointSets, EdgeMap};

/// The fan of each corner: corner `3 t + k` is vertex `k` of triangle `t`; triangles on both sides of an edge share the
/// corners at its ends. A fan is named by its smallest corner.
pub(crate) fn fans(mesh: &TriangleMesh, edges: &EdgeMap) -> Vec<u32> {
    let mut corners = DisjointSets::new(3 * mesh.triangles.len());
    for edge in edges.iter() {
        if let [a, b] = edge {
            for end in a.vertices {
                let corner = |triangle: u32| {
                    let k = mesh.triangles[triangle as usize].iter().position(|&v| v == end);
                    k.map(|k| 3 * triangle + k as u32)
                };
                if let (Some(p), Some(q)) = (corner(a.triangle), corner(b.triangle)) {
                    corners.join(p, q);
                }
            }
        }
    }
    (0..3 * mesh.triangles.len() as u32).map(|c| corners.root(c)).collect()
}
