//! The point of a surface nearest to a given one.

use crate::creases::area_vector;
use point_cloud::TriangleTree;
use point_cloud::vec3::{cross, dot, sub, unit};
use thb_core::{BezierMap, HierarchicalSpace, Jet, SplineMap, descend};

use crate::{Error, Tessellation};

/// Cells that a descent crosses at most: each is one Newton descent.
///
/// Limit: beyond, the triangles of the tessellation are asked, which start it in the right cell.
const MAX_HOPS: usize = 8;

/// Shift across the border of a cell, as a share of the cell, by which the neighbour is found.
///
/// Derived: below the size of the finest cells, 2⁻¹⁵ of an element.
const BEYOND_BORDER: f64 = 1e-6;

/// Newton steps shorter than this share of a cell end a descent.
///
/// Derived: the squared distance then changes by 10⁻¹⁰ of the squared size of the cell, far below any tolerance.
const STEP_TOLERANCE: f64 = 1e-5;

/// The point of a surface that is nearest to a given one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Foot {
    /// Its distance.
    pub(crate) distance: f64,
    /// The vector from it to the given point.
    pub(crate) offset: [f64; 3],
    /// Unit normal of the surface there, along `S_u × S_v`; zero where there is none.
    pub(crate) normal: [f64; 3],
    /// Whether it lies on a side of the parameter domain that is no seam.
    pub(crate) on_rim: bool,
    /// Its cell.
    pub(crate) cell: usize,
    /// Its parameter.
    pub(crate) parameter: [f64; 2],
}

impl Foot {
    /// Distance along the normal, and distance along the surface: beyond the rim.
    pub(crate) fn split(&self) -> (f64, f64) {
        let height = dot(self.offset, self.normal);
        (height.abs(), (self.distance * self.distance - height * height).max(0.0).sqrt())
    }
}

/// Queries on one surface.
pub(crate) struct SurfaceSearch<'a> {
    map: &'a SplineMap<2>,
    bezier: &'a BezierMap<2>,
    tessellation: &'a Tessellation,
    tree: TriangleTree,
    domain: ([f64; 2], [f64; 2]),
    periodic: [bool; 2],
}

impl<'a> SurfaceSearch<'a> {
    pub(crate) fn new(map: &'a SplineMap<2>, tessellation: &'a Tessellation) -> Result<Self, Error> {
        if tessellation.triangles.is_empty() {
            return Err(Error::NoArea);
        }
        let corners: Vec<[[f64; 3]; 3]> =
            tessellation.triangles.iter().map(|t| t.map(|v| tessellation.vertices[v as usize])).collect();
        let (domain, periodic) = (map.space().domain(), map.space().periodic());
        Ok(Self { map, bezier: map.bezier(), tessellation, tree: TriangleTree::new(&corners), domain, periodic })
    }

    fn space(&self) -> &HierarchicalSpace<2> {
        self.map.space()
    }

    /// The length of the domain in directions that are periodic.
    pub(crate) fn periods(&self) -> [Option<f64>; 2] {
        std::array::from_fn(|d| self.periodic[d].then(|| self.domain.1[d] - self.domain.0[d]))
    }

    /// The nearest point to `point`. With a parameter near it the search begins there, and the whole surface is searched
    /// only where that ends farther away than `enough`; the distance is then an upper bound.
    pub(crate) fn nearest(&self, point: [f64; 3], start: Option<[f64; 2]>, enough: f64) -> Foot {
        let near = start.and_then(|u| self.space().locate_cell(u).ok().map(|cell| self.descend(point, cell, u)));
        if let Some((cell, u, distance)) = near.filter(|&(.., distance)| distance <= enough) {
            return self.foot(point, cell, u, distance);
        }
        let found = self.tree.nearest(point);
        let (cell, u) = self.place_in_parameters(found.triangle, found.barycentric);
        let mut best = self.descend(point, cell, u);
        if let Some(near) = near.filter(|near| near.2 < best.2) {
            best = near;
        }
        self.foot(point, best.0, best.1, best.2)
    }

    /// Cell and parameter of a point of a triangle of the tessellation.
    pub(crate) fn place_in_parameters(&self, triangle: u32, weights: [f64; 3]) -> (usize, [f64; 2]) {
        let (t, cell) = (triangle as usize, self.tessellation.cells[triangle as usize] as usize);
        let corners = self.tessellation.corner_parameters(t);
        let (lower, upper) = self.bezier.cell_box(cell);
        let u =
            std::array::from_fn(|d| (0..3).map(|k| weights[k] * corners[k][d]).sum::<f64>().clamp(lower[d], upper[d]));
        (cell, u)
    }

    /// Newton's method in a cell, and on into neighbours while the distance falls.
    fn descend(&self, point: [f64; 3], cell: usize, u: [f64; 2]) -> (usize, [f64; 2], f64) {
        let found = descend(self.bezier, &point, cell, u, STEP_TOLERANCE);
        let mut best = (found.cell, found.u, found.distance);
        for _ in 0..MAX_HOPS {
            let (lower, upper) = self.bezier.cell_box(best.0);
            let mut beyond = best.1;
            let mut leaves = false;
            for d in 0..2 {
                let step = BEYOND_BORDER * (upper[d] - lower[d]);
                let (low, high) = (best.1[d] <= lower[d], best.1[d] >= upper[d]);
                if !low && !high {
                    continue;
                }
                let mut x = if low { lower[d] - step } else { upper[d] + step };
                if x < self.domain.0[d] || x > self.domain.1[d] {
                    if !self.periodic[d] {
                        continue;
                    }
                    x += (self.domain.1[d] - self.domain.0[d]) * if low { 1.0 } else { -1.0 };
                }
                beyond[d] = x;
                leaves = true;
            }
            if !leaves {
                break;
            }
            let Ok(cell) = self.space().locate_cell(beyond) else { break };
            let next = descend(self.bezier, &point, cell, beyond, STEP_TOLERANCE);
            // Round-off: the same border seen from the other side is no progress.
            if next.distance >= best.2 * (1.0 - 1e-12) {
                break;
            }
            best = (next.cell, next.u, next.distance);
        }
        best
    }

    fn foot(&self, point: [f64; 3], cell: usize, u: [f64; 2], distance: f64) -> Foot {
        let Jet { value, first, .. } = self.bezier.jet(cell, u);
        let on_rim = (0..2).any(|d| !self.periodic[d] && (u[d] <= self.domain.0[d] || u[d] >= self.domain.1[d]));
        Foot {
            distance,
            offset: sub(point, value),
            normal: unit(cross(first[0], first[1])),
            on_rim,
            cell,
            parameter: u,
        }
    }

    /// The point of the surface at the parameter of a point of a triangle, and its unit normal along `S_u × S_v`; zero where there is none.
    pub(crate) fn place_and_normal(&self, triangle: u32, weights: [f64; 3]) -> ([f64; 3], [f64; 3]) {
        let (cell, u) = self.place_in_parameters(triangle, weights);
        let Jet { value, first, .. } = self.bezier.jet(cell, u);
        (value, unit(cross(first[0], first[1])))
    }
}

/// Distance of `point` to the tangent plane of a surface at a parameter in a cell: what is left of its distance to a point of the
/// rim when that along the surface is taken away.
pub fn distance_across(map: &SplineMap<2>, cell: usize, u: [f64; 2], point: [f64; 3]) -> f64 {
    let mut image = [0.0; 3];
    map.bezier().derivative(cell, u, [0, 0], &mut image);
    dot(sub(point, image), unit(area_vector(map.bezier(), cell, u))).abs()
}
