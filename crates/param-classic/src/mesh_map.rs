//! Maps of disk meshes onto the unit square.

use std::ops::Range;

use ndarray::{Array2, Axis};
use point_cloud::{BoundaryLoop, CornerChoice, Corners, DiskMesh, disk_corners};

use crate::ParamError;
use crate::barycentric::{BarycentricSystem, WeightEntry};
use crate::quality::{MapQuality, map_quality};
use crate::sequence::Rule;
use crate::sides::{CONSTANT_ON_SIDE, SideSet, place_sides};
use crate::weights::{Weights, corner_weights};
use point_cloud::vec3::{norm, sub};

/// Options of [`map_disk`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MeshMapParams {
    /// Weights of the interior vertices.
    pub weights: Weights,
    /// How the vertices of a side are spread over it.
    pub boundary: Rule,
    /// The vertices that become the corners of the square.
    pub corners: CornerChoice,
}

/// A map of a disk mesh onto the unit square.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshMap {
    /// Parameters (u, v) of the vertices, shape `(m, 2)`, all in \[0, 1\].
    pub parameters: Array2<f64>,
    /// The corners, as places in the mesh's outer loop: they lie at (0, 0), (1, 0), (1, 1), (0, 1).
    pub corners: Corners,
    /// How the map came out.
    pub report: MeshMapReport,
}

/// How a map came out.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshMapReport {
    /// Vertices that were solved for, hole centres included.
    pub unknowns: usize,
    /// Largest distance of a vertex from the weighted mean of its neighbours, in parameters; near round-off.
    pub residual: f64,
    /// Holes that were closed for the map, each by a fan round an extra vertex in its centre.
    pub holes: usize,
    /// Interior vertices that an edge between two vertices of one side cuts off from the rest: they lie on that side.
    pub cut_off: usize,
    /// Distortion, and the triangles that collapsed into a side.
    pub quality: MapQuality,
}

/// Shortest length of a spoke from the centre of a hole, as a share of the hole's perimeter. The centre of a strongly
/// bent hole may fall on its rim, where mean-value weights would be infinite; the map is one-to-one whatever the value.
const SHORTEST_SPOKE: f64 = 1e-3;

/// Maps a disk mesh onto the unit square: the outer loop onto its boundary, corners to corners, sides by
/// [`MeshMapParams::boundary`], and every other vertex to the weighted mean of its neighbours.
///
/// The map keeps the orientation: triangles are counter-clockwise in (u, v), so `S_u × S_v` points to the side from
/// which the mesh's triangles are counter-clockwise. It is one-to-one (see [`Weights`]) except at edges between two
/// vertices of one side: a triangle with all its vertices on one side collapses into it, and so does all that such an
/// edge cuts off. This is reported, not an error: boundary vertices keep different parameters.
///
/// Holes are closed by virtual triangles from their rim to an extra vertex in their centre, since without them the
/// rim could not be in the mean of its neighbours without folding.
///
/// Sparse LU in one thread; 10⁵ vertices take seconds.
///
/// # Errors
/// Those of [`disk_corners`] as [`ParamError::Cloud`], [`ParamError::NoLength`] for a side without length,
/// [`ParamError::ShortEdge`], [`ParamError::Solve`], [`ParamError::FoldedTriangles`] where round-off spoils the theory
/// (mapped areas near 1e-16).
pub fn map_disk(disk: &DiskMesh, params: &MeshMapParams) -> Result<MeshMap, ParamError> {
    let span = tracing::info_span!("map_disk", vertices = disk.vertices().nrows());
    let _guard = span.enter();
    let corners = disk_corners(disk, params.corners)?;
    let filled = FilledDisk::new(disk, disk.holes().iter().collect());
    let n = filled.vertices.len();
    let mut uv = vec![[0.0; 2]; n];
    let sides = place_boundary(disk, &corners, params.boundary, &mut uv)?;
    let fixed: Vec<bool> = sides.iter().map(|s| *s != SideSet::NONE).chain(vec![false; n - sides.len()]).collect();

    let system = BarycentricSystem::new(&fixed, filled.weights(params.weights)?);
    system.solve(&mut uv)?;
    let residual = system.residual(&uv);
    for at in &mut uv {
        // A mean lies in the square; round-off may leave it by a last bit.
        *at = at.map(|x| x.clamp(0.0, 1.0));
    }
    let cut_off = snap_cut_off(&system, &sides, &mut uv);

    let parameters = Array2::from_shape_fn((disk.vertices().nrows(), 2), |(i, k)| uv[i][k]);
    let quality = map_quality(disk.vertices(), disk.triangles(), parameters.view())?;
    quality.check_folds()?;
    let report = MeshMapReport { unknowns: system.unknowns(), residual, holes: disk.holes().len(), cut_off, quality };
    tracing::debug!(?report, "mapped");
    Ok(MeshMap { parameters, corners, report })
}

/// Writes the parameters of the outer loop; returns the sides that each vertex of the mesh lies on.
fn place_boundary(
    disk: &DiskMesh,
    corners: &Corners,
    rule: Rule,
    uv: &mut [[f64; 2]],
) -> Result<Vec<SideSet>, ParamError> {
    let boundary: Vec<usize> = disk.outer_loop().vertices.iter().map(|&v| v as usize).collect();
    let points = disk.vertices().select(Axis(0), &boundary);
    let (parameters, on_loop) = place_sides(points.view(), corners.positions, rule).map_err(|e| match e {
        ParamError::ShortEdge { vertices, length } => {
            ParamError::ShortEdge { vertices: vertices.map(|place| boundary[place as usize] as u32), length }
        }
        other => other,
    })?;
    let mut sides = vec![SideSet::NONE; disk.vertices().nrows()];
    for (place, &vertex) in boundary.iter().enumerate() {
        uv[vertex] = [parameters[[place, 0]], parameters[[place, 1]]];
        sides[vertex] = on_loop[place];
    }
    Ok(sides)
}

pub(crate) fn short_edge(disk: &DiskMesh, vertices: [u32; 2]) -> ParamError {
    let [a, b] = vertices.map(|v| disk.vertices().row(v as usize).to_owned());
    let difference = &b - &a;
    ParamError::ShortEdge { vertices, length: difference.dot(&difference).sqrt() }
}

/// The mesh with its holes closed.
pub(crate) struct FilledDisk<'a> {
    disk: &'a DiskMesh,
    holes: Vec<&'a BoundaryLoop>,
    /// The vertices of the mesh, then the centres of the holes.
    pub(crate) vertices: Vec<[f64; 3]>,
    /// Triangles between rim and centre, hole by hole.
    pub(crate) fans: Vec<[u32; 3]>,
    /// Of each hole, its part of `fans`.
    fan_of_hole: Vec<Range<usize>>,
}

impl<'a> FilledDisk<'a> {
    /// Closes those loops of the mesh that are `holes`.
    pub(crate) fn new(disk: &'a DiskMesh, holes: Vec<&'a BoundaryLoop>) -> Self {
        let points = disk.vertices();
        let mut vertices: Vec<[f64; 3]> = points.rows().into_iter().map(|p| std::array::from_fn(|k| p[k])).collect();
        let (mut fans, mut fan_of_hole) = (Vec::new(), Vec::new());
        for hole in &holes {
            let rim = &hole.vertices;
            let center = vertices.len() as u32;
            let mut sum = [0.0; 3];
            for &v in rim {
                sum = std::array::from_fn(|k| sum[k] + vertices[v as usize][k]);
            }
            vertices.push(sum.map(|x| x / rim.len() as f64));
            let begin = fans.len();
            // The surface runs through the rim from i to i + 1, so the fan runs back.
            fans.extend((0..rim.len()).map(|i| [rim[(i + 1) % rim.len()], rim[i], center]));
            fan_of_hole.push(begin..fans.len());
        }
        Self { disk, holes, vertices, fans, fan_of_hole }
    }

    /// The weights of every vertex's neighbours, triangle by triangle, fans last: of each corner the weight of the next one,
    /// then that of the one after.
    pub(crate) fn weights(&self, weights: Weights) -> Result<Vec<WeightEntry>, ParamError> {
        let triangles = self.disk.triangles();
        let mut entries = Vec::with_capacity(6 * (triangles.len() + self.fans.len()));
        for &triangle in triangles {
            if weights == Weights::MeanValue {
                for k in 0..3 {
                    let ends = [triangle[k], triangle[(k + 1) % 3]];
                    let [p, q] = ends.map(|v| self.vertices[v as usize]);
                    if norm(sub(p, q)) == 0.0 {
                        return Err(short_edge(self.disk, ends));
                    }
                }
            }
            self.push_triangle(&mut entries, weights, triangle, 0.0);
        }
        for (hole, fan) in self.holes.iter().zip(&self.fan_of_hole) {
            for &triangle in &self.fans[fan.clone()] {
                self.push_triangle(&mut entries, weights, triangle, SHORTEST_SPOKE * hole.length);
            }
        }
        Ok(entries)
    }

    fn push_triangle(&self, entries: &mut Vec<WeightEntry>, weights: Weights, triangle: [u32; 3], floor: f64) {
        for k in 0..3 {
            let [i, j, l] = [triangle[k], triangle[(k + 1) % 3], triangle[(k + 2) % 3]];
            let [to_j, to_l] = corner_weights(weights, [i, j, l].map(|v| self.vertices[v as usize]), floor);
            entries.push((i, j, to_j));
            entries.push((i, l, to_l));
        }
    }
}

/// Puts vertices that touch vertices of one side only exactly on it, where they are but for round-off; returns their
/// number, hole centres not counted.
fn snap_cut_off(system: &BarycentricSystem, sides: &[SideSet], uv: &mut [[f64; 2]]) -> usize {
    let side_of = |v: usize| sides.get(v).copied().unwrap_or(SideSet::NONE);
    let mut seen: Vec<bool> = (0..uv.len()).map(|v| side_of(v) != SideSet::NONE).collect();
    let mut cut_off = 0;
    for start in 0..uv.len() {
        if seen[start] {
            continue;
        }
        // The unknown vertices that hang together, and the sides that all their fixed neighbours share.
        seen[start] = true;
        let (mut part, mut common, mut next) = (vec![start], SideSet::ALL, 0);
        while next < part.len() {
            for &(neighbour, _) in system.neighbours(part[next]) {
                let neighbour = neighbour as usize;
                if side_of(neighbour) != SideSet::NONE {
                    common.0 &= side_of(neighbour).0;
                } else if !seen[neighbour] {
                    seen[neighbour] = true;
                    part.push(neighbour);
                }
            }
            next += 1;
        }
        for (side, (constant, value)) in CONSTANT_ON_SIDE.into_iter().enumerate() {
            if common.holds(side) {
                part.iter().for_each(|&v| uv[v][constant] = value);
            }
        }
        if common != SideSet::NONE {
            cut_off += part.iter().filter(|&&v| v < sides.len()).count();
        }
    }
    cut_off
}

#[cfg(test)]
#[path = "mesh_map_tests.rs"]
mod tests;
