//! Meshes that can be laid flat: one piece, one side, no handles, at least one boundary loop.

use ndarray::{ArrayView2, Axis};

use crate::edges::EdgeMap;
use crate::order_loop::loop_length;
use crate::pieces::{Pieces, unreferenced_vertices};
use crate::vec3::{cross, sub, unit};
use crate::vertex_fans::fans;
use crate::{CloudError, TriangleMesh, check_finite, orient_consistently};

/// A closed sequence of boundary vertices, the surface on its left seen from outside.
#[derive(Clone, Debug, PartialEq)]
pub struct BoundaryLoop {
    /// The vertices in order; the last is joined to the first. Starts at the smallest index.
    pub vertices: Vec<u32>,
    /// Length of the loop, in the units of the mesh.
    pub length: f64,
}

/// A mesh that has the topology of a disk, possibly with holes, and is checked to have it.
///
/// All triangles have the same orientation, every vertex is used, and around each vertex the triangles form one fan.
#[derive(Clone, Debug, PartialEq)]
pub struct DiskMesh {
    mesh: TriangleMesh,
    loops: Vec<BoundaryLoop>,
    flipped: usize,
}

impl DiskMesh {
    /// Orients and checks a mesh, vertices of shape `(m, 3)`.
    ///
    /// # Errors
    /// Every condition has its own variant: [`CloudError::WrongDimension`], coordinates not finite, bad indices,
    /// [`CloudError::NonManifoldEdges`], [`CloudError::SeveralPieces`], [`CloudError::UnreferencedVertices`],
    /// [`CloudError::NotOrientable`], [`CloudError::PinchedVertices`], [`CloudError::Closed`], [`CloudError::Handles`].
    pub fn new(mut mesh: TriangleMesh) -> Result<Self, CloudError> {
        if mesh.vertices.ncols() != 3 {
            return Err(CloudError::WrongDimension { given: mesh.vertices.ncols(), required: 3 });
        }
        check_finite(mesh.vertices.view())?;
        let edges = EdgeMap::new(&mesh)?;
        let sizes = Pieces::of_edges(&edges, mesh.triangles.len()).sizes;
        if sizes.len() > 1 {
            return Err(CloudError::SeveralPieces { count: sizes.len(), sizes });
        }
        if let unused @ [first, ..] = unreferenced_vertices(&mesh).as_slice() {
            return Err(CloudError::UnreferencedVertices { count: unused.len(), first: *first });
        }
        let flipped = orient_consistently(&mut mesh)?;
        let edges = EdgeMap::new(&mesh)?;
        check_pinched(&mesh, &edges)?;
        let loops = boundary_loops(&mesh, &edges);
        let euler = mesh.vertices.nrows() as i64 - edges.count() as i64 + mesh.triangles.len() as i64;
        // A connected orientable surface of genus g with b boundary loops: χ = 2 − 2g − b.
        let handles = ((2 - loops.len() as i64 - euler) / 2) as usize;
        if loops.is_empty() {
            return Err(CloudError::Closed { triangles: mesh.triangles.len() });
        }
        if handles > 0 {
            return Err(CloudError::Handles { handles, euler, loops: loops.len() });
        }
        Ok(Self { mesh, loops, flipped })
    }

    /// The mesh, consistently oriented.
    pub fn mesh(&self) -> &TriangleMesh {
        &self.mesh
    }

    /// The vertices, shape `(m, 3)`.
    pub fn vertices(&self) -> ArrayView2<'_, f64> {
        self.mesh.vertices.view()
    }

    /// The triangles, consistently oriented.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.mesh.triangles
    }

    /// The outer boundary: the longest loop, by length.
    pub fn outer_loop(&self) -> &BoundaryLoop {
        &self.loops[0]
    }

    /// The other loops, longest first: the rims of the holes.
    pub fn holes(&self) -> &[BoundaryLoop] {
        &self.loops[1..]
    }

    /// Number of triangles that were flipped to give all the same orientation.
    pub fn flipped(&self) -> usize {
        self.flipped
    }

    /// Back to the plain mesh, consistently oriented.
    pub fn into_mesh(self) -> TriangleMesh {
        self.mesh
    }
}

/// Checks that the triangles around each vertex form one fan.
fn check_pinched(mesh: &TriangleMesh, edges: &EdgeMap) -> Result<(), CloudError> {
    let fan_of = fans(mesh, edges);
    let mut fans = vec![0usize; mesh.vertices.nrows()];
    for (corner, &vertex) in mesh.triangles.iter().flatten().enumerate() {
        if fan_of[corner] == corner as u32 {
            fans[vertex as usize] += 1;
        }
    }
    let count = fans.iter().filter(|&&f| f > 1).count();
    match fans.iter().position(|&f| f > 1) {
        None => Ok(()),
        Some(first) => Err(CloudError::PinchedVertices { count, vertex: first as u32, fans: fans[first] }),
    }
}

/// The boundary loops of an oriented mesh without pinched vertices, longest first; of equal ones that with the smaller
/// first vertex is earlier.
fn boundary_loops(mesh: &TriangleMesh, edges: &EdgeMap) -> Vec<BoundaryLoop> {
    const NONE: u32 = u32::MAX;
    let mut next = vec![NONE; mesh.vertices.nrows()];
    for edge in edges.iter() {
        if let [h] = edge {
            let [low, high] = h.vertices;
            let (from, to) = if h.forward { (low, high) } else { (high, low) };
            next[from as usize] = to;
        }
    }
    let mut loops = Vec::new();
    for start in 0..next.len() as u32 {
        let mut vertices = Vec::new();
        let mut at = start;
        // Each vertex is taken out as it is passed, so the walk ends where it began.
        while next[at as usize] != NONE {
            vertices.push(at);
            at = std::mem::replace(&mut next[at as usize], NONE);
        }
        if !vertices.is_empty() {
            let rows: Vec<usize> = vertices.iter().map(|&v| v as usize).collect();
            let length = loop_length(mesh.vertices.select(Axis(0), &rows).view());
            loops.push(BoundaryLoop { vertices, length });
        }
    }
    loops.sort_by(|a, b| b.length.total_cmp(&a.length));
    loops
}

/// Unit normals of the vertices of `mesh`, area-weighted over their triangles, as one array each; zero where the
/// triangles of a vertex have no area.
pub(crate) fn vertex_normals(mesh: &TriangleMesh) -> Vec<[f64; 3]> {
    let at = |v: u32| std::array::from_fn::<f64, 3, _>(|k| mesh.vertices[[v as usize, k]]);
    let mut normals = vec![[0.0; 3]; mesh.vertices.nrows()];
    for &[a, b, c] in &mesh.triangles {
        let (p, q, r) = (at(a), at(b), at(c));
        let (e, f) = (sub(q, p), sub(r, p));
        let area = cross(e, f);
        for v in [a, b, c] {
            normals[v as usize] = std::array::from_fn(|k| normals[v as usize][k] + area[k]);
        }
    }
    normals.into_iter().map(unit).collect()
}

#[cfg(test)]
#[path = "disk_tests.rs"]
mod tests;
