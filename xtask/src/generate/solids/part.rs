//! A closed mesh with what is known of it, and the checks that it is what was planned.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Result, ensure};
use point_cloud::DisjointSets;
use point_cloud::vec3::{cross, dot};

pub(super) type Point = [f64; 3];

/// Height of a row of an even triangulation, in edges.
///
/// Derived: √3/2.
pub(super) const ROW: f64 = 0.866_025_403_784_438_6;

/// Longest edge of a round section, in radii: 21 and more edges a turn, which lie within 0.012 radii of it.
pub(super) const ROUND: f64 = 0.3;

/// A closed mesh, its triangles counter-clockwise from outside.
#[derive(Clone, Debug, Default)]
pub struct Part {
    /// Vertices.
    pub points: Vec<Point>,
    /// Triangles, numbers of vertices.
    pub triangles: Vec<[usize; 3]>,
    /// Edges that are sharp by construction, smaller vertex first, sorted.
    pub creases: Vec<[usize; 2]>,
}

/// A part and what is known of the exact shape.
#[derive(Clone, Debug)]
pub(super) struct Made {
    pub(super) part: Part,
    pub(super) genus: usize,
    pub(super) volume: Option<f64>,
}

impl Part {
    /// The number of a new vertex.
    pub(super) fn add(&mut self, point: Point) -> usize {
        self.points.push(point);
        self.points.len() - 1
    }

    /// A triangle, unless two of its corners are one vertex.
    pub(super) fn triangle(&mut self, corners: [usize; 3]) {
        let [a, b, c] = corners;
        if a != b && b != c && c != a {
            self.triangles.push(corners);
        }
    }

    /// A sharp edge, unless both ends are one vertex.
    pub(super) fn crease(&mut self, a: usize, b: usize) {
        if a != b {
            self.creases.push([a.min(b), a.max(b)]);
        }
    }

    /// The volume inside, by the divergence theorem.
    pub fn volume(&self) -> f64 {
        self.triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|v| self.points[v]);
                dot(a, cross(b, c)) / 6.0
            })
            .sum()
    }

    /// Checks that the mesh is closed, of one piece, oriented outward and of this genus, and sorts its creases.
    ///
    /// # Errors
    /// What is not so.
    pub fn checked(mut self, genus: usize) -> Result<Self> {
        self.creases.sort_unstable();
        self.creases.dedup();
        let mut sides: BTreeMap<[usize; 2], usize> = BTreeMap::new();
        for t in &self.triangles {
            for k in 0..3 {
                *sides.entry([t[k], t[(k + 1) % 3]]).or_default() += 1;
            }
        }
        for (&[a, b], &count) in &sides {
            let back = sides.get(&[b, a]).copied().unwrap_or(0);
            ensure!(
                count == 1 && back == 1,
                "the edge from vertex {a} to {b} is used {count} times, and {back} times back"
            );
        }
        for crease in &self.creases {
            ensure!(sides.contains_key(crease), "the crease {crease:?} is no edge");
        }
        let pieces = self.pieces(&sides)?;
        ensure!(pieces == 1, "the mesh has {pieces} pieces");
        let euler = self.points.len() + self.triangles.len();
        let found = (2 + sides.len() / 2).checked_sub(euler);
        ensure!(found == Some(2 * genus), "Euler's formula gives 2 x genus = {found:?}, {} were planned", 2 * genus);
        let volume = self.volume();
        ensure!(volume > 0.0, "the volume is {volume}: the triangles look inward");
        Ok(self)
    }

    /// The number of pieces, if every vertex is used and the triangles round each are one ring.
    fn pieces(&self, sides: &BTreeMap<[usize; 2], usize>) -> Result<usize> {
        let mut corners = vec![0_usize; self.points.len()];
        let mut next: BTreeMap<(usize, usize), usize> = BTreeMap::new();
        for t in &self.triangles {
            for k in 0..3 {
                corners[t[k]] += 1;
                next.insert((t[k], t[(k + 1) % 3]), t[(k + 2) % 3]);
            }
        }
        let mut sets = DisjointSets::new(self.points.len());
        sides.keys().for_each(|&[a, b]| sets.join(a as u32, b as u32));
        for &[a, first] in sides.keys() {
            let (mut at, mut round) = (first, 0);
            while let Some(&other) = next.get(&(a, at)) {
                at = other;
                round += 1;
                if at == first || round > corners[a] {
                    break;
                }
            }
            ensure!(round == corners[a], "the {} triangles round vertex {a} are not one ring", corners[a]);
        }
        ensure!(corners.iter().all(|&count| count > 0), "a vertex belongs to no triangle");
        let roots: BTreeSet<u32> = (0..corners.len()).map(|v| sets.root(v as u32)).collect();
        Ok(roots.len())
    }

    /// The same part, turned by a rotation.
    pub(super) fn turned(mut self, rows: [Point; 3]) -> Self {
        for p in &mut self.points {
            *p = rows.map(|row| dot(row, *p));
        }
        self
    }
}

/// a + s b
pub(super) fn along(a: Point, s: f64, b: Point) -> Point {
    [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]]
}
