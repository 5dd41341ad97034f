//! Parts from a file.

use std::path::{Path, PathBuf};

use crate::settings::{Place, Schema, Settings, UsageError, text_of};
use crate::toml_file::{Entry, parts_of};

/// A part of a manifest.
#[derive(Debug)]
pub(crate) struct Row {
    /// The scan.
    pub(crate) input: PathBuf,
    /// The name of its files in an output directory; that of the scan by default.
    pub(crate) name: Option<String>,
    /// Its own options.
    pub(crate) settings: Settings,
}

/// The parts of a manifest, by its extension.
pub(crate) fn rows_of(schema: &Schema, path: &Path) -> Result<Vec<Row>, UsageError> {
    let whole = Place { file: path, line: 0 };
    let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
    let text = text_of(path)?;
    let parts = match extension.to_str() {
        Some("toml") => parts_of(path, &text)?,
        Some("csv") => parts_of_table(schema, path, &text)?,
        _ => return Err(whole.error("a manifest is a .csv or a .toml file")),
    };
    if parts.is_empty() {
        return Err(whole.error("there is no part in the manifest"));
    }
    parts.into_iter().map(|(line, entries)| row_of(schema, path, line, entries)).collect()
}

fn row_of(schema: &Schema, path: &Path, line: usize, entries: Vec<Entry>) -> Result<Row, UsageError> {
    let (mut input, mut name, mut settings) = (None, None, Settings::default());
    for Entry { key, values, line } in entries {
        let place = Place { file: path, line };
        let one = || match values.as_slice() {
            [one] if !one.is_empty() => Ok(one.clone()),
            _ => Err(place.error(format!("{key}: one name is needed"))),
        };
        match key.as_str() {
            "input" => input = Some(PathBuf::from(one()?)),
            "name" => {
                let given = one()?;
                if given.contains(['/', '\\']) || given.starts_with('.') {
                    return Err(place.error(format!("name: {given:?} is not possible: a name without folders")));
                }
                name = Some(given);
            }
            _ => schema.set(&mut settings, place, &key, &values)?,
        }
    }
    let input = input.ok_or_else(|| Place { file: path, line }.error("the part has no input"))?;
    Ok(Row { input, name, settings })
}

/// The lines of a table whose first line names the columns; empty cells say nothing.
fn parts_of_table(schema: &Schema, path: &Path, text: &str) -> Result<Vec<(usize, Vec<Entry>)>, UsageError> {
    let mut table = csv::ReaderBuilder::new().comment(Some(b'#')).trim(csv::Trim::All).from_reader(text.as_bytes());
    let wrong = |error: csv::Error| {
        let line = error.position().map_or(0, |position| position.line() as usize);
        let message = match error.kind() {
            csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
                format!("{len} cells, and {expected_len} columns in the first line")
            }
            _ => error.to_string(),
        };
        Place { file: path, line }.error(message)
    };
    let head = table.headers().map_err(wrong)?.clone();
    let first = head.position().map_or(1, |position| position.line() as usize);
    let place = Place { file: path, line: first };
    for key in head.iter().filter(|key| !["input", "name"].contains(key)) {
        schema.known(place, key)?;
    }
    if !head.iter().any(|key| key == "input") {
        return Err(place.error("no column is named input"));
    }
    let mut parts = Vec::new();
    for record in table.records() {
        let record = record.map_err(wrong)?;
        let line = record.position().map_or(0, |position| position.line() as usize);
        let cells = head.iter().zip(&record).filter(|(_, cell)| !cell.is_empty());
        let entry = |(key, cell): (&str, &str)| Entry { key: key.to_owned(), values: vec![cell.to_owned()], line };
        parts.push((line, cells.map(entry).collect()));
    }
    Ok(parts)
}
