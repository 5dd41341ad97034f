//! Maps of clouds without order.

use ndarray::{Array2, ArrayView2, Axis};
use param_classic::{
    BoundaryParameters, CloudMap, CloudMapParams, CloudWeights, correct_shape, map_cloud, map_spanned, side_parameters,
};
use point_cloud::{BoundaryParams, CloudBoundary, CornerParams, find_boundary, find_corners, loop_length};

use super::layout::{Cloud, HoleReport, Layout, STRAY, map_params};
use super::{few, network, tube};
use crate::options::{Networks, ParameterChoice};
use crate::{Error, Event, ParameterOptions, Watch};

/// Lays out a cloud at once: by default through a mesh that is spanned over it; else, and where none comes out, through its
/// boundary and barycentric weights (Imperatore 2024, §4.2.1).
pub(super) fn lay_out(
    cloud: &Cloud,
    choice: ParameterChoice,
    options: &ParameterOptions,
    watch: &mut Watch<'_>,
) -> Result<Layout, Error> {
    if options.closed.directions() != [false; 2] {
        return tube::of_cloud(cloud, choice, options, watch);
    }
    let by_shape = matches!(choice, ParameterChoice::Auto | ParameterChoice::MeanValue);
    if by_shape && cloud.boundary.is_none() && cloud.points.nrows() < few::FEW {
        return few::lay_out(cloud, options);
    }
    let _ = watch(Event::Step("spanning a mesh over the cloud"));
    let found = find_boundary(cloud.points.view(), &BoundaryParams::default());
    if let Some(layout) = tube::of_cloud_unasked(cloud, &found, choice, options, watch) {
        return Ok(layout);
    }
    let spanned = match (found, &cloud.boundary) {
        (Ok(found), _) => Some(found),
        // A boundary that is given needs no finding.
        (Err(_), Some(_)) => None,
        (Err(reason), None) => return Err(reason.into()),
    };
    let has_mesh = spanned.as_ref().is_some_and(|found| found.triangles.is_some());
    let by_mesh = by_shape && cloud.boundary.is_none();
    let mut layout = match &spanned {
        Some(found) if by_mesh && has_mesh => by_spanned_mesh(cloud, found, options, watch)?,
        _ => by_boundary(cloud, spanned.as_ref(), choice, options, watch)?,
    };
    if by_mesh && !has_mesh {
        layout
            .warnings
            .push("no mesh could be spanned over the cloud; it was laid out by its boundary and neighbours".to_owned());
    }
    if choice == ParameterChoice::Auto && options.networks == Networks::On {
        let _ = watch(Event::Step("asking the networks"));
        layout.network = Some(layout.ask_networks());
    }
    if let Some(found) = &spanned {
        (layout.spacing, layout.noise) = (Some(found.spacing), Some(found.noise));
    }
    Ok(layout)
}

fn by_spanned_mesh(
    cloud: &Cloud,
    found: &CloudBoundary,
    options: &ParameterOptions,
    watch: &mut Watch<'_>,
) -> Result<Layout, Error> {
    let _ = watch(Event::Step("mapping the mesh"));
    let params = map_params(ParameterChoice::MeanValue, cloud.corners, options);
    let map = map_spanned(cloud.points.view(), found, &params)?;
    let refined = map.report.refinement.is_some();
    let stray = STRAY * found.spacing;
    let off_mesh = map.report.off_mesh.iter().zip(&map.report.distances);
    let far: Vec<u32> = off_mesh.filter(|(_, distance)| **distance > stray).map(|(&i, _)| i).collect();
    let projected = map.report.off_mesh.len() - far.len();
    let mut layout = Layout {
        points: cloud.points.clone(),
        rows: (0..cloud.points.nrows() as u32).collect(),
        boundary: found.outer.clone(),
        holes: found.holes.iter().map(|rim| hole(cloud, rim)).collect(),
        rims: found.holes.clone(),
        method: if refined { "spanned mesh, mean-value, refined" } else { "spanned mesh, mean-value" },
        ..Layout::default()
    };
    layout.take(map);
    if projected > 0 {
        layout.warnings.push(format!(
            "{projected} points that fit no triangle of the mesh, or are equal to others, were projected onto it"
        ));
    }
    if !far.is_empty() {
        let kept: Vec<usize> = (0..cloud.points.nrows()).filter(|&i| far.binary_search(&(i as u32)).is_err()).collect();
        layout.keep(&kept);
        layout
            .warnings
            .push(format!("{} points are more than {stray:.4e} off the surface, and were left out", far.len()));
    }
    Ok(layout)
}

fn hole(cloud: &Cloud, rim: &[u32]) -> HoleReport {
    HoleReport { points: rim.len(), length: loop_length(cloud.points.select(Axis(0), &places(rim)).view()) }
}

/// Through the boundary, given or found, and weights of neighbours. The triangles found serve to measure the map only.
fn by_boundary(
    cloud: &Cloud,
    spanned: Option<&CloudBoundary>,
    choice: ParameterChoice,
    options: &ParameterOptions,
    watch: &mut Watch<'_>,
) -> Result<Layout, Error> {
    let Some(outer) = cloud.boundary.as_ref().or(spanned.map(|found| &found.outer)) else {
        return Err(point_cloud::CloudError::NoTriangles.into());
    };
    let points = cloud.points.view();
    let outline = points.select(Axis(0), &places(outer));
    let positions = match cloud.corners {
        Some(corners) => corner_positions(corners, outer)?,
        None => find_corners(outline.view(), CornerParams::default())?.positions,
    };
    let fixed = BoundaryParameters {
        points: outer.clone(),
        parameters: side_parameters(outline.view(), positions, options.side_rule.rule())?,
    };
    let (mut parameters, mut method, warnings) = match choice {
        ParameterChoice::Bidgcn => {
            let _ = watch(Event::Step("asking the network"));
            (network::of_cloud(points, &fixed)?, "bidgcn", Vec::new())
        }
        ParameterChoice::Pargcn => {
            let _ = watch(Event::Step("asking the network"));
            (network::by_learned_weights(points, &fixed)?, "pargcn", Vec::new())
        }
        _ => {
            let _ = watch(Event::Step("mapping the cloud"));
            by_weights(points, &fixed, choice, options)?
        }
    };
    if choice == ParameterChoice::Auto {
        // Nothing is lost where the correction has no solution.
        if let Ok(corrected) = correct_shape(points, &fixed, parameters.view()) {
            (parameters, method) = (corrected.parameters, "lpsp, corrected");
        }
    }
    let mut layout = Layout {
        parameters,
        rows: (0..cloud.points.nrows() as u32).collect(),
        boundary: outer.clone(),
        holes: spanned.map(|found| found.holes.iter().map(|rim| hole(cloud, rim)).collect()).unwrap_or_default(),
        rims: spanned.map(|found| found.holes.clone()).unwrap_or_default(),
        corners: Some(positions.map(|at| outer[at])),
        method,
        warnings,
        points: cloud.points.clone(),
        ..Layout::default()
    };
    if let Some(mut triangles) = spanned.and_then(|found| found.triangles.clone()) {
        // The loop may run the other way round than the triangles.
        if layout.runs_against(&triangles, layout.rows.len()) {
            triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        layout.triangles = triangles;
    }
    Ok(layout)
}

/// By weights of neighbours, with the name of the method and what to warn of.
fn by_weights(
    points: ArrayView2<'_, f64>,
    fixed: &BoundaryParameters,
    choice: ParameterChoice,
    options: &ParameterOptions,
) -> Result<(Array2<f64>, &'static str, Vec<String>), Error> {
    let (weights, method) = match choice {
        ParameterChoice::Uniform => (CloudWeights::Uniform, "uniform"),
        ParameterChoice::Recd => (CloudWeights::ReciprocalDistance { exponent: 1.0 }, "recd"),
        _ => (CloudWeights::LocalProjection, "lpsp"),
    };
    let params = CloudMapParams { weights, radius: options.radius.0, ..CloudMapParams::default() };
    let CloudMap { parameters, report } = map_cloud(points, fixed, &params)?;
    let mut warnings = Vec::new();
    if report.growths > 0 {
        let radius = report.radius.unwrap_or_default();
        warnings.push(format!("the radius was grown to {radius:.4e} so that every point has a path to the boundary"));
    }
    Ok((parameters, method, warnings))
}

fn places(rows: &[u32]) -> Vec<usize> {
    rows.iter().map(|&row| row as usize).collect()
}

/// Places of the corners in the loop, the first first, the others as the loop meets them.
fn corner_positions(corners: [u32; 4], outer: &[u32]) -> Result<[usize; 4], Error> {
    let mut positions = [0; 4];
    for (position, corner) in positions.iter_mut().zip(corners) {
        let on_loop = outer.iter().position(|&point| point == corner);
        *position = on_loop.ok_or(Error::CornerInside { row: corner })?;
    }
    let first = positions[0];
    let n = outer.len();
    positions.sort_by_key(|&at| (at + n - first) % n);
    Ok(positions)
}
