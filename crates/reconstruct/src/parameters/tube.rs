//! Meshes and unordered clouds that close round one direction.

use ndarray::{Array2, ArrayView2, Axis};
use param_classic::{TubeMap, TubeMapParams, Weights, extend_map, map_tube, unroll};
use point_cloud::vec3::{add, dot, scale};
use point_cloud::{
    BoundaryLoop, BoundaryParams, CloudBoundary, CloudError, DiskMesh, TriangleMesh, TubeEnds, find_boundary,
    find_rows, principal_axes,
};

use super::layout::{Cloud, HoleReport, Layout, STRAY};
use crate::options::range;
use crate::options::{Closed, Domain, ParameterChoice, Refine};
use crate::{Error, Event, ParameterOptions, Watch};

/// Factors by which a cloud that is no tube as it lies is squeezed along its longest axis to span a mesh over it: sections of a
/// blade or a duct lie farther apart than the points on them.
const SQUEEZES: [f64; 8] = [2.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0, 32.0];

/// Checks that the options suit a tube that is laid out by its shape; open surfaces pass.
pub(super) fn check(choice: ParameterChoice, has_outline: bool, options: &ParameterOptions) -> Result<(), Error> {
    let closed = options.closed;
    if closed.directions() == [false; 2] {
        return Ok(());
    }
    if closed == Closed::Uv {
        return Err(Error::ClosedBothWays);
    }
    let corners = options.corners.map_or(String::new(), |corners| corners.to_string());
    range("--corners", corners, "none with --closed u or v: a tube has none", options.corners.is_none())?;
    let outline = "none with --closed u or v: the ends of a tube are found by its shape";
    range("--outline", "given".to_owned(), outline, !has_outline)?;
    match choice {
        ParameterChoice::Auto | ParameterChoice::MeanValue | ParameterChoice::Uniform => Ok(()),
        _ => Err(Error::NotClosed { closed: closed.to_string() }),
    }
}

/// Spans a mesh over a cloud and maps it; points off the mesh are projected onto it.
pub(super) fn of_cloud(
    cloud: &Cloud,
    choice: ParameterChoice,
    options: &ParameterOptions,
    watch: &mut Watch<'_>,
) -> Result<Layout, Error> {
    let _ = watch(Event::Step("spanning a mesh over the cloud"));
    through(cloud, span(cloud.points.view())?, choice, options, watch)
}

/// Whether a scan may be laid out as a tube without being asked: what only sheets have is not given.
fn may_be_unasked(choice: ParameterChoice, options: &ParameterOptions) -> bool {
    let by_shape = matches!(choice, ParameterChoice::Auto | ParameterChoice::MeanValue | ParameterChoice::Uniform);
    options.closed == Closed::Auto
        && options.domain == Domain::Unit
        && options.corners.is_none()
        && options.outline.is_none()
        && by_shape
}

fn is_tube(disk: &DiskMesh) -> bool {
    let shape = disk.tube_shape();
    tracing::debug!(?shape, "looked for a tube");
    shape.is_some_and(|shape| shape.is_tube())
}

/// Maps a mesh round u where it is a tube by its shape, and says so.
pub(super) fn of_mesh_unasked(
    disk: &DiskMesh,
    choice: ParameterChoice,
    options: &ParameterOptions,
    watch: &mut Watch<'_>,
) -> Option<Layout> {
    if !may_be_unasked(choice, options) || !is_tube(disk) {
        return None;
    }
    let round = ParameterOptions { closed: Closed::U, ..options.clone() };
    let mut layout = of_mesh(disk, choice, &round, watch).ok()?;
    layout.warnings.push(told(disk).ok()?);
    Some(layout)
}

/// Maps a cloud round u where the mesh over it, of which `found` is the attempt, is a tube by its shape, and says so. Rows of points that
/// are too far apart for a mesh are squeezed.
pub(super) fn of_cloud_unasked(
    cloud: &Cloud,
    found: &Result<CloudBoundary, CloudError>,
    choice: ParameterChoice,
    options: &ParameterOptions,
    watch: &mut Watch<'_>,
) -> Option<Layout> {
    if !may_be_unasked(choice, options) || cloud.boundary.is_some() || cloud.corners.is_some() {
        return None;
    }
    let points = cloud.points.view();
    let at_once = match found {
        Ok(found) if !found.holes.is_empty() => {
            let tube = tube_of(found, points).ok();
            tube.map(|(disk, rows)| Spanned { disk, rows, spacing: found.spacing, noise: found.noise, squeeze: 1.0 })
        }
        Ok(_) | Err(CloudError::NoSurface { .. } | CloudError::CloudPieces { .. }) => None,
        Err(_) => return None,
    };
    let spanned = match at_once.filter(|spanned| is_tube(&spanned.disk)) {
        Some(spanned) => spanned,
        None => {
            // Over rows far apart a mesh is torn, or joins points of one row only.
            find_rows(points).ok()??;
            span_squeezed(points).filter(|spanned| is_tube(&spanned.disk))?
        }
    };
    let told = told(&spanned.disk).ok()?;
    let round = ParameterOptions { closed: Closed::U, ..options.clone() };
    let mut layout = through(cloud, spanned, choice, &round, watch).ok()?;
    layout.warnings.push(told);
    Some(layout)
}

/// Says that a tube was recognized.
fn told(disk: &DiskMesh) -> Result<String, CloudError> {
    let TubeEnds { ends, .. } = disk.tube_ends()?;
    Ok(format!(
        "a tube by its shape, with two ends of like length ({:.4e} and {:.4e}): laid out round u, as with --closed u; --closed none lays \
         it out as a sheet",
        ends[0].length, ends[1].length
    ))
}

/// Maps the mesh over a cloud; points off the mesh are projected onto it.
fn through(
    cloud: &Cloud,
    spanned: Spanned,
    choice: ParameterChoice,
    options: &ParameterOptions,
    watch: &mut Watch<'_>,
) -> Result<Layout, Error> {
    let points = cloud.points.view();
    let Spanned { disk, rows, spacing, noise, squeeze } = spanned;
    let mut layout = of_mesh(&disk, choice, options, watch)?;
    let directions = options.closed.directions();
    let cut = unroll(&layout.triangles, layout.parameters.view(), directions);
    let mut on_mesh = vec![false; points.nrows()];
    rows.iter().for_each(|&row| on_mesh[row] = true);
    let off_mesh: Vec<usize> = (0..on_mesh.len()).filter(|&row| !on_mesh[row]).collect();
    let others = extend_map(
        cut.vertices(disk.vertices()).view(),
        &cut.triangles,
        cut.parameters.view(),
        points.select(Axis(0), &off_mesh).view(),
    )?;
    let mut parameters = Array2::zeros((points.nrows(), 2));
    rows.iter().zip(layout.parameters.rows()).for_each(|(&row, uv)| parameters.row_mut(row).assign(&uv));
    off_mesh.iter().zip(others.parameters.rows()).for_each(|(&row, uv)| parameters.row_mut(row).assign(&uv));
    confine(&mut parameters, directions);
    let of_cloud = |v: u32| rows[v as usize] as u32;
    layout.triangles.iter_mut().for_each(|t| *t = t.map(of_cloud));
    layout.boundary.iter_mut().chain(layout.rims.iter_mut().flatten()).for_each(|v| *v = of_cloud(*v));
    layout.seam = layout.seam.map(|seam| seam.map(of_cloud));
    (layout.points, layout.parameters) = (cloud.points.clone(), parameters);
    layout.rows = (0..points.nrows() as u32).collect();
    layout.method = name(true, choice, layout.refined);
    (layout.spacing, layout.noise) = (Some(spacing), Some(noise));
    if squeeze > 1.0 {
        layout.warnings.push(format!(
            "the points lie in rows: the mesh was spanned over the cloud squeezed {squeeze} times along its longest axis"
        ));
    }
    let stray = STRAY * spacing;
    let far: Vec<usize> = (0..off_mesh.len()).filter(|&k| others.distances[k] > stray).map(|k| off_mesh[k]).collect();
    if off_mesh.len() > far.len() {
        layout.warnings.push(format!(
            "{} points that fit no triangle of the mesh, or are equal to others, were projected onto it",
            off_mesh.len() - far.len()
        ));
    }
    if !far.is_empty() {
        let kept: Vec<usize> = (0..points.nrows()).filter(|row| far.binary_search(row).is_err()).collect();
        layout.keep(&kept);
        layout
            .warnings
            .push(format!("{} points are more than {stray:.4e} off the surface, and were left out", far.len()));
    }
    Ok(layout)
}

/// What the report calls a layout: whether its mesh was spanned over a cloud, its weights, and whether its stretch was evened.
fn name(spanned: bool, choice: ParameterChoice, evened: bool) -> &'static str {
    match (spanned, choice == ParameterChoice::Uniform, evened) {
        (false, true, false) => "periodic uniform",
        (false, true, true) => "periodic uniform, evened",
        (false, false, false) => "periodic mean-value",
        (false, false, true) => "periodic mean-value, evened",
        (true, true, false) => "spanned mesh, periodic uniform",
        (true, true, true) => "spanned mesh, periodic uniform, evened",
        (true, false, false) => "spanned mesh, periodic mean-value",
        (true, false, true) => "spanned mesh, periodic mean-value, evened",
    }
}

/// A tube spanned over a cloud, its triangles counter-clockwise from outside.
struct Spanned {
    disk: DiskMesh,
    /// Row of the point at each vertex.
    rows: Vec<usize>,
    /// In the units of the points; that along the squeezed axis where there is one.
    spacing: f64,
    noise: f64,
    squeeze: f64,
}

/// Spans a tube over a cloud: over the points as they are or, where they lie in rows too far apart, squeezed by the factor that
/// leaves the shortest boundary.
fn span(points: ArrayView2<'_, f64>) -> Result<Spanned, Error> {
    let first = match span_as_it_is(points, points) {
        Ok((disk, rows, spacing, noise)) => return Ok(Spanned { disk, rows, spacing, noise, squeeze: 1.0 }),
        Err(reason) => reason,
    };
    span_squeezed(points).ok_or_else(|| first.into())
}

/// Spans a tube over a cloud squeezed along its longest axis.
fn span_squeezed(points: ArrayView2<'_, f64>) -> Option<Spanned> {
    let places: Vec<[f64; 3]> = points.rows().into_iter().map(|p| [p[0], p[1], p[2]]).collect();
    let axis = principal_axes(&places).directions[2];
    let mut best: Option<(f64, Spanned)> = None;
    for squeeze in SQUEEZES {
        let shrink = |p: &[f64; 3]| add(*p, scale((squeeze.recip() - 1.0) * dot(*p, axis), axis));
        let squeezed: Vec<[f64; 3]> = places.iter().map(shrink).collect();
        let squeezed = Array2::from_shape_fn(points.dim(), |(i, k)| squeezed[i][k]);
        match span_as_it_is(points, squeezed.view()) {
            Ok((disk, rows, spacing, noise)) => {
                let rims = std::iter::once(disk.outer_loop()).chain(disk.holes());
                let open: f64 = rims.map(|rim| rim.length).sum();
                tracing::debug!(squeeze, open, "spanned a tube");
                if best.as_ref().is_none_or(|(least, _)| open < *least) {
                    // Along the axis the points lie that much farther apart.
                    best = Some((open, Spanned { disk, rows, spacing: spacing * squeeze, noise, squeeze }));
                }
            }
            Err(reason) => tracing::debug!(squeeze, %reason, "no tube"),
        }
    }
    best.map(|(_, spanned)| spanned)
}

type TubeOfCloud = (DiskMesh, Vec<usize>, f64, f64);

/// The mesh over squeezed points, as a tube over the points themselves; spacing and noise.
fn span_as_it_is(points: ArrayView2<'_, f64>, squeezed: ArrayView2<'_, f64>) -> Result<TubeOfCloud, CloudError> {
    let found = find_boundary(squeezed, &BoundaryParams::default())?;
    let (disk, rows) = tube_of(&found, points)?;
    Ok((disk, rows, found.spacing, found.noise))
}

/// The mesh over a cloud as a tube, its triangles counter-clockwise from outside, and the row of the point at each vertex.
fn tube_of(found: &CloudBoundary, points: ArrayView2<'_, f64>) -> Result<(DiskMesh, Vec<usize>), CloudError> {
    let (mut disk, rows) = found.disk_mesh(points)?;
    disk.tube_ends()?;
    if disk.enclosed_volume() < 0.0 {
        let TriangleMesh { vertices, mut triangles } = disk.into_mesh();
        triangles.iter_mut().for_each(|t| t.swap(1, 2));
        disk = DiskMesh::new(TriangleMesh { vertices, triangles })?;
    }
    Ok((disk, rows))
}

/// Maps a mesh that is a tube.
pub(super) fn of_mesh(
    disk: &DiskMesh,
    choice: ParameterChoice,
    options: &ParameterOptions,
    watch: &mut Watch<'_>,
) -> Result<Layout, Error> {
    let _ = watch(Event::Step("mapping the mesh round"));
    let ends = disk.tube_ends()?;
    let uniform = choice == ParameterChoice::Uniform;
    let evened = options.refine == Refine::On || options.refine == Refine::Auto && !uniform;
    let usual = TubeMapParams::default();
    let params = TubeMapParams {
        weights: if uniform { Weights::Uniform } else { Weights::MeanValue },
        boundary: options.side_rule.rule(),
        rounds: if evened { usual.rounds } else { 0 },
    };
    let TubeMap { parameters, seam, report } = map_tube(disk, &ends, &params)?;
    let along_v = options.closed == Closed::U;
    let mut warnings = Vec::new();
    if !ends.holes.is_empty() {
        let lengths = ends.ends.map(|rim| format!("{:.4e}", rim.length));
        warnings.push(format!(
            "of the {} boundary loops the longest and the one farthest from it, of lengths {} and {}, are the ends of the tube; the \
             surface spans the others",
            ends.holes.len() + 2,
            lengths[0],
            lengths[1]
        ));
    }
    let n = disk.vertices().nrows();
    let parameters = match along_v {
        true => parameters,
        // Turned by a right angle, so that triangles stay counter-clockwise.
        false => Array2::from_shape_fn((n, 2), |(i, d)| match d {
            0 => parameters[[i, 1]],
            _ => (1.0 - parameters[[i, 0]]) % 1.0,
        }),
    };
    let hole = |rim: &&BoundaryLoop| HoleReport { points: rim.vertices.len(), length: rim.length };
    Ok(Layout {
        points: disk.vertices().to_owned(),
        parameters,
        rows: (0..n as u32).collect(),
        triangles: disk.triangles().to_vec(),
        boundary: ends.ends.iter().flat_map(|rim| rim.vertices.iter().copied()).collect(),
        holes: ends.holes.iter().map(hole).collect(),
        rims: ends.holes.iter().map(|rim| rim.vertices.clone()).collect(),
        seam: Some(seam),
        closed: options.closed.directions(),
        refined: report.rounds > 0,
        method: name(false, choice, report.rounds > 0),
        warnings,
        ..Layout::default()
    })
}

/// Brings parameters into the unit square: round in closed directions, to the nearest side in open ones.
fn confine(parameters: &mut Array2<f64>, closed: [bool; 2]) {
    super::closed::wrap(parameters, closed);
    for (mut column, _) in parameters.columns_mut().into_iter().zip(closed).filter(|(_, closed)| !closed) {
        column.mapv_inplace(|u| u.clamp(0.0, 1.0));
    }
}
