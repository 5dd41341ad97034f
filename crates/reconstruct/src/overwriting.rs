//! No output is an input or another output.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use crate::output::{check_no_page, check_parameter_format};
use crate::paths::identity;
use crate::{Error, OutputPaths, ParameterOptions};

/// Checks the outputs of parameters before anything is read.
///
/// # Errors
/// [`Error::ParameterFormat`], [`Error::NoPage`], [`Error::OutputTwice`], [`Error::OutputIsInput`].
pub fn check_parameter_outputs(
    input: &Path,
    options: &ParameterOptions,
    outputs: &[PathBuf],
    report: Option<&Path>,
) -> Result<(), Error> {
    for path in outputs {
        check_parameter_format(path)?;
    }
    check_no_page(report)?;
    let paths = OutputPaths { files: outputs.to_vec(), reports: report.map(Path::to_owned).into_iter().collect() };
    let read: Vec<PathBuf> =
        std::iter::once(input).chain(options.files().map(PathBuf::as_path)).map(Path::to_owned).collect();
    check_overwriting(&read, &[paths], []).map(drop)
}

/// Checks that an output is none of the inputs.
///
/// # Errors
/// [`Error::OutputIsInput`].
pub fn check_no_input(inputs: &[PathBuf], output: &Path) -> Result<(), Error> {
    check_overwriting(inputs, &[], [&output.to_owned()]).map(drop)
}

/// Checks that no output is an input or another output; returns what all of them are known by.
pub(crate) fn check_overwriting<'a>(
    inputs: &[PathBuf],
    outputs: &'a [OutputPaths],
    others: impl IntoIterator<Item = &'a PathBuf>,
) -> Result<BTreeSet<PathBuf>, Error> {
    let read: BTreeSet<PathBuf> = inputs.iter().map(|input| identity(input)).collect();
    let mut written = BTreeSet::new();
    for path in outputs.iter().flat_map(|paths| paths.files.iter().chain(&paths.reports)).chain(others) {
        let identity = identity(path);
        if read.contains(&identity) {
            return Err(Error::OutputIsInput { path: path.clone() });
        }
        if !written.insert(identity) {
            return Err(Error::OutputTwice { path: path.clone() });
        }
    }
    written.extend(read);
    Ok(written)
}
