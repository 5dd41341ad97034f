//! The connected pieces of a mesh and the vertices that belong to none.

use ndarray::Axis;

use crate::edges::{DisjointSets, EdgeMap};
use crate::{CloudError, TriangleMesh};

/// The pieces of a mesh. Triangles that share an edge belong to one piece; pieces that meet in a vertex only are two.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pieces {
    /// Piece of each triangle, shape `(n_triangles,)`.
    pub piece_of: Vec<usize>,
    /// Triangles of each piece, largest first; of equal ones the one with the first triangle is earlier.
    pub sizes: Vec<usize>,
}

impl Pieces {
    /// Finds the pieces. Edges with more than two triangles connect all of them.
    ///
    /// # Errors
    /// Those of [`EdgeMap::new`].
    pub fn find(mesh: &TriangleMesh) -> Result<Self, CloudError> {
        Ok(Self::of_edges(&EdgeMap::new(mesh)?, mesh.triangles.len()))
    }

    pub(crate) fn of_edges(edges: &EdgeMap, n_triangles: usize) -> Self {
        let mut sets = DisjointSets::new(n_triangles);
        for edge in edges.iter() {
            for pair in edge.windows(2) {
                sets.join(pair[0].triangle, pair[1].triangle);
            }
        }
        let roots: Vec<u32> = (0..n_triangles as u32).map(|t| sets.root(t)).collect();
        let mut size_of_root = vec![0; n_triangles];
        roots.iter().for_each(|&r| size_of_root[r as usize] += 1);
        let mut order: Vec<usize> = (0..n_triangles).filter(|&r| size_of_root[r] > 0).collect();
        order.sort_by_key(|&r| std::cmp::Reverse(size_of_root[r]));
        let mut rank = vec![0; n_triangles];
        order.iter().enumerate().for_each(|(k, &r)| rank[r] = k);
        Self {
            piece_of: roots.iter().map(|&r| rank[r as usize]).collect(),
            sizes: order.iter().map(|&r| size_of_root[r]).collect(),
        }
    }
}

/// A part of a mesh, and where its vertices came from.
#[derive(Clone, Debug, PartialEq)]
pub struct SubMesh {
    /// The part; its vertices are numbered anew in their old order.
    pub mesh: TriangleMesh,
    /// For each vertex of the part its index in the whole mesh, increasing.
    pub kept: Vec<usize>,
}

/// The piece with the most triangles, without the vertices it does not use.
///
/// # Errors
/// Those of [`EdgeMap::new`].
pub fn largest_piece(mesh: &TriangleMesh) -> Result<SubMesh, CloudError> {
    let pieces = Pieces::find(mesh)?;
    if pieces.sizes.len() > 1 {
        tracing::info!(sizes = ?pieces.sizes, "kept the largest piece of the mesh");
    }
    let of_largest = pieces.piece_of.iter().zip(&mesh.triangles).filter(|(p, _)| **p == 0);
    Ok(sub_mesh(mesh, of_largest.map(|(_, t)| *t).collect()))
}

/// The mesh without the vertices that no triangle uses.
///
/// # Errors
/// Those of [`EdgeMap::new`].
pub fn drop_unreferenced(mesh: &TriangleMesh) -> Result<SubMesh, CloudError> {
    EdgeMap::new(mesh)?;
    Ok(sub_mesh(mesh, mesh.triangles.clone()))
}

/// Vertices that no triangle uses, increasing. Indices beyond the last vertex are passed over.
pub fn unreferenced_vertices(mesh: &TriangleMesh) -> Vec<u32> {
    let mut used = vec![false; mesh.vertices.nrows()];
    for &v in mesh.triangles.iter().flatten() {
        if let Some(u) = used.get_mut(v as usize) {
            *u = true;
        }
    }
    (0..used.len() as u32).filter(|&v| !used[v as usize]).collect()
}

/// `triangles` with the vertices they use; their indices must be in range.
fn sub_mesh(mesh: &TriangleMesh, triangles: Vec<[u32; 3]>) -> SubMesh {
    let mut new_index = vec![u32::MAX; mesh.vertices.nrows()];
    triangles.iter().flatten().for_each(|&v| new_index[v as usize] = 0);
    let kept: Vec<usize> = (0..new_index.len()).filter(|&v| new_index[v] == 0).collect();
    kept.iter().enumerate().for_each(|(new, &old)| new_index[old] = new as u32);
    let triangles = triangles.iter().map(|t| t.map(|v| new_index[v as usize])).collect();
    let vertices = mesh.vertices.select(Axis(0), &kept);
    SubMesh { mesh: TriangleMesh { vertices, triangles }, kept }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    #[test]
    fn pieces_are_sorted_by_size_and_the_largest_keeps_its_vertices() {
        // Triangle 0 alone; triangles 1, 2 share the edge 4-5; vertex 3 is used by none; both pieces meet in vertex 2.
        let mesh = TriangleMesh {
            vertices: Array2::from_shape_fn((7, 3), |(i, k)| (10 * i + k) as f64),
            triangles: vec![[0, 1, 2], [2, 4, 5], [5, 4, 6]],
        };
        assert_eq!(Pieces::find(&mesh).unwrap(), Pieces { piece_of: vec![1, 0, 0], sizes: vec![2, 1] });
        let part = largest_piece(&mesh).unwrap();
        assert_eq!(part.kept, [2, 4, 5, 6]);
        assert_eq!(part.mesh.triangles, [[0, 1, 2], [2, 1, 3]]);
        assert_eq!(part.mesh.vertices.row(3), mesh.vertices.row(6));
        assert_eq!(unreferenced_vertices(&mesh), [3]);
        assert_eq!(drop_unreferenced(&mesh).unwrap().kept, [0, 1, 2, 4, 5, 6]);
    }

    #[test]
    fn bad_indices_are_named() {
        let vertices = Array2::zeros((3, 3));
        let mesh = |triangles| TriangleMesh { vertices: vertices.clone(), triangles };
        assert_eq!(Pieces::find(&mesh(vec![])), Err(CloudError::NoTriangles));
        assert_eq!(
            largest_piece(&mesh(vec![[0, 1, 2], [0, 3, 1]])),
            Err(CloudError::VertexOutOfRange { triangle: 1, vertex: 3, count: 3 })
        );
        assert_eq!(
            drop_unreferenced(&mesh(vec![[0, 2, 2]])),
            Err(CloudError::RepeatedVertex { triangle: 0, vertex: 2 })
        );
    }
}
