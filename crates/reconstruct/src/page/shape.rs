//! Surfaces and scans as they are drawn.

use deviation::{Measured, SignedDistance, Tessellation, tessellate};
use point_cloud::vec3::{cross, diagonal, dot, norm, scale, sub};
use report_page::{Part, Scan, Surface};
use thb_core::{CellSpace, HierarchicalSpace, SplineMap};

use crate::{Error, Fit, SolidFit};

/// Vertices of a drawn surface, at most.
///
/// Limit: the size of the page.
pub(super) const MOST_VERTICES: usize = 40_000;

/// Patches of a whole part share so many vertices, and have at least these each.
const FEWEST_VERTICES: usize = 200;

/// The chord error of a drawn surface at least, as a share of the diagonal of its control points: finer is not seen.
const FINEST_CHORD: f64 = 2e-5;

/// The distances of the fitted points from the surface, positive on the side that the face points to, and its normal there.
pub(super) fn signed_distances(fit: &Fit, points: &[[f64; 3]]) -> Result<Vec<SignedDistance>, Error> {
    let (map, tolerance) = (fit.surface(), fit.report.result.tolerance);
    let tessellation = tessellate(map, tolerance)?;
    let is_mesh = !fit.scanned.triangles.is_empty();
    let measured = Measured::new(map, &tessellation)?;
    let mut found = measured.signed_distances(points, is_mesh, fit.parameters.view(), tolerance);
    if fit.reversed {
        found.iter_mut().for_each(|found| *found = found.turned());
    }
    Ok(found)
}

/// A third of the area of the triangles around each point; empty without triangles.
pub(super) fn area_of_vertices(points: &[[f64; 3]], triangles: &[[u32; 3]]) -> Vec<f64> {
    if triangles.is_empty() {
        return Vec::new();
    }
    let mut areas = vec![0.0; points.len()];
    for corners in triangles {
        let [p, q, r] = corners.map(|v| points[v as usize]);
        let area = norm(cross(sub(q, p), sub(r, p))) / 6.0;
        corners.iter().for_each(|&v| areas[v as usize] += area);
    }
    areas
}

/// The triangles of a surface with normals on the side that the face points to, the lines between its cells, and its control net.
pub(super) fn surface_of(map: &SplineMap<2>, reversed: bool, chord: f64, most: usize) -> Result<Surface, Error> {
    let rows: Vec<[f64; 3]> = map.coefficients().outer_iter().map(|row| std::array::from_fn(|k| row[k])).collect();
    let finest = FINEST_CHORD * diagonal(&rows);
    let tessellation = Tessellation::new(map, chord.max(finest).max(f64::MIN_POSITIVE), most)?;
    let space = map.space();
    let (cell_lines, face_lines) = lines(&tessellation);
    let mut triangles = tessellation.triangles.clone();
    if reversed {
        triangles.iter_mut().for_each(|corners| corners.swap(1, 2));
    }
    Ok(Surface {
        normals: normals(map, &tessellation, reversed),
        triangles,
        cell_lines,
        face_lines,
        control_lines: net(space),
        control_points: rows,
        cells: cells(space),
        vertices: tessellation.vertices,
    })
}

/// The normal at each vertex; of vertices on several cells that of one of them.
fn normals(map: &SplineMap<2>, tessellation: &Tessellation, reversed: bool) -> Vec<[f64; 3]> {
    let mut normals = vec![[0.0; 3]; tessellation.vertices.len()];
    let sign = if reversed { -1.0 } else { 1.0 };
    for (t, corners) in tessellation.triangles.iter().enumerate() {
        let cell = tessellation.cells[t] as usize;
        let (lower, upper) = map.bezier().cell_box(cell);
        for (&v, u) in corners.iter().zip(tessellation.corner_parameters(t)) {
            if normals[v as usize] != [0.0; 3] {
                continue;
            }
            let inside = std::array::from_fn(|d| u[d].clamp(lower[d], upper[d]));
            let jet = map.bezier().jet(cell, inside);
            let normal = cross(jet.first[0], jet.first[1]);
            // At a pole the triangle has one.
            let normal = if norm(normal) > 0.0 { normal } else { tessellation.area_vector(t) };
            normals[v as usize] = scale(sign / norm(normal).max(f64::MIN_POSITIVE), normal);
        }
    }
    normals
}

/// Sides of triangles between two cells, and those with one triangle only.
fn lines(tessellation: &Tessellation) -> (Vec<[u32; 2]>, Vec<[u32; 2]>) {
    let sides = tessellation
        .triangles
        .iter()
        .zip(&tessellation.cells)
        .flat_map(|(&[a, b, c], &cell)| [[a, b], [b, c], [c, a]].map(|[a, b]| ([a.min(b), a.max(b)], cell)));
    let mut sides: Vec<([u32; 2], u32)> = sides.collect();
    sides.sort_unstable();
    let (mut between_cells, mut rim) = (Vec::new(), Vec::new());
    for group in sides.chunk_by(|a, b| a.0 == b.0) {
        if group.len() == 1 {
            rim.push(group[0].0);
        } else if group.iter().any(|side| side.1 != group[0].1) {
            between_cells.push(group[0].0);
        }
    }
    (between_cells, rim)
}

/// The cells in the parameter plane, from 0 to 1.
fn cells(space: &HierarchicalSpace<2>) -> Vec<[f64; 4]> {
    let (lower, upper) = space.domain();
    let share = |x: f64, d: usize| (x - lower[d]) / (upper[d] - lower[d]);
    let of_cell = |cell: usize| {
        let cell = space.cell(cell);
        [share(cell.lower[0], 0), share(cell.lower[1], 1), share(cell.upper[0], 0), share(cell.upper[1], 1)]
    };
    (0..space.n_cells()).map(of_cell).collect()
}

/// Lines between control points whose functions are neighbours of one level.
fn net(space: &HierarchicalSpace<2>) -> Vec<[u32; 2]> {
    let mut lines = Vec::new();
    let periodic = space.periodic();
    for level in 0..space.n_levels() {
        let (active, first) = (space.active_functions(level), space.first_of_level(level));
        let [n_u, n_v] = space.function_counts(level).map(|n| n as u64);
        let number = |i: u64, j: u64| active.binary_search(&(j * n_u + i)).ok().map(|at| (first + at) as u32);
        for (at, &function) in active.iter().enumerate() {
            let (i, j) = (function % n_u, function / n_u);
            let next = |x: u64, n: u64, d: usize| if x + 1 < n { Some(x + 1) } else { periodic[d].then_some(0) };
            let ends = [next(i, n_u, 0).and_then(|i| number(i, j)), next(j, n_v, 1).and_then(|j| number(i, j))];
            lines.extend(ends.into_iter().flatten().map(|end| [(first + at) as u32, end]));
        }
    }
    lines
}

/// A whole part: the samples that were fitted, and its patches.
pub(super) fn solid_part(fit: &SolidFit, chord: f64) -> Result<Part, Error> {
    let space = fit.surface.space();
    let bezier = fit.surface.bezier();
    let inward = if fit.reversed { -1.0 } else { 1.0 };
    let mut scan = Scan::default();
    for ((sample, &distance), &cell) in fit.samples.as_slice().iter().zip(&fit.distances).zip(fit.samples.cells()) {
        let jet = bezier.jet(cell as usize, sample.place.u);
        let outward = scale(inward, cross(jet.first[0], jet.first[1]));
        let height = dot(sub(sample.point, jet.value), outward);
        scan.points.push(sample.point);
        scan.deviations.push(distance.copysign(height));
        scan.normals.push(scale(1.0 / norm(outward).max(f64::MIN_POSITIVE), outward));
        scan.weights.push(if sample.arc.is_none() { sample.weight } else { 0.0 });
    }
    let mut surface = Surface::default();
    let most = (MOST_VERTICES / space.n_patches().max(1)).max(FEWEST_VERTICES);
    for patch in 0..space.n_patches() {
        let map = space.patch_map(patch, fit.surface.coefficients())?;
        append(&mut surface, surface_of(&map, fit.reversed, chord, most)?);
    }
    // The parameter plane of one patch says nothing of the others.
    surface.cells.clear();
    Ok(Part { name: String::new(), scan, surface })
}

/// Adds a surface to another one.
fn append(all: &mut Surface, one: Surface) {
    let (first, first_control) = (all.vertices.len() as u32, all.control_points.len() as u32);
    all.triangles.extend(one.triangles.iter().map(|corners| corners.map(|v| first + v)));
    all.cell_lines.extend(one.cell_lines.iter().map(|ends| ends.map(|v| first + v)));
    all.face_lines.extend(one.face_lines.iter().map(|ends| ends.map(|v| first + v)));
    all.control_lines.extend(one.control_lines.iter().map(|ends| ends.map(|v| first_control + v)));
    all.vertices.extend(one.vertices);
    all.normals.extend(one.normals);
    all.control_points.extend(one.control_points);
}
