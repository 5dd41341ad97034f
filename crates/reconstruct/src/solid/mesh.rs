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
        let weights = barycentric_in_plane(point, self.curved.corners(best as usize)).unwrap_or(MIDDLE);
        let kept = weights.map(|w| w.max(0.0));
        let all: f64 = kept.iter().sum();
        (best as usize, kept.map(|w| w / all))
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
