//! What a surface of several patches is judged by: angles at arcs, folds, volume.

use point_cloud::vec3::{cross, dot, norm, unit};
use rayon::prelude::*;
use serde::Serialize;
use thb_core::bernstein::gauss_legendre;
use thb_core::{CellSpace, MultiPatchSpace, PatchPlace, side_point};

use crate::Surface;

/// Places along an arc at which angles are measured, ends included.
///
/// Derived: the definition by which results are judged.
const PLACES: usize = 21;

/// Angle in degrees between neighbouring patches along a smooth arc from which on one of them has turned over there.
///
/// Derived: half of 180°; where patches meet smoothly the angle is far below 10°.
pub const TURNED_OVER: f64 = 90.0;

/// Places in a cell and direction at which folds are looked for, and how near its border the outer ones lie.
const FOLD_PLACES: usize = 5;
const FOLD_MARGIN: f64 = 1e-3;

/// Angles, in degrees, between the normals of neighbouring patches along smooth arcs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct AngleReport {
    /// The largest.
    pub max: f64,
    /// The 99th percentile of all places, weighed alike along each arc.
    pub p99: f64,
    /// The largest at vertices.
    pub at_vertices: f64,
    /// Smooth arcs.
    pub arcs: usize,
}

/// Angles between oriented normals at places along all arcs that have two patches and are not `sharp`.
pub fn angles(surface: &Surface, sharp: &[bool]) -> AngleReport {
    let smooth = smooth_arcs(surface, sharp);
    let of_arcs: Vec<Vec<f64>> = smooth.par_iter().map(|&arc| angles_along(surface, arc)).collect();
    let at_vertices = of_arcs.iter().flat_map(|of_arc| [of_arc[0], of_arc[PLACES - 1]]).fold(0.0, f64::max);
    let mut all: Vec<f64> = of_arcs.into_iter().flatten().collect();
    all.sort_unstable_by(f64::total_cmp);
    let max = all.last().copied().unwrap_or(0.0);
    let p99 = all.get((all.len() * 99) / 100).copied().unwrap_or(max);
    AngleReport { max, p99, at_vertices, arcs: smooth.len() }
}

/// Arcs between two patches that are not sharp.
fn smooth_arcs(surface: &Surface, sharp: &[bool]) -> Vec<usize> {
    let topology = surface.space().topology();
    (0..sharp.len()).filter(|&arc| !sharp[arc] && topology.uses(arc).len() == 2).collect()
}

fn angles_along(surface: &Surface, arc: usize) -> Vec<f64> {
    let angle = |k: usize| {
        let [a, b] = beside(surface, arc, k).map(|place| normal_at(surface, place));
        norm(cross(a, b)).atan2(dot(a, b)).to_degrees()
    };
    (0..PLACES).map(angle).collect()
}

/// The k-th place along an arc, on the patches of both its sides.
fn beside(surface: &Surface, arc: usize, k: usize) -> [PatchPlace; 2] {
    let uses = surface.space().topology().uses(arc);
    let t = k as f64 / (PLACES - 1) as f64;
    [uses[0], uses[1]].map(|on| {
        let u = side_point(on.side, if on.reversed { 1.0 - t } else { t });
        PatchPlace { patch: on.patch, u }
    })
}

/// The cells on both sides of places along smooth arcs at which one of them is turned over, each as often as it has such places.
pub(crate) fn turned_over(surface: &Surface, sharp: &[bool]) -> Vec<usize> {
    let of_arc = |arc: usize| {
        let angles = angles_along(surface, arc);
        let turned = (0..PLACES).filter(|&k| angles[k] >= TURNED_OVER);
        let cells = turned.flat_map(|k| beside(surface, arc, k)).filter_map(|place| surface.space().locate(place).ok());
        cells.collect::<Vec<usize>>()
    };
    smooth_arcs(surface, sharp).into_par_iter().flat_map_iter(of_arc).collect()
}

fn area_vector(surface: &Surface, cell: usize, u: [f64; 2]) -> [f64; 3] {
    let jet = surface.bezier().jet(cell, u);
    cross(jet.first[0], jet.first[1])
}

fn normal_at(surface: &Surface, place: PatchPlace) -> [f64; 3] {
    surface.space().locate(place).map_or([0.0; 3], |cell| unit(area_vector(surface, cell, place.u)))
}

/// The patches on which the surface turns away from what it should be: `outward` gives the normal that is right near a point. Each
/// with the number of its places that are turned, of 5 × 5 in each cell.
pub fn folds(surface: &Surface, outward: impl Fn([f64; 3], [f64; 3]) -> [f64; 3] + Sync) -> Vec<(usize, usize)> {
    let space: &MultiPatchSpace = surface.space();
    let turned = turned_places(surface, outward);
    let of_patch = |patch: usize| (patch, space.cells_of_patch(patch).map(|cell| turned[cell]).sum::<usize>());
    (0..space.n_patches()).map(of_patch).filter(|(_, places)| *places > 0).collect()
}

/// The number of places in each cell, of 5 × 5, at which the surface turns away from what it should be ([`folds`]).
pub(crate) fn turned_places(surface: &Surface, outward: impl Fn([f64; 3], [f64; 3]) -> [f64; 3] + Sync) -> Vec<usize> {
    let in_cell = |cell: usize| {
        let (lower, upper) = surface.bezier().cell_box(cell);
        let places = (0..FOLD_PLACES * FOLD_PLACES).filter(|k| {
            let step = [k % FOLD_PLACES, k / FOLD_PLACES].map(|i| i as f64 / (FOLD_PLACES - 1) as f64);
            let inside = step.map(|t| FOLD_MARGIN + (1.0 - 2.0 * FOLD_MARGIN) * t);
            let u = std::array::from_fn(|d| lower[d] + inside[d] * (upper[d] - lower[d]));
            let (point, normal) = (surface.bezier().jet(cell, u).value, unit(area_vector(surface, cell, u)));
            dot(normal, outward(point, normal)) <= 0.0
        });
        places.count()
    };
    (0..surface.space().n_cells()).into_par_iter().map(in_cell).collect()
}

/// Integrals over a surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Integrals {
    /// Its area.
    pub area: f64,
    /// The volume that a closed surface encloses, `⅓ ∫ S · (S_u × S_v)`; negative if normals point inward.
    pub volume: f64,
}

/// Area and volume, by as many Gauss points a cell as make the volume exact.
pub fn integrals(surface: &Surface) -> Integrals {
    let space = surface.space().as_ref();
    // The integrand of the volume has degree 3 p − 1 in each direction.
    let gauss = gauss_legendre((3 * space.degree()[0]).div_ceil(2));
    let of_cell = |cell: usize| {
        let (lower, upper) = surface.bezier().cell_box(cell);
        let size: [f64; 2] = std::array::from_fn(|d| upper[d] - lower[d]);
        let mut sum = Integrals::default();
        for (x, wx) in &gauss {
            for (y, wy) in &gauss {
                let u = [lower[0] + x * size[0], lower[1] + y * size[1]];
                let jet = surface.bezier().jet(cell, u);
                let area = cross(jet.first[0], jet.first[1]);
                let weight = wx * wy * size[0] * size[1];
                sum.area += weight * norm(area);
                sum.volume += weight * dot(jet.value, area) / 3.0;
            }
        }
        sum
    };
    let of_cells: Vec<Integrals> = (0..space.n_cells()).into_par_iter().map(of_cell).collect();
    of_cells
        .into_iter()
        .fold(Integrals::default(), |a, b| Integrals { area: a.area + b.area, volume: a.volume + b.volume })
}
