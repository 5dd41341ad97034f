//! Measured clouds.

use std::path::Path;

use anyhow::{Context, Result};
use geom_io::{ReadOptions, read_scan};
use ndarray::{Array2, Axis};
use param_classic::{
    BOUNDARY_TOLERANCE, BoundaryParameters, Rule, map_quality, side_parameters, triangulate_parameters,
};
use param_nn::BezierFit;
use point_cloud::{CornerChoice, DiskMesh, Normalization, TriangleMesh, disk_corners};

use super::{Networks, text};
use crate::tables::markdown::{figure, table};
use crate::tables::parcnn::fitting::{elements, fit};

/// Clouds with parameters of their own, and meshes.
pub(super) const WITH_PARAMETERS: [(&str, &str); 5] = [
    ("Nefertiti", "thesis/nefertiti_v9000_boundary_correction.xml"),
    ("Nefertiti, bust", "thesis/nefertiti_up.xml"),
    ("face", "thesis/face_v9000.xml"),
    ("hull", "thesis/shipHull_v1000_scattered.xml"),
    ("car", "thesis/car_v1000.xml"),
];
const MESHES: [(&str, &str); 3] = [
    ("Nefertiti", "nefertiti_face_532.obj"),
    ("Nefertiti", "nefertiti_face_2040.obj"),
    ("Nefertiti", "nefertiti_head_8933.obj"),
];

/// Elements per direction of the finer fit.
const ELEMENTS: usize = 16;

/// A cloud in the unit cube, its boundary with parameters, and triangles over it.
pub(super) struct RealCloud {
    pub(super) name: String,
    pub(super) points: Array2<f64>,
    pub(super) boundary: BoundaryParameters,
    triangles: Vec<[u32; 3]>,
    /// Parameters of the file.
    pub(super) own: Option<Array2<f64>>,
}

impl RealCloud {
    /// The boundary points are those whose parameters lie on the boundary of the square; folds are counted on the triangles
    /// that the parameters of the file span.
    pub(super) fn with_parameters(name: &str, path: &Path) -> Result<Self> {
        let scan = read_scan(path, &ReadOptions::default())?;
        let own = scan.cloud.parameters.with_context(|| format!("{} has no parameters", path.display()))?;
        let points = Normalization::of(scan.cloud.points.view())?.apply(scan.cloud.points.view())?;
        let depth = |row: usize| own.row(row).iter().fold(1.0f64, |d, x| d.min(*x).min(1.0 - x));
        let rows: Vec<usize> = (0..points.nrows()).filter(|&row| depth(row) <= BOUNDARY_TOLERANCE).collect();
        let boundary = BoundaryParameters {
            points: rows.iter().map(|&row| row as u32).collect(),
            parameters: own.select(Axis(0), &rows),
        };
        let triangles = triangulate_parameters(own.view())?;
        Ok(Self { name: format!("{name}, {}", points.nrows()), points, boundary, triangles, own: Some(own) })
    }

    /// The boundary of the mesh by chord length between its corners.
    fn of_mesh(name: &str, path: &Path) -> Result<Self> {
        let scan = read_scan(path, &ReadOptions::default())?;
        let triangles = scan.triangles.with_context(|| format!("{} has no triangles", path.display()))?;
        let vertices = Normalization::of(scan.cloud.points.view())?.apply(scan.cloud.points.view())?;
        let disk = DiskMesh::new(TriangleMesh { vertices, triangles })?;
        let corners = disk_corners(&disk, CornerChoice::default())?;
        let outer = disk.outer_loop().vertices.clone();
        let rows: Vec<usize> = outer.iter().map(|&v| v as usize).collect();
        let outline = disk.vertices().select(Axis(0), &rows);
        let parameters = side_parameters(outline.view(), corners.positions, Rule::ChordLength)?;
        let TriangleMesh { vertices: points, triangles } = disk.into_mesh();
        let boundary = BoundaryParameters { points: outer, parameters };
        Ok(Self { name: format!("{name}, {}", points.nrows()), points, boundary, triangles, own: None })
    }

    /// Errors of the two fits, and folded triangles.
    fn judged(&self, parameters: &Array2<f64>) -> Result<[String; 3]> {
        let patch = BezierFit::new(parameters.view(), self.points.view(), 2)?.mse;
        let spline = fit(parameters, self.points.view(), &elements::<2>(2, ELEMENTS)?)?.mse();
        let folded = map_quality(self.points.view(), &self.triangles, parameters.view())?.folded.len();
        Ok([figure(patch), figure(spline), folded.to_string()])
    }
}

/// Figure 4.31, and more clouds.
pub(super) fn tables(networks: &Networks, folder: &Path, tell: &mut dyn FnMut(&str)) -> Result<String> {
    let mut rows = Vec::new();
    let with_parameters =
        WITH_PARAMETERS.iter().map(|(name, file)| RealCloud::with_parameters(name, &folder.join(file)));
    let meshes = MESHES.iter().map(|(name, file)| RealCloud::of_mesh(name, &folder.join(file)));
    for cloud in with_parameters.chain(meshes) {
        let cloud = cloud?;
        let mut name = cloud.name.clone();
        for (method_name, method) in networks.methods() {
            let row = match method.map(cloud.points.view(), &cloud.boundary) {
                Ok(mapped) => {
                    let judged = cloud.judged(&mapped.parameters)?;
                    [&judged[..], &[format!("{:.2}", mapped.seconds)]].concat()
                }
                Err(reason) => vec![format!("no map: {reason}"), "–".into(), "–".into(), "–".into()],
            };
            rows.push([&[std::mem::take(&mut name), method_name.into()][..], &row].concat());
        }
        if let Some(own) = &cloud.own {
            let judged = cloud.judged(own)?;
            rows.push([&["".into(), "of the file".into()][..], &judged, &["–".into()]].concat());
        }
        tell(&cloud.name);
    }
    let header = ["cloud", "parameters", "MSE, biquadratic", "MSE, 16 × 16 elements", "folded triangles", "seconds"];
    Ok(String::from(text::BEFORE_REAL) + &table(&header, &rows))
}
