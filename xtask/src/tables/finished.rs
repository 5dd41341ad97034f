//! Rows of a table that takes long, kept as they are finished, so that a run that was cut off goes on.

use std::fs::{self, File, OpenOptions};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result};
use serde_json::Value;

/// A row that is kept as a line of JSON, with the commit that made it.
pub(super) trait Finished: Sized {
    /// The line.
    fn to_json(&self, commit: &str) -> Value;
    /// A row from a line of that commit; nothing from any other line.
    fn from_json(line: &str, commit: &str) -> Option<Self>;
}

/// Rows that are finished.
pub(super) struct Cache<R> {
    file: File,
    path: PathBuf,
    commit: String,
    rows: Vec<R>,
}

impl<R: Finished> Cache<R> {
    /// With the rows of this commit; empty unless a run is to be resumed. Finished rows stay in the file in any case.
    pub(super) fn open(path: &Path, resume: bool, commit: &str) -> Result<Self> {
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
        }
        let text = if resume && path.is_file() {
            fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?
        } else {
            String::new()
        };
        let rows = text.lines().filter_map(|line| R::from_json(line, commit)).collect();
        let file = OpenOptions::new().create(true).append(true).open(path);
        let file = file.with_context(|| format!("cannot write {}", path.display()))?;
        Ok(Self { file, path: path.to_owned(), commit: commit.to_owned(), rows })
    }

    /// The last row of which this holds.
    pub(super) fn take(&mut self, is_it: impl Fn(&R) -> bool) -> Option<R> {
        let at = self.rows.iter().rposition(is_it)?;
        Some(self.rows.remove(at))
    }

    pub(super) fn add(&mut self, row: &R) -> Result<()> {
        writeln!(self.file, "{}", row.to_json(&self.commit))
            .with_context(|| format!("cannot write {}", self.path.display()))
    }
}
