//! Maps of tubes onto the unit square whose first direction wraps.

use ndarray::{Array2, Axis};
use point_cloud::vec3::{cross, dot, norm, sub};
use point_cloud::{BoundaryLoop, DiskMesh, TubeEnds};

use crate::ParamError;
use crate::barycentric::{BarycentricSystem, WeightEntry};
use crate::mesh_map::{FilledDisk, short_edge};
use crate::quality::{MapQuality, map_quality};
use crate::sequence::{Rule, sequence_parameters};
use crate::unroll::unroll;
use crate::weights::Weights;

/// Options of [`map_tube`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TubeMapParams {
    /// Weights of the inner vertices.
    pub weights: Weights,
    /// How the vertices of the two ends are spread round them.
    pub boundary: Rule,
    /// Most rounds that even out the stretch, each as much work as the map itself.
    pub rounds: usize,
}

impl Default for TubeMapParams {
    /// Mean-value weights and chord length. Ten rounds: of tapered tubes and blades the stretch is even after two to eight.
    fn default() -> Self {
        Self { weights: Weights::MeanValue, boundary: Rule::ChordLength, rounds: 10 }
    }
}

/// A map of a tube.
#[derive(Clone, Debug, PartialEq)]
pub struct TubeMap {
    /// Parameters of the vertices, shape `(m, 2)`: round the tube, in [0, 1) and wrapping at 1, and along it, in \[0, 1\]. The
    /// first end of [`TubeEnds`] lies at 0.
    pub parameters: Array2<f64>,
    /// Of each end the vertex nearest to the seam, where the first parameter is 0.
    pub seam: [u32; 2],
    /// How the map came out.
    pub report: TubeMapReport,
}

/// How a map of a tube came out.
#[derive(Clone, Debug, PartialEq)]
pub struct TubeMapReport {
    /// Vertices that were solved for, hole centres included.
    pub unknowns: usize,
    /// Largest distance of a vertex from the weighted mean of its neighbours, in parameters; near round-off.
    pub residual: f64,
    /// Holes that were closed for the map, each by a fan round an extra vertex in its centre.
    pub holes: usize,
    /// Rounds that evened out the stretch.
    pub rounds: usize,
    /// Mean squared stretch before and after them, 1 if it is the same everywhere.
    pub stretch: [f64; 2],
    /// Distortion.
    pub quality: MapQuality,
}

/// A round must lower the mean squared stretch to this share; less is not worth a solution.
const WORTHWHILE: f64 = 0.99;

/// Largest ratio of stretches that a round answers, and of their inverse: weights of very different size cost digits.
const MOST_STRETCH: f64 = 1e3;

/// Maps a mesh, taken as a tube with the given ends, onto the unit square whose first direction wraps: each end onto its side,
/// spread by [`TubeMapParams::boundary`], and every other vertex to the weighted mean of its neighbours, whole turns across the
/// seam added.
///
/// Triangles are counter-clockwise in (u, v), and none folds over: on the strip that covers the tube this is a map with positive
/// weights between two straight lines (Tutte 1963; Gortler, Gotsman & Thurston, Discrete one-forms on meshes, CAGD 23, 2006).
/// How far the ends are turned against each other is free, since with a map `(u, v)` also `(u + s v, v)` is one; `s` is taken so
/// that u and v are orthogonal on average. The seam, u = 0, goes along the short way of [`TubeEnds::path`].
///
/// Where a tube grows thin, means of neighbours crowd all its length into a small part of the square. So weights are divided by
/// the stretch at the neighbour, again and again as long as that lowers the mean stretch (Yoshizawa, Belyaev & Seidel, A fast and
/// simple stretch-minimizing mesh parameterization, SMI 2004), here measured in the rectangle that suits the tube best. Weights
/// stay positive.
///
/// # Errors
/// [`ParamError::NoLength`] for an end without length, [`ParamError::ShortEdge`], [`ParamError::Solve`],
/// [`ParamError::LongWayRound`], [`ParamError::FoldedTriangles`] where round-off spoils the theory.
pub fn map_tube(disk: &DiskMesh, ends: &TubeEnds<'_>, params: &TubeMapParams) -> Result<TubeMap, ParamError> {
    let span = tracing::info_span!("map_tube", vertices = disk.vertices().nrows());
    let _guard = span.enter();
    let filled = FilledDisk::new(disk, ends.holes.clone());
    let cover = Cover::new(disk, &filled, &ends.path);
    let n = filled.vertices.len();
    let (mut uv, mut fixed) = (vec![[0.0; 2]; n], vec![false; n]);
    for (side, rim) in ends.ends.into_iter().enumerate() {
        let start = ends.path[side * (ends.path.len() - 1)];
        for (v, u) in round(disk, rim, start, side == 1, params.boundary)? {
            (uv[v as usize], fixed[v as usize]) = ([u, side as f64], true);
        }
    }
    let entries = filled.weights(params.weights)?;
    let solve = |entries: &[WeightEntry], uv: &mut [[f64; 2]]| -> Result<(usize, f64), ParamError> {
        let system = BarycentricSystem::new(&fixed, entries.to_vec()).with_jumps(&cover.jumps(entries, n));
        system.solve(uv)?;
        let residual = system.residual(uv);
        // The heights are exact on the sides, so the vertices there turn as they should.
        let shear = cover.best_shear(uv);
        uv.iter_mut().for_each(|at| at[0] += shear * at[1]);
        Ok((system.unknowns(), residual))
    };
    let (unknowns, mut residual) = solve(&entries, &mut uv)?;
    let (first, mut local) = cover.stretch(&uv);
    let (mut rounds, mut stretch, mut entries) = (0, first, entries);
    while rounds < params.rounds {
        entries.iter_mut().for_each(|entry| entry.2 /= local[entry.1 as usize]);
        let mut next = uv.clone();
        let (_, left) = solve(&entries, &mut next)?;
        let (lower, at_vertices) = cover.stretch(&next);
        if lower.is_nan() || lower >= stretch * WORTHWHILE {
            break;
        }
        (uv, residual, stretch, local) = (next, left, lower, at_vertices);
        rounds += 1;
    }

    cover.check_turns(&uv)?;
    let middle = mean_along(&ends.path, &filled.vertices, &uv);
    let parameters = Array2::from_shape_fn((disk.vertices().nrows(), 2), |(i, k)| match k {
        // A tiny negative number wraps to 1.
        0 => (uv[i][0] - middle).rem_euclid(1.0) % 1.0,
        _ => uv[i][1].clamp(0.0, 1.0),
    });
    let cut = unroll(disk.triangles(), parameters.view(), [true, false]);
    let quality = map_quality(cut.vertices(disk.vertices()).view(), &cut.triangles, cut.parameters.view())?;
    quality.check_folds()?;
    let off_seam = |v: &u32| (parameters[[*v as usize, 0]] - 0.5).abs();
    let seam = ends.ends.map(|rim| {
        let nearest = rim.vertices.iter().max_by(|a, b| off_seam(a).total_cmp(&off_seam(b)).then(b.cmp(a)));
        nearest.copied().unwrap_or_default()
    });
    let holes = ends.holes.len();
    let report = TubeMapReport { unknowns, residual, holes, rounds, stretch: [first, stretch], quality };
    tracing::debug!(?report, "mapped");
    Ok(TubeMap { parameters, seam, report })
}

/// The vertices of an end with their share of the way round, from `start` on; `against` the order of the loop.
fn round(
    disk: &DiskMesh,
    rim: &BoundaryLoop,
    start: u32,
    against: bool,
    rule: Rule,
) -> Result<Vec<(u32, f64)>, ParamError> {
    let mut vertices = rim.vertices.clone();
    if against {
        vertices.reverse();
    }
    let first = vertices.iter().position(|&v| v == start).unwrap_or(0);
    vertices.rotate_left(first);
    let turn: Vec<usize> = vertices.iter().chain(vertices.first()).map(|&v| v as usize).collect();
    let points = disk.vertices().select(Axis(0), &turn);
    let no_length = || ParamError::NoLength { what: "an end of the tube", rule: rule.name(), points: vertices.len() };
    let shares = sequence_parameters(points.view(), rule).ok_or_else(no_length)?;
    if let Some(k) = (0..vertices.len()).find(|&k| shares[k] >= shares[k + 1]) {
        return Err(short_edge(disk, [turn[k], turn[k + 1]].map(|v| v as u32)));
    }
    Ok(vertices.into_iter().zip(shares).collect())
}

/// Mean of u along a way, by length.
fn mean_along(path: &[u32], vertices: &[[f64; 3]], uv: &[[f64; 2]]) -> f64 {
    let (mut sum, mut length) = (0.0, 0.0);
    for pair in path.windows(2) {
        let [a, b] = [pair[0] as usize, pair[1] as usize];
        let step = norm(sub(vertices[a], vertices[b]));
        sum += 0.5 * step * (uv[a][0] + uv[b][0]);
        length += step;
    }
    if length > 0.0 { sum / length } else { 0.0 }
}

/// The triangles of a tube as they lie on the strip that covers it.
struct Cover<'a> {
    /// The triangles of the mesh, then the fans in its holes.
    triangles: Vec<[u32; 3]>,
    /// Turns to add to u at each of their corners.
    turns: Vec<[f64; 3]>,
    vertices: &'a [[f64; 3]],
    /// Number of triangles without fans.
    real: usize,
}

impl<'a> Cover<'a> {
    /// Cuts a tube along a way from its first end to its second: on the left of the way, its vertices are one turn farther.
    fn new(disk: &DiskMesh, filled: &'a FilledDisk<'_>, path: &[u32]) -> Self {
        let triangles: Vec<[u32; 3]> = disk.triangles().iter().chain(&filled.fans).copied().collect();
        let mut turns = vec![[0.0; 3]; triangles.len()];
        let mut place = vec![None; filled.vertices.len()];
        path.iter().enumerate().for_each(|(at, &v)| place[v as usize] = Some(at));
        // The corners at each vertex of the way: by the vertex that follows in the triangle, and by the one before.
        let mut around: Vec<Vec<(u32, u32, usize, usize)>> = vec![Vec::new(); path.len()];
        for (t, corners) in triangles.iter().enumerate() {
            for k in 0..3 {
                if let Some(at) = place[corners[k] as usize] {
                    around[at].push((corners[(k + 1) % 3], corners[(k + 2) % 3], t, k));
                }
            }
        }
        for (at, corners) in around.iter().enumerate() {
            // Round the vertex from the way onwards to the way back, or from a boundary, all on the left.
            let (ahead, back) = (path.get(at + 1), at.checked_sub(1).map(|before| path[before]));
            let mut left = Vec::new();
            match ahead {
                Some(&ahead) => {
                    let mut from = ahead;
                    while let Some(&(_, to, t, k)) = corners.iter().find(|corner| corner.0 == from) {
                        left.push((t, k));
                        if Some(to) == back {
                            break;
                        }
                        from = to;
                    }
                }
                None => {
                    let mut to = back.unwrap_or_default();
                    while let Some(&(from, _, t, k)) = corners.iter().find(|corner| corner.1 == to) {
                        left.push((t, k));
                        to = from;
                    }
                }
            }
            left.into_iter().for_each(|(t, k)| turns[t][k] = 1.0);
        }
        Self { turns, real: disk.triangles().len(), vertices: &filled.vertices, triangles }
    }

    /// For each of `n` vertices the weighted mean of the turns to add to its neighbours; weights in the order of
    /// [`FilledDisk::weights`].
    fn jumps(&self, entries: &[WeightEntry], n: usize) -> Vec<f64> {
        let (mut sums, mut totals) = (vec![0.0; n], vec![0.0; n]);
        for (number, &(vertex, _, weight)) in entries.iter().enumerate() {
            let (turns, k) = (&self.turns[number / 6], number % 6 / 2);
            sums[vertex as usize] += weight * (turns[(k + 1 + number % 2) % 3] - turns[k]);
            totals[vertex as usize] += weight;
        }
        sums.iter().zip(totals).map(|(sum, total)| if total > 0.0 { sum / total } else { 0.0 }).collect()
    }

    /// Corners of a triangle in space and on the strip.
    fn corners(&self, t: usize, uv: &[[f64; 2]]) -> ([[f64; 3]; 3], [[f64; 2]; 3]) {
        let corners = self.triangles[t].map(|v| v as usize);
        let on_strip = |k: usize| [uv[corners[k]][0] + self.turns[t][k], uv[corners[k]][1]];
        (corners.map(|v| self.vertices[v]), [0, 1, 2].map(on_strip))
    }

    /// The `s` for which the gradients of `u + s v` and v are orthogonal on average over the surface.
    fn best_shear(&self, uv: &[[f64; 2]]) -> f64 {
        let (mut mixed, mut square) = (0.0, 0.0);
        for t in 0..self.real {
            let (p, q) = self.corners(t, uv);
            for k in 0..3 {
                let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                let (a, b) = (sub(p[i], p[k]), sub(p[j], p[k]));
                let area = norm(cross(a, b));
                if area > 0.0 {
                    // The cotangent of the angle weighs the opposite edge.
                    let weight = dot(a, b) / area;
                    let [du, dv] = [0, 1].map(|d| q[i][d] - q[j][d]);
                    mixed += weight * du * dv;
                    square += weight * dv * dv;
                }
            }
        }
        if square > 0.0 { -mixed / square } else { 0.0 }
    }

    /// The mean over the surface of `(|S_u|²/a² + |S_v|²/b²)/2`, where a and b are the means of `|S_u|` and `|S_v|` over the
    /// square; and the root of the same round each vertex, relative to the whole.
    fn stretch(&self, uv: &[[f64; 2]]) -> (f64, Vec<f64>) {
        let measured: Vec<Option<[f64; 4]>> = (0..self.triangles.len())
            .map(|t| {
                let (p, q) = self.corners(t, uv);
                let (e, f) = (sub(p[1], p[0]), sub(p[2], p[0]));
                let [d, g] = [1, 2].map(|k| [q[k][0] - q[0][0], q[k][1] - q[0][1]]);
                let plane = d[0] * g[1] - d[1] * g[0];
                let along = |x: f64, y: f64| -> f64 {
                    // The derivative of the map to the surface in a direction (x, y), squared.
                    let (r, s) = ((x * g[1] - y * g[0]) / plane, (y * d[0] - x * d[1]) / plane);
                    (0..3).map(|k| (r * e[k] + s * f[k]).powi(2)).sum()
                };
                let own = [0.5 * norm(cross(e, f)), 0.5 * plane, along(1.0, 0.0), along(0.0, 1.0)];
                (plane > 0.0 && own.iter().all(|x| x.is_finite())).then_some(own)
            })
            .collect();
        let sum = |part: &dyn Fn(&[f64; 4]) -> f64| measured.iter().flatten().map(part).sum::<f64>();
        let flat = sum(&|m| m[1]);
        let (a, b) = (sum(&|m| m[1] * m[2].sqrt()) / flat, sum(&|m| m[1] * m[3].sqrt()) / flat);
        let squared = |m: &[f64; 4]| 0.5 * (m[2] / (a * a) + m[3] / (b * b));
        let mean = sum(&|m| m[0] * squared(m)) / sum(&|m| m[0]);
        let (mut sums, mut areas) = (vec![0.0; self.vertices.len()], vec![0.0; self.vertices.len()]);
        for (corners, m) in self.triangles.iter().zip(&measured) {
            let Some(m) = m else { continue };
            for &v in corners {
                sums[v as usize] += m[0] * squared(m);
                areas[v as usize] += m[0];
            }
        }
        let local = |(sum, area): (&f64, &f64)| {
            let relative = (sum / area / mean).sqrt();
            if relative.is_finite() { relative.clamp(MOST_STRETCH.recip(), MOST_STRETCH) } else { 1.0 }
        };
        (mean, sums.iter().zip(&areas).map(local).collect())
    }

    /// Checks that no edge reaches half way round: which way it goes would not be known from its ends.
    fn check_turns(&self, uv: &[[f64; 2]]) -> Result<(), ParamError> {
        for t in 0..self.real {
            let (_, q) = self.corners(t, uv);
            for k in 0..3 {
                let share = (q[(k + 1) % 3][0] - q[k][0]).abs();
                if share >= 0.5 {
                    let vertices = [self.triangles[t][k], self.triangles[t][(k + 1) % 3]];
                    return Err(ParamError::LongWayRound { vertices, share });
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
#[path = "tube_map_tests.rs"]
mod tests;
