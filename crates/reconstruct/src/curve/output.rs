//! Curves in files.

use std::path::{Path, PathBuf};

use geom_io::{ModelFormat, SvgOptions, WriteOptions, write_model};

use super::fitting::CurveFit;
use crate::Error;
use crate::options::Schema;
use crate::output::{OutputPaths, check_no_page, make_parent};
use crate::overwriting::check_overwriting;
use crate::step_header::step_options;

/// Checks, before anything is fitted, that outputs have formats of curves, and differ from the input and from each other.
///
/// # Errors
/// [`Error::CurveFormat`], [`Error::NoPage`], [`Error::OutputIsInput`], [`Error::OutputTwice`].
pub fn check_curve_outputs(input: &Path, outputs: &[PathBuf], report: Option<&Path>) -> Result<(), Error> {
    let unknown = |path: &&PathBuf| ModelFormat::from_path(path).is_none();
    if let Some(path) = outputs.iter().find(unknown) {
        return Err(Error::CurveFormat { path: path.clone() });
    }
    check_no_page(report)?;
    let paths = OutputPaths { files: outputs.to_vec(), reports: report.map(Path::to_owned).into_iter().collect() };
    check_overwriting(&[input.to_owned()], &[paths], []).map(drop)
}

/// Writes a curve by the extension of the file: `.step .stp .xml .json .dxf`, or a picture with points and knots `.svg`.
///
/// # Errors
/// [`Error::Model`], [`Error::Io`].
pub fn write_curve(path: &Path, fit: &CurveFit) -> Result<(), Error> {
    make_parent(path)?;
    let svg = SvgOptions { points: Some(fit.points.clone()), knots: true };
    let step = step_options("", Schema::Ap214);
    Ok(write_model(path, &fit.model, &WriteOptions { svg, step })?)
}
