//! Large clouds: a well-spread subset is laid out, its map is carried to all points, and all are moved onto a smooth
//! surface through them.

use std::sync::Arc;

use fit_ls::LeastSquares;
use ndarray::{Array2, ArrayView2, Axis};
use param_classic::{extend_map, triangulate_parameters};
use point_cloud::spread_subset;
use rayon::prelude::*;
use thb_core::{CellSpace, ClosestPoints, HierarchicalSpace, Kind, KnotVector};

use super::Layout;
use super::cloud::{self, Cloud};
use crate::parameter_options::ParameterChoice;
use crate::{Error, Event, ParameterOptions, Watch};

/// Clouds of up to as many times the subset are laid out at once: that takes seconds, and nothing is lost.
const AT_ONCE: usize = 3;

/// Elements per direction of the smooth surfaces that points are projected onto, one after the other. The map of the subset is linear
/// on triangles; surfaces coarser than these see no kinks.
const PROJECTIONS: [usize; 2] = [16, 32];

/// Degree of these surfaces.
const DEGREE: usize = 3;

/// Distance from the mesh over the subset, in its spacings, from which on a point is not of the surface: noise within the
/// subset has kept it off the mesh, or it is stray.
const STRAY: f64 = 4.0;

/// Longest way in parameters that a projection may move a point: farther away is another part of the surface.
const LONGEST_MOVE: f64 = 0.1;

/// Lays out a cloud, a large one through a subset.
pub(super) fn lay_out(
    cloud: Cloud,
    choice: ParameterChoice,
    options: &ParameterOptions,
    watch: &mut Watch<'_>,
) -> Result<Layout, Error> {
    let m = cloud.points.nrows();
    if m <= AT_ONCE * options.subset {
        return cloud::lay_out(cloud, choice, options, watch);
    }
    let _ = watch(Event::Step("choosing a well-spread subset"));
    let mut kept = spread_subset(cloud.points.view(), options.subset)?;
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
    let mut part = cloud::lay_out(part, choice, options, watch)?;

    let _ = watch(Event::Step("carrying the map to all points"));
    let triangles = match part.triangles.is_empty() {
        true => triangulate_parameters(part.parameters.view())?,
        false => part.triangles.clone(),
    };
    let carried = extend_map(part.points.view(), &triangles, part.parameters.view(), cloud.points.view())?;
    let stray = STRAY * part.spacing.unwrap_or(f64::INFINITY);
    let near: Vec<usize> = (0..m).filter(|&i| carried.distances[i] <= stray).collect();
    let left_out = m - near.len();
    if left_out > 0 {
        part.warnings.push(format!("{left_out} points are more than {stray:.4e} off the surface, and were left out"));
    }
    let (points, carried) = match left_out {
        0 => (cloud.points, carried.parameters),
        _ => (cloud.points.select(Axis(0), &near), carried.parameters.select(Axis(0), &near)),
    };
    let mut parameters = onto_square(carried);
    for elements in PROJECTIONS {
        let _ = watch(Event::Step("moving the points onto a smooth surface"));
        parameters = project(points.view(), &parameters, elements)?;
    }
    part.of_rows(&kept);
    let rows: Vec<u32> = near.iter().map(|&i| i as u32).collect();
    // The vertices of the mesh lie on it, so none of them was left out.
    let place = |i: u32| rows.binary_search(&part.rows[i as usize]).unwrap_or_default() as u32;
    Ok(Layout {
        triangles: part.triangles.iter().map(|t| t.map(place)).collect(),
        boundary: part.boundary.iter().map(|&i| place(i)).collect(),
        corners: part.corners.map(|corners| corners.map(place)),
        points,
        parameters,
        rows,
        subset: Some(kept.len()),
        holes: part.holes,
        method: part.method,
        refined: part.refined,
        spacing: part.spacing,
        noise: part.noise,
        warnings: part.warnings,
        reversed: false,
        is_height_field: false,
    })
}

/// Stretches parameters that reach beyond the square, or not up to its sides, onto it. The outline of a subset lies within the
/// cloud's, by a share of its spacing.
fn onto_square(mut parameters: Array2<f64>) -> Array2<f64> {
    for mut column in parameters.columns_mut() {
        let lower = column.iter().copied().fold(f64::INFINITY, f64::min);
        let upper = column.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        column.mapv_inplace(|x| ((x - lower) / (upper - lower)).clamp(0.0, 1.0));
    }
    parameters
}

/// Parameters of the closest points on a smooth surface that is fitted to the points at their present ones.
fn project(points: ArrayView2<'_, f64>, parameters: &Array2<f64>, elements: usize) -> Result<Array2<f64>, Error> {
    let knots = KnotVector::uniform(DEGREE, elements)?;
    let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots])?);
    let map = LeastSquares::new(parameters.view(), points, None, fit_ls::Options::default())?.fit(&space)?;
    let search = ClosestPoints::new(map.bezier().clone())?;
    let moved: Vec<[f64; 2]> = (0..points.nrows())
        .into_par_iter()
        .map(|i| {
            let start = [parameters[[i, 0]], parameters[[i, 1]]];
            let Ok(cell) = map.space().locate_cell(start) else { return start };
            let point = [points[[i, 0]], points[[i, 1]], points[[i, 2]]];
            let closest = search.closest_from(&point, cell, start).u;
            let way = (closest[0] - start[0]).abs().max((closest[1] - start[1]).abs());
            if way <= LONGEST_MOVE { closest } else { start }
        })
        .collect();
    Ok(Array2::from_shape_fn((moved.len(), 2), |(i, d)| moved[i][d]))
}
