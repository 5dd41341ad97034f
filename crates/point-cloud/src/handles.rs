//! The triangles that tie a surface to itself by handles.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::vec3::{add, cross, dot, norm, scale, sub, unit};

const NONE: u32 = u32::MAX;

/// A step over an edge bent by a right angle counts as this many times longer, so that fronts meet at folds.
const BENT_STEP: f64 = 8.0;

/// The triangles to take out of an oriented mesh of one piece, so that it has no handles; none where it has none. Increasing.
///
/// A region grows from one triangle by the shortest way, edge by edge, as long as it stays planar. A triangle that
/// meets the boundary of the region along two separate stretches of one loop cuts this loop in two, which a plane
/// region may do; one that joins two different loops makes a handle and is left out. Loops only ever split, so this is
/// final, and what is left out is where the fronts meet: a narrow seam round each handle. O(n log n) where handles
/// are few.
pub(crate) fn handle_triangles(points: &[[f64; 3]], triangles: &[[u32; 3]]) -> Vec<u32> {
    if triangles.is_empty() {
        return Vec::new();
    }
    let across = opposite_half_edges(triangles);
    let corner = |t: u32| triangles[t as usize].map(|v| points[v as usize]);
    let center = |t: u32| {
        let [p, q, r] = corner(t);
        scale(1.0 / 3.0, add(add(p, q), r))
    };
    let normal = |t: u32| {
        let [p, q, r] = corner(t);
        unit(cross(sub(q, p), sub(r, p)))
    };
    let mut region = Region::new(across);
    let mut done = vec![false; triangles.len()];
    let mut left_out = Vec::new();
    // Distances are not negative, so their bits sort like the numbers.
    let mut heap = BinaryHeap::from([Reverse((0u64, 0u32))]);
    while let Some(Reverse((bits, t))) = heap.pop() {
        if std::mem::replace(&mut done[t as usize], true) {
            continue;
        }
        if !region.try_add(t) {
            left_out.push(t);
            continue;
        }
        for h in 3 * t..3 * t + 3 {
            let neighbour = region.across[h as usize] / 3;
            if region.across[h as usize] != NONE && !done[neighbour as usize] {
                let bend = 1.0 - dot(normal(t), normal(neighbour));
                let step = norm(sub(center(neighbour), center(t))) * (1.0 + (BENT_STEP - 1.0) * bend.max(0.0));
                heap.push(Reverse(((f64::from_bits(bits) + step).to_bits(), neighbour)));
            }
        }
    }
    // Triangles behind a seam were never reached.
    left_out.extend((0..triangles.len() as u32).filter(|&t| !done[t as usize]));
    left_out.sort_unstable();
    left_out
}

/// Half-edge `3 t + k` runs from corner `k` of triangle `t` to the next; for each the one that runs back, or [`NONE`].
fn opposite_half_edges(triangles: &[[u32; 3]]) -> Vec<u32> {
    let mut sides: Vec<([u32; 2], u32)> = Vec::with_capacity(3 * triangles.len());
    for (t, corners) in (0u32..).zip(triangles) {
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            sides.push(([a.min(b), a.max(b)], 3 * t + k as u32));
        }
    }
    sides.sort_unstable();
    let mut across = vec![NONE; sides.len()];
    for pair in sides.chunk_by(|a, b| a.0 == b.0) {
        if let [a, b] = pair {
            across[a.1 as usize] = b.1;
            across[b.1 as usize] = a.1;
        }
    }
    across
}

/// A part of a mesh, glued together along edges; vertices at which it only touches count as apart.
struct Region {
    across: Vec<u32>,
    /// For each half-edge on the boundary of the region the following one on its loop, and the one before; [`NONE`]
    /// elsewhere.
    next: Vec<u32>,
    previous: Vec<u32>,
}

impl Region {
    fn new(across: Vec<u32>) -> Self {
        let none = vec![NONE; across.len()];
        Self { across, next: none.clone(), previous: none }
    }

    /// Glues a triangle to the region unless that makes a handle.
    fn try_add(&mut self, triangle: u32) -> bool {
        let own = [0, 1, 2].map(|k| 3 * triangle + k);
        let met: Vec<[u32; 2]> = own
            .map(|h| [h, self.across[h as usize]])
            .into_iter()
            .filter(|[_, o]| *o != NONE && self.next[*o as usize] != NONE)
            .collect();
        for k in 0..3 {
            self.link(own[k], own[(k + 1) % 3]);
        }
        // The first edge joins the loop of the triangle to the region; each further one may only cut a loop.
        for (count, &[h, o]) in met.iter().enumerate() {
            if count > 0 && !self.on_one_loop(h, o) {
                for &[h, o] in met[..count].iter().rev() {
                    self.unglue(h, o);
                }
                own.iter().for_each(|&h| self.next[h as usize] = NONE);
                return false;
            }
            self.glue(h, o);
        }
        for &[h, o] in &met {
            self.next[h as usize] = NONE;
            self.next[o as usize] = NONE;
        }
        true
    }

    fn link(&mut self, from: u32, to: u32) {
        self.next[from as usize] = to;
        self.previous[to as usize] = from;
    }

    /// Takes two opposite half-edges out of their loops; they keep their own links, for [`Region::unglue`].
    fn glue(&mut self, h: u32, o: u32) {
        let [before_h, after_h] = [self.previous[h as usize], self.next[h as usize]];
        let [before_o, after_o] = [self.previous[o as usize], self.next[o as usize]];
        if after_h != o {
            self.link(before_o, after_h);
        }
        if after_o != h {
            self.link(before_h, after_o);
        }
    }

    /// Takes back the latest [`Region::glue`].
    fn unglue(&mut self, h: u32, o: u32) {
        for x in [h, o] {
            let (before, after) = (self.previous[x as usize], self.next[x as usize]);
            self.next[before as usize] = x;
            self.previous[after as usize] = x;
        }
    }

    /// Whether two boundary half-edges lie on one loop. Both loops are walked in step, so that a short one ends the search.
    fn on_one_loop(&self, x: u32, y: u32) -> bool {
        let (mut forward, mut backward, mut other) = (x, x, y);
        loop {
            forward = self.next[forward as usize];
            backward = self.previous[backward as usize];
            other = self.next[other as usize];
            if forward == y || backward == y || other == x {
                return true;
            }
            if forward == x || other == y {
                return false;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CloudError, DiskMesh, TriangleMesh, largest_piece};
    use ndarray::Array2;
    use std::f64::consts::TAU;

    /// A torus of `n` by `m` vertices; `open` leaves out the triangles of one cell.
    fn torus(n: usize, m: usize, open: bool) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
        let points = (0..n * m)
            .map(|i| {
                let (s, t) = (TAU * (i / m) as f64 / n as f64, TAU * (i % m) as f64 / m as f64);
                let r = 3.0 + t.cos();
                [r * s.cos(), r * s.sin(), t.sin()]
            })
            .collect();
        let at = |i: usize, j: usize| ((i % n) * m + j % m) as u32;
        let triangles = (0..n * m)
            .skip(usize::from(open))
            .flat_map(|c| {
                let (i, j) = (c / m, c % m);
                [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]]
            })
            .collect();
        (points, triangles)
    }

    fn disk(points: &[[f64; 3]], triangles: &[[u32; 3]], without: &[u32]) -> Result<DiskMesh, CloudError> {
        let left =
            (0u32..).zip(triangles).filter(|(t, _)| without.binary_search(t).is_err()).map(|(_, c)| *c).collect();
        let vertices = Array2::from_shape_fn((points.len(), 3), |(i, k)| points[i][k]);
        DiskMesh::new(largest_piece(&TriangleMesh { vertices, triangles: left })?.mesh)
    }

    #[test]
    fn a_handle_is_cut_by_a_narrow_seam() {
        let (n, m) = (40, 12);
        let (points, triangles) = torus(n, m, true);
        assert!(matches!(disk(&points, &triangles, &[]), Err(CloudError::Handles { handles: 1, .. })));
        let seam = handle_triangles(&points, &triangles);
        // A torus loses a strip along one of its circles; pinched vertices beside the strip are not its task.
        assert!(!seam.is_empty() && seam.len() <= 4 * (n + m), "{}", seam.len());
        match disk(&points, &triangles, &seam) {
            Ok(_) | Err(CloudError::PinchedVertices { .. }) => {}
            Err(other) => panic!("{other}"),
        }
    }

    #[test]
    fn plane_regions_with_holes_and_tubes_lose_nothing() {
        let (points, triangles) = torus(30, 9, false);
        // A tube, open at both ends, and a tube with a slit.
        let tube: Vec<[u32; 3]> = triangles[..triangles.len() - 18].to_vec();
        assert_eq!(handle_triangles(&points, &tube), []);
        let slit: Vec<[u32; 3]> = (0..tube.len()).filter(|t| t % 18 > 1).map(|t| tube[t]).collect();
        assert_eq!(handle_triangles(&points, &slit), []);
        let holes: Vec<[u32; 3]> = (0..tube.len()).filter(|t| t % 77 > 1).map(|t| tube[t]).collect();
        assert_eq!(handle_triangles(&points, &holes), []);
        assert_eq!(handle_triangles(&points, &[]), []);
    }
}
