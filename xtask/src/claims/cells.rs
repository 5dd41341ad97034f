//! Cells of the tables in docs/results.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, Result, bail};
use serde::Deserialize;

/// Where figures stand: rows and columns of a table of a page.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Cells {
    /// The name of a file in docs/results, or any file of the repository by its path: then `rows` are what it contains.
    pub(super) page: String,
    /// How the heading begins that the table stands below.
    #[serde(default)]
    pub(super) section: String,
    /// Which of the tables below it, from 1 on.
    #[serde(default = "first")]
    pub(super) table: usize,
    /// What rows begin with: their first cell or, between bars, the first ones.
    pub(super) rows: Vec<String>,
    /// Columns, the first having number 0.
    #[serde(default)]
    pub(super) columns: Vec<usize>,
}

fn first() -> usize {
    1
}

impl Cells {
    /// Figures of a row.
    pub(super) fn width(&self) -> usize {
        self.columns.len().max(1)
    }

    /// Whether the file is no page but a source that holds the figures as they are.
    pub(super) fn is_source(&self) -> bool {
        self.page.contains('/')
    }

    /// The cells in the text of the page, row by row.
    pub(super) fn of(&self, text: &str) -> Result<Vec<String>> {
        if self.is_source() {
            let missing = self.rows.iter().find(|row| !text.contains(row.as_str()));
            return match missing {
                Some(row) => bail!("{} does not contain {row:?}", self.page),
                None => Ok(self.rows.clone()),
            };
        }
        let table = self.table_of(text).with_context(|| {
            format!("{}.md has no table {} below a heading {:?}", self.page, self.table, self.section)
        })?;
        let mut found = Vec::new();
        for name in &self.rows {
            let key: Vec<&str> = name.split(" | ").collect();
            let row = table
                .iter()
                .find(|row| row.len() >= key.len() && row.iter().zip(&key).all(|(cell, k)| cell == k))
                .with_context(|| format!("{}.md, {}: no row {name:?}", self.page, self.section))?;
            for &column in &self.columns {
                let cell = row.get(column).with_context(|| format!("{}.md, {name}: no column {column}", self.page))?;
                found.push((*cell).to_owned());
            }
        }
        Ok(found)
    }

    /// The rows of the table without its header.
    fn table_of<'a>(&self, text: &'a str) -> Option<Vec<Vec<&'a str>>> {
        let level = |line: &str| line.chars().take_while(|&c| c == '#').count();
        let mut lines = text.lines();
        let heading =
            lines.find(|line| level(line) > 0 && line.trim_start_matches(['#', ' ']).starts_with(&self.section))?;
        let below = lines.take_while(|line| level(line) == 0 || level(line) > level(heading));
        let (mut tables, mut inside) = (Vec::<Vec<Vec<&str>>>::new(), false);
        for line in below {
            let row = line.strip_prefix('|').and_then(|line| line.strip_suffix('|'));
            if row.is_some() && !inside {
                tables.push(Vec::new());
            }
            inside = row.is_some();
            if let (Some(row), Some(table)) = (row, tables.last_mut()) {
                table.push(row.split('|').map(str::trim).collect());
            }
        }
        // Header and rule.
        Some(tables.into_iter().nth(self.table.checked_sub(1)?)?.split_off(2))
    }
}

/// Pages that were read.
pub(super) struct Pages<'a> {
    root: &'a Path,
    texts: BTreeMap<String, String>,
}

impl<'a> Pages<'a> {
    pub(super) fn new(root: &'a Path) -> Self {
        Self { root, texts: BTreeMap::new() }
    }

    /// What a page shows in these cells.
    pub(super) fn shown(&mut self, cells: &Cells) -> Result<Vec<String>> {
        if !self.texts.contains_key(&cells.page) {
            let file = if cells.is_source() { cells.page.clone() } else { format!("docs/results/{}.md", cells.page) };
            let text = std::fs::read_to_string(self.root.join(&file)).with_context(|| format!("cannot read {file}"))?;
            self.texts.insert(cells.page.clone(), text);
        }
        cells.of(&self.texts[&cells.page])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAGE: &str = "# P\n\n## One\n\n| a | b |\n|---|---:|\n| x | 1 |\n\nText:\n\n| a | b | c |\n|---|---:|---:|\n| x | 2 | 3 |\n| x | 4 | 5 |\n\n## Two\n\n| a | b |\n|---|---:|\n| x | 6 |\n";

    fn cells(section: &str, table: usize, row: &str, columns: &[usize]) -> Cells {
        let (section, rows, columns) = (section.to_owned(), vec![row.to_owned()], columns.to_vec());
        Cells { page: "p".into(), section, table, rows, columns }
    }

    #[test]
    fn tables_are_counted_below_their_heading() {
        assert_eq!(cells("One", 1, "x", &[1]).of(PAGE).unwrap(), ["1"]);
        assert_eq!(cells("One", 2, "x", &[1, 2]).of(PAGE).unwrap(), ["2", "3"]);
        assert_eq!(cells("One", 2, "x | 4", &[2]).of(PAGE).unwrap(), ["5"]);
        assert_eq!(cells("Two", 1, "x", &[1]).of(PAGE).unwrap(), ["6"]);
        for missing in [cells("One", 3, "x", &[1]), cells("Three", 1, "x", &[1]), cells("Two", 1, "y", &[1])] {
            assert!(missing.of(PAGE).is_err());
        }
        assert!(cells("Two", 1, "x", &[2]).of(PAGE).is_err());
    }
}
