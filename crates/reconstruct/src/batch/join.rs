//! The page and the summary of parts that are done.

use std::path::{Path, PathBuf};

use report_page::IndexRow;

use super::outcome::PartResult;
use super::record::{RECORDS, Record};
use crate::{Error, write_text};

/// Reads what a directory keeps of the parts that were written to it, by whichever runs, and writes the page of all of them,
/// `index.html`. The parts come in the order of their names.
///
/// # Errors
/// [`Error::NoRecords`], [`Error::Io`], [`Error::Record`], [`Error::Write`].
pub fn join_batch(directory: &Path, summary: Option<&Path>) -> Result<Vec<PartResult>, Error> {
    let records = directory.join(RECORDS);
    let none = || Error::NoRecords { directory: directory.to_owned() };
    let list = |path: &Path| -> std::io::Result<Vec<PathBuf>> {
        std::fs::read_dir(path)?.map(|entry| entry.map(|entry| entry.path())).collect()
    };
    if !records.is_dir() {
        return Err(none());
    }
    let mut files = list(&records).map_err(|source| Error::Io { path: records.clone(), source })?;
    files.retain(|path| path.extension().is_some_and(|extension| extension == "json"));
    files.sort();
    if files.is_empty() {
        return Err(none());
    }
    let parts: Vec<PartResult> =
        files.iter().map(|path| Record::read(path).map(|record| record.part)).collect::<Result<_, _>>()?;
    write_index(&directory.join("index.html"), parts.iter())?;
    summary.map_or(Ok(()), |path| write_summary(path, parts.iter()))?;
    Ok(parts)
}

pub(super) fn write_summary<'a>(path: &Path, parts: impl Iterator<Item = &'a PartResult>) -> Result<(), Error> {
    let mut lines = String::new();
    for part in parts {
        let line = serde_json::to_string(part);
        lines += &line.map_err(|source| Error::Io { path: path.to_owned(), source: source.into() })?;
        lines.push('\n');
    }
    write_text(path, &lines)
}

pub(super) fn write_index<'a>(path: &Path, parts: impl Iterator<Item = &'a PartResult>) -> Result<(), Error> {
    let rows: Vec<IndexRow> = parts.map(PartResult::index_row).collect();
    let directory = path.parent().and_then(Path::file_name).unwrap_or_default();
    write_text(path, &report_page::index(&directory.to_string_lossy(), &rows))
}
