//! What a directory keeps of each part, so that runs can be resumed and joined.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::{Deserialize, Serialize};
use serde_json::json;
use sha2::{Digest, Sha256};

use super::outcome::{PartOutcome, PartResult};
use super::part::BatchPart;
use crate::paths::is_directory;
use crate::program::{PROGRAM, SCHEMA};
use crate::scanned::fingerprint;
use crate::{Error, FitOptions, LayoutChoice, OutputPaths, write_report};

/// The folder of an output directory that holds a record of each part, `NAME.json`.
pub const RECORDS: &str = "parts";

/// What stands in a record while its part is being fitted, and afterwards if that was ended by force.
const NOT_FINISHED: &str = "not finished: it is being fitted, or that was ended by force; --resume begins it anew";

/// The record of a part.
#[derive(Debug, Deserialize, Serialize)]
pub(super) struct Record {
    /// Version of this layout.
    schema: u32,
    /// The program and its version.
    program: String,
    /// What the result depends on, as SHA-256: see [`of_part`]. Empty where the part is to be begun anew in any case.
    depends_on: String,
    /// What became of it: its line of the summary.
    pub(super) part: PartResult,
    /// A small picture, PNG in base64; empty without.
    picture: String,
}

impl Record {
    /// The record of a part that is about to be fitted.
    pub(super) fn of_begun(part: &BatchPart) -> Self {
        let outcome = PartOutcome::Failed { error: NOT_FINISHED.to_owned() };
        let part =
            PartResult { input: part.input.clone(), outputs: Vec::new(), outcome, kept: false, picture: Vec::new() };
        Self::of_done(String::new(), part)
    }

    /// The record of a part that is done with.
    pub(super) fn of_done(depends_on: String, part: PartResult) -> Self {
        let picture = STANDARD.encode(&part.picture);
        Self { schema: 1, program: PROGRAM.to_owned(), depends_on, part, picture }
    }

    pub(super) fn write(&self, path: &Path) -> Result<(), Error> {
        write_report(path, self)
    }

    /// Reads a record with its picture.
    pub(super) fn read(path: &Path) -> Result<Self, Error> {
        let of_system = |source| Error::Io { path: path.to_owned(), source };
        let bytes = std::fs::read(path).map_err(of_system)?;
        let read: Result<Self, _> = serde_json::from_slice(&bytes);
        let mut record = read.map_err(|source| Error::Record { path: path.to_owned(), source })?;
        record.part.picture = STANDARD.decode(&record.picture).unwrap_or_default();
        Ok(record)
    }

    /// The result of a part that was fitted before, if it would be the same now and all its files are still there.
    pub(super) fn kept(path: &Path, depends_on: &str) -> Option<PartResult> {
        let found = Self::read(path).ok()?;
        let is_fitted = matches!(found.part.outcome, PartOutcome::Fitted { .. });
        let is_there = found.part.outputs.iter().all(|output| output.is_file());
        let is_same = !depends_on.is_empty() && found.depends_on == depends_on;
        (is_fitted && is_there && is_same).then_some(PartResult { kept: true, ..found.part })
    }
}

/// Where the record of a part stands: in the first directory that the part is written to.
pub(super) fn record_path(outputs: &[PathBuf], name: &OsStr) -> Option<PathBuf> {
    let mut file = name.to_owned();
    file.push(".json");
    Some(outputs.iter().find(|output| is_directory(output))?.join(RECORDS).join(file))
}

/// What the result of a part depends on, as one SHA-256: the input and the files that options name, by their content; the options; the
/// program's version and the report's; the names of the outputs. Empty for what cannot be read twice. The number of threads is left out:
/// the result does not depend on it.
pub(super) fn of_part(part: &BatchPart, outputs: &OutputPaths) -> String {
    let Some(input) = fingerprint(&part.input) else { return String::new() };
    let layout = match &part.options.solid.layout {
        LayoutChoice::File(path) => Some(path),
        _ => None,
    };
    let files = part.options.surface.files().chain(layout);
    let files: Vec<Option<String>> = files.map(|path| fingerprint(path)).collect();
    let surface = FitOptions { threads: 0, ..part.options.surface.clone() };
    let all = json!({
        "program": PROGRAM,
        "schema": SCHEMA,
        "file": part.input.to_string_lossy(),
        "input": input,
        "files": files,
        "product": part.product,
        "surface": surface,
        "solid": part.options.solid,
        "outputs": outputs.files.iter().chain(&outputs.reports).map(|path| path.to_string_lossy()).collect::<Vec<_>>(),
    });
    Sha256::digest(all.to_string()).iter().map(|byte| format!("{byte:02x}")).collect()
}
