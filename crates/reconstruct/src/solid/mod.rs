//! Whole parts: from a mesh, and a layout in patches if there is one, to one surface of many faces, a solid where the mesh is closed.

mod attempts;
mod mesh;
mod options;
mod part;
mod report;
mod sampling;

use std::path::{Path, PathBuf};
use std::time::Instant;

use geom_io::{read_layout, read_scan};
use multi_patch::Surface;
use point_cloud::vec3::box_of;
use quad_layout::{QuadLayout, RawPatch};

use crate::paths::is_directory;
use crate::{Error, Event, Watch, units};
use mesh::SolidMesh;
pub use options::{LayoutChoice, Sharp, Smoothness, SolidOptions};
use part::{Attempt, ELEMENTS, Part};
pub(crate) use report::KINK;
pub use report::{SolidDistances, SolidLayoutReport, SolidReason, SolidReport, SolidVolume};

/// A surface of many faces that was fitted to a whole part.
#[derive(Debug)]
pub struct SolidFit {
    /// The surface.
    pub surface: Surface,
    /// The samples of the mesh that were fitted, at their foot points.
    pub samples: multi_patch::Samples,
    /// The distance of each from the surface.
    pub distances: Vec<f64>,
    /// How good it is.
    pub report: SolidReport,
    /// Unit of its coordinates.
    pub unit: geom_io::LengthUnit,
    /// Whether `S_u × S_v` points inward.
    pub reversed: bool,
}

impl SolidFit {
    /// Whether the surface is near the mesh as asked and folds nowhere.
    pub fn reached(&self) -> bool {
        self.report.is_reached()
    }
}

/// Fits the patches of a layout, found here or of a file, to a mesh in a file.
///
/// # Errors
/// [`Error`]. A tolerance that is not reached and folds are no errors: the report has them.
pub fn fit_solid_file(path: &Path, options: &SolidOptions, watch: &mut Watch<'_>) -> Result<SolidFit, Error> {
    let start = Instant::now();
    options.check()?;
    let _ = watch(Event::Step("reading"));
    let scan = read_scan(path, &options.read)?;
    let unit = units::resolve(options.units, scan.unit);
    let mesh = SolidMesh::new(scan, options.sharp.rule())?;
    let mut tried = match &options.layout {
        LayoutChoice::File(file) => {
            let layout = layout_of(file, &mesh)?;
            let part = Part { path, mesh: &mesh, options };
            part.attempt(&layout, options.elements.unwrap_or(ELEMENTS), watch)?
        }
        _ => attempts::best(&Part { path, mesh: &mesh, options }, watch)?,
    };
    tried.report.seconds = start.elapsed().as_secs_f64();
    let reversed = (tried.report.volume.as_ref().is_some_and(|volume| volume.surface < 0.0)) != options.flip;
    let Attempt { surface, samples, distances, report } = tried;
    Ok(SolidFit { surface, samples, distances, report, unit, reversed })
}

/// Whether a fit is that of a whole part without being told so: of a file with a closed mesh, of which STEP files are made, or what goes
/// to a directory. Whoever reads a file next tells why it cannot be read. What can be read only once, as standard input and pipes, is left
/// alone.
pub fn makes_solid(input: &Path, outputs: &[PathBuf], read: &geom_io::ReadOptions) -> bool {
    let is_step = |path: &PathBuf| geom_io::ModelFormat::from_path(path) == Some(geom_io::ModelFormat::Step);
    if outputs.is_empty() || !outputs.iter().all(|path| is_step(path) || is_directory(path)) || !input.is_file() {
        return false;
    }
    if !may_hold_mesh(input, read) {
        return false;
    }
    read_scan(input, read).is_ok_and(mesh::is_closed_mesh)
}

/// Whether a file has a format of meshes, or one that only a look into it tells.
fn may_hold_mesh(input: &Path, read: &geom_io::ReadOptions) -> bool {
    use geom_io::Format::{Glb, Obj, Off, Ply, Stl, ThreeMf};
    let format = read.format.map_or_else(|| geom_io::Format::from_path(input), Ok);
    format.map_or(true, |format| matches!(format, Ply | Obj | Off | Stl | Glb | ThreeMf))
}

/// Share of the diagonal by which the box of a layout may differ from that of the mesh: vertices were slid along the surface.
///
/// Limit: a layout of another part differs by far more in one of three directions.
const SAME_BOX: f64 = 0.05;

/// The layout in the coordinates of the mesh. A file has those, or those in which the mesh's box has its centre at 0 and diagonal 1.
fn layout_of(path: &Path, mesh: &SolidMesh) -> Result<QuadLayout, Error> {
    let file = read_layout(path)?;
    let corner = |patch: usize, corner: u32| {
        let known = file.corners.get(corner as usize).copied();
        known.ok_or(Error::LayoutCorner { patch, corner, corners: file.corners.len() })
    };
    let mut patches = Vec::with_capacity(file.quads.len());
    for (number, quad) in file.quads.iter().enumerate() {
        let [a, b, c, d] = quad.corners;
        patches.push(RawPatch {
            corners: [corner(number, a)?, corner(number, b)?, corner(number, c)?, corner(number, d)?],
            paths: quad.paths.clone(),
            triangles: quad.triangles.clone(),
            vertices: quad.vertices.clone(),
            uv: quad.uv.clone(),
        });
    }
    let layout = QuadLayout::new(file.vertices, patches)?;
    let used = layout.patches().iter().flat_map(|patch| &patch.vertices);
    let found = box_of(used.map(|&vertex| layout.vertices()[vertex as usize]));
    let [lower, upper] = mesh.bounds;
    let unit = mesh.diagonal;
    let centre: [f64; 3] = std::array::from_fn(|k| 0.5 * (lower[k] + upper[k]));
    let off = |found: [[f64; 3]; 2]| {
        let offs = (0..2).flat_map(|end| (0..3).map(move |k| (end, k)));
        offs.map(|(end, k)| (found[end][k] - mesh.bounds[end][k]).abs()).fold(0.0, f64::max)
    };
    if off(found) <= SAME_BOX * unit {
        return Ok(layout);
    }
    let place = |p: [f64; 3]| std::array::from_fn(|k| centre[k] + unit * p[k]);
    if off(found.map(place)) <= SAME_BOX * unit {
        return Ok(layout.moved(place));
    }
    Err(Error::ForeignLayout { path: path.to_owned(), layout: found, mesh: mesh.bounds })
}
