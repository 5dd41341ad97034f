//! Meshes whose parameters wrap, laid out in the plane.

use std::collections::BTreeMap;

use ndarray::{Array2, ArrayView2, Axis};

/// A mesh cut open where its parameters wrap from 1 to 0: vertices there occur several times, once for each turn.
#[derive(Clone, Debug, PartialEq)]
pub struct UnrolledMesh {
    /// For each vertex its index in the closed mesh; the first ones are the vertices of the closed mesh themselves.
    pub origin: Vec<u32>,
    /// The triangles, in the order of the closed mesh.
    pub triangles: Vec<[u32; 3]>,
    /// Parameters of the vertices, shape `(n, 2)`; in directions that wrap up to half a turn beyond \[0, 1\].
    pub parameters: Array2<f64>,
}

impl UnrolledMesh {
    /// The vertices, shape `(n, N)`, from those of the closed mesh.
    pub fn vertices(&self, closed: ArrayView2<'_, f64>) -> Array2<f64> {
        closed.select(Axis(0), &self.origin.iter().map(|&v| v as usize).collect::<Vec<_>>())
    }
}

/// Cuts a mesh open whose parameters `uv`, shape `(m, 2)`, wrap at 1 in some directions. The corners of a triangle are
/// taken at the places nearest to its first one, so no triangle may reach half way round.
pub fn unroll(triangles: &[[u32; 3]], uv: ArrayView2<'_, f64>, wraps: [bool; 2]) -> UnrolledMesh {
    let mut origin: Vec<u32> = (0..uv.nrows() as u32).collect();
    if !wraps.contains(&true) {
        return UnrolledMesh { origin, triangles: triangles.to_vec(), parameters: uv.to_owned() };
    }
    let mut turns = vec![[0i64; 2]; origin.len()];
    let mut copies: BTreeMap<(u32, [i64; 2]), u32> = BTreeMap::new();
    let mut unrolled = Vec::with_capacity(triangles.len());
    for corners in triangles {
        let first = corners[0] as usize;
        unrolled.push(corners.map(|v| {
            let turn: [i64; 2] =
                std::array::from_fn(
                    |d| {
                        if wraps[d] { (uv[[first, d]] - uv[[v as usize, d]]).round() as i64 } else { 0 }
                    },
                );
            if turn == [0; 2] {
                return v;
            }
            *copies.entry((v, turn)).or_insert_with(|| {
                origin.push(v);
                turns.push(turn);
                origin.len() as u32 - 1
            })
        }));
    }
    let parameters =
        Array2::from_shape_fn((origin.len(), 2), |(i, d)| uv[[origin[i] as usize, d]] + turns[i][d] as f64);
    UnrolledMesh { origin, triangles: unrolled, parameters }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    #[test]
    fn triangles_across_the_seam_get_copies_of_their_far_corners() {
        let uv = array![[0.9, 0.0], [0.1, 0.0], [0.1, 1.0], [0.9, 1.0], [0.5, 0.5]];
        let triangles = [[0, 1, 2], [0, 2, 3], [1, 4, 2]];
        let cut = unroll(&triangles, uv.view(), [true, false]);
        assert_eq!(cut.origin, [0, 1, 2, 3, 4, 1, 2]);
        assert_eq!(cut.triangles, [[0, 5, 6], [0, 6, 3], [1, 4, 2]]);
        assert!((cut.parameters[[5, 0]] - 1.1).abs() < 1e-15 && cut.parameters[[6, 1]] == 1.0);
        assert_eq!(cut.vertices(uv.view()).row(6), uv.row(2));
        assert_eq!(unroll(&triangles, uv.view(), [false; 2]).triangles, triangles);
    }
}
