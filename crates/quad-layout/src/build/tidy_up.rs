//! Vertices that lines have left behind are taken out again.
//!
//! Each line halves the edges that it crosses. When a border is drawn anew the old line's vertices are of no use, and without this there
//! would be more of them with each time.

use std::collections::{BTreeMap, BTreeSet};

use point_cloud::vec3::{cross, dot, norm, scale, sub};
use rayon::prelude::*;

use super::patchwork::Patchwork;

/// How far, in diagonals, a vertex may lie from the plane of a triangle that another one in its plane replaces.
///
/// Limit: round-off.
const PLANE: f64 = 1e-10;

/// Least ratio of a triangle's height to its longest side, unless those that it replaces are flatter still.
const FLAT: f64 = 0.05;

/// Passes over the vertices of a region: one may be in the way of another.
const PASSES: usize = 4;

impl Patchwork {
    /// Takes out vertices that lines have added and that lie on no border, where others of the same planes can take their place: the
    /// surface stays what it is.
    pub(super) fn tidy_up(&mut self) {
        let mut is_held = vec![false; self.points.len()];
        is_held[..self.given].fill(true);
        self.borders.iter().flat_map(|border| &border.path).for_each(|&v| is_held[v as usize] = true);
        let points = &self.points;
        self.faces.par_iter_mut().for_each(|faces| {
            let free: BTreeSet<u32> = faces.iter().flatten().copied().filter(|&v| !is_held[v as usize]).collect();
            if !free.is_empty() {
                *faces = Region::new(points, faces).without(&free);
            }
        });
    }
}

/// Triangles of a region, with those at each vertex.
struct Region<'a> {
    points: &'a [[f64; 3]],
    /// None where one has been taken out.
    faces: Vec<Option<[u32; 3]>>,
    at: BTreeMap<u32, Vec<usize>>,
}

impl<'a> Region<'a> {
    fn new(points: &'a [[f64; 3]], faces: &[[u32; 3]]) -> Self {
        let mut region = Self { points, faces: Vec::with_capacity(faces.len()), at: BTreeMap::new() };
        faces.iter().for_each(|&face| region.add(face));
        region
    }

    fn add(&mut self, face: [u32; 3]) {
        face.iter().for_each(|&v| self.at.entry(v).or_default().push(self.faces.len()));
        self.faces.push(Some(face));
    }

    fn without(mut self, free: &BTreeSet<u32>) -> Vec<[u32; 3]> {
        let mut left = free.clone();
        for _ in 0..PASSES {
            let before = left.len();
            left.retain(|&vertex| self.take_out(vertex).is_none());
            if left.is_empty() || left.len() == before {
                break;
            }
        }
        self.faces.into_iter().flatten().collect()
    }

    /// The faces at a vertex as (vertex, next, next but one), in the order in which they follow one another round it.
    fn fan(&self, vertex: u32) -> Option<Vec<[u32; 2]>> {
        let mut next: BTreeMap<u32, u32> = BTreeMap::new();
        for &face in self.at.get(&vertex)? {
            let face = self.faces[face]?;
            let k = face.iter().position(|&v| v == vertex)?;
            next.insert(face[(k + 1) % 3], face[(k + 2) % 3]);
        }
        let (&start, _) = next.first_key_value()?;
        let (mut fan, mut now) = (Vec::with_capacity(next.len()), start);
        while let Some(&to) = next.get(&now) {
            fan.push([now, to]);
            now = to;
            if now == start || fan.len() > next.len() {
                break;
            }
        }
        (now == start && fan.len() == next.len()).then_some(fan)
    }

    /// Puts triangles from one vertex round `vertex` in the place of those at `vertex`, the one that leaves the least flat ones.
    fn take_out(&mut self, vertex: u32) -> Option<()> {
        let fan = self.fan(vertex)?;
        let flattest = fan.iter().map(|[p, q]| self.shape([vertex, *p, *q])).fold(f64::INFINITY, f64::min);
        let candidates =
            fan.iter().filter_map(|[centre, _]| Some((self.flattest_from(*centre, vertex, &fan)?, *centre)));
        let (shape, centre) = candidates.reduce(|a, b| if b.0 > a.0 { b } else { a })?;
        if shape < flattest.min(FLAT) {
            return None;
        }
        for face in self.at.remove(&vertex)? {
            let corners = self.faces[face].take()?;
            corners.iter().for_each(|v| {
                if let Some(at) = self.at.get_mut(v) {
                    at.retain(|other| *other != face);
                }
            });
        }
        fan.iter().filter(|side| !side.contains(&centre)).for_each(|[p, q]| self.add([centre, *p, *q]));
        Some(())
    }

    /// The shape of the flattest triangle from `centre`, if all lie in the planes of those that they replace and no edge is there twice.
    fn flattest_from(&self, centre: u32, vertex: u32, fan: &[[u32; 2]]) -> Option<f64> {
        let mut flattest = f64::INFINITY;
        for &[p, q] in fan.iter().filter(|side| !side.contains(&centre)) {
            let [old, new] = [vertex, centre].map(|from| self.area_vector([from, p, q]));
            let normal = scale(1.0 / norm(old).max(f64::MIN_POSITIVE), old);
            let off = dot(normal, sub(self.points[centre as usize], self.points[p as usize]));
            if off.abs() > PLANE || dot(normal, new) <= 0.0 {
                return None;
            }
            flattest = flattest.min(self.shape([centre, p, q]));
        }
        let beside = |[p, q]: &[u32; 2]| (*p == centre || *q == centre).then_some([*p, *q]);
        let neighbours: BTreeSet<u32> = fan.iter().filter_map(beside).flatten().collect();
        let joined = self.at.get(&centre)?.iter().filter_map(|&face| self.faces[face]).flatten();
        let mut others = joined.filter(|v| *v != centre && *v != vertex && !neighbours.contains(v));
        let is_new = !others.any(|v| fan.iter().any(|[p, _]| *p == v));
        is_new.then_some(flattest)
    }

    fn area_vector(&self, face: [u32; 3]) -> [f64; 3] {
        let [p, q, r] = face.map(|v| self.points[v as usize]);
        cross(sub(q, p), sub(r, p))
    }

    /// A triangle's height over its longest side, divided by that side.
    fn shape(&self, face: [u32; 3]) -> f64 {
        let [p, q, r] = face.map(|v| self.points[v as usize]);
        let longest = [sub(q, p), sub(r, q), sub(p, r)].map(|side| dot(side, side)).into_iter().fold(0.0, f64::max);
        norm(self.area_vector(face)) / longest.max(f64::MIN_POSITIVE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(points: &[[f64; 3]], faces: &[[u32; 3]]) -> f64 {
        let region = Region::new(points, faces);
        faces.iter().map(|&face| 0.5 * norm(region.area_vector(face))).sum()
    }

    /// Two squares that meet at a right angle, with a vertex in the middle of each and one in the middle of their edge.
    #[test]
    fn vertices_in_planes_and_on_edges_go_and_the_surface_stays() {
        let points = vec![
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
            [0.0, 1.0, 1.0],
            [0.5, 0.5, 0.0],
            [0.0, 0.5, 0.5],
            [0.0, 0.5, 0.0],
        ];
        let round = |middle: u32, ring: &[u32]| -> Vec<[u32; 3]> {
            (0..ring.len()).map(|i| [middle, ring[i], ring[(i + 1) % ring.len()]]).collect()
        };
        let mut faces = round(6, &[0, 1, 2, 3, 8]);
        faces.extend(round(7, &[0, 8, 3, 5, 4]));
        let left = Region::new(&points, &faces).without(&BTreeSet::from([6, 7, 8]));
        assert_eq!(left.len(), 4, "{left:?}");
        assert!((area(&points, &left) - 2.0).abs() < 1e-12);
        assert!(left.iter().all(|face| face.iter().all(|v| *v < 6)));
        // A vertex at which planes meet stays.
        let kept = Region::new(&points, &faces).without(&BTreeSet::from([3]));
        assert_eq!(kept.len(), faces.len());
    }
}
