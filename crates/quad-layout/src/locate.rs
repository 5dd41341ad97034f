//! The place of a point of the surface on the patches.

use point_cloud::TriangleTree;
use point_cloud::vec3::{cross, dot, sub};
use thb_core::PatchPlace;

use crate::QuadLayout;

/// Radii, in multiples of the distance of the nearest triangle, within which a triangle that faces the right way is looked for.
///
/// Limit: beyond, the point lies on no sheet of the layout that faces its way, and the nearest one is taken.
const RADII: [f64; 3] = [2.0, 8.0, 32.0];

/// Least radius, as a share of the diagonal: thin walls have another sheet at no distance.
const LEAST_RADIUS: f64 = 1e-3;

/// Where a point lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// On the patches.
    pub place: PatchPlace,
    /// How far the triangles of the layout are.
    pub distance: f64,
}

/// Finds points on the triangles of a layout.
pub struct Locator<'a> {
    layout: &'a QuadLayout,
    tree: TriangleTree,
    /// Patch and number of each triangle.
    triangles: Vec<[u32; 2]>,
    corners: Vec<[[f64; 3]; 3]>,
    least_radius: f64,
}

impl<'a> Locator<'a> {
    /// Indexes the triangles of a layout; lengths are compared with `diagonal`.
    pub fn new(layout: &'a QuadLayout, diagonal: f64) -> Self {
        let mut triangles = Vec::new();
        for (patch, of) in layout.patches.iter().enumerate() {
            triangles.extend((0..of.triangles.len()).map(|triangle| [patch as u32, triangle as u32]));
        }
        let corners: Vec<[[f64; 3]; 3]> =
            triangles.iter().map(|&[patch, triangle]| layout.triangle(patch as usize, triangle as usize)).collect();
        Self { layout, tree: TriangleTree::new(&corners), triangles, corners, least_radius: LEAST_RADIUS * diagonal }
    }

    /// The place of the nearest point of the layout on a triangle that faces the side of `normal`; of the nearest at all where there is
    /// none about.
    pub fn locate(&self, point: [f64; 3], normal: [f64; 3]) -> Spot {
        let nearest = self.tree.nearest(point);
        let distance = nearest.squared_distance.sqrt();
        if self.faces(nearest.triangle, normal) {
            return Spot { place: self.place(nearest.triangle, nearest.barycentric), distance };
        }
        for radius in RADII.map(|multiple| multiple * distance.max(self.least_radius)) {
            let mut best: Option<Spot> = None;
            self.tree.for_each_within(point, radius, |triangle| {
                if !self.faces(triangle, normal) {
                    return;
                }
                let tree = TriangleTree::new(&self.corners[triangle as usize..=triangle as usize]);
                let foot = tree.nearest(point);
                let distance = foot.squared_distance.sqrt();
                if best.is_none_or(|best| distance < best.distance) {
                    best = Some(Spot { place: self.place(triangle, foot.barycentric), distance });
                }
            });
            if let Some(best) = best {
                return best;
            }
        }
        Spot { place: self.place(nearest.triangle, nearest.barycentric), distance }
    }

    fn faces(&self, triangle: u32, normal: [f64; 3]) -> bool {
        let [p, q, r] = self.corners[triangle as usize];
        dot(cross(sub(q, p), sub(r, p)), normal) > 0.0
    }

    fn place(&self, triangle: u32, weights: [f64; 3]) -> PatchPlace {
        let [patch, triangle] = self.triangles[triangle as usize];
        let of = &self.layout.patches[patch as usize];
        let corners = of.triangles[triangle as usize].map(|v| of.uv[v as usize]);
        let u = [0, 1].map(|d| (0..3).map(|k| weights[k] * corners[k][d]).sum::<f64>().clamp(0.0, 1.0));
        PatchPlace { patch, u }
    }
}
