//! Every fixture has a source, a licence and, where it is generated, its command.

use std::path::Path;

use anyhow::{Context, Result};

use super::files::{files, relative};
use super::licences::is_permissive;
use crate::generate::fixtures::{COMMAND, FIXTURES, FOLDER};

/// The list of the fixtures.
const LIST: &str = "README.md";

/// Largest fixture: tests read them often, in debug builds too.
const LARGEST: u64 = 300_000;

/// A row of the list: file, source, licence, and how the file came about.
#[derive(Debug, PartialEq)]
struct Row<'a> {
    file: &'a str,
    source: &'a str,
    licence: &'a str,
    origin: &'a str,
}

pub(super) fn check(root: &Path) -> Result<Vec<String>> {
    let folder = root.join(FOLDER);
    let list = std::fs::read_to_string(folder.join(LIST)).with_context(|| format!("cannot read {FOLDER}/{LIST}"))?;
    let mut sizes = Vec::new();
    for path in files(&folder)? {
        let name = relative(&folder, &path).display().to_string();
        if name != LIST {
            sizes.push((name, path.metadata()?.len()));
        }
    }
    Ok(compare(&rows(&list), &sizes))
}

/// The rows of the tables of a Markdown text, heads and rules left out.
fn rows(text: &str) -> Vec<Row<'_>> {
    let cells = text.lines().filter_map(|line| line.trim().strip_prefix('|')?.strip_suffix('|'));
    cells
        .filter_map(|line| {
            let cells: Vec<&str> = line.split('|').map(str::trim).collect();
            let [file, source, licence, origin] = cells[..] else { return None };
            Some(Row { file: file.strip_prefix('`')?.strip_suffix('`')?, source, licence, origin })
        })
        .collect()
}

fn compare(rows: &[Row<'_>], sizes: &[(String, u64)]) -> Vec<String> {
    let mut findings = Vec::new();
    for (name, size) in sizes {
        if *size > LARGEST {
            findings.push(format!("{FOLDER}/{name} has {size} bytes, more than {LARGEST}"));
        }
        if rows.iter().filter(|row| row.file == name).count() != 1 {
            findings.push(format!("{FOLDER}/{name} needs one row in {FOLDER}/{LIST}: file, source, licence, origin"));
        }
    }
    for row in rows {
        let Row { file, source, licence, origin } = row;
        if !sizes.iter().any(|(name, _)| name == file) {
            findings.push(format!("{FOLDER}/{LIST} lists {file}, which does not exist"));
        }
        if source.is_empty() || origin.is_empty() || !is_permissive(licence) {
            findings
                .push(format!("{FOLDER}/{LIST}: {file} lacks source, origin or a permissive licence ({licence:?})"));
        }
        if FIXTURES.iter().any(|(name, _)| name == file) != origin.contains(COMMAND) {
            findings.push(format!("{FOLDER}/{LIST}: {file} is generated, or named so, but not both"));
        }
    }
    findings
}

#[cfg(test)]
mod tests {
    use super::*;

    const LISTED: &str =
        "| file | source | licence | origin |\n|---|---|---|---|\n| `a.off` | a museum | CC0-1.0 | unchanged |\n";

    #[test]
    fn a_listed_file_is_in_order() {
        assert_eq!(compare(&rows(LISTED), &[("a.off".to_owned(), 10)]), [""; 0]);
    }

    #[test]
    fn what_is_missing_on_either_side_is_found() {
        let rows = rows(LISTED);
        assert_eq!(compare(&rows, &[]).len(), 1);
        assert_eq!(compare(&rows, &[("a.off".to_owned(), 10), ("b.off".to_owned(), 10)]).len(), 1);
        assert_eq!(compare(&rows, &[("a.off".to_owned(), LARGEST + 1)]).len(), 1);
        let row = Row { file: "a.off", source: "", licence: "GPL-3.0-only", origin: "unchanged" };
        assert_eq!(compare(&[row], &[("a.off".to_owned(), 10)]).len(), 1);
        let row = Row { file: "peaks_4k.csv", source: "own", licence: "MIT OR Apache-2.0", origin: "unchanged" };
        assert_eq!(compare(&[row], &[("peaks_4k.csv".to_owned(), 10)]).len(), 1);
    }
}
