//! A checked layout.

use std::collections::BTreeMap;
use std::sync::Arc;

use rayon::prelude::*;
use thb_core::{PatchSide, PatchTopology};

use crate::edge::path_length;
use crate::injective::{folded, map_anew};
use crate::{LayoutError, LayoutPatch};

/// A patch as it is given.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RawPatch {
    /// The vertices at its corners, counter-clockwise seen from outside.
    pub corners: [u32; 4],
    /// Vertices along its sides, from each corner to the next.
    pub paths: [Vec<u32>; 4],
    /// Its triangles, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Its vertices.
    pub vertices: Vec<u32>,
    /// The parameters of each of its vertices; corners 0 to 3 lie at (0, 0), (1, 0), (1, 1), (0, 1).
    pub uv: Vec<[f64; 2]>,
}

/// A surface cut into patches of four sides.
#[derive(Clone, Debug)]
pub struct QuadLayout {
    pub(crate) vertices: Vec<[f64; 3]>,
    topology: Arc<PatchTopology>,
    /// The vertices along each arc, from its start to its end.
    pub(crate) paths: Vec<Vec<u32>>,
    pub(crate) patches: Vec<LayoutPatch>,
    pub(crate) mapped_anew: Vec<usize>,
    /// Of a layout that was made here, which arcs were laid along creases.
    pub(crate) creases: Option<Vec<bool>>,
}

impl QuadLayout {
    /// Glues patches and checks their maps. Patches with triangles that are turned over or without area in the parameters are mapped
    /// anew: [`QuadLayout::mapped_anew`] lists them.
    ///
    /// # Errors
    /// [`LayoutError`].
    pub fn new(vertices: Vec<[f64; 3]>, patches: Vec<RawPatch>) -> Result<Self, LayoutError> {
        if let Some(index) = vertices.iter().position(|p| p.iter().any(|x| !x.is_finite())) {
            return Err(LayoutError::NotFinite { what: "vertex", index });
        }
        for (patch, raw) in patches.iter().enumerate() {
            check(patch, raw, vertices.len())?;
        }
        let (topology, paths) = glue(&patches)?;
        if let Some(arc) = topology.misoriented_arc() {
            return Err(LayoutError::Misoriented { arc });
        }
        let prepared: Vec<Result<Prepared, LayoutError>> =
            patches.par_iter().enumerate().map(|(number, raw)| Prepared::new(number, raw, &vertices)).collect();
        let mut layout = Self {
            vertices,
            topology: Arc::new(topology),
            paths,
            patches: Vec::new(),
            mapped_anew: Vec::new(),
            creases: None,
        };
        for (number, prepared) in prepared.into_iter().enumerate() {
            layout.add(number, prepared?);
        }
        tracing::info!(patches = layout.patches.len(), mapped_anew = ?layout.mapped_anew, "layout");
        Ok(layout)
    }

    fn add(&mut self, number: usize, prepared: Prepared) {
        let Prepared { mut patch, midpoints, is_new } = prepared;
        for (midpoint, place) in midpoints {
            patch.vertices[place] = self.vertices.len() as u32;
            self.vertices.push(midpoint);
        }
        if is_new {
            self.mapped_anew.push(number);
        }
        self.patches.push(patch);
    }

    /// How the patches are glued.
    pub fn topology(&self) -> &Arc<PatchTopology> {
        &self.topology
    }

    /// The vertices.
    pub fn vertices(&self) -> &[[f64; 3]] {
        &self.vertices
    }

    /// The patches.
    pub fn patches(&self) -> &[LayoutPatch] {
        &self.patches
    }

    /// The vertices along an arc, from its start to its end.
    pub fn path(&self, arc: usize) -> &[u32] {
        &self.paths[arc]
    }

    /// The patches whose given parameters folded.
    pub fn mapped_anew(&self) -> &[usize] {
        &self.mapped_anew
    }

    /// Of a layout made by [`QuadLayout::of_mesh`], which arcs are creases.
    pub fn creases(&self) -> Option<&[bool]> {
        self.creases.as_deref()
    }

    /// The same in other coordinates.
    #[must_use]
    pub fn moved(mut self, place: impl Fn([f64; 3]) -> [f64; 3]) -> Self {
        self.vertices.iter_mut().for_each(|vertex| *vertex = place(*vertex));
        self
    }

    /// The middles of the triangles beside a segment of an arc's path: one on each side that is there.
    pub fn beside(&self, arc: usize, segment: usize) -> Vec<[f64; 3]> {
        let ends = [self.paths[arc][segment], self.paths[arc][segment + 1]];
        let mut middles = Vec::with_capacity(2);
        for on in self.topology.uses(arc) {
            let patch = &self.patches[on.patch as usize];
            let has = |t: &&[u32; 3]| {
                let corners = t.map(|v| patch.vertices[v as usize]);
                ends.iter().all(|end| corners.contains(end))
            };
            if let Some(triangle) = patch.triangles.iter().position(|t| has(&t)) {
                let corners = self.triangle(on.patch as usize, triangle);
                middles.push([0, 1, 2].map(|k| (corners[0][k] + corners[1][k] + corners[2][k]) / 3.0));
            }
        }
        middles
    }

    /// The mean lengths of opposite sides of each patch, in the direction of u and of v.
    pub fn sizes(&self) -> Vec<[f64; 2]> {
        let lengths: Vec<f64> = self.paths.iter().map(|path| path_length(&self.vertices, path)).collect();
        let of_patch = |sides: &[PatchSide; 4]| {
            [0, 1].map(|d| 0.5 * (lengths[sides[d].arc as usize] + lengths[sides[d + 2].arc as usize]))
        };
        self.topology.patches().iter().map(of_patch).collect()
    }

    /// The corners of a triangle of a patch in space.
    pub fn triangle(&self, patch: usize, triangle: usize) -> [[f64; 3]; 3] {
        let patch = &self.patches[patch];
        patch.triangles[triangle].map(|v| self.vertices[patch.vertices[v as usize] as usize])
    }
}

/// A patch with numbers of its own, and vertices that it got: their points, and their places among its vertices.
struct Prepared {
    patch: LayoutPatch,
    midpoints: Vec<([f64; 3], usize)>,
    is_new: bool,
}

impl Prepared {
    fn new(number: usize, raw: &RawPatch, vertices: &[[f64; 3]]) -> Result<Self, LayoutError> {
        let local: BTreeMap<u32, u32> = raw.vertices.iter().zip(0..).map(|(&vertex, place)| (vertex, place)).collect();
        let place =
            |vertex: u32| local.get(&vertex).copied().ok_or(LayoutError::NoParameters { patch: number, vertex });
        let mut triangles = Vec::with_capacity(raw.triangles.len());
        for [a, b, c] in &raw.triangles {
            triangles.push([place(*a)?, place(*b)?, place(*c)?]);
        }
        let mut sides: [Vec<u32>; 4] = Default::default();
        for (side, path) in sides.iter_mut().zip(&raw.paths) {
            *side = path.iter().map(|&vertex| place(vertex)).collect::<Result<_, _>>()?;
        }
        let patch = LayoutPatch { triangles, vertices: raw.vertices.clone(), uv: raw.uv.clone() };
        if folded(&patch) == 0 && on_sides(&patch.uv, &sides) {
            return Ok(Self { patch, midpoints: Vec::new(), is_new: false });
        }
        let points = raw.vertices.iter().map(|&v| vertices[v as usize]).collect();
        let (mut patch, points) =
            map_anew(patch, points, &sides).map_err(|reason| LayoutError::NotADisk { patch: number, reason })?;
        let first = raw.vertices.len();
        let midpoints = points[first..].iter().copied().zip(first..).collect();
        patch.vertices.resize(points.len(), 0);
        Ok(Self { patch, midpoints, is_new: true })
    }
}

/// Largest distance of a vertex of a side from its side of the square.
///
/// Limit: parameters in files are rounded to five digits.
const OFF_SIDE: f64 = 1e-4;

/// Whether the vertices of each side lie on its side of the square, corners in the corners.
fn on_sides(uv: &[[f64; 2]], sides: &[Vec<u32>; 4]) -> bool {
    let is_near = |a: f64, b: f64| (a - b).abs() <= OFF_SIDE;
    sides.iter().enumerate().all(|(side, path)| {
        let (fixed, value) = [(1, 0.0), (0, 1.0), (1, 1.0), (0, 0.0)][side];
        let starts = path.first().is_some_and(|&v| {
            let corner = thb_core::side_point(side as u8, 0.0);
            (0..2).all(|d| is_near(uv[v as usize][d], corner[d]))
        });
        starts && path.iter().all(|&v| is_near(uv[v as usize][fixed], value))
    })
}

fn check(patch: usize, raw: &RawPatch, vertices: usize) -> Result<(), LayoutError> {
    let named = raw.corners.iter().chain(raw.paths.iter().flatten()).chain(raw.triangles.iter().flatten());
    if let Some(&vertex) = named.chain(&raw.vertices).find(|&&v| v as usize >= vertices) {
        return Err(LayoutError::NoSuchVertex { patch, vertex: vertex as usize, vertices });
    }
    if raw.uv.len() != raw.vertices.len() {
        let vertex = raw.vertices.get(raw.uv.len()).or(raw.vertices.last()).copied().unwrap_or(0);
        return Err(LayoutError::NoParameters { patch, vertex });
    }
    if raw.uv.iter().flatten().any(|x| !x.is_finite()) {
        return Err(LayoutError::NotFinite { what: "the parameter of a vertex of patch", index: patch });
    }
    for (side, path) in raw.paths.iter().enumerate() {
        let (from, to) = (raw.corners[side], raw.corners[(side + 1) % 4]);
        if path.len() < 2 || path.first() != Some(&from) || path.last() != Some(&to) {
            return Err(LayoutError::BrokenPath { patch, side, from, to });
        }
    }
    Ok(())
}

/// Paths of the same vertices, forward or backward, are one arc; it runs as its first patch does.
fn glue(patches: &[RawPatch]) -> Result<(PatchTopology, Vec<Vec<u32>>), LayoutError> {
    let mut number_of: BTreeMap<u32, u32> = BTreeMap::new();
    let mut arc_of: BTreeMap<&[u32], u32> = BTreeMap::new();
    let (mut arcs, mut paths, mut glued) = (Vec::new(), Vec::new(), Vec::with_capacity(patches.len()));
    let backward: Vec<[Vec<u32>; 4]> =
        patches.iter().map(|raw| raw.paths.clone().map(|path| path.into_iter().rev().collect())).collect();
    for (raw, backward) in patches.iter().zip(&backward) {
        let mut sides = [PatchSide { arc: 0, reversed: false }; 4];
        for (side, (path, reverse)) in sides.iter_mut().zip(raw.paths.iter().zip(backward)) {
            if let Some(&arc) = arc_of.get(path.as_slice()) {
                *side = PatchSide { arc, reversed: false };
            } else if let Some(&arc) = arc_of.get(reverse.as_slice()) {
                *side = PatchSide { arc, reversed: true };
            } else {
                let arc = arcs.len() as u32;
                arc_of.insert(path, arc);
                let ends = [path[0], path[path.len() - 1]];
                arcs.push(ends.map(|vertex| {
                    let next = number_of.len() as u32;
                    *number_of.entry(vertex).or_insert(next)
                }));
                paths.push(path.clone());
                *side = PatchSide { arc, reversed: false };
            }
        }
        glued.push(sides);
    }
    Ok((PatchTopology::new(number_of.len(), arcs, glued)?, paths))
}
