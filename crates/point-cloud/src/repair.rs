//! The largest disk in a mesh that is not quite one.

use crate::edges::EdgeMap;
use crate::handles::handle_triangles;
use crate::pieces::{SubMesh, largest_piece};
use crate::vertex_fans::fans;
use crate::{CloudError, DiskMesh, TriangleMesh, orient_consistently};

/// The part of a mesh that is a disk.
#[derive(Clone, Debug, PartialEq)]
pub struct LargestDisk {
    /// The disk, possibly with holes.
    pub disk: DiskMesh,
    /// For each of its vertices the index in the whole mesh, increasing.
    pub kept: Vec<usize>,
    /// Number of triangles that were taken out.
    pub removed: usize,
    /// Number of triangles that were turned over to agree with their neighbours.
    pub turned: usize,
}

/// Rounds of taking out fans and pieces; each takes out whole ones, few meshes need a third.
const ROUNDS: usize = 16;

/// Takes out of a mesh, vertices of shape `(m, 3)`, what keeps it from being a disk: all pieces but the largest, at each
/// pinched vertex all fans of triangles but the largest, and a narrow seam of triangles round each handle. O(n log n).
///
/// # Errors
/// [`CloudError::Closed`], [`CloudError::NonManifoldEdges`], [`CloudError::NotOrientable`], bad indices, coordinates not
/// finite.
pub fn largest_disk(mesh: &TriangleMesh) -> Result<LargestDisk, CloudError> {
    let whole = mesh.triangles.len();
    let mut part = largest_piece(mesh)?;
    let turned = orient_consistently(&mut part.mesh)?;
    part = without_pinches(part)?;
    let points: Vec<[f64; 3]> = part.mesh.vertices.rows().into_iter().map(|p| [p[0], p[1], p[2]]).collect();
    let handles = handle_triangles(&points, &part.mesh.triangles);
    if !handles.is_empty() {
        // The rims of seams round its handles are no outline of a closed surface.
        if let Err(closed @ CloudError::Closed { .. }) = DiskMesh::new(part.mesh.clone()) {
            return Err(closed);
        }
        part = without_pinches(without(part, |t| handles.binary_search(&t).is_ok())?)?;
    }
    let disk = DiskMesh::new(part.mesh)?;
    let removed = whole - disk.triangles().len();
    if removed > 0 {
        tracing::info!(removed, "took triangles out of the mesh to make it a disk");
    }
    Ok(LargestDisk { disk, kept: part.kept, removed, turned })
}

/// The mesh without some of its triangles.
fn without(part: SubMesh, removed: impl Fn(u32) -> bool) -> Result<SubMesh, CloudError> {
    let SubMesh { mut mesh, kept } = part;
    let mut index = 0;
    mesh.triangles.retain(|_| {
        index += 1;
        !removed(index - 1)
    });
    let inner = largest_piece(&mesh)?;
    Ok(SubMesh { mesh: inner.mesh, kept: inner.kept.iter().map(|&v| kept[v]).collect() })
}

/// The largest piece in which the triangles at each vertex form one fan.
fn without_pinches(mut part: SubMesh) -> Result<SubMesh, CloudError> {
    for _ in 0..ROUNDS {
        let edges = EdgeMap::new(&part.mesh)?;
        let fans = fans(&part.mesh, &edges);
        // Of each vertex its largest fan, the first of equal ones.
        let mut best: Vec<Option<(usize, u32)>> = vec![None; part.mesh.vertices.nrows()];
        let corners = || part.mesh.triangles.iter().flatten().zip(&fans);
        let mut size = vec![0; fans.len()];
        corners().for_each(|(_, &fan)| size[fan as usize] += 1);
        for (&vertex, &fan) in corners() {
            let own = &mut best[vertex as usize];
            if own.is_none_or(|(count, _)| size[fan as usize] > count) {
                *own = Some((size[fan as usize], fan));
            }
        }
        let smaller: Vec<bool> = corners().map(|(&v, &fan)| best[v as usize].is_some_and(|b| b.1 != fan)).collect();
        if !smaller.contains(&true) {
            break;
        }
        part = without(part, |t| smaller[3 * t as usize..3 * t as usize + 3].contains(&true))?;
    }
    Ok(part)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;
    use std::f64::consts::TAU;

    /// `n` by `n` cells over the unit lattice, those that `keep` keeps.
    fn sheet(n: usize, keep: impl Fn(usize, usize) -> bool) -> TriangleMesh {
        let at = |i: usize, j: usize| (i * (n + 1) + j) as u32;
        let triangles = (0..n * n)
            .map(|c| (c / n, c % n))
            .filter(|&(i, j)| keep(i, j))
            .flat_map(|(i, j)| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]])
            .collect();
        let vertices = Array2::from_shape_fn(((n + 1) * (n + 1), 3), |(v, k)| [v / (n + 1), v % (n + 1), 0][k] as f64);
        TriangleMesh { vertices, triangles }
    }

    #[test]
    fn a_disk_stays_as_it_is() {
        let mesh = sheet(6, |i, j| (i, j) != (2, 3));
        let part = largest_disk(&mesh).unwrap();
        assert_eq!((part.removed, part.turned, part.disk.into_mesh()), (0, 0, mesh.clone()));
        assert_eq!(part.kept, (0..49).collect::<Vec<_>>());
        let mut turned = mesh;
        for triangle in [3, 10, 11] {
            turned.triangles[triangle].swap(0, 2);
        }
        assert_eq!(largest_disk(&turned).unwrap().turned, 3);
    }

    #[test]
    fn pieces_pinches_and_handles_are_taken_out() {
        // Two blocks that touch in a vertex, and a third one apart.
        let mesh = sheet(12, |i, j| (i < 4 && j < 4) || (4..6).contains(&i) && (4..6).contains(&j) || (i > 8 && j > 8));
        let part = largest_disk(&mesh).unwrap();
        assert_eq!((part.removed, part.disk.triangles().len()), (26, 32));
        // A bridge over the sheet joins two holes: a handle.
        let mut mesh = sheet(12, |i, j| (i, j) != (3, 6) && (i, j) != (8, 6));
        let at = |i: usize, j: usize| (i * 13 + j) as u32;
        let (near, far) = ([at(4, 7), at(4, 6), at(3, 6), at(3, 7)], [at(8, 7), at(8, 6), at(9, 6), at(9, 7)]);
        for k in 0..4 {
            let [a, b, c, d] = [near[k], near[(k + 1) % 4], far[(k + 1) % 4], far[k]];
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
        assert!(matches!(DiskMesh::new(mesh.clone()), Err(CloudError::Handles { handles: 1, .. })));
        let part = largest_disk(&mesh).unwrap();
        assert!((1..=16).contains(&part.removed) && part.kept.len() == 169, "{} {}", part.removed, part.kept.len());
    }

    #[test]
    fn closed_meshes_have_no_disk() {
        let vertices = Array2::from_shape_fn((4, 3), |(i, k)| f64::from(u8::from(i == k + 1)));
        let triangles = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        assert!(matches!(largest_disk(&TriangleMesh { vertices, triangles }), Err(CloudError::Closed { .. })));
        // A torus: cut along its handle it has an outline, of which its shape knows nothing.
        let at = |i: usize, j: usize| (i % 9 * 9 + j % 9) as u32;
        let cells = (0..81).map(|c| (c / 9, c % 9));
        let triangles = cells
            .flat_map(|(i, j)| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]])
            .collect();
        let vertices = Array2::from_shape_fn((81, 3), |(v, k)| {
            let (s, t) = ((v / 9) as f64 * TAU / 9.0, (v % 9) as f64 * TAU / 9.0);
            [(3.0 + t.cos()) * s.cos(), (3.0 + t.cos()) * s.sin(), t.sin()][k]
        });
        let torus = largest_disk(&TriangleMesh { vertices, triangles });
        assert!(matches!(torus, Err(CloudError::Closed { triangles: 162 })), "{torus:?}");
    }
}
