//! Results of whole parts in files.

use std::path::PathBuf;

use geom_io::{StepOptions, write_solid};

use crate::options::Schema;
use crate::output::{THUMBNAIL, WithStep, Written, is_page, make_parent};
use crate::step_header::step_options;
use crate::{Error, SolidFit, page_of_solid, write_report, write_text};

/// Writes a surface of many faces into STEP files, and its report into files of its own, each complete or not at all.
///
/// # Errors
/// [`Error::Model`], [`Error::Write`], [`Error::Io`].
pub fn write_solid_outputs(fit: &SolidFit, outputs: &[PathBuf], reports: &[PathBuf]) -> Result<(), Error> {
    write_solid_and_draw(fit, outputs, reports, &step_options("", Schema::Ap214)).map(drop)
}

/// As [`write_solid_outputs`], with a header; returns what is known then.
pub(crate) fn write_solid_and_draw(
    fit: &SolidFit,
    outputs: &[PathBuf],
    reports: &[PathBuf],
    step: &StepOptions,
) -> Result<Written, Error> {
    let options = StepOptions { flip: fit.reversed, ..step.clone() };
    let mut step = None;
    for path in outputs {
        make_parent(path)?;
        step = Some(write_solid(path, &fit.surface, fit.unit, &options)?);
    }
    let mut picture = Vec::new();
    for path in reports {
        if is_page(path) {
            let page = page_of_solid(fit)?;
            write_text(path, &page.to_html())?;
            picture = page.thumbnail(THUMBNAIL);
        } else {
            write_report(path, &WithStep { report: &fit.report, step })?;
        }
    }
    Ok(Written { picture, step })
}

/// Refuses outputs of a surface of many faces that are no STEP files, before work is done for them.
///
/// # Errors
/// [`Error::SolidFormat`], [`Error::Write`].
pub fn check_solid_outputs(outputs: &[PathBuf], reports: &[PathBuf]) -> Result<(), Error> {
    for path in outputs {
        if geom_io::ModelFormat::from_path(path) != Some(geom_io::ModelFormat::Step) {
            return Err(Error::SolidFormat { path: path.clone() });
        }
    }
    Ok(outputs.iter().chain(reports).try_for_each(|path| geom_io::check_writable(path))?)
}
