//! Parameters for the points of a scan.

pub(crate) mod boundary;
mod closed;
mod cloud;
mod few;
mod guard;
mod large;
mod layers;
pub(crate) mod layout;
mod mesh;
mod network;
mod quality;
mod tube;

use std::mem;
use std::time::Instant;

use geom_io::{Scan, read_scan};
use ndarray::{Array1, Array2, Axis};
use point_cloud::{
    BoundingBox, Duplicates, canonical_order, canonical_triangles, check_curve_cloud, check_surface_cloud,
    principal_axes,
};

pub use self::layers::LayersReport;
use self::layout::{Cloud, Layout, corners_among};
pub use self::layout::{HoleReport, NetworkReport};
pub(crate) use self::layout::{MIN_POINTS, extent, places_of};
pub(crate) use self::mesh::STRAY_TRIANGLES;
pub use self::quality::{ParameterReport, SeamReport, Stretch, VoidReport};
use crate::clean::{Cleaned, CleaningReport, clean};
use crate::options::{Closed, Domain, ParameterChoice, SideRule};
use crate::{Error, Event, ParameterOptions, Watch};

/// Standard deviation of parameters across the line that they are nearest to, as a share of that along it, from which on they
/// span a domain.
///
/// Limit: along a line of slope 1 the square holds 10⁴ times as many functions without as with points, and a fit is left to its smoothing.
const LINE_PER_LENGTH: f64 = 1e-4;

/// What the user of a cloud without order can do about a parameterization that needs more.
const CLOUD_HINT: &str =
    "; leave --param out to have it laid out by its shape, or give a mesh, columns i,j or columns u,v";

/// Points with parameters.
#[derive(Clone, Debug)]
pub struct Parameterized {
    /// The points, `(m, 3)`.
    pub points: Array2<f64>,
    /// The same points as they were scanned, where two layers were moved to the middle between them.
    pub scanned: Option<Array2<f64>>,
    /// Their parameters, `(m, 2)`.
    pub parameters: Array2<f64>,
    /// The confidence in each point, where the file gives one.
    pub weights: Option<Array1<f64>>,
    /// The normal at each point, where the file gives some; NaN where it gives none.
    pub normals: Option<Vec<[f64; 3]>>,
    /// Row of each point in the file, from 0: see [`Scan::rows`].
    pub rows: Vec<u32>,
    /// Triangles over the points: those of a mesh, or of one spanned over (a subset of) a cloud; empty if there are none.
    pub triangles: Vec<[u32; 3]>,
    /// Triangles of a mesh without room in the parameter square, over the same points: part of the scan, but not laid out.
    pub left_out: Vec<[u32; 3]>,
    /// Whether these triangles are the scan, and not spanned over its points.
    pub is_mesh: bool,
    /// The points of the outer boundary in order; empty where it was not needed.
    pub boundary: Vec<u32>,
    /// The points round each hole that was found, in order, in the order of the holes of the report.
    pub rims: Vec<Vec<u32>>,
    /// Whether the parameters run against the triangles of the input.
    pub reversed: bool,
    /// Whether u and whether v wraps at 1; a triangle may then lie across the seam.
    pub closed: [bool; 2],
    /// The diagonal of the points' bounding box, without what was set aside: what percentages are of.
    pub diagonal: f64,
    /// How it went, and how good it is.
    pub report: ParameterReport,
    /// What the user should know.
    pub warnings: Vec<String>,
}

/// Reads a file, as `options.read` says, and finds parameters for its points.
///
/// # Errors
/// [`Error`].
pub fn parameterize_file(
    path: &std::path::Path,
    options: &ParameterOptions,
    watch: &mut Watch<'_>,
) -> Result<Parameterized, Error> {
    let _ = watch(Event::Step("reading"));
    parameterize(read_scan(path, &options.read)?, options, watch)
}

/// Finds parameters for the points of a scan in the way asked for, and measures how good they are.
///
/// # Errors
/// [`Error`].
pub fn parameterize(scan: Scan, options: &ParameterOptions, watch: &mut Watch<'_>) -> Result<Parameterized, Error> {
    let start = Instant::now();
    options.check()?;
    let columns = scan.cloud.points.ncols();
    if columns != 3 {
        return Err(Error::Coordinates { given: columns });
    }
    // Beside a value far beyond the rest all others lie on a line, so that is looked at later.
    check_curve_cloud(scan.cloud.points.view(), MIN_POINTS)?;
    let read = scan.cloud.points.nrows();
    let Cleaned { mut scan, found, report: cleaning, gaps, .. } = clean(in_canonical_order(scan), options, watch)?;
    check_surface_cloud(scan.cloud.points.view(), MIN_POINTS)?;
    let mut warnings = scan.notes.clone();
    warnings.extend(found.warnings(&options.clean));
    let layers = layers::to_middle(&mut scan, options, watch)?;
    warnings.extend(layers.iter().map(|layers| layers.report.to_string()));

    let _ = watch(Event::Step("laying out"));
    let (rows, confidence) = (mem::take(&mut scan.rows), scan.weights.take());
    let file_normals = scan.normals.clone();
    let mut layout = lay_out(scan, &rows, options, watch).map_err(|error| error.of_rows(&rows))?;
    if !gaps.is_empty() {
        let has_data = |&at: &usize| gaps.binary_search(&(layout.rows[at] as usize)).is_err();
        let kept: Vec<usize> = (0..layout.rows.len()).filter(has_data).collect();
        layout.keep(&kept);
    }
    // In the order of the file again.
    let mut in_order: Vec<usize> = (0..layout.rows.len()).collect();
    in_order.sort_by_key(|&at| rows[layout.rows[at] as usize]);
    if !in_order.is_sorted() {
        layout.keep(&in_order);
    }
    warnings.extend(layout.warnings.iter().cloned());
    let _ = watch(Event::Step("measuring the parameters"));
    let in_file = |i: u32| rows[layout.rows[i as usize] as usize];
    let closed = if options.closed == Closed::Auto { layout.closed } else { options.closed.directions() };
    let mut report = quality::measure(&layout, options.domain, closed)?;
    report.layers = layers.as_ref().map(|layers| layers.report);
    report.corners = layout.corners.map(|corners| corners.map(in_file));
    report.seam = layout.seam.map(|seam| SeamReport {
        rows: seam.map(in_file),
        points: seam.map(|i| std::array::from_fn(|k| layout.points[[i as usize, k]])),
    });
    report.left_out = read - layout.rows.len();
    report.cleaning = CleaningReport { merged: cleaning.merged + layout.merged, ..cleaning };
    report.outliers = found.outliers;
    report.stray = found.stray;
    report.seconds = start.elapsed().as_secs_f64();
    let scanned = layers.map(|layers| {
        let laid_out: Vec<usize> = layout.rows.iter().map(|&row| row as usize).collect();
        layers.scanned.select(Axis(0), &laid_out)
    });
    let weights = confidence.map(|all| layout.rows.iter().map(|&row| all[row as usize]).collect());
    let normals = file_normals.map(|all| layout.rows.iter().map(|&row| all[row as usize]).collect());
    let rows = (0..layout.rows.len() as u32).map(in_file).collect();
    let Layout { points, parameters, triangles, left_out, is_mesh, boundary, rims, reversed, .. } = layout;
    let diagonal = BoundingBox::of(points.view())?.diagonal();
    Ok(Parameterized {
        diagonal,
        points,
        scanned,
        parameters,
        weights,
        normals,
        rows,
        triangles,
        // Triangles over a cloud are no scan.
        left_out: if is_mesh { left_out } else { Vec::new() },
        is_mesh,
        boundary,
        rims,
        reversed,
        closed,
        report,
        warnings,
    })
}

/// The points of a scan, unless their order means something, in one that does not depend on how the file lists them.
pub(crate) fn in_canonical_order(mut scan: Scan) -> Scan {
    if scan.cloud.grid.is_none() && scan.cloud.parameters.is_none() {
        scan.select(&canonical_order(scan.cloud.points.view()));
        scan.triangles.iter_mut().for_each(|triangles| canonical_triangles(triangles));
    }
    scan
}

/// Lays points out in the way asked for; `rows` are theirs in the file.
fn lay_out(mut scan: Scan, rows: &[u32], options: &ParameterOptions, watch: &mut Watch<'_>) -> Result<Layout, Error> {
    let given_boundary = boundary::given(&scan, rows, options)?;
    let choice = match options.param {
        ParameterChoice::Auto if scan.cloud.parameters.is_some() => ParameterChoice::Given,
        ParameterChoice::Auto if scan.triangles.is_some() && given_boundary.is_none() => ParameterChoice::MeanValue,
        ParameterChoice::Auto if scan.cloud.grid.is_some() => ParameterChoice::Chord,
        other => other,
    };
    let missing = |needed, hint| Error::NoParameters { asked: options.param.to_string(), needed, hint };
    match (choice, scan.triangles.is_some(), scan.cloud.grid) {
        (ParameterChoice::Given, ..) => {
            let mut parameters =
                scan.cloud.parameters.take().ok_or_else(|| missing("parameters u, v in the file", ""))?;
            closed::wrap(&mut parameters, options.closed.directions());
            check_domain(&parameters, options.domain, |place| scan.line_of_row(rows[place]))?;
            let is_height_field = scan.cell.is_some() || options.read.height_field;
            let layout = as_they_are(scan.cloud.points, parameters, scan.triangles, "given", Vec::new());
            Ok(Layout { is_height_field, ..layout })
        }
        (ParameterChoice::Parcnn, ..) if options.closed.directions() == [false; 2] => {
            let grid = scan.cloud.grid.ok_or_else(|| missing("grid order (columns i, j)", CLOUD_HINT))?;
            let parameters = network::of_grid(scan.cloud.points.view(), grid, options.told)?;
            Ok(as_they_are(scan.cloud.points, parameters, scan.triangles, "parcnn", Vec::new()))
        }
        (ParameterChoice::Chord | ParameterChoice::Centripetal, ..) | (ParameterChoice::Uniform, false, Some(_)) => {
            let grid = scan.cloud.grid.ok_or_else(|| missing("grid order (columns i, j)", CLOUD_HINT))?;
            let (rule, name) = match choice {
                ParameterChoice::Uniform => (SideRule::Uniform, "uniform"),
                ParameterChoice::Centripetal => (SideRule::Centripetal, "centripetal"),
                _ => (SideRule::Chord, "chord"),
            };
            let found = closed::parameterize(scan.cloud.points.view(), grid, rule.rule(), options.closed.directions())?;
            let skipped = [(found.report.skipped_u, 'u'), (found.report.skipped_v, 'v')];
            let single = skipped
                .into_iter()
                .filter(|(lines, _)| *lines > 0)
                .map(|(lines, direction)| format!("{lines} grid lines along {direction} are single points"));
            let repeated =
                ['u', 'v'].into_iter().zip(found.repeated).filter(|(_, repeated)| *repeated).map(|(direction, _)| {
                    format!("the last point of the grid lines along {direction} is their first one")
                });
            let warnings: Vec<String> = single.chain(repeated).collect();
            if found.kept.len() == scan.cloud.points.nrows() {
                return Ok(as_they_are(scan.cloud.points, found.parameters, scan.triangles, name, warnings));
            }
            // Triangles would name points that are left out.
            let points = scan.cloud.points.select(Axis(0), &found.kept);
            let mut layout = as_they_are(points, found.parameters, None, name, warnings);
            layout.rows = found.kept.iter().map(|&row| row as u32).collect();
            Ok(layout)
        }
        (ParameterChoice::MeanValue | ParameterChoice::Uniform, true, _) if given_boundary.is_none() => {
            tube::check(choice, false, options)?;
            mesh::lay_out_or_take_vertices(scan, rows, choice, options, watch)
        }
        _ => {
            tube::check(choice, given_boundary.is_some(), options)?;
            let corners = corners_among(rows, options)?;
            let cloud = Cloud { points: scan.cloud.points, boundary: given_boundary, corners };
            let mut layout = large::lay_out(cloud, choice, options, watch)?;
            // The triangles of a mesh tell its outside, whatever laid out its vertices.
            match scan.triangles {
                Some(triangles) => layout.reversed = layout.runs_against(&triangles, rows.len()),
                // A tube has an inside, and normals tell theirs once there is a surface.
                None if layout.closed != [false; 2] || scan.normals.is_some() => {}
                None => {
                    layout.warnings.push("the cloud does not tell its outside: --flip turns the face normal".to_owned())
                }
            }
            Ok(layout)
        }
    }
}

/// A layout with known parameters for all points.
fn as_they_are(
    points: Array2<f64>,
    parameters: Array2<f64>,
    triangles: Option<Vec<[u32; 3]>>,
    method: &'static str,
    mut warnings: Vec<String>,
) -> Layout {
    let duplicates = Duplicates::find(points.view()).count();
    if duplicates > 0 {
        warnings.push(format!("{duplicates} points are equal to others; all are kept"));
    }
    let rows = (0..points.nrows() as u32).collect();
    let mut layout = Layout { points, parameters, rows, method, warnings, ..Layout::default() };
    if let Some(mut triangles) = triangles {
        layout.reversed = layout.runs_against(&triangles, layout.rows.len());
        if layout.reversed {
            triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        layout.triangles = triangles;
        layout.is_mesh = true;
    }
    layout
}

/// `line` tells the line of a point in the file.
fn check_domain(parameters: &Array2<f64>, domain: Domain, line: impl Fn(usize) -> Option<usize>) -> Result<(), Error> {
    if parameters.ncols() != 2 {
        return Err(
            fit_ls::Error::Shape { what: "columns of parameters", given: parameters.ncols(), expected: 2 }.into()
        );
    }
    let outside = parameters.indexed_iter().find(|(_, value)| !(0.0..=1.0).contains(*value));
    if let (Domain::Unit, Some(((index, direction), &value))) = (domain, outside) {
        let [u, v] = [0, 1].map(|d| extent(parameters.column(d)));
        return Err(Error::OutsideUnitSquare { index, line: line(index), direction, value, u, v });
    }
    for (direction, column) in parameters.axis_iter(Axis(1)).enumerate() {
        let value = column.iter().copied().next().unwrap_or(0.0);
        if column.iter().all(|&x| x == value) {
            return Err(Error::FlatDomain { direction, value });
        }
    }
    let places: Vec<[f64; 3]> = parameters.rows().into_iter().map(|uv| [uv[0], uv[1], 0.0]).collect();
    let [_, across, along] = principal_axes(&places).variances.map(|variance| variance.max(0.0).sqrt());
    if across <= LINE_PER_LENGTH * along {
        return Err(Error::LineDomain { points: places.len(), width: across, length: along });
    }
    Ok(())
}
