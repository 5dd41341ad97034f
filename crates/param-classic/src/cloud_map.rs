//! Maps of scattered clouds with known boundary onto the unit square, without a mesh.

use ndarray::{Array2, ArrayView2};
use point_cloud::{BoundingBox, CloudError, CloudTree, check_surface_cloud};
use rayon::prelude::*;

use crate::ParamError;
use crate::barycentric::{BarycentricSystem, WeightEntry};
use crate::local_star::delaunay_star;
use crate::radius_graph::{COINCIDENT, apart, cut_off, radius_graph};
use crate::shape_preserving::shape_preserving_weights;
use crate::sides::BoundaryParameters;
use point_cloud::vec3::{norm, sub};

/// How an interior point of a cloud is averaged from its neighbours (Imperatore 2024, §4.2.1; Floater and Reimers,
/// Meshless parameterization and surface reconstruction, CAGD 18, 2001).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum CloudWeights {
    /// UNIF: the plain mean of all points within the radius. Sees where the points are dense, not where they are.
    Uniform,
    /// RECD: weights `|p_i − p_j|^(−exponent)` on all points within the radius.
    ReciprocalDistance {
        /// Power of the distance, from 0 (then UNIF) to 8; the published method has 1.
        exponent: f64,
    },
    /// LPSP: shape-preserving weights on the neighbours in a Delaunay triangulation of the surroundings, projected onto
    /// their plane of best fit. Reproduces plane clouds exactly.
    #[default]
    LocalProjection,
}

/// Largest exponent of [`CloudWeights::ReciprocalDistance`]: beyond it one neighbour takes all the weight.
const LARGEST_EXPONENT: f64 = 8.0;

/// Radius within which points are neighbours.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Radius {
    /// This length, in the units of the points.
    Given(f64),
    /// `3/√m` of the longest side of the bounding box (Imperatore 2024, eq. 4.16).
    Automatic,
    /// As [`Radius::Automatic`], then grown until every interior point has a path of neighbours to the boundary.
    #[default]
    Grown,
}

/// Options of [`map_cloud`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CloudMapParams {
    /// Weights of the interior points.
    pub weights: CloudWeights,
    /// Radius of the neighbourhoods.
    pub radius: Radius,
    /// Most neighbours of a point, the nearest ones; `None` for all within the radius. At least 3. The default, 64, is
    /// the published one: 3/√m of an evenly sampled square has 28.
    pub max_neighbours: Option<usize>,
}

impl Default for CloudMapParams {
    fn default() -> Self {
        Self { weights: CloudWeights::default(), radius: Radius::default(), max_neighbours: Some(64) }
    }
}

/// A map of a cloud onto the unit square.
#[derive(Clone, Debug, PartialEq)]
pub struct CloudMap {
    /// Parameters (u, v) of all points, shape `(m, 2)`, all in \[0, 1\]; those of the boundary points are the given ones.
    pub parameters: Array2<f64>,
    /// How the map came out.
    pub report: CloudMapReport,
}

/// How a map of a cloud came out.
#[derive(Clone, Debug, PartialEq)]
pub struct CloudMapReport {
    /// Interior points, which were solved for.
    pub unknowns: usize,
    /// Radius of the neighbourhoods, in the units of the points; `None` for [`correct_shape`](crate::correct_shape).
    pub radius: Option<f64>,
    /// How often the radius was grown, each time by a quarter.
    pub growths: usize,
    /// Neighbours with a weight, mean over the interior points.
    pub mean_neighbours: f64,
    /// Interior points round which no ring of neighbours closes, so that they got reciprocal distances in place of
    /// shape-preserving weights.
    pub open_rings: usize,
    /// Largest distance of a point from the weighted mean of its neighbours, in parameters.
    pub residual: f64,
}

/// Factor by which the radius grows: the neighbourhoods then grow by about half, so that at most a third of the
/// neighbours are more than are needed.
const GROWTH: f64 = 1.25;

/// Numbers of nearest neighbours that are tried where no ring closes within the radius. 24 is about as
/// many as the automatic radius finds on an even cloud; beyond 64 the tangent plane has little to do with the point.
const WIDER_SURROUNDINGS: [usize; 2] = [24, 64];

/// Number of cut-off points that an error names.
const CUT_OFF_NAMED: usize = 5;

/// How far from the boundary of the square a boundary parameter may lie: parameters read from text have nine digits.
pub const BOUNDARY_TOLERANCE: f64 = 1e-9;

/// Maps a scattered cloud, shape `(m, 3)`, onto the unit square: the boundary points to their given parameters, every
/// other point to the weighted mean of its neighbours (Imperatore 2024, §4.2.1, eq. 4.11 and 4.12).
///
/// The weights are positive, so all interior parameters lie in the convex hull of the boundary's. That the map is
/// one-to-one is not guaranteed, other than for meshes.
///
/// Sparse LU in one thread for the solution, neighbours and weights in parallel; the result does not depend on the
/// number of threads.
///
/// # Errors
/// [`CloudError`]s of a cloud that is no surface; [`ParamError::BadBoundaryPoint`]; [`CloudError::BadOption`];
/// [`ParamError::CutOffPoints`] if the radius, or the limit of neighbours, leaves points without a path to the
/// boundary; [`ParamError::Solve`].
pub fn map_cloud(
    points: ArrayView2<'_, f64>,
    boundary: &BoundaryParameters,
    params: &CloudMapParams,
) -> Result<CloudMap, ParamError> {
    let span = tracing::info_span!("map_cloud", points = points.nrows());
    let _guard = span.enter();
    check_params(params)?;
    let cloud = BoundedCloud::new(points, boundary)?;
    let m = cloud.points.len();
    let tree = CloudTree::new(&cloud.points)?;
    let mut radius = match params.radius {
        Radius::Given(radius) => radius / cloud.unit,
        Radius::Automatic | Radius::Grown => 3.0 / (m as f64).sqrt(),
    };
    // The unit cube is √3 across: a larger radius finds no further neighbours.
    let largest_radius = if params.radius == Radius::Grown { 3f64.sqrt() } else { 0.0 };
    let mut growths = 0;
    let rows = loop {
        let graph = radius_graph(&tree, &cloud.fixed, radius, params.max_neighbours);
        let mut missing = cut_off(&cloud.fixed, &graph, |&j| j);
        if missing.is_empty() {
            let rows = cloud.weights(&graph, &tree, params.weights);
            // The neighbours in a local triangulation are fewer than those within the radius.
            missing = cut_off(&cloud.fixed, &rows.entries, |e| e.0);
            if missing.is_empty() {
                break rows;
            }
        }
        if radius >= largest_radius {
            return Err(ParamError::CutOffPoints {
                count: missing.len(),
                interior: cloud.interior(),
                radius: radius * cloud.unit,
                first: missing.into_iter().take(CUT_OFF_NAMED).collect(),
            });
        }
        radius *= GROWTH;
        growths += 1;
    };
    let map = cloud.solve(rows, Some(radius * cloud.unit), growths)?;
    tracing::debug!(report = ?map.report, "mapped");
    Ok(map)
}

fn check_params(params: &CloudMapParams) -> Result<(), ParamError> {
    let bad = |name, value, range| Err(CloudError::BadOption { name, value, range }.into());
    match (params.weights, params.radius, params.max_neighbours) {
        (CloudWeights::ReciprocalDistance { exponent }, ..) if !(0.0..=LARGEST_EXPONENT).contains(&exponent) => {
            bad("exponent", exponent, "from 0 to 8")
        }
        (_, Radius::Given(radius), _) if !(radius > 0.0 && radius.is_finite()) => {
            bad("radius", radius, "positive and finite")
        }
        (_, _, Some(limit)) if limit < 3 => bad("max_neighbours", limit as f64, "at least 3"),
        _ => Ok(()),
    }
}

/// A checked cloud in the unit cube, and which of its points are on the boundary.
pub(crate) struct BoundedCloud {
    /// The points, moved and scaled into the unit cube by one factor.
    pub(crate) points: Vec<[f64; 3]>,
    /// Longest side of the bounding box, in the units of the points.
    unit: f64,
    /// Whether a point is on the boundary.
    pub(crate) fixed: Vec<bool>,
    /// Parameters of the boundary points; zero for the others.
    uv: Vec<[f64; 2]>,
}

/// Neighbours with weights, of every interior point.
pub(crate) struct Rows {
    pub(crate) entries: Vec<Vec<(u32, f64)>>,
    pub(crate) open_rings: usize,
}

impl BoundedCloud {
    pub(crate) fn new(points: ArrayView2<'_, f64>, boundary: &BoundaryParameters) -> Result<Self, ParamError> {
        let (m, dimension) = points.dim();
        if dimension != 3 {
            return Err(CloudError::WrongDimension { given: dimension, required: 3 }.into());
        }
        check_surface_cloud(points, 4)?;
        let required = [boundary.points.len(), 2];
        if <[usize; 2]>::from(boundary.parameters.dim()) != required {
            let given = boundary.parameters.dim().into();
            return Err(ParamError::WrongShape { what: "boundary parameters", given, required });
        }
        // Fewer span no area.
        if boundary.points.len() < 3 {
            return Err(CloudError::TooFewPoints { given: boundary.points.len(), required: 3 }.into());
        }
        let (mut fixed, mut uv) = (vec![false; m], vec![[0.0; 2]; m]);
        for (index, &point) in boundary.points.iter().enumerate() {
            let parameters = [boundary.parameters[[index, 0]], boundary.parameters[[index, 1]]];
            let inside = parameters.iter().all(|x| (0.0..=1.0).contains(x));
            let depth = parameters.iter().fold(1.0f64, |d, x| d.min(*x).min(1.0 - x));
            let problem = match fixed.get(point as usize) {
                None => "is not a row of the cloud",
                Some(true) => "is named a second time",
                Some(false) if !inside || depth > BOUNDARY_TOLERANCE => {
                    "does not lie on the boundary of the unit square"
                }
                Some(false) => {
                    (fixed[point as usize], uv[point as usize]) = (true, parameters);
                    continue;
                }
            };
            return Err(ParamError::BadBoundaryPoint { index, point, parameters, problem });
        }
        let bounds = BoundingBox::of(points)?;
        let unit = bounds.longest_side();
        let points =
            points.rows().into_iter().map(|p| std::array::from_fn(|k| (p[k] - bounds.lower[k]) / unit)).collect();
        Ok(Self { points, unit, fixed, uv })
    }

    pub(crate) fn interior(&self) -> usize {
        self.fixed.iter().filter(|f| !**f).count()
    }

    fn weights(&self, graph: &[Vec<u32>], tree: &CloudTree<'_>, weights: CloudWeights) -> Rows {
        let row = |i: usize| match weights {
            _ if self.fixed[i] => (vec![], false),
            CloudWeights::Uniform => (self.reciprocal_distances(i, &graph[i], 0.0), false),
            CloudWeights::ReciprocalDistance { exponent } => (self.reciprocal_distances(i, &graph[i], exponent), false),
            CloudWeights::LocalProjection => self
                .local_projection(i, &graph[i])
                .or_else(|| {
                    WIDER_SURROUNDINGS.iter().find_map(|&k| self.local_projection(i, &apart(tree.nearest(i, k))))
                })
                .map_or_else(|| (self.reciprocal_distances(i, &graph[i], 1.0), true), |row| (row, false)),
        };
        Rows::collect((0..self.points.len()).into_par_iter().map(row).collect())
    }

    pub(crate) fn reciprocal_distances(&self, i: usize, around: &[u32], exponent: f64) -> Vec<(u32, f64)> {
        // A ring of the parameter plane may hold points that are equal in space.
        let distance = |j: u32| norm(sub(self.points[j as usize], self.points[i])).max(COINCIDENT);
        // Relative to the nearest neighbour, no power over- or underflows.
        let nearest = around.iter().map(|&j| distance(j)).fold(f64::INFINITY, f64::min);
        around.iter().map(|&j| (j, (nearest / distance(j)).powf(exponent))).collect()
    }

    fn local_projection(&self, i: usize, around: &[u32]) -> Option<Vec<(u32, f64)>> {
        let surroundings: Vec<[f64; 3]> = around.iter().map(|&j| self.points[j as usize]).collect();
        let star = delaunay_star(self.points[i], &surroundings)?;
        let ring: Vec<u32> = star.iter().map(|&k| around[k as usize]).collect();
        self.shape_preserving(i, &ring)
    }

    /// Shape-preserving weights of the neighbours in cyclic order; `None` where they do not exist.
    pub(crate) fn shape_preserving(&self, i: usize, ring: &[u32]) -> Option<Vec<(u32, f64)>> {
        let places: Vec<[f64; 3]> = ring.iter().map(|&j| self.points[j as usize]).collect();
        let weights = shape_preserving_weights(self.points[i], &places)?;
        Some(ring.iter().copied().zip(weights).filter(|(_, w)| *w > 0.0).collect())
    }

    pub(crate) fn solve(&self, rows: Rows, radius: Option<f64>, growths: usize) -> Result<CloudMap, ParamError> {
        let open_rings = rows.open_rings;
        let flat: Vec<WeightEntry> = (0u32..)
            .zip(rows.entries)
            .flat_map(|(i, row)| row.into_iter().map(move |(j, weight)| (i, j, weight)))
            .collect();
        let count = flat.len();
        let system = BarycentricSystem::new(&self.fixed, flat);
        let mut uv = self.uv.clone();
        system.solve(&mut uv)?;
        let residual = system.residual(&uv);
        let unknowns = system.unknowns();
        let report = CloudMapReport {
            unknowns,
            radius,
            growths,
            mean_neighbours: count as f64 / unknowns.max(1) as f64,
            open_rings,
            residual,
        };
        // A mean lies in the square; round-off may leave it by a last bit.
        let parameters = Array2::from_shape_fn((uv.len(), 2), |(i, k)| uv[i][k].clamp(0.0, 1.0));
        Ok(CloudMap { parameters, report })
    }
}

impl Rows {
    /// From the rows and whether their rings are open.
    pub(crate) fn collect(rows: Vec<(Vec<(u32, f64)>, bool)>) -> Self {
        let open_rings = rows.iter().filter(|r| r.1).count();
        Self { entries: rows.into_iter().map(|r| r.0).collect(), open_rings }
    }
}

#[cfg(test)]
#[path = "cloud_map_tests.rs"]
mod tests;
