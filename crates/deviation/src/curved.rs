//! Curved triangles: the surface that a triangle mesh stands for lies between its flat facets and these.
//!
//! Vlachos, Peters, Boyd, Mitchell, "Curved PN triangles", Symposium on Interactive 3D Graphics 2001, pp. 159–166: over each
//! facet a cubic Bézier triangle through its corners, tangent to the planes of the corner normals. Departures: a corner's
//! normal is the mean of the facets round the vertex that turn by less than [`CREASE_DEGREES`] from this one, so edges stay
//! sharp; and facets of a plane stay flat.

use std::collections::{BTreeSet, HashMap};

use point_cloud::DisjointSets;
use point_cloud::vec3::{add, cross, dot, norm, scale, sub, unit};

use crate::parts::{point_at, radius};

/// Angle between facets, in degrees, from which on their common edge is sharp and normals aren't averaged across it.
///
/// Derived: the definition by which results are judged (docs, "What counts").
pub const CREASE_DEGREES: f64 = 40.0;

/// Facets that turn by less than this angle, in degrees, lie in one plane.
///
/// Limit: round-off of coordinates written with six digits turns facets by less.
const FLAT_DEGREES: f64 = 0.1;

/// Facets in one plane from which on the plane is meant, and is not a coarse piece of something round.
///
/// Derived: the definition by which results are judged (docs, "What counts").
const PLANE_FACETS: usize = 4;

/// Weight of the normal of a plane among those round a vertex: the others bend towards it, not it towards them.
///
/// Derived: the definition by which results are judged (docs, "What counts").
const PLANE_WEIGHT: f64 = 1e6;

/// Curved triangles over the facets of a mesh.
#[derive(Clone, Debug)]
pub struct CurvedTriangles {
    vertices: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
    /// Unit normal of each facet; zero without area.
    facets: Vec<[f64; 3]>,
    /// Unit normal at each corner.
    corners: Vec<[[f64; 3]; 3]>,
    areas: Vec<f64>,
}

impl CurvedTriangles {
    /// Over `triangles`, whose indices lie within `vertices`.
    pub fn new(vertices: Vec<[f64; 3]>, triangles: Vec<[u32; 3]>) -> Self {
        Self::with_creases(vertices, triangles, &BTreeSet::new())
    }

    /// The same, where the facets on both sides of further edges, the smaller vertex first, do not bend towards each other either.
    pub fn with_creases(vertices: Vec<[f64; 3]>, triangles: Vec<[u32; 3]>, creases: &BTreeSet<[u32; 2]>) -> Self {
        let doubled: Vec<[f64; 3]> = triangles
            .iter()
            .map(|t| {
                let [p, q, r] = t.map(|v| vertices[v as usize]);
                cross(sub(q, p), sub(r, p))
            })
            .collect();
        let facets: Vec<[f64; 3]> = doubled.iter().map(|&n| unit(n)).collect();
        let areas = doubled.iter().map(|&n| 0.5 * norm(n)).collect();
        let in_plane = facets_in_planes(&triangles, &facets);
        let round = facets_round_vertices(vertices.len(), &triangles);
        let crease = CREASE_DEGREES.to_radians().cos();
        let corner = |t: usize, k: usize| {
            if in_plane[t] {
                return facets[t];
            }
            let near = facets_between_creases(t, triangles[t][k], round.of(triangles[t][k]), &triangles, creases);
            let sum = near.into_iter().map(|o| o as usize).filter(|&o| dot(facets[t], facets[o]) >= crease);
            unit(sum.fold([0.0; 3], |sum, o| add(sum, scale(if in_plane[o] { PLANE_WEIGHT } else { 1.0 }, doubled[o]))))
        };
        let corners = (0..triangles.len()).map(|t| std::array::from_fn(|k| corner(t, k))).collect();
        Self { vertices, triangles, facets, corners, areas }
    }

    /// The vertices.
    pub fn vertices(&self) -> &[[f64; 3]] {
        &self.vertices
    }

    /// The triangles.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Unit normal of a facet.
    pub fn facet_normal(&self, triangle: usize) -> [f64; 3] {
        self.facets[triangle]
    }

    /// Area of each facet.
    pub fn areas(&self) -> &[f64] {
        &self.areas
    }

    /// The corners of a facet.
    pub fn corners(&self, triangle: usize) -> [[f64; 3]; 3] {
        self.triangles[triangle].map(|v| self.vertices[v as usize])
    }

    /// The point of a facet with barycentric coordinates `w`.
    pub fn on_facet(&self, triangle: usize, w: [f64; 3]) -> [f64; 3] {
        point_at(self.corners(triangle), w)
    }

    /// The point of the curved triangle with barycentric coordinates `w`.
    pub fn on_curved(&self, triangle: usize, w: [f64; 3]) -> [f64; 3] {
        let (p, n) = (self.corners(triangle), self.corners[triangle]);
        // b[i][j], i ≠ j: the control point of the side from i to j next to i.
        let beside = |i: usize, j: usize| {
            let height = dot(sub(p[j], p[i]), n[i]);
            scale(1.0 / 3.0, sub(add(scale(2.0, p[i]), p[j]), scale(height, n[i])))
        };
        let mut point = (0..3).fold([0.0; 3], |sum, i| add(sum, scale(w[i].powi(3), p[i])));
        let mut sides = [0.0; 3];
        for i in 0..3 {
            for j in (0..3).filter(|&j| j != i) {
                let b = beside(i, j);
                sides = add(sides, b);
                point = add(point, scale(3.0 * w[i] * w[i] * w[j], b));
            }
        }
        let (mean_side, mean) = (scale(1.0 / 6.0, sides), scale(1.0 / 3.0, add(add(p[0], p[1]), p[2])));
        let middle = add(mean_side, scale(0.5, sub(mean_side, mean)));
        add(point, scale(6.0 * w[0] * w[1] * w[2], middle))
    }

    /// How much the sagitta changes within a part of the triangle round a place, about: between its middle and its corners, and those of
    /// the part turned by half a turn. `reach` is the distance of the corners.
    pub fn change_of_sagitta(&self, triangle: usize, w: [f64; 3], reach: f64) -> f64 {
        let size = reach / radius(self.corners(triangle)).max(f64::MIN_POSITIVE);
        let middle = self.sagitta(triangle, w);
        let change = |k: usize, size: f64| {
            let corner = std::array::from_fn(|i| w[i] + size * (f64::from(u8::from(i == k)) - 1.0 / 3.0));
            (self.sagitta(triangle, corner) - middle).abs()
        };
        (0..3).map(|k| change(k, size).max(change(k, -size))).fold(0.0, f64::max)
    }

    /// Signed height of the curved triangle over the facet along the facet's normal: the sagitta at this place.
    pub fn sagitta(&self, triangle: usize, w: [f64; 3]) -> f64 {
        dot(sub(self.on_curved(triangle, w), self.on_facet(triangle, w)), self.facets[triangle])
    }
}

/// For each vertex the facets that have it as a corner.
struct FacetsRound {
    starts: Vec<u32>,
    facets: Vec<u32>,
}

impl FacetsRound {
    fn of(&self, vertex: u32) -> &[u32] {
        let v = vertex as usize;
        &self.facets[self.starts[v] as usize..self.starts[v + 1] as usize]
    }
}

/// Those of the facets round a vertex that are reached from one without crossing a crease that ends there.
fn facets_between_creases(
    from: usize,
    vertex: u32,
    round: &[u32],
    triangles: &[[u32; 3]],
    creases: &BTreeSet<[u32; 2]>,
) -> Vec<u32> {
    let others = |facet: u32| triangles[facet as usize].into_iter().filter(move |&other| other != vertex);
    let is_crease = |other: u32| creases.contains(&[vertex.min(other), vertex.max(other)]);
    if !round.iter().any(|&facet| others(facet).any(is_crease)) {
        return round.to_vec();
    }
    let mut reached = vec![from as u32];
    let mut next = 0;
    while next < reached.len() {
        let ways: Vec<u32> = others(reached[next]).filter(|&other| !is_crease(other)).collect();
        for &facet in round {
            if !reached.contains(&facet) && others(facet).any(|other| ways.contains(&other)) {
                reached.push(facet);
            }
        }
        next += 1;
    }
    // In the order of the others, for the last bit of sums.
    round.iter().copied().filter(|facet| reached.contains(facet)).collect()
}

fn facets_round_vertices(vertices: usize, triangles: &[[u32; 3]]) -> FacetsRound {
    let mut starts = vec![0u32; vertices + 1];
    triangles.iter().flatten().for_each(|&v| starts[v as usize + 1] += 1);
    for v in 0..vertices {
        starts[v + 1] += starts[v];
    }
    let mut next = starts.clone();
    let mut facets = vec![0; 3 * triangles.len()];
    for (t, triangle) in triangles.iter().enumerate() {
        for &v in triangle {
            facets[next[v as usize] as usize] = t as u32;
            next[v as usize] += 1;
        }
    }
    FacetsRound { starts, facets }
}

/// Which facets lie in one plane with at least [`PLANE_FACETS`] − 1 others that they are connected with.
fn facets_in_planes(triangles: &[[u32; 3]], facets: &[[f64; 3]]) -> Vec<bool> {
    let flat = FLAT_DEGREES.to_radians().cos();
    let mut groups = DisjointSets::new(triangles.len());
    // An edge of three facets joins none of them.
    let mut at_edge: HashMap<(u32, u32), (usize, [usize; 2])> = HashMap::with_capacity(3 * triangles.len() / 2);
    for (t, triangle) in triangles.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
            let (count, sides) = at_edge.entry((a.min(b), a.max(b))).or_insert((0, [0; 2]));
            if *count < 2 {
                sides[*count] = t;
            }
            *count += 1;
        }
    }
    for (count, [a, b]) in at_edge.into_values() {
        if count == 2 && dot(facets[a], facets[b]) >= flat {
            groups.join(a as u32, b as u32);
        }
    }
    let roots: Vec<usize> = (0..triangles.len() as u32).map(|t| groups.root(t) as usize).collect();
    let mut sizes = vec![0; triangles.len()];
    roots.iter().for_each(|&root| sizes[root] += 1);
    roots.iter().map(|&root| sizes[root] >= PLANE_FACETS).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A band of a cylinder of radius 1 round the z axis with `n` facet columns over a right angle.
    fn cylinder(n: usize) -> CurvedTriangles {
        let angle = |i: usize| std::f64::consts::FRAC_PI_2 * i as f64 / n as f64;
        let vertices = (0..2 * (n + 1)).map(|k| [angle(k / 2).cos(), angle(k / 2).sin(), (k % 2) as f64]).collect();
        let triangles = (0..n as u32).flat_map(|i| [[2 * i, 2 * i + 2, 2 * i + 3], [2 * i, 2 * i + 3, 2 * i + 1]]);
        CurvedTriangles::new(vertices, triangles.collect())
    }

    #[test]
    fn curved_triangles_come_near_the_round_surface_that_facets_are_of() {
        for n in [6, 12, 24] {
            let curved = cylinder(n);
            let flat = 1.0 - (0.5 * std::f64::consts::FRAC_PI_2 / n as f64).cos();
            // Not beside the rims, where normals are those of one facet.
            for t in 4..2 * n - 4 {
                let [x, y, _] = curved.on_curved(t, [0.25, 0.5, 0.25]);
                let [fx, fy, _] = curved.on_facet(t, [0.25, 0.5, 0.25]);
                let (off, facet_off) = ((x.hypot(y) - 1.0).abs(), (fx.hypot(fy) - 1.0).abs());
                assert!(off < 0.35 * facet_off && facet_off <= 1.01 * flat, "{n}: {off} {facet_off}");
            }
        }
    }

    #[test]
    fn the_sagitta_changes_little_more_within_a_part_than_between_its_middle_and_its_corners() {
        let curved = cylinder(6);
        for t in 0..12 {
            let reach = radius(curved.corners(t)) / 8.0;
            crate::parts::for_each_part(8, |w| {
                let said = curved.change_of_sagitta(t, w, reach);
                let mut changes = Vec::new();
                crate::parts::for_each_part(6, |of_part| {
                    let there = std::array::from_fn(|k| w[k] + (of_part[k] - 1.0 / 3.0) / 8.0);
                    changes.push((curved.sagitta(t, there) - curved.sagitta(t, w)).abs());
                });
                assert!(changes.into_iter().all(|change| change <= 1.01 * said), "{t} {w:?}");
            });
        }
    }

    #[test]
    fn planes_and_sharp_edges_stay() {
        // Two unit squares of eight facets each that meet at a right angle along x = 1.
        let grid = |at: &dyn Fn(f64, f64) -> [f64; 3]| {
            (0..9).map(|k| at((k % 3) as f64 / 2.0, (k / 3) as f64 / 2.0)).collect::<Vec<_>>()
        };
        let mut vertices = grid(&|s, t| [s, t, 0.0]);
        vertices.extend(grid(&|s, t| [1.0, t, s]).into_iter().filter(|p| p[2] > 0.0));
        let place = |p: [f64; 3]| vertices.iter().position(|&q| q == p).unwrap() as u32;
        let mut triangles = Vec::new();
        for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let corner = |a: usize, b: usize| ((i + a) as f64 / 2.0, (j + b) as f64 / 2.0);
            for of in [|(s, t): (f64, f64)| [s, t, 0.0], |(s, t): (f64, f64)| [1.0, t, s]] {
                let [a, b, c, d] = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)].map(|p| place(of(p)));
                triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        let curved = CurvedTriangles::new(vertices, triangles);
        for t in 0..16 {
            assert_eq!(curved.sagitta(t, [0.2, 0.3, 0.5]), 0.0);
        }
    }
}
