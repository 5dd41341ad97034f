//! A triangle mesh that grows triangle by triangle and stays without overlap around each vertex.

use crate::star::TangentPlane;

/// The corner of a triangle `(v, from, to)` at the vertex `v`, counter-clockwise seen along the normal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Wedge {
    pub(crate) from: u32,
    pub(crate) to: u32,
}

/// Triangles over points with tangent planes, kept as the wedges at each point.
///
/// The wedges at a point do not overlap in its tangent plane; so no edge has more than two triangles, and neighbouring
/// triangles have the same orientation.
pub(crate) struct Fans<'a> {
    points: &'a [[f64; 3]],
    planes: &'a [TangentPlane],
    pub(crate) wedges: Vec<Vec<Wedge>>,
}

impl<'a> Fans<'a> {
    pub(crate) fn new(points: &'a [[f64; 3]], planes: &'a [TangentPlane]) -> Self {
        Self { points, planes, wedges: vec![Vec::new(); points.len()] }
    }

    /// Direction of point `to` in the tangent plane of point `at`, of any length.
    fn direction(&self, at: u32, to: u32) -> [f64; 2] {
        self.planes[at as usize].project(self.points[to as usize])
    }

    /// Adds a triangle if it overlaps none at its vertices.
    pub(crate) fn try_add(&mut self, triangle: [u32; 3]) -> bool {
        self.add_if(triangle, Self::fits)
    }

    /// Adds a triangle if its edges are free, even where it is folded against its tangent planes.
    pub(crate) fn try_add_folded(&mut self, triangle: [u32; 3]) -> bool {
        self.add_if(triangle, Self::has_free_edges)
    }

    fn add_if(&mut self, triangle: [u32; 3], allowed: impl Fn(&Self, u32, Wedge) -> bool) -> bool {
        let fits = (0..3).all(|k| allowed(self, triangle[k], rotated(triangle, k)));
        if fits {
            for k in 0..3 {
                self.wedges[triangle[k] as usize].push(rotated(triangle, k));
            }
        }
        fits
    }

    /// Whether a triangle has the edge between two vertices.
    pub(crate) fn has_edge(&self, a: u32, b: u32) -> bool {
        self.wedges[a as usize].iter().any(|w| w.from == b || w.to == b)
    }

    fn has_free_edges(&self, at: u32, new: Wedge) -> bool {
        self.wedges[at as usize].iter().all(|old| old.from != new.from && old.to != new.to)
    }

    fn fits(&self, at: u32, new: Wedge) -> bool {
        let [a, b] = [new.from, new.to].map(|p| self.direction(at, p));
        // Inside an angle below 180°, its first side included: two angles overlap when one begins inside the other.
        let inside = |d: [f64; 2], from: [f64; 2], to: [f64; 2]| turn(from, d) >= 0.0 && turn(d, to) > 0.0;
        turn(a, b) > 0.0
            && self.has_free_edges(at, new)
            && self.wedges[at as usize].iter().all(|old| {
                let [c, d] = [old.from, old.to].map(|p| self.direction(at, p));
                !inside(a, c, d) && !inside(c, a, b)
            })
    }

    /// Takes a triangle out.
    pub(crate) fn remove(&mut self, triangle: [u32; 3]) {
        for k in 0..3 {
            let wedge = rotated(triangle, k);
            self.wedges[triangle[k] as usize].retain(|w| *w != wedge);
        }
    }

    /// All triangles, smallest vertex first, in order.
    pub(crate) fn triangles(&self) -> Vec<[u32; 3]> {
        let mut triangles: Vec<[u32; 3]> = Vec::new();
        for (v, wedges) in self.wedges.iter().enumerate() {
            let v = v as u32;
            triangles.extend(wedges.iter().filter(|w| v < w.from && v < w.to).map(|w| [v, w.from, w.to]));
        }
        triangles.sort_unstable();
        triangles
    }

    /// The wedges at a vertex as chains of neighbours, each chain in counter-clockwise order.
    pub(crate) fn chains(&self, vertex: u32) -> Vec<Vec<Wedge>> {
        let wedges = &self.wedges[vertex as usize];
        let mut chains: Vec<Vec<Wedge>> = Vec::new();
        let mut used = vec![false; wedges.len()];
        // Chains with a first wedge, then closed rings, which may begin anywhere.
        for ring in [false, true] {
            for start in 0..wedges.len() {
                if used[start] || (!ring && wedges.iter().any(|w| w.to == wedges[start].from)) {
                    continue;
                }
                let mut chain = Vec::new();
                let mut at = Some(start);
                while let Some(k) = at.filter(|&k| !used[k]) {
                    used[k] = true;
                    chain.push(wedges[k]);
                    at = wedges.iter().position(|w| w.from == wedges[k].to);
                }
                chains.push(chain);
            }
        }
        chains
    }

    /// The closed sequences of edges with a triangle on their left side only; a gap between two fans of one vertex is
    /// passed by the shortest way, so each gap has its own loop.
    pub(crate) fn boundary_loops(&self) -> Vec<Vec<u32>> {
        // Edges v → first vertex of each open chain at v.
        let mut open: Vec<Vec<(u32, u32)>> = Vec::with_capacity(self.wedges.len());
        for v in 0..self.wedges.len() as u32 {
            let ends = |c: &Vec<Wedge>| c.first().map(|w| w.from).zip(c.last().map(|w| w.to));
            open.push(self.chains(v).iter().filter_map(ends).filter(|(from, to)| from != to).collect());
        }
        let mut passed: Vec<Vec<bool>> = open.iter().map(|c| vec![false; c.len()]).collect();
        let mut loops = Vec::new();
        for start in 0..open.len() as u32 {
            for first in 0..open[start as usize].len() {
                let (mut at, mut chain) = (start, first);
                let mut vertices = Vec::new();
                while !passed[at as usize][chain] {
                    passed[at as usize][chain] = true;
                    vertices.push(at);
                    let to = open[at as usize][chain].0;
                    // Arrived at `to` along the last edge of one of its chains; leave across the gap that follows it.
                    let back = self.direction(to, at);
                    let candidates = open[to as usize].iter().enumerate();
                    let next = candidates.min_by(|(_, x), (_, y)| {
                        let gap = |c: &(u32, u32)| angle(back, self.direction(to, c.0));
                        gap(x).total_cmp(&gap(y))
                    });
                    let Some((k, _)) = next else { break };
                    (at, chain) = (to, k);
                }
                if !vertices.is_empty() {
                    loops.push(vertices);
                }
            }
        }
        loops
    }
}

/// The wedge of `triangle` at its vertex `k`.
fn rotated(triangle: [u32; 3], k: usize) -> Wedge {
    Wedge { from: triangle[(k + 1) % 3], to: triangle[(k + 2) % 3] }
}

fn turn(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

/// Counter-clockwise angle from `a` to `b`, in [0, 2π).
fn angle(a: [f64; 2], b: [f64; 2]) -> f64 {
    let t = turn(a, b).atan2(a[0] * b[0] + a[1] * b[1]);
    if t >= 0.0 { t } else { t + std::f64::consts::TAU }
}
