//! Results of whole parts in files.

use std::path::PathBuf;

use geom_io::{StepOptions, write_solid};

use crate::output::{THUMBNAIL, is_page, make_parent};
use crate::{Error, SolidFit, page_of_solid, write_report, write_text};

/// Writes a surface of many faces into a STEP file, and its report into a file of its own, each complete or not at all; returns a small
/// picture, as PNG, if there is a page.
///
/// # Errors
/// [`Error::Model`], [`Error::Write`], [`Error::Io`].
pub fn write_solid_outputs(fit: &SolidFit, outputs: &[PathBuf], reports: &[PathBuf]) -> Result<Vec<u8>, Error> {
    for path in outputs {
        make_parent(path)?;
        write_solid(path, &fit.surface, fit.unit, &StepOptions { flip: fit.reversed, ..StepOptions::default() })?;
    }
    let mut picture = Vec::new();
    for path in reports {
        if is_page(path) {
            let page = page_of_solid(fit)?;
            write_text(path, &page.to_html())?;
            picture = page.thumbnail(THUMBNAIL);
        } else {
            write_report(path, &fit.report)?;
        }
    }
    Ok(picture)
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
