//! Parameters for the points of a scan.

use geom_io::Scan;
use ndarray::{Array2, Axis};
use param_classic::{MeshMapParams, Rule, Weights, map_disk, map_quality, parameterize_grid};
use point_cloud::{
    DiskMesh, Duplicates, TriangleMesh, check_surface_cloud, drop_unreferenced, merge_duplicate_vertices,
    unreferenced_vertices,
};

use crate::{Domain, Error, FitOptions, ParameterChoice};

/// Fewest points of a surface: four control points of the smallest bilinear one.
const MIN_POINTS: usize = 4;

/// What a raw cloud can be turned into by the user so that this version can fit it.
const CLOUD_HINT: &str = "; give a mesh (PLY, OBJ, OFF), a gridded CSV with columns i,j, or a CSV with parameters u,v";

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
        return map_mesh(TriangleMesh { vertices: scan.cloud.points, triangles }, weights, warnings);
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
        ParameterChoice::Auto => Err(missing("parameters, triangles or grid order", CLOUD_HINT)),
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

/// Maps a mesh onto the unit square.
fn map_mesh(mesh: TriangleMesh, weights: Weights, mut warnings: Vec<String>) -> Result<Parameterized, Error> {
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
    let name = match weights {
        Weights::MeanValue => "mean-value",
        Weights::Uniform => "uniform",
    };
    let points = disk.into_mesh().vertices;
    Ok(Parameterized { points, parameters: map.parameters, name, corners: Some(corners), reversed: false, warnings })
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
