//! Further points on long triangles, so that a fit sees what lies between their corners.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use deviation::CurvedTriangles;
use ndarray::{Array1, Array2, ArrayView2};
use rustc_hash::FxHashMap;

/// Triangles of the denser mesh that would cover the area, were all equilateral.
///
/// Calibrated: `thb fit` of a box-like shell of 735 vertices at 0.1 %: 217 control points and 99.5 % of the area within, where its
/// vertices alone gave 625 and 82 %; other densities were not compared.
const TRIANGLES: f64 = 6000.0;

/// Points that may be added for each vertex and triangle of the scan, at most.
///
/// Limit: triangles far longer than wide would else be cut into millions.
const MOST_PER_TRIANGLE: usize = 16;

/// Points that may be added to the smallest mesh.
///
/// Limit: as above.
const MOST_OF_FEW: usize = 20_000;

/// Least weight of a vertex, as a share of the mean: one among triangles without area still counts.
///
/// Limit: a point of weight zero would be none.
const LEAST_WEIGHT: f64 = 1e-3;

/// A mesh with points added on its long edges.
pub(crate) struct Denser {
    /// Points, `(n, 3)`: first those of the mesh, then the added ones, which lie on the curved triangles.
    pub(crate) points: Array2<f64>,
    /// Their parameters, `(n, 2)`.
    pub(crate) parameters: Array2<f64>,
    /// Weight of each point: the area of the triangles round it, in means.
    pub(crate) weights: Array1<f64>,
    /// Triangles over all points.
    pub(crate) triangles: Vec<[u32; 3]>,
}

/// An edge that waits to be split, the longest first.
struct Waiting {
    length: f64,
    edge: (u32, u32),
}

impl PartialEq for Waiting {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Waiting {}

impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> Ordering {
        self.length.total_cmp(&other.length).then(other.edge.cmp(&self.edge))
    }
}

/// Splits the longest edge of a mesh again and again, in the middle, until all are short enough for the area to be sampled evenly.
///
/// New points lie on the curved triangle over the facet that they split, and have the parameters of the middle of the edge: the map of
/// the mesh onto the square stays what it is. `None` if there is nothing to split. Vertices keep their places in the list.
///
/// Splitting the longest edge of all keeps the mesh conforming and its angles (Rivara, "Algorithms for refining triangular grids
/// suitable for adaptive and multigrid techniques", International Journal for Numerical Methods in Engineering 20, 1984, pp. 745–756).
pub(crate) fn densify(
    curved: &CurvedTriangles,
    parameters: ArrayView2<'_, f64>,
    periodic: [bool; 2],
) -> Option<Denser> {
    let area: f64 = curved.areas().iter().sum();
    // Edge of an equilateral triangle.
    let longest = (area / TRIANGLES * 4.0 / 3f64.sqrt()).sqrt();
    Splitting::new(curved, parameters).split_all(periodic, |_, _| longest)?.denser()
}

/// Length of an edge, in medians of those along the same parameter, from which on it bridges a stretch without points.
///
/// Derived: refinement halves cells, so that one which is three times halved still reaches over the edge.
const BRIDGES: f64 = 8.0;

/// Share of the parameter's range that such a stretch takes at least: sections whose points crowd round an edge have steps of many medians,
/// but none that is long for the part.
///
/// Derived: a quarter of an element of the usual level 0, which two refinements halve twice.
const BRIDGED: f64 = 1.0 / 16.0;

/// Weight of a point that was added to such a stretch, in weights of points for the same area.
///
/// Calibrated: `thb fit --closed u` of nine sections of a cone with radii from 10 to 6, at 0, 1, 2, 3, 40, 80, 81, 82 and 83 along it: the
/// surface leaves the cone by 0.78 without such points, by 0.13 with weight 0.01 and by 0.09 with this one.
const WEIGHT_OF_BRIDGE: f64 = 0.1;

/// Adds points to the stretches of a cloud in order that its points leave out, where cells that are small enough for the others hold none
/// and a surface swings. `None` if there are none. `triangles` are spanned over the parameters.
pub(crate) fn bridge(curved: &CurvedTriangles, parameters: ArrayView2<'_, f64>, periodic: [bool; 2]) -> Option<Denser> {
    let mut mesh = Splitting::new(curved, parameters);
    // The parameter that changes most from a to b.
    let along = |a: [f64; 2], b: [f64; 2]| usize::from((b[1] - a[1]).abs() > (b[0] - a[0]).abs());
    let mut lengths: [Vec<f64>; 2] = Default::default();
    for &(a, b) in mesh.sides.keys() {
        let [u, v] = [a, b].map(|i| mesh.parameters[i as usize]);
        lengths[along(u, v)].push(mesh.waiting((a, b)).length);
    }
    let longest = lengths.map(|mut lengths| {
        let middle = lengths.len() / 2;
        if lengths.is_empty() {
            f64::INFINITY
        } else {
            BRIDGES * *lengths.select_nth_unstable_by(middle, f64::total_cmp).1
        }
    });
    let given = mesh.places.len();
    // Parameters are spread over the unit square.
    mesh = mesh.split_all(periodic, |a, b| {
        let d = along(a, b);
        if (b[d] - a[d]).abs() > BRIDGED { longest[d] } else { f64::INFINITY }
    })?;
    let mut denser = mesh.denser()?;
    denser.weights.iter_mut().skip(given).for_each(|weight| *weight *= WEIGHT_OF_BRIDGE);
    Some(denser)
}
/// Weights of the points of a cloud, in means; a point at the place of others still counts.
pub(crate) fn spacing_weights(weights: &[f64]) -> Vec<f64> {
    let mean = weights.iter().sum::<f64>() / weights.len().max(1) as f64;
    weights.iter().map(|weight| if mean > 0.0 { (weight / mean).max(LEAST_WEIGHT) } else { 1.0 }).collect()
}

/// Share of the points of a cloud that have to be corners of the triangles spanned over it for their areas to be weights: large clouds
/// have triangles over a subset.
///
/// Limit: nearly all have, or few.
const MOSTLY_SPANNED: f64 = 0.8;

/// The area of the triangles round each point of a cloud where most have some, else the square of their spacing (`weights`).
pub(crate) fn area_weights_of_cloud(points: &[[f64; 3]], triangles: &[[u32; 3]], weights: &[f64]) -> Vec<f64> {
    let mut corners: Vec<u32> = triangles.iter().flatten().copied().collect();
    corners.sort_unstable();
    corners.dedup();
    let is_spanned = corners.len() as f64 >= MOSTLY_SPANNED * points.len() as f64;
    if is_spanned { area_weights(points, triangles) } else { spacing_weights(weights) }
}

/// The area of the triangles round each point, in means; a point without triangles weighs as the mean one.
pub(crate) fn area_weights(points: &[[f64; 3]], triangles: &[[u32; 3]]) -> Vec<f64> {
    let mut weights = vec![0.0; points.len()];
    let mut used = vec![false; points.len()];
    for t in triangles {
        let [p, q, r] = t.map(|v| points[v as usize]);
        let area = point_cloud::vec3::norm(point_cloud::vec3::cross(
            point_cloud::vec3::sub(q, p),
            point_cloud::vec3::sub(r, p),
        ));
        for &v in t {
            weights[v as usize] += area;
            used[v as usize] = true;
        }
    }
    let count = used.iter().filter(|&&used| used).count().max(1) as f64;
    let mean = weights.iter().sum::<f64>() / count;
    let of = |(weight, used): (f64, bool)| if used && mean > 0.0 { (weight / mean).max(LEAST_WEIGHT) } else { 1.0 };
    weights.into_iter().zip(used).map(of).collect()
}

/// A point of a facet: the facet and barycentric coordinates in it.
type OnFacet = (u32, [f64; 3]);

struct Splitting<'a> {
    curved: &'a CurvedTriangles,
    places: Vec<[f64; 3]>,
    parameters: Vec<[f64; 2]>,
    triangles: Vec<[u32; 3]>,
    /// For each triangle the facet it is a part of, and where its corners lie in it.
    parts: Vec<(u32, [[f64; 3]; 3])>,
    /// The triangles at each edge.
    sides: FxHashMap<(u32, u32), Vec<u32>>,
}

fn edge(a: u32, b: u32) -> (u32, u32) {
    (a.min(b), a.max(b))
}

impl<'a> Splitting<'a> {
    fn new(curved: &'a CurvedTriangles, parameters: ArrayView2<'_, f64>) -> Self {
        let triangles = curved.triangles().to_vec();
        let mut sides: FxHashMap<(u32, u32), Vec<u32>> = FxHashMap::default();
        for (t, triangle) in triangles.iter().enumerate() {
            for k in 0..3 {
                sides.entry(edge(triangle[k], triangle[(k + 1) % 3])).or_default().push(t as u32);
            }
        }
        let corners = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        Self {
            places: curved.vertices().to_vec(),
            parameters: parameters.outer_iter().map(|row| [row[0], row[1]]).collect(),
            parts: (0..triangles.len() as u32).map(|t| (t, corners)).collect(),
            triangles,
            sides,
            curved,
        }
    }

    fn waiting(&self, (a, b): (u32, u32)) -> Waiting {
        let [p, q] = [a, b].map(|v| self.places[v as usize]);
        Waiting { length: point_cloud::vec3::norm(point_cloud::vec3::sub(q, p)), edge: (a, b) }
    }

    /// Splits edges that are longer than `longest` says, of the parameters of their ends, the longest first. `None` if there are none.
    fn split_all(mut self, periodic: [bool; 2], longest: impl Fn([f64; 2], [f64; 2]) -> f64) -> Option<Self> {
        let facets = self.curved.triangles().len();
        let limit = (MOST_PER_TRIANGLE * facets).min(MOST_OF_FEW.max(facets));
        let is_long = |mesh: &Self, edge: (u32, u32)| {
            let [u, v] = [edge.0, edge.1].map(|i| mesh.parameters[i as usize]);
            Some(mesh.waiting(edge)).filter(|waiting| waiting.length > longest(u, v))
        };
        let mut waiting: BinaryHeap<Waiting> = self.sides.keys().filter_map(|&edge| is_long(&self, edge)).collect();
        let given = self.places.len();
        while let Some(Waiting { edge, .. }) = waiting.pop() {
            if self.places.len() >= given + limit {
                break;
            }
            for edge in self.split(edge, periodic) {
                waiting.extend(is_long(&self, edge));
            }
        }
        (self.places.len() > given).then_some(self)
    }

    /// The mesh as it is, with weights by area.
    fn denser(self) -> Option<Denser> {
        let weights = area_weights(&self.places, &self.triangles);
        let flat = |rows: &[[f64; 3]]| rows.iter().flatten().copied().collect::<Vec<f64>>();
        let uv: Vec<f64> = self.parameters.iter().flatten().copied().collect();
        Some(Denser {
            points: Array2::from_shape_vec((self.places.len(), 3), flat(&self.places)).ok()?,
            parameters: Array2::from_shape_vec((self.parameters.len(), 2), uv).ok()?,
            weights: Array1::from(weights),
            triangles: self.triangles,
        })
    }

    /// Splits an edge and the triangles at it; the edges that come of it.
    fn split(&mut self, (a, b): (u32, u32), periodic: [bool; 2]) -> Vec<(u32, u32)> {
        let Some(at_edge) = self.sides.remove(&(a, b)) else { return Vec::new() };
        let new = self.places.len() as u32;
        // The middle on the curved triangle of each side; at a sharp edge they differ.
        let middles: Vec<OnFacet> = at_edge
            .iter()
            .map(|&t| {
                let (facet, corners) = self.parts[t as usize];
                let of =
                    |v: u32| self.triangles[t as usize].iter().position(|&w| w == v).map_or([0.0; 3], |k| corners[k]);
                let (p, q) = (of(a), of(b));
                (facet, std::array::from_fn(|k| 0.5 * (p[k] + q[k])))
            })
            .collect();
        let mut place = [0.0; 3];
        for &(facet, w) in &middles {
            let on = self.curved.on_curved(facet as usize, w);
            (0..3).for_each(|k| place[k] += on[k] / middles.len() as f64);
        }
        self.places.push(place);
        let [u, v] = [a, b].map(|v| self.parameters[v as usize]);
        self.parameters.push(std::array::from_fn(|d| middle(u[d], v[d], periodic[d])));
        let mut made = vec![edge(a, new), edge(new, b)];
        for (&t, &(facet, w)) in at_edge.iter().zip(&middles) {
            let other = self.triangles.len() as u32;
            let (triangle, (_, corners)) = (self.triangles[t as usize], self.parts[t as usize]);
            let replaced = |from: u32| {
                let is_old = |k: usize| triangle[k] != from;
                let vertices = std::array::from_fn(|k| if is_old(k) { triangle[k] } else { new });
                (vertices, (facet, std::array::from_fn(|k| if is_old(k) { corners[k] } else { w })))
            };
            let ((first, first_part), (second, second_part)) = (replaced(b), replaced(a));
            (self.triangles[t as usize], self.parts[t as usize]) = (first, first_part);
            self.triangles.push(second);
            self.parts.push(second_part);
            // The side opposite to a belongs to the second triangle now.
            let Some(&apex) = triangle.iter().find(|&&v| v != a && v != b) else { continue };
            if let Some(list) = self.sides.get_mut(&edge(b, apex)) {
                list.iter_mut().filter(|known| **known == t).for_each(|known| *known = other);
            }
            self.sides.entry(edge(a, new)).or_default().push(t);
            self.sides.entry(edge(new, b)).or_default().push(other);
            self.sides.entry(edge(new, apex)).or_default().extend([t, other]);
            made.push(edge(new, apex));
        }
        made
    }
}

/// The middle of two parameters, the short way round where the direction is periodic with period 1.
fn middle(a: f64, b: f64, periodic: bool) -> f64 {
    let far = periodic && (a - b).abs() > 0.5;
    let middle = 0.5 * (a + b) + if far { 0.5 } else { 0.0 };
    if middle >= 1.0 && far { middle - 1.0 } else { middle }
}

#[cfg(test)]
mod tests {
    use super::*;
    use deviation::Scan;
    use param_classic::triangulate_parameters;

    /// A sheet with rows at some places along x, bent along y.
    fn rows_at(places: &[f64]) -> (Vec<[f64; 3]>, Array2<f64>) {
        let (first, last) = (places[0], places[places.len() - 1]);
        let all = places.iter().flat_map(|&x| (0..12).map(move |j| (x, f64::from(j))));
        let points: Vec<[f64; 3]> = all.map(|(x, y)| [x, y, 0.01 * y * y]).collect();
        let parameters = Array2::from_shape_fn((points.len(), 2), |(i, d)| match d {
            0 => (points[i][0] - first) / (last - first),
            _ => points[i][1] / 11.0,
        });
        (points, parameters)
    }

    #[test]
    fn long_stretches_without_points_get_some_of_little_weight() {
        for gap in [20.0, 37.0, 90.0] {
            let places: Vec<f64> = (0..6).map(f64::from).chain((0..6).map(|k| 5.0 + gap + f64::from(k))).collect();
            let (points, parameters) = rows_at(&places);
            let triangles = triangulate_parameters(parameters.view()).unwrap();
            let scan = Scan::mesh(&points, &triangles).unwrap();
            let found = bridge(scan.curved().unwrap(), parameters.view(), [false; 2]).unwrap();
            let added = found.points.slice_axis(ndarray::Axis(0), (points.len()..).into()).to_owned();
            assert!(added.nrows() > 0);
            for (i, p) in added.outer_iter().enumerate() {
                assert!(p[0] > 5.0 && p[0] < 5.0 + gap, "{p}");
                assert!((p[2] - 0.01 * p[1] * p[1]).abs() < 0.05, "off the sheet: {p}");
                let u = found.parameters[[points.len() + i, 0]];
                assert!((u - p[0] / (10.0 + gap)).abs() < 0.02, "{u} at {p}");
            }
            // No stretch is left that is longer than eight steps.
            let mut xs: Vec<f64> = found.points.column(0).to_vec();
            xs.sort_by(f64::total_cmp);
            assert!(xs.windows(2).all(|pair| pair[1] - pair[0] <= 8.0), "{xs:?}");
        }
    }

    #[test]
    fn even_rows_get_no_points() {
        for step in [0.2, 1.0, 7.0] {
            let (points, parameters) = rows_at(&[0.0, step, 2.0 * step, 3.0 * step, 6.0 * step]);
            let triangles = triangulate_parameters(parameters.view()).unwrap();
            let scan = Scan::mesh(&points, &triangles).unwrap();
            assert!(bridge(scan.curved().unwrap(), parameters.view(), [false; 2]).is_none(), "{step}");
        }
    }
}
