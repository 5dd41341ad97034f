//! Maps of meshes onto the unit square.

use geom_io::Scan;
use ndarray::Axis;
use param_classic::{SpannedMap, map_mesh};
use point_cloud::{
    CloudError, DiskMesh, LargestDisk, Pieces, TriangleMesh, Welded, drop_unreferenced, largest_disk,
    merge_duplicate_vertices, unreferenced_vertices, weld,
};

use super::layout::{Cloud, HoleReport, Layout, corners_among, map_params};
use super::{large, tube};
use crate::options::ParameterChoice;
use crate::{Error, Event, ParameterOptions, Watch};

/// Share of the triangles up to which pieces besides the largest are stray and left out.
pub(crate) const STRAY_TRIANGLES: f64 = 0.02;

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
    let welded = weld(&mesh)?;
    let as_it_is = |error| {
        let (exact, duplicates, dropped) = merge_duplicate_vertices(&mesh);
        // What two sides of a thin part have in common may have been welded together.
        disk_of(Welded { mesh: exact, duplicates, dropped, distance: 0.0 }).map_err(|_| error)
    };
    let no_disk = match disk_of(welded).or_else(as_it_is) {
        Ok(Disk { disk, kept, merged, mut warnings }) => {
            let corners = match given_corners {
                Some(corners) => Some(vertices_of(corners, &mesh, &kept, rows)?),
                None => None,
            };
            let mut layout = map(disk, choice, corners, options, watch).map_err(|error| error.of_rows(&kept))?;
            layout.of_rows(&kept);
            layout.is_mesh = true;
            layout.merged = merged;
            warnings.append(&mut layout.warnings);
            layout.warnings = warnings;
            return Ok(layout);
        }
        Err(reason) => reason,
    };
    if !matches!(no_disk, Error::Cloud(CloudError::NonManifoldEdges { .. } | CloudError::NotOrientable { .. })) {
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

/// A cleaned and checked mesh.
struct Disk {
    disk: DiskMesh,
    /// The vertex of the given mesh that each of its vertices was.
    kept: Vec<u32>,
    /// Vertices that were made one with others.
    merged: usize,
    /// What was changed.
    warnings: Vec<String>,
}

/// The disk in a mesh whose equal vertices are one.
fn disk_of(welded: Welded) -> Result<Disk, Error> {
    let mut warnings = Vec::new();
    let Welded { mesh: mut merged, duplicates, dropped, distance } = welded;
    let mut kept: Vec<u32> = duplicates.kept.iter().map(|&row| row as u32).collect();
    match (duplicates.count(), distance > 0.0) {
        (0, _) => {}
        (count, false) => warnings.push(format!("{count} equal vertices were merged")),
        (count, true) => {
            warnings.push(format!("{count} vertices within {distance:.2e} of others were merged with them"))
        }
    }
    if dropped > 0 {
        warnings.push(format!("{dropped} triangles with a vertex twice were left out"));
    }
    let unused = unreferenced_vertices(&merged).len();
    if unused > 0 {
        warnings.push(format!("{unused} vertices belong to no triangle and were left out"));
        let part = drop_unreferenced(&merged)?;
        kept = part.kept.iter().map(|&at| kept[at]).collect();
        merged = part.mesh;
    }
    let sizes = Pieces::find(&merged)?.sizes;
    let largest = sizes.first().copied().unwrap_or(0);
    if (merged.triangles.len() - largest) as f64 > STRAY_TRIANGLES * merged.triangles.len() as f64 {
        return Err(Error::SeveralPieces { sizes });
    }
    let LargestDisk { disk, kept: in_disk, removed, turned } = largest_disk(&merged)?;
    if removed > 0 {
        warnings.push(format!(
            "{removed} triangles and {} vertices were taken out of the mesh to make it a disk: stray pieces, pinched \
             vertices, handles",
            kept.len() - in_disk.len()
        ));
    }
    let kept = in_disk.iter().map(|&at| kept[at]).collect();
    if turned > 0 {
        warnings.push(format!("{turned} triangles were turned over to agree with their neighbours"));
    }
    Ok(Disk { disk, kept, merged: duplicates.count(), warnings })
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
fn map(
    disk: DiskMesh,
    choice: ParameterChoice,
    corners: Option<[u32; 4]>,
    options: &ParameterOptions,
    watch: &mut Watch<'_>,
) -> Result<Layout, Error> {
    if options.closed.directions() != [false; 2] {
        return tube::of_mesh(&disk, choice, options, watch);
    }
    if let Some(layout) = tube::of_mesh_unasked(&disk, choice, options, watch) {
        return Ok(layout);
    }
    let hole = |rim: &point_cloud::BoundaryLoop| HoleReport { points: rim.vertices.len(), length: rim.length };
    let holes: Vec<HoleReport> = disk.holes().iter().map(hole).collect();
    let points = disk.vertices().to_owned();
    let boundary = disk.outer_loop().vertices.clone();
    let rims = disk.holes().iter().map(|rim| rim.vertices.clone()).collect();
    let _ = watch(Event::Step("mapping the mesh"));
    let map = map_mesh(disk, &map_params(choice, corners, options))?;
    let mut layout = Layout {
        rows: (0..points.nrows() as u32).collect(),
        method: match (choice, map.report.refinement.is_some()) {
            (ParameterChoice::Uniform, false) => "uniform",
            (ParameterChoice::Uniform, true) => "uniform, refined",
            (_, false) => "mean-value",
            (_, true) => "mean-value, refined",
        },
        points,
        boundary,
        holes,
        rims,
        ..Layout::default()
    };
    layout.take(map);
    Ok(layout)
}

impl Layout {
    /// Takes over the map of a mesh.
    pub(super) fn take(&mut self, map: SpannedMap) {
        let report = &map.report.map;
        if report.holes > 0 {
            self.warnings.push(format!("the mesh has {} holes; the surface spans them", report.holes));
        }
        if report.cut_off + report.quality.collapsed > 0 {
            self.warnings.push(format!(
                "{} triangles collapsed into a side of the parameter square, {} vertices with them",
                report.quality.collapsed, report.cut_off
            ));
        }
        self.parameters = map.parameters;
        (self.triangles, self.left_out) = (map.triangles, map.left_out);
        self.corners = Some(map.corners);
        self.refined = map.report.refinement.is_some();
    }

    /// Keeps some points, in the order given; triangles and boundary have to lie within them.
    pub(super) fn keep(&mut self, kept: &[usize]) {
        let mut places = vec![None; self.rows.len()];
        kept.iter().enumerate().for_each(|(at, &i)| places[i] = Some(at as u32));
        let place = |i: u32| places[i as usize].unwrap_or_default();
        self.points = self.points.select(Axis(0), kept);
        self.parameters = self.parameters.select(Axis(0), kept);
        self.rows = kept.iter().map(|&i| self.rows[i]).collect();
        self.triangles.iter_mut().for_each(|t| *t = t.map(place));
        self.left_out.retain(|t| t.iter().all(|&i| places[i as usize].is_some()));
        self.left_out.iter_mut().for_each(|t| *t = t.map(place));
        self.boundary.iter_mut().for_each(|i| *i = place(*i));
        for rim in &mut self.rims {
            // Points of a rim may have been off the surface.
            rim.retain(|i| places[*i as usize].is_some());
            rim.iter_mut().for_each(|i| *i = place(*i));
        }
        self.corners = self.corners.map(|corners| corners.map(place));
        self.seam = self.seam.map(|seam| seam.map(place));
    }
}
