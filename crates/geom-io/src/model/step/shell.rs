//! Faces, edges and vertices of a partition: what neighbouring patches share.

use std::collections::{BTreeMap, BTreeSet};

use ndarray::{Array2, ArrayView1};
use thb_core::{HierarchicalSpace, SplineMap, TensorSpace};

use super::partition::{GridBox, partition};
use super::trim::{Rim, rims};
use crate::model::ModelErrorKind;

/// A connected shell.
pub(super) struct Shell {
    pub(super) faces: Vec<Face>,
    pub(super) edges: Vec<Edge>,
    pub(super) vertices: Vec<[f64; 3]>,
}

/// A patch and its loop, counter-clockwise in the parameter plane.
pub(super) struct Face {
    pub(super) surface: SplineMap<2, TensorSpace<2>>,
    /// The directions in which the patch closes on itself. Its seam is an edge that the loop follows both ways.
    pub(super) closed: [bool; 2],
    /// Edge numbers, and whether the loop follows the edge's own direction.
    pub(super) boundary: Vec<(usize, bool)>,
    /// The rims of its holes, one closed edge each, clockwise in the parameter plane.
    pub(super) holes: Vec<usize>,
}

/// A piece of an isoparametric line, in the direction of its growing parameter.
pub(super) struct Edge {
    pub(super) vertices: [usize; 2],
    pub(super) degree: usize,
    /// Knots with repetitions.
    pub(super) knots: Vec<f64>,
    pub(super) points: Vec<[f64; 3]>,
}

/// Corner of a patch, in cells of the finest level.
pub(super) type Corner = [u32; 2];

/// A point of the map in space; maps into the plane lie in z = 0.
pub(super) fn in_space(point: ArrayView1<'_, f64>) -> [f64; 3] {
    std::array::from_fn(|k| point.get(k).copied().unwrap_or(0.0))
}

impl Shell {
    /// The shell of a map: one face if the tensor product has at most `limit` control points, else a partition.
    ///
    /// Sides are cut at every corner that lies on them, so that neighbours share whole edges; an edge's curve comes from
    /// the map itself and is the same, to round-off, as the boundary of both patches. Edges no longer than `tolerance`
    /// are left out and their ends become one vertex: a side may collapse to a point. At the seam of a periodic direction
    /// the first and the last patch are neighbours, or one patch is its own neighbour.
    ///
    /// Each of the `holes`, closed cubic rims in the parameter plane, is cut out of one patch: no side runs through a hole.
    pub(super) fn new(
        map: &SplineMap<2>,
        limit: usize,
        tolerance: f64,
        holes: &[Array2<f64>],
        size: f64,
    ) -> Result<Self, ModelErrorKind> {
        let space = map.space();
        let (lower, upper) = space.domain();
        let counts = space.patch_knots(lower, upper)?.map(|knots| knots.n_functions());
        let grid = space.mesh().grid(space.n_levels() - 1).map(|n| n as u32);
        let finest = space.n_levels() - 1;
        let rims = rims(holes, [space.knots(finest, 0)?.breaks(), space.knots(finest, 1)?.breaks()])?;
        let boxes = match counts[0].saturating_mul(counts[1]) {
            n if n <= limit => vec![GridBox { lower: [0; 2], upper: grid }],
            _ => partition(space, limit, &rims.iter().map(|rim| rim.bounds).collect::<Vec<_>>())?,
        };
        let mut shell = Builder::new(map, grid, &boxes)?.build(&boxes, tolerance)?;
        for rim in &rims {
            shell.cut(map, rim, &boxes, size)?;
        }
        Ok(shell)
    }

    /// Cuts a hole out of the face whose box holds it.
    fn cut(&mut self, map: &SplineMap<2>, rim: &Rim, boxes: &[GridBox], size: f64) -> Result<(), ModelErrorKind> {
        for (face, b) in self.faces.iter_mut().zip(boxes) {
            if rim.is_in(b.lower, b.upper) {
                self.vertices.push(rim.start(map)?);
                self.edges.push(rim.edge(map, self.vertices.len() - 1, size)?);
                face.holes.push(self.edges.len() - 1);
                break;
            }
        }
        Ok(())
    }
}

struct Builder<'a> {
    map: &'a SplineMap<2>,
    periodic: [bool; 2],
    grid: Corner,
    /// Parameters of the finest level's cell boundaries.
    breaks: [&'a [f64]; 2],
    vertex_of: BTreeMap<Corner, usize>,
    /// For each direction: the corners on each line across it, by their position along the line. A seam is the line at 0,
    /// but it is reached twice along lines across it, at 0 and at the end of the grid.
    on_line: [BTreeMap<u32, BTreeSet<u32>>; 2],
    edge_of: BTreeMap<(Corner, Corner), usize>,
}

impl<'a> Builder<'a> {
    fn new(map: &'a SplineMap<2>, grid: Corner, boxes: &[GridBox]) -> Result<Self, ModelErrorKind> {
        let space: &HierarchicalSpace<2> = map.space();
        let finest = space.n_levels() - 1;
        let mut builder = Self {
            map,
            periodic: space.periodic(),
            grid,
            breaks: [space.knots(finest, 0)?.breaks(), space.knots(finest, 1)?.breaks()],
            vertex_of: BTreeMap::new(),
            on_line: [BTreeMap::new(), BTreeMap::new()],
            edge_of: BTreeMap::new(),
        };
        for corner in boxes.iter().flat_map(corners) {
            let (next, place) = (builder.vertex_of.len(), builder.place(corner));
            builder.vertex_of.entry(place).or_insert(next);
            builder.on_line[0].entry(place[0]).or_default().insert(corner[1]);
            builder.on_line[1].entry(place[1]).or_default().insert(corner[0]);
        }
        Ok(builder)
    }

    /// A corner without regard to the side of a seam from which it is seen.
    fn place(&self, corner: Corner) -> Corner {
        std::array::from_fn(|d| if self.periodic[d] { corner[d] % self.grid[d] } else { corner[d] })
    }

    fn build(mut self, boxes: &[GridBox], tolerance: f64) -> Result<Shell, ModelErrorKind> {
        let mut vertices = vec![[0.0; 3]; self.vertex_of.len()];
        for (corner, &vertex) in &self.vertex_of {
            vertices[vertex] = in_space(ArrayView1::from(&self.map.eval(self.parameter(*corner))?));
        }
        let mut edges = Vec::new();
        let mut loops = Vec::with_capacity(boxes.len());
        for b in boxes {
            let mut boundary = Vec::new();
            let ([u0, v0], [u1, v1]) = (b.lower, b.upper);
            // Bottom and right side run along the parameters, top and left side against them.
            for (d, at, from, to, forward) in
                [(1, v0, u0, u1, true), (0, u1, v0, v1, true), (1, v1, u0, u1, false), (0, u0, v0, v1, false)]
            {
                let first = boundary.len();
                for [start, end] in self.pieces(d, at, from, to) {
                    boundary.push((self.edge(d, start, end, &mut edges)?, forward));
                }
                if !forward {
                    boundary[first..].reverse();
                }
            }
            loops.push(boundary);
        }
        let collapsed: Vec<bool> = edges.iter().map(|edge| edge.is_collapsed(tolerance)).collect();
        merge_ends(&mut edges, &collapsed, vertices.len());
        let mut faces = Vec::with_capacity(boxes.len());
        for (b, mut boundary) in boxes.iter().zip(loops) {
            boundary.retain(|(edge, _)| !collapsed[*edge]);
            let (lower, upper) = (self.parameter(b.lower), self.parameter(b.upper));
            if boundary.is_empty() {
                return Err(ModelErrorKind::Degenerate { lower: lower.to_vec(), upper: upper.to_vec(), tolerance });
            }
            let closed = [0, 1].map(|d| self.periodic[d] && b.upper[d] - b.lower[d] == self.grid[d]);
            faces.push(Face { surface: self.map.patch(lower, upper)?, closed, boundary, holes: Vec::new() });
        }
        Ok(Shell { faces, edges, vertices })
    }

    fn parameter(&self, corner: Corner) -> [f64; 2] {
        std::array::from_fn(|d| self.breaks[d][corner[d] as usize])
    }

    /// A side, on the line where direction `d` is `at`, cut at the corners on it.
    fn pieces(&self, d: usize, at: u32, from: u32, to: u32) -> Vec<[Corner; 2]> {
        let at = self.place([at; 2])[d];
        let along: Vec<u32> = self.on_line[d].get(&at).map_or(vec![], |line| line.range(from..=to).copied().collect());
        let corner = |position| if d == 0 { [at, position] } else { [position, at] };
        along.windows(2).map(|pair| [corner(pair[0]), corner(pair[1])]).collect()
    }

    /// The edge between two corners on a line across direction `d`, made at its first use.
    fn edge(&mut self, d: usize, start: Corner, end: Corner, edges: &mut Vec<Edge>) -> Result<usize, ModelErrorKind> {
        if let Some(&edge) = self.edge_of.get(&(start, end)) {
            return Ok(edge);
        }
        // The line as the side of a strip one finest cell wide, on the side of the line where it has fewer knots.
        let mut best: Option<Edge> = None;
        let before =
            if self.periodic[d] && start[d] == 0 { self.grid[d].checked_sub(1) } else { start[d].checked_sub(1) };
        for (outer, row) in [(before, 1), ((start[d] < self.grid[d]).then_some(start[d]), 0)] {
            let Some(outer) = outer else { continue };
            let (mut lower, mut upper) = (start, end);
            (lower[d], upper[d]) = (outer, outer + 1);
            let strip = self.map.patch(self.parameter(lower), self.parameter(upper))?;
            let (knots, across) = (strip.space().knots(1 - d), strip.space().knots(d));
            let (n, n_across) = (knots.n_functions(), across.n_functions());
            if best.as_ref().is_some_and(|edge| edge.points.len() <= n) {
                continue;
            }
            let function = |i: usize| {
                let fixed = row * (n_across - 1);
                if d == 0 { i * n_across + fixed } else { fixed * n + i }
            };
            best = Some(Edge {
                vertices: [start, end].map(|corner| self.vertex_of[&self.place(corner)]),
                degree: knots.degree(),
                knots: knots.knots().to_vec(),
                points: (0..n).map(|i| in_space(strip.coefficients().row(function(i)))).collect(),
            });
        }
        edges.extend(best);
        self.edge_of.insert((start, end), edges.len() - 1);
        Ok(edges.len() - 1)
    }
}

fn corners(b: &GridBox) -> [Corner; 4] {
    [b.lower, [b.upper[0], b.lower[1]], [b.lower[0], b.upper[1]], b.upper]
}

impl Shell {
    /// Whether the shell has no boundary: each of its edges is used twice.
    pub(super) fn is_closed(&self) -> bool {
        let mut uses = vec![0; self.edges.len()];
        self.faces.iter().flat_map(|face| &face.boundary).for_each(|(edge, _)| uses[*edge] += 1);
        self.faces.iter().flat_map(|face| &face.holes).for_each(|edge| uses[*edge] += 1);
        uses.iter().all(|&uses| uses == 0 || uses == 2)
    }
}

impl Edge {
    /// Whether the control points, and with them the curve, stay that close to the first one.
    fn is_collapsed(&self, tolerance: f64) -> bool {
        let first = self.points[0];
        self.points.iter().all(|point| (0..3).map(|k| (point[k] - first[k]).powi(2)).sum::<f64>() <= tolerance.powi(2))
    }
}

/// Gives both ends of each collapsed edge the same vertex: of all vertices joined in this way the one made first.
fn merge_ends(edges: &mut [Edge], collapsed: &[bool], n_vertices: usize) {
    let mut parent: Vec<usize> = (0..n_vertices).collect();
    let root = |parent: &[usize], mut vertex: usize| {
        while parent[vertex] != vertex {
            vertex = parent[vertex];
        }
        vertex
    };
    for (edge, _) in edges.iter().zip(collapsed).filter(|(_, collapsed)| **collapsed) {
        let [a, b] = edge.vertices.map(|vertex| root(&parent, vertex));
        parent[a.max(b)] = a.min(b);
    }
    for edge in edges {
        edge.vertices = edge.vertices.map(|vertex| root(&parent, vertex));
    }
}
