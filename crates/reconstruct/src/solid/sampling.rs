//! Samples of a part: of its area on curved triangles, and of its creases.

use multi_patch::Sample;
use point_cloud::vec3::{add, cross, dot, norm, scale, sub};
use quad_layout::QuadLayout;
use rayon::prelude::*;
use thb_core::{CellSpace, MultiPatchSpace, PatchPlace, side_point};

use super::mesh::SolidMesh;

/// Samples of the area for each cell of the space, in the mean of each patch.
///
/// Limit: more than the 16 functions of a bicubic cell, so that data decide.
const PER_CELL: usize = 24;

/// Parts that a side of a triangle is cut into at most.
///
/// Limit: 10⁴ samples a triangle.
const MOST_PARTS: usize = 100;

/// Samples of a crease or outline for each element along it.
///
/// Limit: twice the 4 functions of a cubic element.
const PER_ELEMENT: usize = 8;

/// Width of the strip whose area a crease counts for, as a share of the size of an element.
///
/// Calibrated: on a layout of a mechanical part with 70 creases. With 1 more faces fold at short arcs, with 0.05 creases are less exact.
const CREASE_WIDTH: f64 = 0.2;

/// Share of the way from an edge into the triangles beside it, at which their facet of the mesh is looked up.
///
/// Limit: round-off, which may lift a point of an edge off its facet.
const INTO: f64 = 1e-2;

/// All samples, first those of the area, patch by patch, then those of arcs that are sharp or outlines.
pub(super) fn samples(mesh: &SolidMesh, layout: &QuadLayout, sharp: &[bool], space: &MultiPatchSpace) -> Vec<Sample> {
    let of_patch = |patch: usize| of_patch(mesh, layout, patch, PER_CELL * space.cells_of_patch(patch).len());
    let mut samples: Vec<Sample> = (0..layout.patches().len()).into_par_iter().flat_map_iter(of_patch).collect();
    let topology = layout.topology();
    let size = (mesh.area / space.n_cells() as f64).sqrt();
    for arc in (0..sharp.len()).filter(|&arc| sharp[arc] || topology.uses(arc).len() == 1) {
        samples.extend(of_arc(mesh, layout, arc, space.elements(arc) * PER_ELEMENT, CREASE_WIDTH * size));
    }
    samples
}

/// About `count` samples of a patch, or one for each of its triangles: of these the middles of equal parts, on the curved triangles of
/// the mesh. However small a patch is, it has data of its own.
fn of_patch(mesh: &SolidMesh, layout: &QuadLayout, patch: usize, count: usize) -> Vec<Sample> {
    let of = &layout.patches()[patch];
    let corners: Vec<[[f64; 3]; 3]> =
        (0..of.triangles.len()).map(|triangle| layout.triangle(patch, triangle)).collect();
    let area_vectors: Vec<[f64; 3]> =
        corners.iter().map(|[p, q, r]| scale(0.5, cross(sub(*q, *p), sub(*r, *p)))).collect();
    let part = area_vectors.iter().map(|area| norm(*area)).sum::<f64>() / count as f64;
    let mut samples = Vec::with_capacity(count);
    for ((triangle, corners), area_vector) in of.triangles.iter().zip(&corners).zip(&area_vectors) {
        let area = norm(*area_vector);
        if area <= 0.0 {
            continue;
        }
        let uv = triangle.map(|v| of.uv[v as usize]);
        let parts = ((area / part).sqrt().ceil() as usize).clamp(1, MOST_PARTS);
        for w in middles(parts) {
            let point = (0..3).fold([0.0; 3], |sum, k| add(sum, scale(w[k], corners[k])));
            let u = [0, 1].map(|d| (0..3).map(|k| w[k] * uv[k][d]).sum::<f64>().clamp(0.0, 1.0));
            let (facet, weights) = mesh.facet_at(point, *area_vector);
            samples.push(Sample {
                point: mesh.curved.on_curved(facet, weights),
                normal: mesh.curved.facet_normal(facet),
                weight: area / (parts * parts) as f64,
                place: PatchPlace { patch: patch as u32, u },
                arc: None,
            });
        }
    }
    samples
}

/// Barycentric coordinates of the middles of `parts`² equal parts of a triangle.
fn middles(parts: usize) -> impl Iterator<Item = [f64; 3]> {
    let step = 1.0 / parts as f64;
    let at = move |i: usize, j: usize, third: f64| {
        let [a, b] = [i, j].map(|k| (k as f64 + third) * step);
        [a, b, 1.0 - a - b]
    };
    let rows = (0..parts).flat_map(move |i| (0..parts - i).map(move |j| [i, j]));
    rows.flat_map(move |[i, j]| {
        let upright = at(i, j, 1.0 / 3.0);
        [Some(upright), (i + j + 1 < parts).then(|| at(i, j, 2.0 / 3.0))].into_iter().flatten()
    })
}

/// `count` samples along an arc, between its ends, together weighing as much as a strip of a width.
fn of_arc(mesh: &SolidMesh, layout: &QuadLayout, arc: usize, count: usize, width: f64) -> Vec<Sample> {
    let path: Vec<[f64; 3]> = layout.path(arc).iter().map(|&v| layout.vertices()[v as usize]).collect();
    let lengths: Vec<f64> = path.windows(2).map(|pair| norm(sub(pair[1], pair[0]))).collect();
    let total: f64 = lengths.iter().sum();
    let on = layout.topology().uses(arc)[0];
    let (mut segment, mut before) = (0, 0.0);
    let mut samples = Vec::with_capacity(count);
    for k in 0..=count {
        let t = k as f64 / count as f64;
        while segment + 1 < lengths.len() && before + lengths[segment] < t * total {
            before += lengths[segment];
            segment += 1;
        }
        let share = if lengths[segment] > 0.0 { (t * total - before) / lengths[segment] } else { 0.0 };
        let point = add(path[segment], scale(share.clamp(0.0, 1.0), sub(path[segment + 1], path[segment])));
        let beside = layout.beside(arc, segment);
        let ends = if k == 0 || k == count { 0.5 } else { 1.0 };
        samples.push(Sample {
            point: on_crease(mesh, point, &beside),
            normal: [0.0; 3],
            weight: ends * total * width / count as f64,
            place: PatchPlace { patch: on.patch, u: side_point(on.side, if on.reversed { 1.0 - t } else { t }) },
            arc: Some(arc as u32),
        });
    }
    samples
}

/// The point near `point`, on a crease of the facets, where the curved triangles of both sides meet: the nearest one at which
/// each is as high over its facet as it is at the crease. Beside a plane that is a point of the plane, and of the curved triangle. `beside`
/// are points inside the layout's triangles on both sides, or on the one of an outline.
fn on_crease(mesh: &SolidMesh, point: [f64; 3], beside: &[[f64; 3]]) -> [f64; 3] {
    let mut sides = Vec::with_capacity(2);
    for inner in beside {
        let near = add(point, scale(INTO, sub(*inner, point)));
        let triangle = mesh.tree.nearest(near).triangle as usize;
        let curved = mesh.curved.on_curved(triangle, mesh.weights_within(triangle, point));
        let normal = mesh.curved.facet_normal(triangle);
        sides.push((normal, dot(sub(curved, point), normal), curved));
    }
    match sides[..] {
        [(n, a, _), (m, b, _)] if dot(n, m).abs() < NEARLY_PARALLEL => {
            // The shortest d with n·d = a and m·d = b.
            let c = dot(n, m);
            let factor = 1.0 / (1.0 - c * c);
            add(point, add(scale(factor * (a - c * b), n), scale(factor * (b - c * a), m)))
        }
        [(.., p), (.., q)] => scale(0.5, add(p, q)),
        [(.., p)] => p,
        _ => point,
    }
}

/// Cosine of the angle between facets from which on their heights fix no point: the mean of the curved triangles is taken.
const NEARLY_PARALLEL: f64 = 0.95;
