//! Results in files.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use geom_io::{
    MeshFormat, MeshStyle, MeshWithScalars, ModelFormat, Scalars, StepOptions, WriteOptions, check_writable,
    write_atomically, write_mesh, write_model,
};
use serde::{Serialize, Serializer};

use crate::mesh::{nearest_errors, tessellate};
use crate::{Error, Fit, Parameterized, draw_parameters};

/// Where the results of one part go.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct OutputPaths {
    /// Files, the format by extension.
    pub files: Vec<PathBuf>,
    /// The report, if it is asked for.
    pub report: Option<PathBuf>,
}

impl OutputPaths {
    /// The outputs of an input: files as named; a directory gets `NAME.step`, `NAME.json` and `NAME.report.json`.
    ///
    /// # Errors
    /// [`Error::OutputFormat`].
    pub fn of(input: &Path, outputs: &[PathBuf], report: Option<&Path>) -> Result<Self, Error> {
        let mut paths = Self { files: Vec::new(), report: report.map(Path::to_owned) };
        for output in outputs {
            if output.as_os_str() == "-" {
                return Err(Error::OutputFormat { path: output.clone() });
            }
            if is_directory(output) {
                let stem = part_name(input);
                let named = |extension: &str| {
                    let mut name = stem.clone();
                    name.push(extension);
                    output.join(name)
                };
                paths.files.push(named(".step"));
                paths.files.push(named(".json"));
                paths.report.get_or_insert_with(|| named(".report.json"));
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
    /// Checks that files can be made where the outputs will stand, before work is done for them.
    ///
    /// # Errors
    /// [`Error::Write`] with the file.
    pub(crate) fn check_writable(&self) -> Result<(), Error> {
        Ok(self.files.iter().chain(&self.report).try_for_each(|path| check_writable(path))?)
    }
}

/// A path as reports have it: what of its name is no text is replaced.
pub(crate) fn shown<S: Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&path.to_string_lossy())
}

/// Paths as reports have them.
pub(crate) fn all_shown<'a, S: Serializer>(
    paths: impl IntoIterator<Item = &'a PathBuf>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(paths.into_iter().map(|path| path.to_string_lossy()))
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

/// Whether an output is meant to be a directory: it is one, or its name has no extension or ends in a separator.
pub(crate) fn is_directory(output: &Path) -> bool {
    output.is_dir() || output.extension().is_none() || output.to_string_lossy().ends_with(std::path::is_separator)
}

fn is_output_file(path: &Path) -> bool {
    ModelFormat::from_path(path).is_some_and(ModelFormat::holds_surfaces) || MeshFormat::from_path(path).is_ok()
}

/// Writes a fit to its files, each complete or not at all, and makes the directories they lie in.
///
/// # Errors
/// [`Error::Model`], [`Error::Write`], [`Error::Io`].
pub fn write_outputs(fit: &Fit, outputs: &OutputPaths) -> Result<(), Error> {
    for path in &outputs.files {
        make_parent(path)?;
        if ModelFormat::from_path(path).is_some() {
            let step = StepOptions {
                max_control_points: fit.report.options.max_step_control_points,
                holes: fit.holes.clone(),
                flip: fit.reversed,
                ..StepOptions::default()
            };
            write_model(path, &fit.model, &WriteOptions { step, ..WriteOptions::default() })?;
        } else {
            let (mesh, parameters) = tessellate(fit.surface(), fit.reversed)?;
            let values = nearest_errors(fit, &parameters);
            let scalars = Some(Scalars { name: "deviation", values: values.view() });
            let mesh = MeshWithScalars { vertices: mesh.vertices.view(), triangles: &mesh.triangles, scalars };
            write_mesh(path, &mesh, &MeshStyle::default())?;
        }
    }
    match &outputs.report {
        Some(path) => write_report(path, &fit.report),
        None => Ok(()),
    }
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
