//! One orientation for all triangles of a mesh.

use crate::edges::{EdgeMap, HalfEdge};
use crate::{CloudError, TriangleMesh};

/// Flips triangles until neighbours agree, and returns how many were flipped.
///
/// Two triangles agree when they run through their common edge in opposite directions. Which orientation is outside
/// cannot be known from an open surface: in each piece the majority of the triangles keeps its own (on a tie the side
/// of the first triangle).
///
/// # Errors
/// Those of [`EdgeMap::new`], [`CloudError::NonManifoldEdges`], [`CloudError::NotOrientable`].
pub fn orient_consistently(mesh: &mut TriangleMesh) -> Result<usize, CloudError> {
    let edges = EdgeMap::new(mesh)?;
    edges.check_manifold()?;
    let flipped = flips(&edges, mesh.triangles.len())?;
    for (triangle, _) in mesh.triangles.iter_mut().zip(&flipped).filter(|(_, f)| **f) {
        triangle.swap(1, 2);
    }
    let count = flipped.iter().filter(|f| **f).count();
    if count > 0 {
        tracing::info!(count, "flipped triangles to one orientation");
    }
    Ok(count)
}

/// What lies across a side of a triangle.
#[derive(Clone, Copy)]
struct Neighbour<'a> {
    triangle: usize,
    /// Whether one of the two has to be flipped against the other.
    differ: bool,
    edge: &'a HalfEdge,
}

fn flips(edges: &EdgeMap, n_triangles: usize) -> Result<Vec<bool>, CloudError> {
    let mut neighbours: Vec<[Option<Neighbour<'_>>; 3]> = vec![[None; 3]; n_triangles];
    for edge in edges.iter() {
        if let [a, b] = edge {
            let differ = a.forward == b.forward;
            neighbours[a.triangle as usize][a.side as usize] =
                Some(Neighbour { triangle: b.triangle as usize, differ, edge: a });
            neighbours[b.triangle as usize][b.side as usize] =
                Some(Neighbour { triangle: a.triangle as usize, differ, edge: b });
        }
    }
    let mut flip: Vec<Option<bool>> = vec![None; n_triangles];
    let mut piece = Vec::new();
    for start in 0..n_triangles {
        if flip[start].is_some() {
            continue;
        }
        flip[start] = Some(false);
        piece.clear();
        piece.push(start);
        let mut next = 0;
        while next < piece.len() {
            let triangle = piece[next];
            next += 1;
            for &Neighbour { triangle: neighbour, differ, edge } in neighbours[triangle].iter().flatten() {
                let wanted = flip[triangle].map(|own| own != differ);
                match flip[neighbour] {
                    None => {
                        flip[neighbour] = wanted;
                        piece.push(neighbour);
                    }
                    known if known != wanted => {
                        return Err(CloudError::NotOrientable { vertices: edge.vertices });
                    }
                    _ => {}
                }
            }
        }
        if 2 * piece.iter().filter(|&&t| flip[t] == Some(true)).count() > piece.len() {
            piece.iter().for_each(|&t| flip[t] = flip[t].map(|f| !f));
        }
    }
    Ok(flip.into_iter().map(|f| f == Some(true)).collect())
}
