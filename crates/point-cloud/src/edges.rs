//! The edges of a triangle mesh.

use crate::{CloudError, TriangleMesh};

/// One side of a triangle, seen from its edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct HalfEdge {
    /// The two vertices of the edge, the smaller first.
    pub vertices: [u32; 2],
    /// The triangle.
    pub triangle: u32,
    /// Which side of the triangle: side `k` runs from its vertex `k` to its vertex `k + 1` modulo 3.
    pub side: u8,
    /// Whether the triangle runs through the edge from the smaller vertex to the larger one.
    pub forward: bool,
}

/// The edges of a mesh with the triangles at each, sorted by vertices.
#[derive(Clone, Debug)]
pub struct EdgeMap {
    half_edges: Vec<HalfEdge>,
}

impl EdgeMap {
    /// Collects the edges, in O(n log n).
    ///
    /// # Errors
    /// [`CloudError::NoTriangles`], [`CloudError::VertexOutOfRange`], [`CloudError::RepeatedVertex`].
    pub fn new(mesh: &TriangleMesh) -> Result<Self, CloudError> {
        let count = mesh.vertices.nrows();
        if mesh.triangles.is_empty() {
            return Err(CloudError::NoTriangles);
        }
        let mut half_edges = Vec::with_capacity(3 * mesh.triangles.len());
        for (triangle, corners) in mesh.triangles.iter().enumerate() {
            for side in 0..3 {
                let (from, to) = (corners[side], corners[(side + 1) % 3]);
                if from as usize >= count {
                    return Err(CloudError::VertexOutOfRange { triangle, vertex: from, count });
                }
                if from == to {
                    return Err(CloudError::RepeatedVertex { triangle, vertex: from });
                }
                half_edges.push(HalfEdge {
                    vertices: [from.min(to), from.max(to)],
                    triangle: triangle as u32,
                    side: side as u8,
                    forward: from < to,
                });
            }
        }
        half_edges.sort_unstable();
        Ok(Self { half_edges })
    }

    /// The edges in the order of their vertices, each as its half-edges in the order of their triangles.
    pub fn iter(&self) -> impl Iterator<Item = &[HalfEdge]> {
        self.half_edges.chunk_by(|a, b| a.vertices == b.vertices)
    }

    /// Number of edges.
    pub fn count(&self) -> usize {
        self.iter().count()
    }

    /// Checks that at most two triangles meet in each edge.
    ///
    /// # Errors
    /// [`CloudError::NonManifoldEdges`].
    pub fn check_manifold(&self) -> Result<(), CloudError> {
        let mut bad = self.iter().filter(|edge| edge.len() > 2);
        match bad.next() {
            None => Ok(()),
            Some(first) => Err(CloudError::NonManifoldEdges {
                count: 1 + bad.count(),
                vertices: first[0].vertices,
                triangles: first.len(),
            }),
        }
    }
}

/// Disjoint sets over `0..n`; the smallest member stands for its set, so the result does not depend on the order of joins.
#[derive(Clone, Debug)]
pub struct DisjointSets(Vec<u32>);

impl DisjointSets {
    /// `n` sets of one member each.
    pub fn new(n: usize) -> Self {
        Self((0..n as u32).collect())
    }

    /// One more member, in a set of its own.
    pub fn add(&mut self) -> u32 {
        let member = self.0.len() as u32;
        self.0.push(member);
        member
    }

    /// The member that stands for the set of another one.
    pub fn root(&mut self, mut i: u32) -> u32 {
        while self.0[i as usize] != i {
            // Path halving.
            self.0[i as usize] = self.0[self.0[i as usize] as usize];
            i = self.0[i as usize];
        }
        i
    }

    /// Makes the sets of two members one.
    pub fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joined_sets_have_one_representative() {
        let mut sets = DisjointSets::new(6);
        for (a, b) in [(4, 5), (1, 4), (0, 2)] {
            sets.join(a, b);
        }
        assert_eq!([0, 1, 2, 3, 4, 5].map(|k| sets.root(k)), [0, 1, 0, 3, 1, 1]);
    }
}
