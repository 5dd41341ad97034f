//! Refinement of a one-to-one map towards less distortion, without a fold at any step.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{Argsort, Pair, SparseColMat, SymbolicSparseColMat};
use faer::{Conj, MatMut, Par, Side};
use ndarray::{Array2, ArrayView2};
use point_cloud::CloudError;
use robust::{Coord, orient2d};

use crate::ParamError;
use crate::dirichlet::{FlatTriangle, best_stretch, energy, quadratic_model};
use crate::quality::{MapQuality, map_quality};

/// Options of [`refine_injective`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InjectiveParams {
    /// Most iterations, each with one sparse Cholesky solution. The first few take away the extremes.
    pub iterations: usize,
    /// It ends once an iteration lowers the energy by less than this share.
    pub tolerance: f64,
    /// Whether boundary vertices may slide along their side; otherwise they stay.
    pub slide: bool,
}

impl Default for InjectiveParams {
    fn default() -> Self {
        Self { iterations: 10, tolerance: 1e-3, slide: true }
    }
}

/// Why a refinement ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InjectiveStop {
    /// The energy no longer falls.
    Converged,
    /// All iterations are used; more may lower the energy further.
    Iterations,
    /// No step is found that lowers the energy: round-off in thin triangles. The map is as good as it gets.
    NoStep,
}

/// A refined map.
#[derive(Clone, Debug, PartialEq)]
pub struct InjectiveMap {
    /// Parameters (u, v) of the vertices, shape `(m, 2)`.
    pub parameters: Array2<f64>,
    /// How it went.
    pub report: InjectiveReport,
}

/// How a refinement went.
#[derive(Clone, Debug, PartialEq)]
pub struct InjectiveReport {
    /// Symmetric Dirichlet energy per area before, at least 4 (an isometry up to scale), in the rectangle that suits
    /// the map best.
    pub energy_before: f64,
    /// The same after.
    pub energy_after: f64,
    /// Width over height of the rectangle that the refined map suits best; the square is this rectangle, scaled.
    pub aspect: f64,
    /// Iterations done.
    pub iterations: usize,
    /// Why it ended.
    pub stop: InjectiveStop,
    /// Vertices held in place: corners, rims of holes, vertices of triangles without area in space or in the plane.
    pub held: usize,
    /// Distortion after.
    pub quality: MapQuality,
}

/// Share of the way to the first collapsing triangle that a step may go.
const SAFE_SHARE: f64 = 0.8;
/// Share of the predicted decrease that a step must reach (Armijo).
const SUFFICIENT_DECREASE: f64 = 1e-4;
/// Halvings of a step; 2⁻³⁰ of a step changes the energy by round-off only.
const HALVINGS: usize = 30;
/// Added to the diagonal, relative to it: keeps the matrix definite where a sliver's weights drown its neighbours'.
const DAMPING: f64 = 1e-12;

/// Lowers the distortion of a one-to-one map of a mesh, vertices of shape `(m, 3)`, onto the unit square, `uv` of shape
/// `(m, 2)`, by a few iterations of the reweighted local–global method on the symmetric Dirichlet energy (Rabinovich et
/// al., Scalable locally injective mappings, ACM TOG 36, 2017). This goes beyond Imperatore 2024.
///
/// The energy is taken in the rectangle of area 1 whose sides suit the map best, so a long strip is not punished for
/// being mapped to a square. It grows beyond all bounds where a triangle collapses, steps end before the first one
/// does, and the orientation is checked exactly: no triangle folds. Vertices on a side stay on it, corners stay; so the
/// map stays one-to-one. Triangles that are collapsed keep their vertices.
///
/// For a cloud, take the triangles of [`triangulate_parameters`](crate::triangulate_parameters).
///
/// # Errors
/// [`ParamError::FoldedTriangles`] if the map folds to begin with; those of [`map_quality`]; parameters not finite;
/// [`CloudError::BadOption`] for a negative tolerance; [`ParamError::Solve`].
pub fn refine_injective(
    vertices: ArrayView2<'_, f64>,
    triangles: &[[u32; 3]],
    uv: ArrayView2<'_, f64>,
    params: &InjectiveParams,
) -> Result<InjectiveMap, ParamError> {
    let span = tracing::info_span!("refine_injective", vertices = vertices.nrows());
    let _guard = span.enter();
    if params.tolerance.is_nan() || params.tolerance < 0.0 {
        return Err(
            CloudError::BadOption { name: "tolerance", value: params.tolerance, range: "zero or positive" }.into()
        );
    }
    point_cloud::check_finite(vertices)?;
    point_cloud::check_finite(uv)?;
    let before = map_quality(vertices, triangles, uv)?;
    before.check_folds()?;
    let mut at: Vec<[f64; 2]> = uv.rows().into_iter().map(|p| [p[0], p[1]]).collect();
    let Some(problem) = Problem::new(vertices, triangles, &at, params.slide)? else {
        // Nothing can move.
        let (e, held) = (4.0, at.len());
        let report = InjectiveReport {
            energy_before: e,
            energy_after: e,
            aspect: 1.0,
            iterations: 0,
            stop: InjectiveStop::Converged,
            held,
            quality: before,
        };
        return Ok(InjectiveMap { parameters: uv.to_owned(), report });
    };
    let mut stretch = best_stretch(&problem.triangles, &at);
    let energy_before = energy(&problem.triangles, &at, stretch);
    let (mut current, mut iterations, mut stop) = (energy_before, 0, InjectiveStop::Iterations);
    while iterations < params.iterations {
        // A matrix that is not definite to round-off is as good a reason to stop as a step that does not help.
        let direction = problem.direction(&at, stretch).inspect_err(|reason| tracing::debug!(%reason, "no direction"));
        let next = direction.ok().and_then(|(step, slope)| problem.search(&at, &step, slope, stretch, current));
        let Some(next) = next else {
            stop = InjectiveStop::NoStep;
            break;
        };
        at = next;
        iterations += 1;
        // The best stretch lowers the energy once more.
        stretch = best_stretch(&problem.triangles, &at);
        let lowered = energy(&problem.triangles, &at, stretch);
        tracing::debug!(iterations, energy = lowered, stretch, "refined");
        let converged = current - lowered <= params.tolerance * current;
        current = lowered;
        if converged {
            stop = InjectiveStop::Converged;
            break;
        }
    }
    let parameters = Array2::from_shape_fn((at.len(), 2), |(i, k)| at[i][k]);
    let quality = map_quality(vertices, triangles, parameters.view())?;
    quality.check_folds()?;
    let report = InjectiveReport {
        energy_before,
        energy_after: current,
        aspect: stretch * stretch,
        iterations,
        stop,
        held: problem.held,
        quality,
    };
    Ok(InjectiveMap { parameters, report })
}

/// The triangles that count, and the coordinates that move.
struct Problem {
    triangles: Vec<FlatTriangle>,
    /// Column of each coordinate of each vertex in the linear system.
    column: Vec<[Option<usize>; 2]>,
    columns: usize,
    held: usize,
    /// Where the matrix has entries, the same in all iterations, and the order in which they are summed up.
    pattern: (SymbolicSparseColMat<usize>, Argsort<usize>),
    symbolic: SymbolicCholesky<usize>,
}

impl Problem {
    /// `None` if no vertex can move.
    fn new(
        vertices: ArrayView2<'_, f64>,
        triangles: &[[u32; 3]],
        uv: &[[f64; 2]],
        slide: bool,
    ) -> Result<Option<Self>, ParamError> {
        let point = |v: u32| std::array::from_fn(|k| vertices[[v as usize, k]]);
        let (mut flat, mut free) = (Vec::with_capacity(triangles.len()), vec![[false; 2]; uv.len()]);
        let mut stuck = vec![false; uv.len()];
        for &triangle in triangles {
            let with_area = FlatTriangle::new(triangle, triangle.map(point))
                .filter(|t| is_positive(t, uv) && energy(std::slice::from_ref(t), uv, 1.0).is_finite());
            triangle.iter().for_each(|&v| match &with_area {
                Some(_) => free[v as usize] = [true; 2],
                None => stuck[v as usize] = true,
            });
            flat.extend(with_area);
        }
        let total: f64 = flat.iter().map(|t| t.area).sum();
        flat.iter_mut().for_each(|t| t.normalize(total));
        // Vertices of edges with one triangle are on the boundary.
        let mut edges: Vec<[u32; 2]> = triangles
            .iter()
            .flat_map(|t| (0..3).map(|k| [t[k].min(t[(k + 1) % 3]), t[k].max(t[(k + 1) % 3])]))
            .collect();
        edges.sort_unstable();
        for edge in edges.chunk_by(|a, b| a == b).filter(|e| e.len() == 1) {
            for v in edge[0].map(|v| v as usize) {
                let on_side = uv[v].iter().any(|&x| x == 0.0 || x == 1.0);
                stuck[v] |= !on_side || !slide;
            }
        }
        let (mut columns, mut held) = (0, 0);
        let mut column = vec![[None; 2]; uv.len()];
        for v in 0..uv.len() {
            for k in 0..2 {
                if free[v][k] && !stuck[v] && uv[v][k] != 0.0 && uv[v][k] != 1.0 {
                    column[v][k] = Some(columns);
                    columns += 1;
                }
            }
            held += usize::from(column[v] == [None; 2]);
        }
        if columns == 0 {
            return Ok(None);
        }
        let failed = |reason: String| ParamError::Solve { unknowns: columns, reason };
        let mut places: Vec<Pair<usize, usize>> = Vec::new();
        for triangle in &flat {
            for_lower(triangle, &column, |row, col, _, _, _| places.push(Pair { row, col }));
        }
        places.extend((0..columns).map(|i| Pair { row: i, col: i }));
        let pattern = SymbolicSparseColMat::try_new_from_indices(columns, columns, &places)
            .map_err(|e| failed(format!("{e:?}")))?;
        let symbolic = factorize_symbolic_cholesky(
            pattern.0.as_ref(),
            Side::Lower,
            SymmetricOrdering::Amd,
            CholeskySymbolicParams::default(),
        )
        .map_err(|e| failed(format!("{e:?}")))?;
        Ok(Some(Self { triangles: flat, column, columns, held, pattern, symbolic }))
    }

    /// The step to the minimum of the quadratic model, and the derivative of the energy along it.
    fn direction(&self, uv: &[[f64; 2]], stretch: f64) -> Result<(Vec<[f64; 2]>, f64), ParamError> {
        let failed = |reason: String| ParamError::Solve { unknowns: self.columns, reason };
        let scales = [stretch, stretch.recip()];
        let mut values = Vec::with_capacity(21 * self.triangles.len() + self.columns);
        let mut right = vec![0.0; self.columns];
        let mut diagonal = vec![0.0; self.columns];
        for triangle in &self.triangles {
            let mut jacobian = triangle.jacobian(uv);
            for (row, scale) in jacobian.iter_mut().zip(scales) {
                row.iter_mut().for_each(|x| *x *= scale);
            }
            let (m, product) = quadratic_model(jacobian);
            let model: [[f64; 2]; 2] =
                std::array::from_fn(|k| std::array::from_fn(|l| triangle.area * m[k][l] * scales[k] * scales[l]));
            for_lower(triangle, &self.column, |_, _, k, l, product| values.push(model[k][l] * product));
            for (gradient, &vertex) in triangle.gradients.iter().zip(&triangle.vertices) {
                for k in 0..2 {
                    if let Some(column) = self.column[vertex as usize][k] {
                        let along = product[k][0] * gradient[0] + product[k][1] * gradient[1];
                        right[column] -= triangle.area * scales[k] * along;
                        let length = gradient[0] * gradient[0] + gradient[1] * gradient[1];
                        diagonal[column] += model[k][k] * length;
                    }
                }
            }
        }
        values.extend(diagonal.iter().map(|d| DAMPING * d));
        let gradient = right.clone();
        let (pattern, order) = &self.pattern;
        let matrix =
            SparseColMat::new_from_argsort(pattern.clone(), order, &values).map_err(|e| failed(format!("{e:?}")))?;
        let scratch = self
            .symbolic
            .factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default())
            .or(self.symbolic.solve_in_place_scratch::<f64>(1, Par::Seq));
        let mut memory = MemBuffer::try_new(scratch).map_err(|e| failed(format!("{e:?}")))?;
        let mut factor = vec![0.0; self.symbolic.len_val()];
        self.symbolic
            .factorize_numeric_llt(
                &mut factor,
                matrix.as_ref(),
                Side::Lower,
                Default::default(),
                Par::Seq,
                MemStack::new(&mut memory),
                Default::default(),
            )
            .map_err(|e| failed(format!("{e:?}")))?;
        LltRef::new(&self.symbolic, &factor).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(&mut right, self.columns, 1),
            Par::Seq,
            MemStack::new(&mut memory),
        );
        // The right side is minus half the gradient.
        let slope = -2.0 * gradient.iter().zip(&right).map(|(g, d)| g * d).sum::<f64>();
        let step = self.column.iter().map(|c| c.map(|c| c.map_or(0.0, |c| right[c]))).collect();
        Ok((step, slope))
    }

    /// The first point along the step, halved again and again, with a sufficient decrease and without a fold.
    fn search(
        &self,
        uv: &[[f64; 2]],
        step: &[[f64; 2]],
        slope: f64,
        stretch: f64,
        current: f64,
    ) -> Option<Vec<[f64; 2]>> {
        if slope.is_nan() || slope >= 0.0 {
            return None;
        }
        let first_collapse = self.triangles.iter().map(|t| collapse(t, uv, step)).fold(f64::INFINITY, f64::min);
        let mut length = (SAFE_SHARE * first_collapse).min(1.0);
        for _ in 0..HALVINGS {
            let next: Vec<[f64; 2]> =
                uv.iter().zip(step).map(|(x, d)| [x[0] + length * d[0], x[1] + length * d[1]]).collect();
            let lowered = energy(&self.triangles, &next, stretch);
            if lowered < current + SUFFICIENT_DECREASE * length * slope
                && self.triangles.iter().all(|t| is_positive(t, &next))
            {
                return Some(next);
            }
            length *= 0.5;
        }
        None
    }
}

/// Whether the image is counter-clockwise, by an exact predicate.
fn is_positive(triangle: &FlatTriangle, uv: &[[f64; 2]]) -> bool {
    let [a, b, c] = triangle.vertices.map(|v| Coord { x: uv[v as usize][0], y: uv[v as usize][1] });
    orient2d(a, b, c) > 0.0
}

/// Where along `step` the image of the triangle first loses its area; infinity if nowhere.
fn collapse(triangle: &FlatTriangle, uv: &[[f64; 2]], step: &[[f64; 2]]) -> f64 {
    let [p, q, r] = triangle.vertices.map(|v| v as usize);
    let edge = |x: &[[f64; 2]], to: usize| [x[to][0] - x[p][0], x[to][1] - x[p][1]];
    let (e, f, de, df) = (edge(uv, q), edge(uv, r), edge(step, q), edge(step, r));
    let wedge = |a: [f64; 2], b: [f64; 2]| a[0] * b[1] - a[1] * b[0];
    // Twice the area along the step: c + b t + a t².
    let (a, b, c) = (wedge(de, df), wedge(e, df) + wedge(de, f), wedge(e, f));
    let discriminant = b * b - 4.0 * a * c;
    if discriminant < 0.0 {
        return f64::INFINITY;
    }
    // Both roots without cancellation; with c > 0 a root is positive where its denominator and numerator agree.
    let sum = -0.5 * (b + discriminant.sqrt().copysign(b));
    [sum / a, c / sum].into_iter().filter(|t| *t > 0.0).fold(f64::INFINITY, f64::min)
}

/// Visits the lower triangle of the block matrix of one triangle: row and column, the coordinates that they stand for, and the product of
/// the gradients of their vertices' hat functions.
fn for_lower(
    triangle: &FlatTriangle,
    column: &[[Option<usize>; 2]],
    mut visit: impl FnMut(usize, usize, usize, usize, f64),
) {
    for (g, &v) in triangle.gradients.iter().zip(&triangle.vertices) {
        for (h, &w) in triangle.gradients.iter().zip(&triangle.vertices) {
            let product = g[0] * h[0] + g[1] * h[1];
            for k in 0..2 {
                for l in 0..2 {
                    if let (Some(i), Some(j)) = (column[v as usize][k], column[w as usize][l])
                        && i >= j
                    {
                        visit(i, j, k, l, product);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
#[path = "injective_tests.rs"]
mod tests;
