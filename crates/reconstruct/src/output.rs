//! Results in files.

use std::collections::BTreeSet;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

use geom_io::{
    MeshFormat, MeshStyle, MeshWithScalars, ModelFormat, Scalars, StepOptions, StepSize, StepSurface, WriteOptions,
    check_writable, write_atomically, write_mesh, write_model, write_step,
};
use ndarray::{Array1, Array2, Axis};
use serde::Serialize;

use crate::mesh::{nearest_errors, tessellate};
use crate::paths::{identity, is_directory};
use crate::{Error, Fit, Parameterized, PieceFits, draw_parameters, page_of, page_of_pieces, step_options};

/// Where the results of one part go.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct OutputPaths {
    /// Files, the format by extension.
    pub files: Vec<PathBuf>,
    /// Reports: pages (`.html`), all others JSON.
    pub reports: Vec<PathBuf>,
}

impl OutputPaths {
    /// The outputs of an input: files as named; a directory gets `NAME.step`, `NAME.json`, `NAME.report.json` and, with `pages`,
    /// `NAME.html`, the last two unless reports of their kind are named.
    ///
    /// # Errors
    /// [`Error::OutputFormat`].
    pub fn of(input: &Path, outputs: &[PathBuf], reports: &[PathBuf], pages: bool) -> Result<Self, Error> {
        Self::of_name(&part_name(input), outputs, reports, pages)
    }

    /// The same for a part of a name that need not be that of its file.
    pub(crate) fn of_name(name: &OsStr, outputs: &[PathBuf], reports: &[PathBuf], pages: bool) -> Result<Self, Error> {
        let mut paths = Self { files: Vec::new(), reports: reports.to_vec() };
        for output in outputs {
            if output.as_os_str() == "-" {
                return Err(Error::OutputFormat { path: output.clone() });
            }
            if is_directory(output) {
                let named = |extension: &str| {
                    let mut name = name.to_owned();
                    name.push(extension);
                    output.join(name)
                };
                paths.files.push(named(".step"));
                paths.files.push(named(".json"));
                if paths.reports.iter().all(|path| is_page(path)) {
                    paths.reports.push(named(".report.json"));
                }
                if pages && !paths.reports.iter().any(|path| is_page(path)) {
                    paths.reports.push(named(".html"));
                }
            } else if is_output_file(output) {
                paths.files.push(output.clone());
            } else {
                return Err(Error::OutputFormat { path: output.clone() });
            }
        }
        Ok(paths)
    }
}

impl OutputPaths {
    /// Where a whole part goes: to all but the files of a directory that are no STEP files.
    pub(crate) fn of_solid(&self, outputs: &[PathBuf]) -> Self {
        let is_step = |path: &PathBuf| ModelFormat::from_path(path) == Some(ModelFormat::Step);
        let files = self.files.iter().filter(|path| is_step(path) || outputs.contains(path));
        Self { files: files.cloned().collect(), reports: self.reports.clone() }
    }

    /// Checks that files can be made where the outputs will stand, before work is done for them.
    ///
    /// # Errors
    /// [`Error::Write`] with the file.
    pub(crate) fn check_writable(&self) -> Result<(), Error> {
        Ok(self.files.iter().chain(&self.reports).try_for_each(|path| check_writable(path))?)
    }
}

/// Name of a part: its file's without the extension and without `.gz` behind that; `stdin` for standard input.
pub(crate) fn part_name(input: &Path) -> OsString {
    if input.as_os_str() == "-" {
        return "stdin".into();
    }
    let compressed = input.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("gz"));
    let inner = if compressed { input.with_extension("") } else { input.to_owned() };
    inner.file_stem().unwrap_or_default().to_owned()
}

fn is_output_file(path: &Path) -> bool {
    ModelFormat::from_path(path).is_some_and(ModelFormat::holds_surfaces) || MeshFormat::from_path(path).is_ok()
}

/// Writes a fit to its files, each complete or not at all, and makes the directories they lie in.
///
/// # Errors
/// [`Error::Model`], [`Error::Write`], [`Error::Io`].
pub fn write_outputs(fit: &Fit, outputs: &OutputPaths) -> Result<(), Error> {
    write_outputs_and_draw(fit, outputs).map(drop)
}

/// Pixels of the small picture of a part in the page of a batch.
pub(crate) const THUMBNAIL: [usize; 2] = [180, 120];

/// As [`write_outputs`]; returns what is known then.
pub(crate) fn write_outputs_and_draw(fit: &Fit, outputs: &OutputPaths) -> Result<Written, Error> {
    let mut step = None;
    for path in &outputs.files {
        make_parent(path)?;
        match ModelFormat::from_path(path) {
            Some(ModelFormat::Step) => {
                let options = step_options_of(fit);
                let surface = StepSurface { map: fit.surface(), options: &options };
                step = Some(write_step(path, &[surface], fit.model.unit)?);
            }
            Some(_) => write_model(path, &fit.model, &WriteOptions::default())?,
            None => write_meshes(path, &[fit])?,
        }
    }
    let mut picture = Vec::new();
    for path in &outputs.reports {
        if is_page(path) {
            let page = page_of(fit)?;
            write_text(path, &page.to_html())?;
            picture = page.thumbnail(THUMBNAIL);
        } else {
            write_report(path, &WithStep { report: &fit.report, step })?;
        }
    }
    Ok(Written { picture, step })
}

/// What is known of files that were written.
pub(crate) struct Written {
    /// A small picture, as PNG, if there is a page; else empty.
    pub(crate) picture: Vec<u8>,
    /// How large the STEP file is, if there is one.
    pub(crate) step: Option<StepSize>,
}

/// A report, and how large the STEP file is.
#[derive(Serialize)]
pub(crate) struct WithStep<'a, R: Serialize> {
    #[serde(flatten)]
    pub(crate) report: &'a R,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) step: Option<StepSize>,
}

/// Whether a report is a page to look at, by its name.
pub(crate) fn is_page(path: &Path) -> bool {
    path.extension().is_some_and(|extension| ["html", "htm"].iter().any(|known| extension.eq_ignore_ascii_case(known)))
}

/// Refuses a page of what has none.
pub(crate) fn check_no_page(report: Option<&Path>) -> Result<(), Error> {
    match report.filter(|path| is_page(path)) {
        Some(path) => Err(Error::NoPage { path: path.to_owned() }),
        None => Ok(()),
    }
}

/// Writes the surfaces of pieces, each file complete or not at all, and makes the directories they lie in; returns the files. A STEP file
/// holds a shell a piece, a mesh all triangles. Formats of one model each, JSON and G+Smo XML, get a file a piece, `NAME.piece-1.json`
/// and so on, none of which may be among the `taken` ones.
///
/// # Errors
/// [`Error::PieceOutput`], [`Error::Model`], [`Error::Write`], [`Error::Io`].
pub fn write_piece_outputs(
    fits: &PieceFits,
    outputs: &OutputPaths,
    taken: &BTreeSet<PathBuf>,
) -> Result<Vec<PathBuf>, Error> {
    let fitted: Vec<(usize, &Fit)> = fits.fitted().collect();
    let is_apart = |path: &&PathBuf| ModelFormat::from_path(path).is_some_and(|format| format != ModelFormat::Step);
    for path in outputs.files.iter().filter(is_apart) {
        let mut names = fitted.iter().map(|(number, _)| of_piece(path, *number));
        if let Some(path) = names.find(|path| taken.contains(&identity(path))) {
            return Err(Error::PieceOutput { path });
        }
    }
    let (mut written, mut step) = (Vec::new(), None);
    for path in outputs.files.iter().filter(|_| !fitted.is_empty()) {
        make_parent(path)?;
        match ModelFormat::from_path(path) {
            Some(ModelFormat::Step) => {
                let options: Vec<StepOptions> = fitted.iter().map(|(_, fit)| step_options_of(fit)).collect();
                let surfaces = fitted.iter().zip(&options);
                let surfaces = surfaces.map(|((_, fit), options)| StepSurface { map: fit.surface(), options });
                let surfaces: Vec<StepSurface<'_>> = surfaces.collect();
                step = Some(write_step(path, &surfaces, fitted[0].1.model.unit)?);
                written.push(path.clone());
            }
            Some(_) => {
                for (number, fit) in &fitted {
                    let path = of_piece(path, *number);
                    write_model(&path, &fit.model, &WriteOptions::default())?;
                    written.push(path);
                }
            }
            None => {
                write_meshes(path, &fitted.iter().map(|(_, fit)| *fit).collect::<Vec<_>>())?;
                written.push(path.clone());
            }
        }
    }
    for path in &outputs.reports {
        if !is_page(path) {
            write_report(path, &WithStep { report: &fits.report(), step })?;
        } else if let Some(page) = page_of_pieces(fits)? {
            write_text(path, &page.to_html())?;
        } else {
            continue;
        }
        written.push(path.clone());
    }
    Ok(written)
}

/// The name of a file for one piece.
fn of_piece(path: &Path, number: usize) -> PathBuf {
    let mut name = path.file_stem().unwrap_or_default().to_owned();
    name.push(format!(".piece-{number}."));
    name.push(path.extension().unwrap_or_default());
    path.with_file_name(name)
}

fn step_options_of(fit: &Fit) -> StepOptions {
    let options = &fit.report.options;
    StepOptions {
        max_control_points: options.max_step_control_points,
        holes: fit.holes.clone(),
        flip: fit.reversed,
        ..step_options(name_in(&fit.model.metadata), options.schema)
    }
}

/// Key under which a model keeps the name of its part.
pub(crate) const NAME: &str = "name";

/// The name of a part in what a model says of itself; empty without.
pub(crate) fn name_in(metadata: &serde_json::Map<String, serde_json::Value>) -> &str {
    metadata.get(NAME).and_then(serde_json::Value::as_str).unwrap_or_default()
}

/// Writes surfaces as one mesh, with the distance of the nearest fitted point at each vertex.
fn write_meshes(path: &Path, fits: &[&Fit]) -> Result<(), Error> {
    let (mut vertices, mut triangles, mut values) = (Array2::zeros((0, 3)), Vec::new(), Array1::zeros(0));
    for fit in fits {
        let (mesh, parameters) = tessellate(fit.surface(), fit.reversed)?;
        let first = vertices.nrows() as u32;
        triangles.extend(mesh.triangles.iter().map(|triangle| triangle.map(|corner| first + corner)));
        vertices.append(Axis(0), mesh.vertices.view()).expect("a fit is in space");
        values.append(Axis(0), nearest_errors(fit, &parameters).view()).expect("a row of values");
    }
    let scalars = Some(Scalars { name: "deviation", values: values.view() });
    let mesh = MeshWithScalars { vertices: vertices.view(), triangles: &triangles, scalars };
    Ok(write_mesh(path, &mesh, &MeshStyle::default())?)
}

/// Writes anything serializable as indented JSON.
///
/// # Errors
/// [`Error::Write`], [`Error::Io`].
pub fn write_report(path: &Path, report: &impl Serialize) -> Result<(), Error> {
    let mut text = serde_json::to_string_pretty(report)
        .map_err(|source| Error::Io { path: path.to_owned(), source: source.into() })?;
    text.push('\n');
    write_text(path, &text)
}

/// The format of a file of parameters.
pub(crate) fn check_parameter_format(path: &Path) -> Result<&'static str, Error> {
    let extension = path.extension().unwrap_or_default();
    let known = ["csv", "svg"].into_iter().find(|known| extension.eq_ignore_ascii_case(known));
    known.ok_or_else(|| Error::ParameterFormat { path: path.to_owned() })
}

/// Writes parameters by the extension of the file: `.csv` with the columns `row,x,y,z,u,v,boundary` (row in the input
/// from 0; 1 for points of the outer boundary), or a picture `.svg`.
///
/// # Errors
/// [`Error::ParameterFormat`], [`Error::Write`], [`Error::Io`].
pub fn write_parameters(path: &Path, laid_out: &Parameterized) -> Result<(), Error> {
    if check_parameter_format(path)? == "svg" {
        return write_text(path, &draw_parameters(laid_out)?);
    }
    make_parent(path)?;
    let mut on_boundary = vec![0; laid_out.rows.len()];
    laid_out.boundary.iter().for_each(|&i| on_boundary[i as usize] = 1);
    Ok(write_atomically(path, |out| {
        writeln!(out, "row,x,y,z,u,v,boundary")?;
        let places = laid_out.points.outer_iter().zip(laid_out.parameters.outer_iter());
        for ((p, q), (row, label)) in places.zip(laid_out.rows.iter().zip(&on_boundary)) {
            writeln!(out, "{row},{},{},{},{},{},{label}", p[0], p[1], p[2], q[0], q[1])?;
        }
        Ok(())
    })?)
}

/// Writes a text file, complete or not at all, and makes the directory it lies in.
///
/// # Errors
/// [`Error::Write`], [`Error::Io`].
pub fn write_text(path: &Path, text: &str) -> Result<(), Error> {
    make_parent(path)?;
    Ok(write_atomically(path, |out| out.write_all(text.as_bytes()))?)
}

pub(crate) fn make_parent(path: &Path) -> Result<(), Error> {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => {
            std::fs::create_dir_all(parent).map_err(|source| Error::Io { path: parent.to_owned(), source })
        }
        _ => Ok(()),
    }
}
