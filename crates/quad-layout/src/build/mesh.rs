//! The triangles that a layout is made on: closed, in units in which the diagonal of the box is 1, split where more are needed.

use std::collections::{BTreeMap, BTreeSet};

use point_cloud::vec3::{add, box_of, cross, norm, scale, sub, unit};

use crate::LayoutError;
use crate::edge::edge;

/// A closed mesh in which edges can be sharp.
#[derive(Clone, Debug, Default)]
pub(super) struct WorkMesh {
    pub(super) points: Vec<[f64; 3]>,
    pub(super) faces: Vec<[u32; 3]>,
    /// Edges that are creases, the smaller vertex first.
    pub(super) sharp: BTreeSet<[u32; 2]>,
}

/// The face across each side of each face; side `k` runs from vertex `k` to vertex `k + 1`.
pub(super) struct Neighbours {
    pub(super) across: Vec<[u32; 3]>,
    /// Some face of each vertex.
    pub(super) some_face: Vec<u32>,
}

impl WorkMesh {
    /// Checks that triangles form one closed surface that is oriented alike everywhere.
    ///
    /// # Errors
    /// [`LayoutError::OpenMesh`], [`LayoutError::EdgeOfMany`], [`LayoutError::MixedOrientation`], [`LayoutError::PinchedVertex`],
    /// [`LayoutError::Pieces`], [`LayoutError::NotFinite`], [`LayoutError::NoMesh`].
    pub(super) fn new(points: Vec<[f64; 3]>, faces: Vec<[u32; 3]>) -> Result<Self, LayoutError> {
        if faces.is_empty() {
            return Err(LayoutError::NoMesh);
        }
        if let Some(index) = points.iter().position(|p| p.iter().any(|x| !x.is_finite())) {
            return Err(LayoutError::NotFinite { what: "vertex", index });
        }
        for (patch, face) in faces.iter().enumerate() {
            if let Some(&vertex) = face.iter().find(|&&v| v as usize >= points.len()) {
                return Err(LayoutError::NoSuchVertex { patch, vertex: vertex as usize, vertices: points.len() });
            }
        }
        let faces = faces.into_iter().filter(|[a, b, c]| a != b && b != c && c != a).collect();
        let mesh = Self { points, faces, sharp: BTreeSet::new() };
        mesh.check()?;
        Ok(mesh)
    }

    /// Triangles moved and scaled to a box with its centre at 0 and diagonal 1, and what the centre and the diagonal were.
    ///
    /// # Errors
    /// Those of [`WorkMesh::new`].
    pub(super) fn of_diagonal_1(
        points: &[[f64; 3]],
        triangles: &[[u32; 3]],
    ) -> Result<(Self, [f64; 3], f64), LayoutError> {
        let [lower, upper] = box_of(triangles.iter().flatten().filter_map(|&v| points.get(v as usize).copied()));
        let (centre, diagonal) = (scale(0.5, add(lower, upper)), norm(sub(upper, lower)));
        let placed = points.iter().map(|p| scale(1.0 / diagonal, sub(*p, centre))).collect();
        Ok((Self::new(placed, triangles.to_vec())?, centre, diagonal))
    }

    fn check(&self) -> Result<(), LayoutError> {
        let (mut open, mut many, mut alike) = (0, 0, 0);
        let half_edges = self.half_edges();
        for group in half_edges.chunk_by(|a, b| a.0 == b.0) {
            match group {
                [_] => open += 1,
                [a, b] => alike += usize::from(a.3 == b.3),
                _ => many += 1,
            }
        }
        if many > 0 {
            return Err(LayoutError::EdgeOfMany { edges: many });
        }
        if open > 0 {
            return Err(LayoutError::OpenMesh { edges: open });
        }
        if alike > 0 {
            return Err(LayoutError::MixedOrientation { edges: alike });
        }
        let neighbours = self.neighbours();
        let mut corners = vec![0usize; self.points.len()];
        self.faces.iter().flatten().for_each(|&v| corners[v as usize] += 1);
        for (vertex, &count) in corners.iter().enumerate().filter(|(_, count)| **count > 0) {
            if self.fan(&neighbours, vertex as u32).len() != count {
                return Err(LayoutError::PinchedVertex { vertex });
            }
        }
        let pieces = self.pieces(&neighbours);
        if pieces > 1 { Err(LayoutError::Pieces { pieces }) } else { Ok(()) }
    }

    fn pieces(&self, neighbours: &Neighbours) -> usize {
        let mut seen = vec![false; self.faces.len()];
        let mut pieces = 0;
        for start in 0..self.faces.len() {
            if seen[start] {
                continue;
            }
            pieces += 1;
            seen[start] = true;
            let mut stack = vec![start as u32];
            while let Some(face) = stack.pop() {
                for next in neighbours.across[face as usize] {
                    if !std::mem::replace(&mut seen[next as usize], true) {
                        stack.push(next);
                    }
                }
            }
        }
        pieces
    }

    /// Edge, face, side, and whether the face runs from the smaller vertex to the larger; sorted by edge.
    fn half_edges(&self) -> Vec<([u32; 2], u32, u8, bool)> {
        let mut half_edges = Vec::with_capacity(3 * self.faces.len());
        for (face, corners) in self.faces.iter().enumerate() {
            for k in 0..3 {
                let (a, b) = (corners[k], corners[(k + 1) % 3]);
                half_edges.push((edge(a, b), face as u32, k as u8, a < b));
            }
        }
        half_edges.sort_unstable();
        half_edges
    }

    /// Which faces meet at sides.
    pub(super) fn neighbours(&self) -> Neighbours {
        let mut across = vec![[u32::MAX; 3]; self.faces.len()];
        for group in self.half_edges().chunk_by(|a, b| a.0 == b.0) {
            if let [a, b] = group {
                across[a.1 as usize][usize::from(a.2)] = b.1;
                across[b.1 as usize][usize::from(b.2)] = a.1;
            }
        }
        let mut some_face = vec![u32::MAX; self.points.len()];
        for (face, corners) in self.faces.iter().enumerate() {
            corners.iter().for_each(|&v| some_face[v as usize] = face as u32);
        }
        Neighbours { across, some_face }
    }

    /// The faces round a vertex, counter-clockwise: each with the number of its corner there.
    pub(super) fn fan(&self, neighbours: &Neighbours, vertex: u32) -> Vec<(u32, usize)> {
        let mut fan = Vec::new();
        let first = neighbours.some_face[vertex as usize];
        let mut face = first;
        while face != u32::MAX {
            let Some(k) = self.faces[face as usize].iter().position(|&v| v == vertex) else { break };
            fan.push((face, k));
            // The side that ends at the vertex leads to the next face.
            face = neighbours.across[face as usize][(k + 2) % 3];
            if face == first || fan.len() > self.faces.len() {
                break;
            }
        }
        fan
    }

    pub(super) fn corners(&self, face: usize) -> [[f64; 3]; 3] {
        self.faces[face].map(|v| self.points[v as usize])
    }

    pub(super) fn centre(&self, face: usize) -> [f64; 3] {
        let [p, q, r] = self.corners(face);
        scale(1.0 / 3.0, add(add(p, q), r))
    }

    /// Twice the area along the normal.
    pub(super) fn area_vector(&self, face: usize) -> [f64; 3] {
        let [p, q, r] = self.corners(face);
        cross(sub(q, p), sub(r, p))
    }

    pub(super) fn area(&self, face: usize) -> f64 {
        0.5 * norm(self.area_vector(face))
    }

    /// The angle of a face at one of its corners.
    pub(super) fn angle(&self, face: u32, k: usize) -> f64 {
        let p = self.corners(face as usize);
        angle_at(p[k], p[(k + 1) % 3], p[(k + 2) % 3])
    }

    pub(super) fn length(&self, a: u32, b: u32) -> f64 {
        norm(sub(self.points[a as usize], self.points[b as usize]))
    }

    /// Normals of the faces, averaged `rounds` times with those of neighbours not across sharp edges.
    pub(super) fn smooth_normals(&self, neighbours: &Neighbours, rounds: usize) -> Vec<[f64; 3]> {
        let areas: Vec<f64> = (0..self.faces.len()).map(|face| self.area(face)).collect();
        let mut normals: Vec<[f64; 3]> = (0..self.faces.len()).map(|face| unit(self.area_vector(face))).collect();
        for _ in 0..rounds {
            let averaged = |face: usize| {
                let mut sum = scale(areas[face], normals[face]);
                for k in 0..3 {
                    let next = neighbours.across[face][k] as usize;
                    let side = edge(self.faces[face][k], self.faces[face][(k + 1) % 3]);
                    if !self.sharp.contains(&side) {
                        sum = add(sum, scale(areas[next], normals[next]));
                    }
                }
                unit(sum)
            };
            normals = (0..self.faces.len()).map(averaged).collect();
        }
        normals
    }

    /// Halves edges; a triangle of which several are halved is cut at the longest first.
    pub(super) fn halve(&mut self, edges: &BTreeSet<[u32; 2]>) {
        let mut middle_of: BTreeMap<[u32; 2], u32> = BTreeMap::new();
        for &[a, b] in edges {
            let middle = self.points.len() as u32;
            self.points.push(scale(0.5, add(self.points[a as usize], self.points[b as usize])));
            middle_of.insert([a, b], middle);
            if self.sharp.remove(&[a, b]) {
                self.sharp.extend([edge(a, middle), edge(middle, b)]);
            }
        }
        let mut cut = Vec::with_capacity(self.faces.len() + 2 * edges.len());
        let mut stack: Vec<[u32; 3]> = self.faces.iter().rev().copied().collect();
        while let Some([a, b, c]) = stack.pop() {
            let longest = [[a, b, c], [b, c, a], [c, a, b]]
                .into_iter()
                .filter_map(|[p, q, r]| middle_of.get(&edge(p, q)).map(|&m| (self.length(p, q), [p, q, r], m)))
                .reduce(|best, other| if other.0 > best.0 { other } else { best });
            match longest {
                Some((_, [p, q, r], m)) => stack.extend([[m, q, r], [p, m, r]]),
                None => cut.push([a, b, c]),
            }
        }
        self.faces = cut;
    }

    /// Puts a vertex into the middle of a face.
    pub(super) fn cut_at_centre(&mut self, face: usize) {
        let [a, b, c] = self.faces[face];
        let m = self.points.len() as u32;
        self.points.push(self.centre(face));
        self.faces[face] = [a, b, m];
        self.faces.extend([[b, c, m], [c, a, m]]);
    }
}

/// The angle at `p` between the directions to `q` and `r`.
pub(super) fn angle_at(p: [f64; 3], q: [f64; 3], r: [f64; 3]) -> f64 {
    let (a, b) = (sub(q, p), sub(r, p));
    norm(cross(a, b)).atan2(point_cloud::vec3::dot(a, b))
}
