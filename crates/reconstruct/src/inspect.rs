//! Questions about models and files.

use std::array;
use std::path::Path;

use deviation::{Deviation, Thresholds};
use geom_io::{
    Geometry, LengthUnit, MeshFormat, MeshStyle, MeshWithScalars, Model, ModelFormat, ReadErrorKind, ReadOptions,
    StepOptions, TakenColumn, WriteOptions, read_model, read_scan, write_mesh, write_model,
};
use ndarray::{Array2, ArrayView2, Axis};
use param_classic::triangulate_parameters;
use point_cloud::{BoundingBox, TriangleMesh, merge_duplicate_vertices};
use rayon::prelude::*;
use serde::Serialize;
use thb_core::{CellSpace, ClosestPoints, SplineMap};

use crate::clean::{MeshPieces, far_values, mesh_pieces};
use crate::error::pieces_of;
use crate::judge::MOST_IN_ORDER;
use crate::mesh::tessellate;
use crate::output::name_in;
use crate::parameters::in_canonical_order;
use crate::{Error, Tolerance, units};

/// Deviation of a cloud from a model.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// Number of points.
    pub points: usize,
    /// Points with values far beyond the rest, which don't count.
    pub sentinels: usize,
    /// Largest distance of a point to the surface (DHD).
    pub dhd: f64,
    /// Two-sided distance (HSD): that, or the largest distance of the surface to the scan if larger, as `deviation.farthest` has it.
    pub hsd: f64,
    /// Mean distance of a point to the surface.
    pub mean: f64,
    /// Mean of the squared distances.
    pub mse: f64,
    /// Its root.
    pub rmse: f64,
    /// The tolerance, in the units of the points.
    pub tolerance: f64,
    /// Diagonal of the points' box, of which percentages are.
    pub diagonal: f64,
    /// Share of the points within it.
    pub within: f64,
    /// Largest distance at the points' own parameters, where the cloud has parameters in the model's domain.
    pub max_at_parameters: Option<f64>,
    /// How the surface lies on the scan: its triangles where the file has some.
    pub deviation: Deviation,
    /// Remarks of the reader of the scan.
    pub notes: Vec<String>,
    /// The points one by one, in the order of the file.
    #[serde(skip)]
    pub at_points: Vec<PointDistance>,
}

/// A point and the closest point of a surface.
#[derive(Clone, Debug)]
pub struct PointDistance {
    /// Which point of the file it is, from 0.
    pub row: u32,
    /// Its coordinates.
    pub point: Vec<f64>,
    /// Its distance from the surface.
    pub distance: f64,
    /// The closest point of the surface.
    pub closest: Vec<f64>,
    /// The parameters of that.
    pub parameters: [f64; 2],
}

/// Compares a cloud, read as `read` says, with a model: distances of its points to their closest points on the surface.
///
/// # Errors
/// [`Error`].
pub fn compare(model: &Path, cloud: &Path, read: &ReadOptions, tolerance: Tolerance) -> Result<Comparison, Error> {
    tolerance.check()?;
    let map = surface(model)?;
    let mut scan = in_canonical_order(read_scan(cloud, read)?);
    let far = far_values(scan.cloud.points.view(), scan.triangles.as_deref())?;
    if !far.rows.is_empty() {
        let is_near = |i: &usize| far.rows.binary_search(&(*i as u32)).is_err();
        scan.select(&(0..scan.rows.len()).filter(is_near).collect::<Vec<_>>());
    }
    let points = scan.cloud.points;
    let diagonal = far.bounds.diagonal();
    let tolerance = tolerance.resolve(diagonal);
    if points.ncols() != map.dim() {
        return Err(fit_ls::Error::Shape {
            what: "coordinates of the points",
            given: points.ncols(),
            expected: map.dim(),
        }
        .into());
    }
    let search = ClosestPoints::new(map.bezier().clone())?;
    let rows: Vec<(u32, Vec<f64>)> =
        scan.rows.iter().copied().zip(points.outer_iter().map(|row| row.to_vec())).collect();
    let at_point = |(row, point): (u32, Vec<f64>)| {
        let found = search.closest(&point);
        let closest = map.eval(found.u)?.to_vec();
        Ok(PointDistance { row, point, distance: found.distance, closest, parameters: found.u })
    };
    let mut at_points = rows.into_par_iter().map(at_point).collect::<Result<Vec<PointDistance>, Error>>()?;
    let distances: Vec<f64> = at_points.iter().map(|at| at.distance).collect();
    at_points.sort_by_key(|at| at.row);
    let of_points = adaptive::Deviation::new(&distances, tolerance);
    let parameters = scan.cloud.parameters.as_ref().filter(|parameters| parameters.ncols() == 2);
    let deviation = measured(&map, &points, scan.triangles, parameters.map(|p| p.view()), tolerance)?;
    let hsd = of_points.max.max(deviation.farthest);
    let max_at_parameters = match scan.cloud.parameters {
        Some(parameters) if parameters.ncols() == 2 => {
            map.eval_batch(parameters.view()).ok().map(|image| largest_distance(&image, &points))
        }
        _ => None,
    };
    Ok(Comparison {
        points: of_points.points,
        sentinels: far.rows.len(),
        dhd: of_points.max,
        hsd,
        mean: distances.iter().sum::<f64>() / distances.len().max(1) as f64,
        mse: of_points.mse,
        rmse: of_points.rmse(),
        tolerance,
        diagonal,
        within: of_points.within,
        max_at_parameters,
        deviation,
        notes: scan.notes,
        at_points,
    })
}

/// How a surface lies on points, or on the triangles over them. Where they have parameters, these tell which are neighbours.
fn measured(
    map: &SplineMap<2>,
    points: &Array2<f64>,
    triangles: Option<Vec<[u32; 3]>>,
    parameters: Option<ArrayView2<'_, f64>>,
    tolerance: f64,
) -> Result<Deviation, Error> {
    // Where triangles have corners of their own, equal ones are one: rims would be everywhere.
    let mesh =
        triangles.map(|triangles| merge_duplicate_vertices(&TriangleMesh { vertices: points.clone(), triangles }).0);
    let places = |points: &Array2<f64>| -> Vec<[f64; 3]> {
        points.outer_iter().map(|row| std::array::from_fn(|k| row[k])).collect()
    };
    let places = mesh.as_ref().map_or_else(|| places(points), |mesh| places(&mesh.vertices));
    let scan = match (&mesh, parameters) {
        (Some(mesh), _) => deviation::Scan::mesh(&places, &mesh.triangles)?,
        (None, Some(parameters)) if places.len() <= MOST_IN_ORDER => {
            deviation::Scan::cloud(&places)?.with_spanned(&triangulate_parameters(parameters).unwrap_or_default(), true)
        }
        (None, _) => deviation::Scan::cloud(&places)?,
    };
    Ok(deviation::measure(map, &scan, None, tolerance, &Thresholds::default())?)
}

fn largest_distance(a: &Array2<f64>, b: &Array2<f64>) -> f64 {
    let squared = (a - b).mapv(|x| x * x).sum_axis(Axis(1));
    squared.iter().fold(0.0_f64, |m, &s| m.max(s)).sqrt()
}

/// Points of a model at parameters.
pub struct Evaluation {
    /// What the columns hold: `u` and, of surfaces, `v`, then as many of `x`, `y`, `z`, `c4`, `c5` and so on as points have coordinates.
    pub columns: Vec<String>,
    /// A row for each parameter.
    pub rows: Array2<f64>,
    /// Remarks of the reader of the parameters.
    pub notes: Vec<String>,
}

/// Points of a model at the parameters of a CSV file with the columns u and v (curves: u), or with as many columns without names.
///
/// # Errors
/// [`Error`].
pub fn eval_model(model: &Path, parameters: &Path) -> Result<Evaluation, Error> {
    let geometry = read_model(model)?.geometry;
    let columns: &[&str] = match geometry {
        Geometry::Curve(_) => &["u"],
        Geometry::Surface(_) => &["u", "v"],
    };
    let mut columns: Vec<String> = columns.iter().map(|&name| name.to_owned()).collect();
    let path = parameters;
    let scan = read_parameters(path, &columns)?;
    let (parameters, image) = match &geometry {
        Geometry::Curve(map) => eval_rows(map, path, &scan)?,
        Geometry::Surface(map) => eval_rows(map, path, &scan)?,
    };
    let names = ["x", "y", "z"].map(str::to_owned).into_iter().chain((4..).map(|k| format!("c{k}")));
    columns.extend(names.take(image.ncols()));
    let rows =
        ndarray::concatenate(Axis(1), &[parameters.view(), image.view()]).map_err(|_| fit_ls::Error::NoPoints)?;
    Ok(Evaluation { columns, rows, notes: scan.notes })
}

/// Reads parameters by the names of their columns; without names by their order, if there are no others.
fn read_parameters(path: &Path, columns: &[String]) -> Result<geom_io::Scan, Error> {
    let read = |columns: Vec<String>| read_scan(path, &ReadOptions { columns, ..ReadOptions::default() });
    let numbered = |count: usize| (1..=count).map(|k| k.to_string()).collect();
    match read(columns.to_vec()) {
        Err(error)
            if matches!(error.kind, ReadErrorKind::ColumnNumber { .. })
                && read(numbered(columns.len() + 1)).is_err() =>
        {
            Ok(read(numbered(columns.len()))?)
        }
        other => Ok(other?),
    }
}

/// How far beyond its domain a parameter may lie, as a share of the domain's length.
///
/// Limit: round-off of numbers written with twelve digits.
const BEYOND_DOMAIN: f64 = 1e-12;

/// The parameters, those beyond the domain by round-off on its boundary, and the points there.
fn eval_rows<const D: usize>(
    map: &SplineMap<D>,
    path: &Path,
    scan: &geom_io::Scan,
) -> Result<(Array2<f64>, Array2<f64>), Error> {
    let mut parameters = scan.cloud.points.clone();
    let (lower, upper) = map.space().domain();
    for (place, mut row) in parameters.outer_iter_mut().enumerate() {
        if map.space().locate_cell(array::from_fn(|d| row[d])).is_ok() {
            continue;
        }
        for d in 0..D {
            let (value, nearest) = (row[d], row[d].clamp(lower[d], upper[d]));
            if (value - nearest).abs() > BEYOND_DOMAIN * (upper[d] - lower[d]) {
                return Err(Error::EvalOutside {
                    path: path.to_owned(),
                    line: scan.line(place),
                    place,
                    name: ["u", "v", "w"][d],
                    value,
                    domain: [lower[d], upper[d]],
                });
            }
            row[d] = nearest;
        }
    }
    let image = map.eval_batch(parameters.view())?;
    Ok((parameters, image))
}

/// Writes a model in another format: `.step .stp .xml .json`, or a sampled mesh `.obj .ply .vtk`.
///
/// # Errors
/// [`Error`].
pub fn convert(input: &Path, output: &Path, step: &StepOptions) -> Result<(), Error> {
    let model = read_model(input)?;
    let flip = step.flip;
    if ModelFormat::from_path(output).is_some() {
        let product = if step.product.is_empty() { name_in(&model.metadata) } else { &step.product };
        let step = StepOptions { product: product.to_owned(), ..step.clone() };
        return Ok(write_model(output, &model, &WriteOptions { step, ..WriteOptions::default() })?);
    }
    if MeshFormat::from_path(output).is_err() {
        return Err(Error::OutputFormat { path: output.to_owned() });
    }
    let Geometry::Surface(map) = model.geometry else {
        return Err(Error::NotASurface { path: input.to_owned() });
    };
    let (mesh, _) = tessellate(&map, flip)?;
    let mesh = MeshWithScalars { vertices: mesh.vertices.view(), triangles: &mesh.triangles, scalars: None };
    Ok(write_mesh(output, &mesh, &MeshStyle::default())?)
}

/// What a file holds.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Info {
    /// A spline model.
    Model {
        /// Dimension of the parameters.
        parameters: usize,
        /// Dimension of the points.
        dimension: usize,
        /// Degree per direction.
        degree: Vec<usize>,
        /// Control points.
        dofs: usize,
        /// Levels.
        levels: usize,
        /// Cells.
        cells: usize,
        /// Functions of each level.
        dofs_per_level: Vec<usize>,
        /// Lower and upper corner of the parameter domain.
        domain: [Vec<f64>; 2],
        /// Length unit.
        unit: &'static str,
    },
    /// A cloud or mesh.
    Scan {
        /// Its format.
        format: &'static str,
        /// Points.
        points: usize,
        /// Triangles, if it is a mesh.
        triangles: Option<usize>,
        /// Coordinates per point.
        dimension: usize,
        /// Whether points come with parameters.
        parameters: bool,
        /// Whether points come with normals.
        normals: bool,
        /// Which columns of a text file were taken for what; empty for other formats.
        columns: Vec<TakenColumn>,
        /// Rows and columns, if it is a grid.
        grid: Option<[usize; 2]>,
        /// Lower and upper corner of the bounding box.
        bounds: [Vec<f64>; 2],
        /// Its diagonal.
        diagonal: f64,
        /// Length unit, where the file tells it.
        unit: Option<&'static str>,
        /// Remarks of the reader.
        notes: Vec<String>,
    },
}

/// Tells what a file holds; clouds and meshes are read as `read` says.
///
/// # Errors
/// [`Error`].
pub fn info(path: &Path, read: &ReadOptions) -> Result<Info, Error> {
    if read.format.is_none() && ModelFormat::from_path(path) == Some(ModelFormat::Json) {
        return Ok(model_info(&read_model(path)?));
    }
    let scan = match read_scan(path, read) {
        Err(error) if matches!(error.kind, geom_io::ReadErrorKind::HoldsModel { .. }) => {
            return Ok(model_info(&read_model(path)?));
        }
        other => other?,
    };
    let bounds = BoundingBox::of(scan.cloud.points.view())?;
    let far = far_values(scan.cloud.points.view(), scan.triangles.as_deref())?;
    // Triangles that are joined wrongly are told where they are fitted.
    let pieces = mesh_pieces(&scan).unwrap_or(None);
    let mut notes = scan.notes;
    if let Some(MeshPieces { sizes, .. }) = pieces.filter(|pieces| pieces.sizes.len() > 1) {
        notes.push(format!(
            "the mesh has {}; thb fit --piece 1 fits the largest of them, --piece all each",
            pieces_of(&sizes)
        ));
    }
    notes.extend(units::hint(None, scan.unit, far.bounds.diagonal()));
    if let [first, ..] = far.rows[..] {
        notes.push(format!(
            "{} points have values far beyond the rest, the first in row {}; thb fit sets them aside, and the diagonal without them is {:.6e}",
            far.rows.len(),
            scan.rows[first as usize],
            far.bounds.diagonal()
        ));
    }
    Ok(Info::Scan {
        format: scan.format.name(),
        points: scan.cloud.points.nrows(),
        triangles: scan.triangles.as_ref().map(Vec::len),
        dimension: scan.cloud.points.ncols(),
        parameters: scan.cloud.parameters.is_some(),
        normals: scan.normals.is_some(),
        columns: scan.columns,
        grid: scan.cloud.grid.map(|grid| [grid.n_u, grid.n_v]),
        diagonal: bounds.diagonal(),
        unit: scan.unit.map(LengthUnit::name),
        bounds: [bounds.lower, bounds.upper].map(|corner| corner.to_vec()),
        notes,
    })
}

fn model_info(model: &Model) -> Info {
    fn of<const D: usize>(map: &SplineMap<D>, unit: &'static str) -> Info {
        let space = map.space();
        let (lower, upper) = space.domain();
        Info::Model {
            parameters: D,
            dimension: map.dim(),
            degree: space.degree().to_vec(),
            dofs: space.n_functions(),
            levels: space.n_levels(),
            cells: space.n_cells(),
            dofs_per_level: space.functions_per_level(),
            domain: [lower.to_vec(), upper.to_vec()],
            unit,
        }
    }
    match &model.geometry {
        Geometry::Curve(map) => of(map, model.unit.name()),
        Geometry::Surface(map) => of(map, model.unit.name()),
    }
}

fn surface(path: &Path) -> Result<SplineMap<2>, Error> {
    match read_model(path)?.geometry {
        Geometry::Surface(map) => Ok(map),
        Geometry::Curve(_) => Err(Error::NotASurface { path: path.to_owned() }),
    }
}
