//! Large clouds: a well-spread subset is laid out, its map is carried to all points, and all are moved onto a smooth
//! surface through them.

use std::sync::Arc;

use fit_ls::LeastSquares;
use moving_param::{Boundary, Constraints, FootPointOptions, foot_points};
use ndarray::{Array2, ArrayView2, Axis, arr1};
use param_classic::{extend_map, map_quality, triangulate_parameters, unroll};
use point_cloud::{CloudError, Rows, find_rows, spread_subset, thin_rows};
use thb_core::{HierarchicalSpace, Kind};

use super::closed::wrap;
use super::layout::{Cloud, Layout, STRAY, spread_over_square};
use super::{cloud, network};
use crate::knots::uniform_knots;
use crate::options::ParameterChoice;
use crate::{Error, Event, ParameterOptions, Watch};

/// Clouds of up to as many times the subset are laid out at once: that takes seconds, and nothing is lost.
const AT_ONCE: usize = 3;

/// Elements per direction of the smooth surfaces that points are projected onto, one after the other. The map of the subset is linear
/// on triangles; surfaces coarser than these see no kinks.
const PROJECTIONS: [usize; 2] = [16, 32];

/// Degree of these surfaces.
const DEGREE: usize = 3;

/// A projection is undone if it folds more than one in so many triangles. Noise across a narrow part folds a few.
const FOLDED: usize = 100;

/// Longest way in parameters that a projection may move a point.
const LONGEST_MOVE: f64 = 0.1;

/// Points along rows for each row across them, at which rows that no mesh could be spanned over are thinned one after the other: the
/// more, the more of the points are laid out themselves, and the longer the triangles.
///
/// Calibrated: of rows at ratios of 5 to 100, straight and bent, with points even and shaken along them, all are spanned at 5 but for some
/// with bends, which are at 2.5; 10 serves where rows are short.
const ROW_RATIOS: [f64; 3] = [5.0, 2.5, 10.0];

/// Lays out a cloud: a large one through a subset, and one of rows too far apart for a mesh through points spread along them.
pub(super) fn lay_out(
    cloud: Cloud,
    choice: ParameterChoice,
    options: &ParameterOptions,
    watch: &mut Watch<'_>,
) -> Result<Layout, Error> {
    let m = cloud.points.nrows();
    let (subset, at_once) = match choice {
        ParameterChoice::Bidgcn => (options.subset.min(network::LARGEST), network::LARGEST),
        ParameterChoice::Pargcn => (options.subset.min(network::LARGEST_WEIGHTED), network::LARGEST_WEIGHTED),
        _ => (options.subset, AT_ONCE * options.subset),
    };
    let by_shape = matches!(choice, ParameterChoice::Auto | ParameterChoice::MeanValue);
    let first = if m <= at_once {
        cloud::lay_out(&cloud, choice, options, watch)
    } else {
        let _ = watch(Event::Step("choosing a well-spread subset"));
        let kept = spread_subset(cloud.points.view(), subset)?;
        through_subset(&cloud, kept, choice, options, watch)
    };
    let is_torn =
        |error: &Error| matches!(error, Error::Cloud(CloudError::NoSurface { .. } | CloudError::CloudPieces { .. }));
    let reason = match first {
        Err(reason) if by_shape && cloud.boundary.is_none() && is_torn(&reason) => reason,
        done => return done,
    };
    let Some(rows) = find_rows(cloud.points.view())? else { return Err(reason) };
    let _ = watch(Event::Step("thinning the rows"));
    for ratio in ROW_RATIOS.into_iter().filter(|&ratio| ratio < rows.ratio()) {
        let kept = thin_rows(cloud.points.view(), rows.across / ratio)?;
        if kept.len() > at_once {
            continue;
        }
        let kept_count = kept.len();
        match through_subset(&cloud, kept, choice, options, watch) {
            Ok(mut layout) => {
                layout.warnings.push(told(rows, kept_count, m));
                return Ok(layout);
            }
            Err(error) => tracing::debug!(ratio, %error, "no mesh over thinned rows"),
        }
    }
    Err(reason)
}

fn told(rows: Rows, kept: usize, given: usize) -> String {
    format!(
        "the points lie in rows {:.4e} apart, {:.0} times as dense along them as across: the mesh was spanned over {kept} of the {given} \
         points; between the rows the surface is a guess",
        rows.across,
        rows.ratio()
    )
}

/// Lays out some of the points of a cloud and carries their map to all.
fn through_subset(
    cloud: &Cloud,
    mut kept: Vec<u32>,
    choice: ParameterChoice,
    options: &ParameterOptions,
    watch: &mut Watch<'_>,
) -> Result<Layout, Error> {
    let m = cloud.points.nrows();
    kept.extend(cloud.boundary.iter().flatten().chain(cloud.corners.iter().flatten()));
    kept.sort_unstable();
    kept.dedup();
    // All of them are kept, so the search always finds.
    let place = |&point: &u32| kept.binary_search(&point).unwrap_or_default() as u32;
    let rows: Vec<usize> = kept.iter().map(|&i| i as usize).collect();
    let part = Cloud {
        points: cloud.points.select(Axis(0), &rows),
        boundary: cloud.boundary.as_ref().map(|outer| outer.iter().map(place).collect()),
        corners: cloud.corners.map(|corners| corners.map(|corner| place(&corner))),
    };
    let mut part = cloud::lay_out(&part, choice, options, watch).map_err(|error| error.of_rows(&kept))?;

    let _ = watch(Event::Step("carrying the map to all points"));
    let triangles = match part.triangles.is_empty() {
        true => triangulate_parameters(part.parameters.view())?,
        false => part.triangles.clone(),
    };
    let closed = part.closed;
    let cut = unroll(&triangles, part.parameters.view(), closed);
    let carried = extend_map(
        cut.vertices(part.points.view()).view(),
        &cut.triangles,
        cut.parameters.view(),
        cloud.points.view(),
    )?;
    let stray = STRAY * part.spacing.unwrap_or(f64::INFINITY);
    let near: Vec<usize> = (0..m).filter(|&i| carried.distances[i] <= stray).collect();
    let left_out = m - near.len();
    if left_out > 0 {
        part.warnings.push(format!("{left_out} points are more than {stray:.4e} off the surface, and were left out"));
    }
    let (points, carried) = match left_out {
        0 => (cloud.points.clone(), carried.parameters),
        _ => (cloud.points.select(Axis(0), &near), carried.parameters.select(Axis(0), &near)),
    };
    part.of_rows(&kept);
    let rows: Vec<u32> = near.iter().map(|&i| i as u32).collect();
    // The vertices of the mesh lie on it, so none of them was left out.
    let place = |i: u32| rows.binary_search(&part.rows[i as usize]).unwrap_or_default() as u32;
    let triangles: Vec<[u32; 3]> = part.triangles.iter().map(|t| t.map(place)).collect();
    // The outline of a subset lies within the cloud's, by a share of its spacing: some parameters lie outside the square.
    let mut parameters = carried;
    spread_over_square(&mut parameters, closed);
    wrap(&mut parameters, closed);
    let parameters = smoothed(&points, parameters, &triangles, closed, watch)?;
    let rims = part.rims.iter().map(|rim| rim.iter().map(|&i| place(i)).collect()).collect();
    Ok(Layout {
        boundary: part.boundary.iter().map(|&i| place(i)).collect(),
        corners: part.corners.map(|corners| corners.map(place)),
        seam: part.seam.map(|seam| seam.map(place)),
        triangles,
        left_out: Vec::new(),
        points,
        parameters,
        rows,
        subset: Some(kept.len()),
        closed,
        rims,
        holes: part.holes,
        method: part.method,
        refined: part.refined,
        spacing: part.spacing,
        noise: part.noise,
        network: part.network,
        warnings: part.warnings,
        reversed: false,
        is_mesh: false,
        is_height_field: false,
        merged: part.merged,
    })
}

/// Parameters moved onto ever finer smooth surfaces, as long as the triangles do not tangle.
fn smoothed(
    points: &Array2<f64>,
    mut parameters: Array2<f64>,
    triangles: &[[u32; 3]],
    closed: [bool; 2],
    watch: &mut Watch<'_>,
) -> Result<Array2<f64>, Error> {
    let folded = |parameters: &Array2<f64>| {
        let cut = unroll(triangles, parameters.view(), closed);
        map_quality(cut.vertices(points.view()).view(), &cut.triangles, cut.parameters.view())
            .map(|quality| quality.folded.len())
    };
    let mut folds = folded(&parameters)?;
    for elements in PROJECTIONS {
        let _ = watch(Event::Step("moving the points onto a smooth surface"));
        let moved = project(points.view(), &parameters, elements, closed)?;
        let then = folded(&moved)?;
        // A surface too coarse for the shape, or parameters too far off, tangle the points.
        if then > folds + triangles.len() / FOLDED {
            tracing::debug!(elements, then, folds, "projection undone");
            break;
        }
        (parameters, folds) = (moved, then);
    }
    Ok(parameters)
}

/// Parameters of the foot points on a smooth surface that is fitted to the points at their present ones.
fn project(
    points: ArrayView2<'_, f64>,
    parameters: &Array2<f64>,
    elements: usize,
    closed: [bool; 2],
) -> Result<Array2<f64>, Error> {
    let knots = [uniform_knots(DEGREE, elements, closed[0])?, uniform_knots(DEGREE, elements, closed[1])?];
    let space = Arc::new(HierarchicalSpace::new(Kind::Thb, knots)?);
    let mut fit = LeastSquares::new(parameters.view(), points, None, fit_ls::Options::default())?;
    let map = fit.fit(&space)?;
    let free = Constraints::in_space(parameters.view(), space.as_ref(), Boundary::Free);
    let feet = foot_points(&map, fit.points(), &free, &FootPointOptions::default())?;
    let mut moved = parameters.clone();
    for (&i, foot) in fit.points().order().iter().zip(feet.parameters) {
        let mut place = moved.row_mut(i as usize);
        // Farther away is another part of the surface.
        let way = |d: usize| {
            let way = foot[d] - place[d];
            if closed[d] { way - way.round() } else { way }
        };
        if (0..2).all(|d| way(d).abs() <= LONGEST_MOVE) {
            place.assign(&arr1(&foot));
        }
    }
    wrap(&mut moved, closed);
    Ok(moved)
}
