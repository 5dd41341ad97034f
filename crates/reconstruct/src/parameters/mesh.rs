//! Maps of meshes onto the unit square.

use geom_io::Scan;
use param_classic::{InjectiveParams, MeshMapParams, Verdict, Weights, map_disk, refine_injective};
use point_cloud::{
    CloudError, CornerChoice, DiskMesh, Pieces, TriangleMesh, drop_unreferenced, largest_piece,
    merge_duplicate_vertices, unreferenced_vertices,
};

use super::cloud::Cloud;
use super::{Layout, corners_among, large};
use crate::parameter_options::{ParameterChoice, Refine};
use crate::{Error, Event, HoleReport, ParameterOptions, Watch};

/// Share of the triangles up to which pieces besides the largest are stray and left out.
const STRAY: f64 = 0.02;

/// Maps a mesh. One whose triangles are joined wrongly is taken as a cloud of its vertices; if that cannot be laid out
/// either, the error is the mesh's.
pub(super) fn lay_out_or_take_vertices(
    scan: Scan,
    rows: &[u32],
    choice: ParameterChoice,
    options: &ParameterOptions,
    watch: &mut Watch<'_>,
) -> Result<Layout, Error> {
    let mesh = TriangleMesh { vertices: scan.cloud.points, triangles: scan.triangles.unwrap_or_default() };
    let given_corners = corners_among(rows, options)?;
    let no_disk = match disk_of(&mesh) {
        Ok((disk, kept, mut warnings)) => {
            let corners = match given_corners {
                Some(corners) => Some(vertices_of(corners, &mesh, &kept, rows)?),
                None => None,
            };
            let mut layout = map(&disk, choice, corners, options, watch)?;
            layout.of_rows(&kept);
            warnings.append(&mut layout.warnings);
            layout.warnings = warnings;
            return Ok(layout);
        }
        Err(reason) => reason,
    };
    if !spoils_edges_only(&no_disk) {
        return Err(no_disk);
    }
    let TriangleMesh { vertices, triangles } = mesh;
    let cloud = Cloud { points: vertices, boundary: None, corners: given_corners };
    let Ok(mut layout) = large::lay_out(cloud, ParameterChoice::Auto, options, watch) else {
        return Err(no_disk);
    };
    layout.warnings.insert(0, format!("the mesh could not be mapped, its vertices were taken as a cloud: {no_disk}"));
    layout.reversed = layout.runs_against(&triangles, rows.len());
    Ok(layout)
}

/// A cleaned and checked mesh, the vertex each of its vertices was, and what was changed.
fn disk_of(mesh: &TriangleMesh) -> Result<(DiskMesh, Vec<u32>, Vec<String>), Error> {
    let mut warnings = Vec::new();
    let (mut merged, duplicates, dropped) = merge_duplicate_vertices(mesh);
    let mut kept: Vec<u32> = duplicates.kept.iter().map(|&row| row as u32).collect();
    if duplicates.count() > 0 {
        warnings.push(format!("{} equal vertices were merged, {dropped} triangles vanished", duplicates.count()));
    }
    let unused = unreferenced_vertices(&merged).len();
    if unused > 0 {
        warnings.push(format!("{unused} vertices belong to no triangle and were left out"));
        let part = drop_unreferenced(&merged)?;
        kept = part.kept.iter().map(|&at| kept[at]).collect();
        merged = part.mesh;
    }
    let sizes = Pieces::find(&merged)?.sizes;
    let triangles: usize = sizes.iter().sum();
    if sizes.len() > 1 && (triangles - sizes[0]) as f64 <= STRAY * triangles as f64 {
        warnings.push(format!(
            "{} stray pieces of the mesh with {} triangles were left out",
            sizes.len() - 1,
            triangles - sizes[0]
        ));
        let part = largest_piece(&merged)?;
        kept = part.kept.iter().map(|&at| kept[at]).collect();
        merged = part.mesh;
    }
    let disk = DiskMesh::new(merged)?;
    if disk.flipped() > 0 {
        warnings.push(format!("{} triangles were turned over to agree with their neighbours", disk.flipped()));
    }
    Ok((disk, kept, warnings))
}

/// Whether a mesh is no disk because of how its triangles are joined, so that its vertices may still be of one.
fn spoils_edges_only(reason: &Error) -> bool {
    matches!(
        reason,
        Error::Cloud(
            CloudError::PinchedVertices { .. }
                | CloudError::NonManifoldEdges { .. }
                | CloudError::Handles { .. }
                | CloudError::NotOrientable { .. }
        )
    )
}

/// Vertices of the cleaned mesh at points of the given one; of equal vertices the first stayed.
fn vertices_of(corners: [u32; 4], mesh: &TriangleMesh, kept: &[u32], rows: &[u32]) -> Result<[u32; 4], Error> {
    let mut vertices = [0; 4];
    for (vertex, corner) in vertices.iter_mut().zip(corners) {
        let place = mesh.vertices.row(corner as usize);
        let same = |&row: &u32| mesh.vertices.row(row as usize) == place;
        let found = kept.binary_search(&corner).ok().or_else(|| kept.iter().position(same));
        let row = rows[corner as usize].into();
        *vertex = found.ok_or(Error::NoSuchPoint { option: "--corners", row })? as u32;
    }
    Ok(vertices)
}

/// Maps a disk onto the unit square and refines the map.
pub(super) fn map(
    disk: &DiskMesh,
    choice: ParameterChoice,
    corners: Option<[u32; 4]>,
    options: &ParameterOptions,
    watch: &mut Watch<'_>,
) -> Result<Layout, Error> {
    let (weights, mut method) = match choice {
        ParameterChoice::Uniform => (Weights::Uniform, "uniform"),
        _ => (Weights::MeanValue, "mean-value"),
    };
    let params = MeshMapParams {
        weights,
        boundary: options.side_rule.rule(),
        corners: corners.map_or(CornerChoice::default(), CornerChoice::Given),
    };
    let _ = watch(Event::Step("mapping the mesh"));
    let map = map_disk(disk, &params)?;
    let mut warnings = Vec::new();
    if map.report.holes > 0 {
        warnings.push(format!("the mesh has {} holes; the surface spans them", map.report.holes));
    }
    if map.report.cut_off + map.report.quality.collapsed > 0 {
        warnings.push(format!(
            "{} triangles collapsed into a side of the parameter square, {} vertices with them",
            map.report.quality.collapsed, map.report.cut_off
        ));
    }
    let mut parameters = map.parameters;
    let mut refined = false;
    let wanted = match options.refine {
        Refine::Auto => choice != ParameterChoice::Uniform && map.report.quality.assessment().verdict > Verdict::Good,
        Refine::On => true,
        Refine::Off => false,
    };
    if wanted {
        let _ = watch(Event::Step("refining the map"));
        let params = InjectiveParams { slide: corners.is_none(), ..InjectiveParams::default() };
        match refine_injective(disk.vertices(), disk.triangles(), parameters.view(), &params) {
            Ok(better) if better.report.energy_after < better.report.energy_before => {
                (parameters, refined) = (better.parameters, true);
                method = if weights == Weights::MeanValue { "mean-value, refined" } else { "uniform, refined" };
            }
            Ok(_) => {}
            Err(reason) => warnings.push(format!("the map was not refined: {reason}")),
        }
    }
    let hole = |rim: &point_cloud::BoundaryLoop| HoleReport { points: rim.vertices.len(), length: rim.length };
    Ok(Layout {
        points: disk.vertices().to_owned(),
        parameters,
        rows: (0..disk.vertices().nrows() as u32).collect(),
        triangles: disk.triangles().to_vec(),
        boundary: disk.outer_loop().vertices.clone(),
        holes: disk.holes().iter().map(hole).collect(),
        corners: Some(map.corners.vertices(disk.outer_loop())),
        method,
        refined,
        warnings,
        ..Layout::default()
    })
}
