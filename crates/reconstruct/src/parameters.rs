//! Parameters for the points of a scan.

use geom_io::Scan;
use ndarray::{Array2, Axis};
use param_classic::{
    BoundaryParameters, CloudMapParams, MeshMapParams, Rule, Weights, map_cloud, map_disk, map_quality,
    parameterize_grid, side_parameters,
};
use point_cloud::{
    BoundaryParams, CloudBoundary, CornerParams, DiskMesh, Duplicates, TriangleMesh, check_surface_cloud,
    drop_unreferenced, find_boundary, find_corners, merge_duplicate_vertices, unreferenced_vertices,
};

use crate::{Domain, Error, FitOptions, ParameterChoice};

/// Fewest points of a surface: four control points of the smallest bilinear one.
const MIN_POINTS: usize = 4;

/// What the user of a cloud without order can do about a parameterization that needs more.
const CLOUD_HINT: &str =
    "; leave --param out to have it laid out by its shape, or give a mesh, columns i,j or columns u,v";

/// Points that are ready to be fitted.
pub(crate) struct Parameterized {
    /// `(m, 3)`.
    pub(crate) points: Array2<f64>,
    /// `(m, 2)`.
    pub(crate) parameters: Array2<f64>,
    /// Name of the parameterization that was used.
    pub(crate) name: &'static str,
    /// Corner vertices of a mapped mesh, at (0,0), (1,0), (1,1), (0,1).
    pub(crate) corners: Option<[u32; 4]>,
    /// Whether the parameters run against the triangles of the input.
    pub(crate) reversed: bool,
    pub(crate) warnings: Vec<String>,
}

/// Finds parameters in the way asked for.
pub(crate) fn parameterize(scan: Scan, options: &FitOptions) -> Result<Parameterized, Error> {
    let given = scan.cloud.points.ncols();
    if given != 3 {
        return Err(Error::Coordinates { given });
    }
    check_surface_cloud(scan.cloud.points.view(), MIN_POINTS)?;
    let mut warnings = scan.notes.clone();
    let choice = match options.param {
        ParameterChoice::Auto if scan.cloud.parameters.is_some() => ParameterChoice::Given,
        ParameterChoice::Auto if scan.triangles.is_some() => ParameterChoice::MeanValue,
        ParameterChoice::Auto if scan.cloud.grid.is_some() => ParameterChoice::Chord,
        other => other,
    };
    let missing = |needed, hint| Error::NoParameters { asked: options.param.to_string(), needed, hint };
    let mesh_weights = match choice {
        ParameterChoice::MeanValue => Some(Weights::MeanValue),
        ParameterChoice::Uniform if scan.triangles.is_some() => Some(Weights::Uniform),
        _ => None,
    };
    if let Some(weights) = mesh_weights {
        let triangles = scan.triangles.ok_or_else(|| missing("the triangles of a mesh", ""))?;
        let disk = disk_of(TriangleMesh { vertices: scan.cloud.points, triangles }, &mut warnings)?;
        let name = match weights {
            Weights::MeanValue => "mean-value",
            Weights::Uniform => "uniform",
        };
        return map_mesh(disk, weights, name, warnings);
    }
    let duplicates = Duplicates::find(scan.cloud.points.view()).count();
    if duplicates > 0 {
        warnings.push(format!("{duplicates} points are equal to others; all are kept"));
    }
    match choice {
        ParameterChoice::Given => {
            let parameters = scan.cloud.parameters.ok_or_else(|| missing("parameters u, v in the file", ""))?;
            check_domain(&parameters, options.domain)?;
            let reversed = runs_against(&scan.cloud.points, &parameters, scan.triangles.as_deref());
            Ok(Parameterized {
                points: scan.cloud.points,
                parameters,
                name: "given",
                corners: None,
                reversed,
                warnings,
            })
        }
        ParameterChoice::Auto => map_unordered(scan.cloud.points, warnings),
        _ => {
            let grid = scan.cloud.grid.ok_or_else(|| missing("grid order (columns i, j)", CLOUD_HINT))?;
            let (rule, name) = match choice {
                ParameterChoice::Uniform => (Rule::Uniform, "uniform"),
                ParameterChoice::Centripetal => (Rule::Centripetal, "centripetal"),
                _ => (Rule::ChordLength, "chord"),
            };
            let (parameters, report) = parameterize_grid(scan.cloud.points.view(), grid, rule)?;
            for (skipped, direction) in [(report.skipped_u, 'u'), (report.skipped_v, 'v')] {
                if skipped > 0 {
                    warnings.push(format!("{skipped} grid lines along {direction} are single points"));
                }
            }
            let reversed = runs_against(&scan.cloud.points, &parameters, scan.triangles.as_deref());
            Ok(Parameterized { points: scan.cloud.points, parameters, name, corners: None, reversed, warnings })
        }
    }
}

/// Cleans and checks a mesh.
fn disk_of(mesh: TriangleMesh, warnings: &mut Vec<String>) -> Result<DiskMesh, Error> {
    let (mut mesh, duplicates, dropped) = merge_duplicate_vertices(&mesh);
    if duplicates.count() > 0 {
        warnings.push(format!("{} equal vertices were merged, {dropped} triangles vanished", duplicates.count()));
    }
    let unused = unreferenced_vertices(&mesh).len();
    if unused > 0 {
        warnings.push(format!("{unused} vertices belong to no triangle and were left out"));
        mesh = drop_unreferenced(&mesh)?.mesh;
    }
    let disk = DiskMesh::new(mesh)?;
    if disk.flipped() > 0 {
        warnings.push(format!("{} triangles were turned over to agree with their neighbours", disk.flipped()));
    }
    Ok(disk)
}

/// Maps a mesh onto the unit square.
fn map_mesh(
    disk: DiskMesh,
    weights: Weights,
    name: &'static str,
    mut warnings: Vec<String>,
) -> Result<Parameterized, Error> {
    let map = map_disk(&disk, &MeshMapParams { weights, ..MeshMapParams::default() })?;
    if map.report.holes > 0 {
        warnings.push(format!("the mesh has {} holes; the surface spans them", map.report.holes));
    }
    if map.report.cut_off + map.report.quality.collapsed > 0 {
        warnings.push(format!(
            "{} triangles collapsed into a side of the parameter square, {} vertices with them",
            map.report.quality.collapsed, map.report.cut_off
        ));
    }
    let corners = map.corners.vertices(disk.outer_loop());
    let points = disk.into_mesh().vertices;
    Ok(Parameterized { points, parameters: map.parameters, name, corners: Some(corners), reversed: false, warnings })
}

/// Lays out a cloud without order: through a mesh that is spanned over it, or where none comes out, through its boundary
/// and shape-preserving weights (Imperatore 2024, §4.2.1).
fn map_unordered(points: Array2<f64>, mut warnings: Vec<String>) -> Result<Parameterized, Error> {
    let boundary = find_boundary(points.view(), &BoundaryParams::default())?;
    let left_out = boundary.left_out.len();
    warnings.push("the cloud does not tell its outside: --flip turns the face normal".to_owned());
    if boundary.triangles.is_none() {
        warnings
            .push("no mesh could be spanned over the cloud; it was laid out by its boundary and neighbours".to_owned());
        return map_by_boundary(points, &boundary, warnings);
    }
    if left_out > 0 {
        warnings.push(format!("{left_out} points are equal to others, stray or off the surface, and were left out"));
    }
    let (disk, _) = boundary.disk_mesh(points.view())?;
    map_mesh(disk, Weights::MeanValue, "spanned mesh, mean-value", warnings)
}

fn map_by_boundary(
    points: Array2<f64>,
    boundary: &CloudBoundary,
    warnings: Vec<String>,
) -> Result<Parameterized, Error> {
    let rows: Vec<usize> = boundary.outer.iter().map(|&row| row as usize).collect();
    let outline = points.select(Axis(0), &rows);
    let corners = find_corners(outline.view(), CornerParams::default())?;
    let sides = side_parameters(outline.view(), corners.positions, Rule::ChordLength)?;
    let corner_points = corners.positions.map(|at| boundary.outer[at]);
    let fixed = BoundaryParameters { points: boundary.outer.clone(), parameters: sides };
    let map = map_cloud(points.view(), &fixed, &CloudMapParams::default())?;
    let name = "shape-preserving";
    Ok(Parameterized {
        points,
        parameters: map.parameters,
        name,
        corners: Some(corner_points),
        reversed: false,
        warnings,
    })
}

fn check_domain(parameters: &Array2<f64>, domain: Domain) -> Result<(), Error> {
    if parameters.ncols() != 2 {
        return Err(
            fit_ls::Error::Shape { what: "columns of parameters", given: parameters.ncols(), expected: 2 }.into()
        );
    }
    let outside = parameters.indexed_iter().find(|(_, value)| !(0.0..=1.0).contains(*value));
    if let (Domain::Unit, Some(((index, direction), &value))) = (domain, outside) {
        return Err(Error::OutsideUnitSquare { index, direction, value });
    }
    for (direction, column) in parameters.axis_iter(Axis(1)).enumerate() {
        let value = column.iter().copied().next().unwrap_or(0.0);
        if column.iter().all(|&x| x == value) {
            return Err(Error::FlatDomain { direction, value });
        }
    }
    Ok(())
}

/// Whether most triangles are clockwise in (u, v).
fn runs_against(points: &Array2<f64>, parameters: &Array2<f64>, triangles: Option<&[[u32; 3]]>) -> bool {
    let Some(triangles) = triangles else { return false };
    map_quality(points.view(), triangles, parameters.view())
        .is_ok_and(|quality| 2 * quality.folded.len() > quality.triangles - quality.collapsed)
}
