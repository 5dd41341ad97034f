//! What was scanned, prepared for measuring surfaces against it.

use std::collections::HashMap;

use point_cloud::vec3::{diagonal, dot};
use point_cloud::{CloudError, CloudTree, PointTree, SPACING_NEIGHBOURS, TriangleTree};
use rayon::prelude::*;

use crate::CurvedTriangles;

/// Largest part of a triangle that is judged at one place, as a share of the area of all.
///
/// Derived: the definition of gathered misses (docs, "What counts").
const LARGEST_PART: f64 = 1e-4;

/// Parts that a side of a triangle is cut into at least and at most.
///
/// Derived: at least four parts a triangle, by the definition of gathered misses; at most 10⁴.
const PARTS_PER_SIDE: [usize; 2] = [2, 100];

/// Spacing that a point of a cloud counts for at most, in medians: a lonely point would else outvote all others.
///
/// Derived: the definition of the weights of points (docs, "What counts").
const MAX_SPACING: f64 = 3.0;

/// Rings of neighbours round a point, one of which is the nearest to any place that the point is near to.
///
/// Limit: the largest distance is looked for where it may be (`tests/peers` measures it otherwise); each ring is a pass over the points.
const RINGS: usize = 2;

/// A scan: triangles where it has some, else points.
pub struct Scan<'a> {
    pub(crate) points: &'a [[f64; 3]],
    pub(crate) kind: Kind,
    diagonal: f64,
}

pub(crate) enum Kind {
    Mesh(Box<Mesh>),
    Cloud(Box<Cloud>),
}

/// The triangles of a scan.
pub(crate) struct Mesh {
    pub(crate) curved: CurvedTriangles,
    pub(crate) tree: TriangleTree,
    /// Whether the side of each triangle opposite to a corner belongs to no other triangle.
    rim_sides: Vec<[bool; 3]>,
    rim_vertices: Vec<bool>,
    /// Vertices of triangles, increasing.
    pub(crate) used: Vec<u32>,
    pub(crate) area: f64,
}

/// The points of a scan without triangles.
pub(crate) struct Cloud {
    pub(crate) tree: PointTree,
    /// Mean distance of each point to its neighbours.
    pub(crate) spacing: Vec<f64>,
    /// The smallest spacing among the points round each point.
    pub(crate) least_spacing: Vec<f64>,
    /// Weight of each point in shares and means: the square of its spacing, which is at most three medians.
    pub(crate) weights: Vec<f64>,
    /// Triangles over the points that are no scan, but tell which way it faces.
    pub(crate) spanned: Option<Box<Mesh>>,
    /// Whether these join points that are neighbours for certain.
    neighbours_are_known: bool,
}

impl<'a> Scan<'a> {
    /// A cloud of points, three at least.
    ///
    /// # Errors
    /// [`CloudError::TooFewPoints`].
    pub fn cloud(points: &'a [[f64; 3]]) -> Result<Self, CloudError> {
        let near = CloudTree::new(points)?;
        let neighbours = SPACING_NEIGHBOURS.min(points.len() - 1).max(1);
        let around: Vec<(f64, [u32; SPACING_NEIGHBOURS])> = near.map_nearest(neighbours, |i, near| {
            let mean = near.iter().map(|n| n.0).sum::<f64>() / near.len().max(1) as f64;
            (mean, std::array::from_fn(|k| near.get(k).map_or(i as u32, |n| n.1)))
        });
        let spacing: Vec<f64> = around.iter().map(|a| a.0).collect();
        let least_spacing = (0..RINGS).fold(spacing.clone(), |least, _| {
            let mut next = least.clone();
            for (i, (_, neighbours)) in around.iter().enumerate() {
                for &j in neighbours {
                    next[i] = next[i].min(least[j as usize]);
                    next[j as usize] = next[j as usize].min(least[i]);
                }
            }
            next
        });
        let mut sorted = spacing.clone();
        let median = *sorted.select_nth_unstable_by(points.len() / 2, f64::total_cmp).1;
        let weights = spacing.iter().map(|s| s.min(MAX_SPACING * median).powi(2)).collect();
        Ok(Self {
            points,
            kind: Kind::Cloud(Box::new(Cloud {
                tree: PointTree::new(points),
                spacing,
                least_spacing,
                weights,
                spanned: None,
                neighbours_are_known: false,
            })),
            diagonal: diagonal(points),
        })
    }

    /// The same with triangles that were spanned over the points: they tell where a surface is folded; distances are to the points alone.
    /// Where `neighbours_are_known`, as in a grid or by given parameters, they also tell where the scan passes through itself; where
    /// they were guessed from the points, nothing tells that. Nothing changes for a mesh, nor by triangles without area.
    pub fn with_spanned(mut self, triangles: &[[u32; 3]], neighbours_are_known: bool) -> Self {
        if let Kind::Cloud(cloud) = &mut self.kind {
            cloud.spanned = Mesh::new(self.points, triangles).map(Box::new);
            cloud.neighbours_are_known = neighbours_are_known;
        }
        self
    }

    /// The triangles that tell where the scan passes through itself.
    pub(crate) fn sheet(&self) -> &[[u32; 3]] {
        self.curved().or(self.spanned()).map_or(&[], CurvedTriangles::triangles)
    }

    /// A mesh, whose triangles name `points`. One without area is a cloud.
    ///
    /// # Errors
    /// [`CloudError::TooFewPoints`].
    pub fn mesh(points: &'a [[f64; 3]], triangles: &[[u32; 3]]) -> Result<Self, CloudError> {
        let Some(mesh) = Mesh::new(points, triangles) else { return Self::cloud(points) };
        let used: Vec<[f64; 3]> = triangles.iter().flatten().filter_map(|&v| points.get(v as usize)).copied().collect();
        Ok(Self { points, kind: Kind::Mesh(Box::new(mesh)), diagonal: diagonal(&used) })
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there is no point.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// Whether the scan has triangles.
    pub fn is_mesh(&self) -> bool {
        matches!(self.kind, Kind::Mesh(_))
    }

    /// Diagonal of the bounding box.
    pub fn diagonal(&self) -> f64 {
        self.diagonal
    }

    /// The curved triangles, where the scan has triangles.
    pub fn curved(&self) -> Option<&CurvedTriangles> {
        match &self.kind {
            Kind::Mesh(mesh) => Some(&mesh.curved),
            Kind::Cloud(_) => None,
        }
    }

    /// The curved triangles spanned over a cloud whose neighbours are known.
    pub fn spanned(&self) -> Option<&CurvedTriangles> {
        match &self.kind {
            Kind::Cloud(cloud) if cloud.neighbours_are_known => cloud.spanned.as_ref().map(|mesh| &mesh.curved),
            _ => None,
        }
    }

    /// The weight of each point of a cloud in shares and means; `None` for a mesh.
    pub fn weights(&self) -> Option<&[f64]> {
        match &self.kind {
            Kind::Mesh(_) => None,
            Kind::Cloud(cloud) => Some(&cloud.weights),
        }
    }

    /// The height of the curved triangles over their facets, 95th percentile by area; `None` for a cloud.
    pub fn sagitta_p95(&self) -> Option<f64> {
        let Kind::Mesh(mesh) = &self.kind else { return None };
        let middle = [1.0 / 3.0; 3];
        let heights = (0..mesh.curved.areas().len())
            .into_par_iter()
            .map(|t| (mesh.curved.sagitta(t, middle).abs(), mesh.curved.areas()[t]))
            .collect();
        Some(crate::Distances::of(heights, 0.0, [0.0; 3]).p95)
    }
}

impl Mesh {
    /// `None` without area. Triangles that name points that are not there are left out.
    fn new(points: &[[f64; 3]], triangles: &[[u32; 3]]) -> Option<Self> {
        let known = |t: &&[u32; 3]| t.iter().all(|&v| (v as usize) < points.len());
        let triangles: Vec<[u32; 3]> = triangles.iter().filter(known).copied().collect();
        let curved = CurvedTriangles::new(points.to_vec(), triangles);
        let triangles = curved.triangles();
        let area: f64 = curved.areas().iter().sum();
        if area <= 0.0 {
            return None;
        }
        let corners: Vec<[[f64; 3]; 3]> = (0..triangles.len()).map(|t| curved.corners(t)).collect();
        let mut sides: HashMap<(u32, u32), u32> = HashMap::with_capacity(3 * triangles.len() / 2);
        let side = |t: &[u32; 3], k: usize| {
            let (a, b) = (t[(k + 1) % 3], t[(k + 2) % 3]);
            (a.min(b), a.max(b))
        };
        triangles.iter().for_each(|t| (0..3).for_each(|k| *sides.entry(side(t, k)).or_insert(0) += 1));
        let rim_sides: Vec<[bool; 3]> =
            triangles.iter().map(|t| std::array::from_fn(|k| sides[&side(t, k)] == 1)).collect();
        let mut rim_vertices = vec![false; points.len()];
        for (t, rim) in triangles.iter().zip(&rim_sides) {
            for k in (0..3).filter(|&k| rim[k]) {
                rim_vertices[t[(k + 1) % 3] as usize] = true;
                rim_vertices[t[(k + 2) % 3] as usize] = true;
            }
        }
        let mut used: Vec<u32> = triangles.iter().flatten().copied().collect();
        used.sort_unstable();
        used.dedup();
        Some(Self { tree: TriangleTree::new(&corners), curved, rim_sides, rim_vertices, used, area })
    }

    /// Parts that each side of a triangle is cut into.
    pub(crate) fn parts_per_side(&self, triangle: usize) -> usize {
        let parts = (self.curved.areas()[triangle] / (LARGEST_PART * self.area)).sqrt().ceil() as usize;
        parts.clamp(PARTS_PER_SIDE[0], PARTS_PER_SIDE[1])
    }

    /// Whether a facet at a distance of at most `radius` from `place` turns by at most a right angle from `normal`.
    pub(crate) fn has_like_normal(&self, place: [f64; 3], radius: f64, normal: [f64; 3]) -> bool {
        let mut found = false;
        self.tree.for_each_within(place, radius, |t| found |= dot(self.curved.facet_normal(t as usize), normal) >= 0.0);
        found
    }

    /// Whether a point of a triangle, given by barycentric coordinates, lies on the outline or on the rim of a hole.
    pub(crate) fn is_on_rim(&self, triangle: u32, weights: [f64; 3]) -> bool {
        let t = triangle as usize;
        let vertices = self.curved.triangles()[t];
        (0..3).any(|k| weights[k] <= ON_SIDE && self.rim_sides[t][k])
            || (0..3).any(|k| weights[k] >= 1.0 - ON_SIDE && self.rim_vertices[vertices[k] as usize])
    }
}

/// Barycentric coordinate up to which a point lies on the side of a triangle.
///
/// Limit: round-off of the nearest point.
const ON_SIDE: f64 = 1e-9;
