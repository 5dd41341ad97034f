//! Maps of patches anew, one to one.
//!
//! A map by positive weights onto a convex square folds nowhere (Floater, One-to-one piecewise linear mappings over triangulations,
//! Math. Comp. 72, 2003), but where an edge joins two vertices of one side it collapses what that edge cuts off. So such edges
//! are halved first; their middles are free and move inward.

use std::collections::BTreeMap;

use ndarray::Array2;
use param_classic::{InjectiveParams, MeshMapParams, Rule, Weights, map_disk, refine_injective};
use point_cloud::vec3::{add, scale};
use point_cloud::{CornerChoice, DiskMesh, TriangleMesh};

use crate::LayoutPatch;
use crate::edge::edge;

/// Number of triangles that are turned over or without area in the parameters.
pub(crate) fn folded(patch: &LayoutPatch) -> usize {
    let is_folded = |t: &&[u32; 3]| {
        let [p, q, r] = t.map(|v| patch.uv[v as usize]);
        (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]) <= 0.0
    };
    patch.triangles.iter().filter(is_folded).count()
}

/// Maps a patch with mean-value weights, its sides by their lengths (all alike where vertices lie in one place), and evens the map out. Returns it with its points: those of
/// halved edges come last, and have no vertex of the layout yet. The reason, in words, if it is no disk.
pub(crate) fn map_anew(
    patch: LayoutPatch,
    mut points: Vec<[f64; 3]>,
    sides: &[Vec<u32>; 4],
) -> Result<(LayoutPatch, Vec<[f64; 3]>), String> {
    let LayoutPatch { mut triangles, vertices, .. } = patch;
    halve_cutting_edges(&mut triangles, &mut points, sides);
    let rows = Array2::from_shape_fn((points.len(), 3), |(i, k)| points[i][k]);
    let disk = DiskMesh::new(TriangleMesh { vertices: rows, triangles: triangles.clone() });
    let disk = disk.map_err(|error| error.to_string())?;
    let corners = CornerChoice::Given([0, 1, 2, 3].map(|side: usize| sides[side][0]));
    // Vertices in one place have no mean values.
    let by_shape = MeshMapParams { corners, ..MeshMapParams::default() };
    let by_neighbours = MeshMapParams { weights: Weights::Uniform, boundary: Rule::Uniform, corners };
    let mapped = map_disk(&disk, &by_shape).or_else(|_| map_disk(&disk, &by_neighbours));
    let mapped = mapped.map_err(|error| error.to_string())?;
    let even = InjectiveParams { slide: false, ..InjectiveParams::default() };
    let refined = refine_injective(disk.vertices(), disk.triangles(), mapped.parameters.view(), &even);
    // The map stays as it is where it cannot be made more even.
    let uv = refined.map_or(mapped.parameters, |refined| refined.parameters);
    let uv = uv.rows().into_iter().map(|row| [row[0], row[1]]).collect();
    let patch = LayoutPatch { triangles, vertices, uv };
    match folded(&patch) {
        0 => Ok((patch, points)),
        folded => Err(format!("{folded} triangles fold in every map")),
    }
}

/// Halves each edge inside the patch that joins two vertices of one side.
fn halve_cutting_edges(triangles: &mut Vec<[u32; 3]>, points: &mut Vec<[f64; 3]>, sides: &[Vec<u32>; 4]) {
    let on_rim: std::collections::BTreeSet<[u32; 2]> =
        sides.iter().flat_map(|side| side.windows(2)).map(|pair| edge(pair[0], pair[1])).collect();
    let mut sides_of: BTreeMap<u32, u8> = BTreeMap::new();
    for (number, side) in sides.iter().enumerate() {
        side.iter().for_each(|&vertex| *sides_of.entry(vertex).or_insert(0) |= 1 << number);
    }
    let mut middle_of: BTreeMap<[u32; 2], u32> = BTreeMap::new();
    for triangle in triangles.iter() {
        for k in 0..3 {
            let side = edge(triangle[k], triangle[(k + 1) % 3]);
            let [a, b] = side.map(|vertex| sides_of.get(&vertex).copied().unwrap_or(0));
            if a & b != 0 && !on_rim.contains(&side) && !middle_of.contains_key(&side) {
                middle_of.insert(side, points.len() as u32);
                points.push(scale(0.5, add(points[side[0] as usize], points[side[1] as usize])));
            }
        }
    }
    let mut cut = Vec::with_capacity(triangles.len());
    let mut stack: Vec<[u32; 3]> = triangles.iter().rev().copied().collect();
    while let Some([a, b, c]) = stack.pop() {
        let corners = [[a, b, c], [b, c, a], [c, a, b]];
        match corners.into_iter().find_map(|[p, q, r]| middle_of.get(&edge(p, q)).map(|&m| (p, q, r, m))) {
            Some((p, q, r, m)) => stack.extend([[m, q, r], [p, m, r]]),
            None => cut.push([a, b, c]),
        }
    }
    *triangles = cut;
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The edge from 0 to 2 cuts off the triangle under it: a map by weights alone would press it flat onto the lower side.
    #[test]
    fn an_ear_gets_an_area() {
        let points =
            vec![[0.0, 0.0, 0.0], [0.5, -0.2, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.5, 0.6, 0.3]];
        let triangles = vec![[0, 1, 2], [0, 2, 5], [2, 3, 5], [3, 4, 5], [4, 0, 5]];
        let patch = LayoutPatch { triangles, vertices: (10..16).collect(), uv: vec![[0.0; 2]; 6] };
        let sides = [vec![0, 1, 2], vec![2, 3], vec![3, 4], vec![4, 0]];
        let (patch, points) = map_anew(patch, points, &sides).unwrap();
        assert_eq!((patch.triangles.len(), points.len(), folded(&patch)), (7, 7, 0));
        assert_eq!(points[6], [0.5, 0.0, 0.0]);
        let corners = [0, 2, 3, 4].map(|v: usize| patch.uv[v]);
        assert_eq!(corners, [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
        assert!(patch.uv[1][1] == 0.0 && patch.uv[6][1] > 0.01, "{:?}", patch.uv);
    }
}
