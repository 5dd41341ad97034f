//! The mesh of a whole part, prepared for sampling and measuring.

use deviation::CurvedTriangles;
use geom_io::Scan;
use point_cloud::vec3::{box_of, cross, dot, norm, sub};
use point_cloud::{EdgeMap, TriangleMesh, TriangleTree, barycentric_in_plane, merge_duplicate_vertices};
use quad_layout::CreaseRule;

use crate::Error;

/// The triangles of a part.
pub(super) struct SolidMesh {
    pub(super) curved: CurvedTriangles,
    pub(super) tree: TriangleTree,
    pub(super) area: f64,
    pub(super) diagonal: f64,
    /// The largest sagitta of a triangle, in its middle.
    sagitta: f64,
    /// Lower and upper corner of its box.
    pub(super) bounds: [[f64; 3]; 2],
}

/// The triangles of a scan, with vertices in one place made one.
fn merged(scan: Scan) -> Result<TriangleMesh, Error> {
    let Some(triangles) = scan.triangles else { return Err(Error::NoTriangles) };
    let vertices = scan.cloud.points;
    if vertices.ncols() != 3 {
        return Err(Error::Coordinates { given: vertices.ncols() });
    }
    Ok(merge_duplicate_vertices(&TriangleMesh { vertices, triangles }).0)
}

/// Whether a scan has triangles, two at each edge.
pub(super) fn is_closed_mesh(scan: Scan) -> bool {
    let edges = merged(scan).ok().and_then(|mesh| EdgeMap::new(&mesh).ok());
    edges.is_some_and(|edges| edges.iter().all(|edge| edge.len() == 2))
}

impl SolidMesh {
    /// Makes vertices in one place one, as formats without shared vertices need it, and indexes the triangles.
    /// `creases` are where facets do not bend towards each other, beside those that are sharp.
    pub(super) fn new(scan: Scan, creases: CreaseRule) -> Result<Self, Error> {
        let mesh = merged(scan)?;
        let vertices: Vec<[f64; 3]> = mesh.vertices.rows().into_iter().map(|p| [p[0], p[1], p[2]]).collect();
        // What no layout can be made of is told where one is made.
        let creases = quad_layout::creases(&vertices, &mesh.triangles, creases).unwrap_or_default();
        let curved = CurvedTriangles::with_creases(vertices, mesh.triangles, &creases);
        let area = curved.areas().iter().sum();
        let corners: Vec<[[f64; 3]; 3]> = (0..curved.triangles().len()).map(|t| curved.corners(t)).collect();
        let bounds = box_of(corners.iter().flatten().copied());
        let diagonal = norm(sub(bounds[1], bounds[0]));
        if !(area > 0.0 && diagonal.is_finite()) {
            return Err(Error::NoTriangles);
        }
        let sagitta = (0..corners.len()).map(|t| curved.sagitta(t, MIDDLE).abs()).fold(0.0, f64::max);
        Ok(Self { tree: TriangleTree::new(&corners), curved, area, diagonal, sagitta, bounds })
    }

    /// The distance of a point from what the mesh stands for: none between a facet and the curved triangle over it.
    pub(super) fn distance(&self, point: [f64; 3]) -> f64 {
        let nearest = self.tree.nearest(point);
        let (triangle, w) = (nearest.triangle as usize, nearest.barycentric);
        let height = dot(sub(point, self.curved.on_facet(triangle, w)), self.curved.facet_normal(triangle));
        let sagitta = self.curved.sagitta(triangle, w);
        let to_curved = norm(sub(point, self.curved.on_curved(triangle, w)));
        let is_between = height * sagitta >= 0.0 && height.abs() <= sagitta.abs();
        // A facet is looked at from above; from beside it nothing lies between.
        let beside = (nearest.squared_distance - height * height).max(0.0).sqrt();
        if is_between { beside } else { nearest.squared_distance.sqrt().min(to_curved) }
    }

    /// The facet nearest to a point of the surface, and the barycentric coordinates of the point there; of facets about as near one that
    /// faces as `like` does, since thin walls have another sheet at no distance.
    pub(super) fn facet_at(&self, point: [f64; 3], like: [f64; 3]) -> (usize, [f64; 3]) {
        let nearest = self.tree.nearest(point);
        let agrees = |triangle: u32| dot(self.curved.facet_normal(triangle as usize), like);
        let mut best = nearest.triangle;
        if agrees(best) <= 0.0 {
            self.tree.for_each_within(point, nearest.squared_distance.sqrt() + AS_NEAR * self.diagonal, |triangle| {
                if agrees(triangle) > agrees(best) {
                    best = triangle;
                }
            });
        }
        if best == nearest.triangle {
            return (best as usize, nearest.barycentric);
        }
        (best as usize, self.weights_within(best as usize, point))
    }

    /// Barycentric coordinates of a place on a facet near a point: of its foot on the plane, those below 0 made 0.
    pub(super) fn weights_within(&self, triangle: usize, point: [f64; 3]) -> [f64; 3] {
        let weights = barycentric_in_plane(point, self.curved.corners(triangle)).unwrap_or(MIDDLE);
        let kept = weights.map(|w| w.max(0.0));
        let all: f64 = kept.iter().sum();
        kept.map(|w| w / all)
    }

    /// The volume that the triangles enclose, if they are closed.
    pub(super) fn volume(&self) -> f64 {
        let of = |t: usize| {
            let [p, q, r] = self.curved.corners(t);
            dot(p, cross(q, r)) / 6.0
        };
        (0..self.curved.triangles().len()).map(of).sum()
    }

    /// The normal of the facet nearest to a point; of facets about as near the one that agrees best with `like`, since at creases
    /// facets of both sides are. A facet is as near as the curved triangle over it: where it stands for something round, the surface
    /// runs beside it by its sagitta.
    pub(super) fn outward(&self, point: [f64; 3], like: [f64; 3]) -> [f64; 3] {
        let nearest = self.tree.nearest(point);
        let radius = nearest.squared_distance.sqrt() + AS_NEAR * self.diagonal;
        let mut best = self.curved.facet_normal(nearest.triangle as usize);
        let mut consider = |triangle: u32| {
            let normal = self.curved.facet_normal(triangle as usize);
            if dot(normal, like) > dot(best, like) {
                best = normal;
            }
        };
        self.tree.for_each_within(point, radius, &mut consider);
        self.tree.for_each_within(point, radius + self.sagitta, |triangle| {
            let t = triangle as usize;
            let height = dot(sub(point, self.curved.corners(t)[0]), self.curved.facet_normal(t)).abs();
            let sagitta = self.curved.sagitta(t, MIDDLE).abs();
            if sagitta > 0.0 && height <= radius + sagitta {
                consider(triangle);
            }
        });
        best
    }
}

/// The middle of a triangle.
const MIDDLE: [f64; 3] = [1.0 / 3.0; 3];

/// Facets that are by up to this share of the diagonal farther away than the nearest are about as near.
///
/// Limit: at a crease of a right angle the surface, which is some hundredths of a percent off, may be nearer to the wrong side.
const AS_NEAR: f64 = 5e-4;

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;

    #[test]
    fn facets_are_found_on_the_sheet_that_faces_the_same_way() {
        // A plate, a two thousandth as thick as it is wide; corners are numbered by the bits of their coordinates.
        let sides = [2.0, 2.0, 1e-3];
        let corners = Array2::from_shape_fn((8, 3), |(i, k)| if i >> k & 1 == 1 { sides[k] } else { 0.0 });
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let mut scan = Scan::in_memory(corners);
        scan.triangles = Some(quads.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect());
        let mesh = SolidMesh::new(scan, CreaseRule::Auto).unwrap();
        for up in [1.0, -1.0] {
            // Nearer to the upper sheet.
            let (facet, weights) = mesh.facet_at([0.7, 1.2, 8e-4], [0.0, 0.0, up]);
            assert_eq!(mesh.curved.facet_normal(facet), [0.0, 0.0, up]);
            let found = mesh.curved.on_facet(facet, weights);
            assert!((found[0] - 0.7).abs() < 1e-12 && (found[1] - 1.2).abs() < 1e-12, "{found:?}");
        }
    }
}
