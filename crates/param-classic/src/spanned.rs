//! Parameters of all points of a cloud through the mesh that was spanned over it.

use std::collections::HashSet;

use ndarray::{Array2, ArrayView2, Axis};
use point_cloud::vec3::{cross, norm, sub};
use point_cloud::{CloudBoundary, CloudError, CornerChoice, DiskMesh, LargestDisk, TriangleMesh, largest_disk};

use crate::{
    InjectiveParams, InjectiveReport, MeshMapParams, MeshMapReport, ParamError, Verdict, extend_map, map_disk,
    refine_injective,
};

/// Options of [`map_spanned`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpannedMapParams {
    /// The map of the mesh; given corners are rows of the cloud.
    pub map: MeshMapParams,
    /// Its refinement, if any.
    pub refinement: Option<InjectiveParams>,
    /// Whether every map is refined. Otherwise only those are that are stretched in places but not on the whole: good ones
    /// need it not, and on long shapes (blades, hulls; mean angle stretch beyond 3) splines fit the smoother map that
    /// comes out without.
    pub refine_all: bool,
    /// Parts of the mesh whose share of the square is smaller than their share of the surface by more than this factor are
    /// taken out of it, at least 1.
    pub most_shrinkage: f64,
}

impl Default for SpannedMapParams {
    /// Shrinkage up to 1000: the finest meshes of real faces, hulls and car bodies stay below 400. No level of refinement
    /// of a surface could follow more.
    fn default() -> Self {
        Self {
            map: MeshMapParams::default(),
            refinement: Some(InjectiveParams::default()),
            refine_all: true,
            most_shrinkage: 1e3,
        }
    }
}

/// A map of a cloud onto the unit square.
#[derive(Clone, Debug, PartialEq)]
pub struct SpannedMap {
    /// Parameters (u, v) of all points, shape `(m, 2)`, all in \[0, 1\].
    pub parameters: Array2<f64>,
    /// Rows of the points at (0, 0), (1, 0), (1, 1), (0, 1).
    pub corners: [u32; 4],
    /// The mapped mesh over the rows of the cloud, counter-clockwise in (u, v).
    pub triangles: Vec<[u32; 3]>,
    /// The triangles of the given mesh that the map leaves out, because they would have next to no room in the square or hang on such ones.
    pub left_out: Vec<[u32; 3]>,
    /// How it came out.
    pub report: SpannedMapReport,
}

/// How a map of a cloud came out.
#[derive(Clone, Debug, PartialEq)]
pub struct SpannedMapReport {
    /// The map of the mesh before its refinement.
    pub map: MeshMapReport,
    /// The refinement; `None` if there was none.
    pub refinement: Option<InjectiveReport>,
    /// Points that belong to no triangle, increasing; they got the parameters of the nearest point of the mesh.
    pub off_mesh: Vec<u32>,
    /// How many of them were taken out of the mesh because the map would shrink them too much.
    pub shrunk: usize,
    /// Distance of each of them from the mesh, in the units of the points.
    pub distances: Vec<f64>,
}

/// Mean angle stretch of maps of long shapes.
const LONG: f64 = 3.0;

/// Rounds of taking shrunk parts out. What is left of a pocket after one is shallower.
const ROUNDS: usize = 4;

/// Maps `points`, shape `(m, 3)`, onto the unit square through the mesh of their `boundary`: [`map_disk`], then
/// [`refine_injective`], then [`extend_map`] for the points outside the mesh. The mesh has no folded triangle in the square.
///
/// Where a cloud is too coarse for its creases the mesh may join the sides of a groove and leave the rest as a deep
/// pocket, which a map shrinks exponentially. Such parts are taken out of the mesh and mapped again; their points are
/// projected onto what is left.
///
/// # Errors
/// [`CloudError::NoTriangles`] if the boundary has no mesh; [`CloudError::BadOption`]; those of [`map_disk`] and
/// [`refine_injective`].
pub fn map_spanned(
    points: ArrayView2<'_, f64>,
    boundary: &CloudBoundary,
    params: &SpannedMapParams,
) -> Result<SpannedMap, ParamError> {
    let (disk, rows) = boundary.disk_mesh(points)?;
    map_through(points, disk, rows, params)
}

/// As [`map_spanned`] for a mesh: all of its vertices get parameters, those of deep pockets by projection.
///
/// # Errors
/// Those of [`map_spanned`].
pub fn map_mesh(disk: DiskMesh, params: &SpannedMapParams) -> Result<SpannedMap, ParamError> {
    let vertices = disk.vertices().to_owned();
    let rows = (0..vertices.nrows()).collect();
    map_through(vertices.view(), disk, rows, params)
}

/// Maps `points` through a mesh over some of them, the given `rows`, increasing.
fn map_through(
    points: ArrayView2<'_, f64>,
    mut disk: DiskMesh,
    mut rows: Vec<usize>,
    params: &SpannedMapParams,
) -> Result<SpannedMap, ParamError> {
    let span = tracing::info_span!("map_through", points = points.nrows());
    let _guard = span.enter();
    if params.most_shrinkage.is_nan() || params.most_shrinkage < 1.0 {
        let (name, value) = ("most_shrinkage", params.most_shrinkage);
        return Err(CloudError::BadOption { name, value, range: "at least 1" }.into());
    }
    let spanned = rows.len();
    let given: Vec<[u32; 3]> = disk.triangles().iter().map(|t| t.map(|v| rows[v as usize] as u32)).collect();
    let mut round = 1;
    let (map, parameters, refinement) = loop {
        let row = |v: u32| rows[v as usize] as u32;
        let map = map_disk(&disk, &MeshMapParams { corners: on_mesh(params.map.corners, &rows)?, ..params.map })
            .map_err(|error| error.renumbered(row))?;
        let quality = &map.report.quality;
        let long = quality.angle.is_some_and(|angle| angle.mean > LONG);
        let in_places = quality.assessment().verdict > Verdict::Good && !long;
        let refined = match &params.refinement {
            Some(options) if params.refine_all || in_places => {
                Some(refine_injective(disk.vertices(), disk.triangles(), map.parameters.view(), options)?)
            }
            _ => None,
        };
        let (uv, refinement) = match refined {
            Some(refined) => (refined.parameters, Some(refined.report)),
            None => (map.parameters.clone(), None),
        };
        let shrunk = shrunk_triangles(&disk, uv.view(), params.most_shrinkage);
        if round == ROUNDS || !shrunk.contains(&true) {
            break (map, uv, refinement);
        }
        round += 1;
        let triangles = disk.triangles().iter().zip(shrunk).filter(|(_, s)| !s).map(|(t, _)| *t).collect();
        let LargestDisk { disk: part, kept, .. } =
            largest_disk(&TriangleMesh { vertices: disk.vertices().to_owned(), triangles })?;
        rows = kept.iter().map(|&v| rows[v]).collect();
        disk = part;
    };
    let mut is_on_mesh = vec![false; points.nrows()];
    rows.iter().for_each(|&row| is_on_mesh[row] = true);
    let off_mesh: Vec<usize> = (0..is_on_mesh.len()).filter(|&row| !is_on_mesh[row]).collect();
    let others =
        extend_map(disk.vertices(), disk.triangles(), parameters.view(), points.select(Axis(0), &off_mesh).view())?;
    let mut all = Array2::zeros((points.nrows(), 2));
    for (part, part_rows) in [(&parameters, &rows), (&others.parameters, &off_mesh)] {
        for (&row, uv) in part_rows.iter().zip(part.rows()) {
            all.row_mut(row).assign(&uv.mapv(|x| x.clamp(0.0, 1.0)));
        }
    }
    let report = SpannedMapReport {
        map: map.report,
        refinement,
        shrunk: spanned - rows.len(),
        off_mesh: off_mesh.iter().map(|&row| row as u32).collect(),
        distances: others.distances,
    };
    tracing::info!(off_mesh = report.off_mesh.len(), shrunk = report.shrunk, "mapped a cloud");
    let row = |v: u32| rows[v as usize] as u32;
    let triangles: Vec<[u32; 3]> = disk.triangles().iter().map(|t| t.map(row)).collect();
    Ok(SpannedMap {
        parameters: all,
        corners: map.corners.vertices(disk.outer_loop()).map(row),
        left_out: without(given, &triangles),
        triangles,
        report,
    })
}

/// The triangles that are not among some others, whichever corner these begin with.
fn without(mut triangles: Vec<[u32; 3]>, others: &[[u32; 3]]) -> Vec<[u32; 3]> {
    if triangles.len() == others.len() {
        return Vec::new();
    }
    let sorted = |mut t: [u32; 3]| {
        t.sort_unstable();
        t
    };
    let others: HashSet<[u32; 3]> = others.iter().map(|&t| sorted(t)).collect();
    triangles.retain(|&t| !others.contains(&sorted(t)));
    triangles
}

/// Given corners, as vertices of the mesh over `rows`.
fn on_mesh(corners: CornerChoice, rows: &[usize]) -> Result<CornerChoice, CloudError> {
    let CornerChoice::Given(given) = corners else { return Ok(corners) };
    let mut vertices = [0; 4];
    for (vertex, row) in vertices.iter_mut().zip(given) {
        let place = rows.binary_search(&(row as usize));
        *vertex = place.map_err(|_| CloudError::CornerNotOnLoop { vertex: row })? as u32;
    }
    Ok(CornerChoice::Given(vertices))
}

/// Whether each triangle has less than `1 / most` of its share of the surface in the square. Triangles that collapsed into a
/// side are no pockets, and stay.
fn shrunk_triangles(disk: &DiskMesh, uv: ArrayView2<'_, f64>, most: f64) -> Vec<bool> {
    let areas: Vec<[f64; 2]> = disk
        .triangles()
        .iter()
        .map(|t| {
            let [p, q, r] = t.map(|v| std::array::from_fn(|k| disk.vertices()[[v as usize, k]]));
            let [a, b, c] = t.map(|v| [uv[[v as usize, 0]], uv[[v as usize, 1]], 0.0]);
            [norm(cross(sub(q, p), sub(r, p))), norm(cross(sub(b, a), sub(c, a)))]
        })
        .collect();
    let on_one_side =
        |t: &[u32; 3]| (0..2).any(|k| [0.0, 1.0].iter().any(|x| t.iter().all(|&v| uv[[v as usize, k]] == *x)));
    let total: [f64; 2] = [0, 1].map(|k| areas.iter().map(|a| a[k]).sum());
    areas
        .iter()
        .zip(disk.triangles())
        .map(|(area, t)| area[1] / total[1] * most < area[0] / total[0] && !on_one_side(t))
        .collect()
}

#[cfg(test)]
#[path = "spanned_tests.rs"]
mod tests;
