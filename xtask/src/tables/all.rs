//! All pages that need no training, computed anew and compared with those in docs/results: none goes stale unseen.

use std::path::Path;
use std::time::Instant;

use anyhow::{Context, Result};

/// Figures of another kind of processor agree within this share; digits beyond the last one shown may round either way.
const ELSEWHERE: f64 = 0.01;

/// Words in the headers of columns that hold times.
const TIMES: [&str; 6] = ["CPU-s", "seconds", "time", "µs", "hours", "milliseconds"];

/// Pages of one figure a cell, and whether they can be made without data.
const PAGES: [(&str, bool); 9] = [
    ("box-splines", true),
    ("published", true),
    ("curves", true),
    ("parcnn", true),
    ("classical", true),
    ("pargcn", true),
    ("rwls", true),
    ("qi", true),
    ("printed", false),
];

/// Makes a page anew; none if it is not among `PAGES` or needs data that are not there.
///
/// # Errors
/// What computing it meets.
pub fn made(page: &str, root: &Path, data: Option<&Path>, say: &mut dyn FnMut(&str)) -> Result<Option<String>> {
    Ok(Some(match (page, data) {
        ("box-splines", _) => super::box_splines::document()?,
        ("published", _) => super::published::document(root)?,
        ("curves", data) => super::curves::document(data)?,
        ("parcnn", data) => super::parcnn::document(data, None)?,
        ("classical", data) => super::classical::document(data)?,
        ("pargcn", data) => super::pargcn::document(data, say)?,
        ("rwls", data) => super::rwls::document(data)?,
        ("qi", data) => super::qi::document(data)?,
        ("printed", Some(data)) => super::moving::printed_settings(data, say)?,
        _ => return Ok(None),
    }))
}

/// Computes the pages and compares: what differs. Without `data` only tables of generated clouds are there to be compared.
///
/// # Errors
/// What computing and reading meet.
pub fn compare(root: &Path, data: Option<&Path>, say: &mut dyn FnMut(&str)) -> Result<Vec<String>> {
    let mut findings = Vec::new();
    for (page, _) in PAGES.into_iter().filter(|(_, without)| data.is_some() || *without) {
        let start = Instant::now();
        let path = root.join(format!("docs/results/{page}.md"));
        let then = std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
        let now = made(page, root, data, &mut |_| ())?.with_context(|| format!("{page} is not made"))?;
        let (cells, differing) = differences(&now, &then);
        say(&format!("{page}: {cells} figures, {} differ, {:.0} s", differing.len(), start.elapsed().as_secs_f64()));
        findings.extend(differing.into_iter().map(|what| format!("{page}.md, {what}")));
    }
    Ok(findings)
}

/// A table, its heading and how many stand before it there.
struct Table<'a> {
    heading: &'a str,
    place: usize,
    rows: Vec<Vec<&'a str>>,
}

fn tables(text: &str) -> Vec<Table<'_>> {
    let (mut found, mut heading, mut place, mut inside) = (Vec::<Table<'_>>::new(), "", 0, false);
    for line in text.lines() {
        if line.starts_with('#') {
            (heading, place) = (line.trim_start_matches(['#', ' ']), 0);
        }
        let row = line.strip_prefix('|').and_then(|line| line.strip_suffix('|'));
        if row.is_some() && !inside {
            found.push(Table { heading, place, rows: Vec::new() });
            place += 1;
        }
        inside = row.is_some();
        if let (Some(row), Some(table)) = (row, found.last_mut()) {
            table.rows.push(row.split('|').map(str::trim).collect());
        }
    }
    found
}

/// How many cells were compared, and which differ. Times are not compared, nor are cells that were left open now.
fn differences(now: &str, then: &str) -> (usize, Vec<String>) {
    let (mut cells, mut found) = (0, Vec::new());
    let old = tables(then);
    for table in tables(now) {
        let Some(before) = old.iter().find(|t| (t.heading, t.place) == (table.heading, table.place)) else {
            found.push(format!("{}: a table that the page has not", table.heading));
            continue;
        };
        if before.rows[0] != table.rows[0] {
            found.push(format!("{}: another header", table.heading));
            continue;
        }
        let is_time = |column: usize| TIMES.iter().any(|word| table.rows[0][column].contains(word));
        // Without data there are fewer rows, in the same order.
        let mut left = before.rows.iter().skip(2);
        for new in table.rows.iter().skip(2) {
            let Some(old) = left.find(|old| names(old) == names(new)) else {
                found.push(format!("{}: no row {}", table.heading, names(new).join(", ")));
                break;
            };
            let open = |(column, (now, _)): &(usize, (&&str, &&str))| !is_time(*column) && **now != "–";
            for (column, (now, then)) in new.iter().zip(old).enumerate().filter(open) {
                cells += 1;
                if !alike(now, then) {
                    let names = names(new).join(", ");
                    found.push(format!("{}, {names}, {}: {now} for {then}", table.heading, table.rows[0][column]));
                }
            }
        }
    }
    (cells, found)
}

/// What a row begins with: its first cell, and those behind it that are no numbers.
fn names<'a>(row: &[&'a str]) -> Vec<&'a str> {
    let is_name = |cell: &&&str| number(cell).is_none() && !["", "–"].contains(*cell);
    row.iter().take(1).chain(row.iter().skip(1).take_while(is_name)).copied().collect()
}

fn number(cell: &str) -> Option<f64> {
    cell.trim_end_matches(['%', ' ']).parse().ok()
}

fn alike(now: &str, then: &str) -> bool {
    match (number(now), number(then)) {
        (Some(a), Some(b)) => (a - b).abs() <= ELSEWHERE * b.abs() || now == then,
        _ => now == then,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAGE: &str = "## A\n\n| x | MSE | CPU-s |\n|---|---:|---:|\n| a | 1.00e-3 | 1.0 |\n| b | – | 2.0 |\n";

    #[test]
    fn figures_that_moved_are_found_times_are_not() {
        assert_eq!(differences(PAGE, PAGE), (3, Vec::new()));
        assert!(differences(&PAGE.replace("| 1.0 |", "| 7.0 |"), PAGE).1.is_empty());
        assert!(differences(&PAGE.replace("1.00e-3", "1.005e-3"), PAGE).1.is_empty());
        let (_, found) = differences(&PAGE.replace("1.00e-3", "1.02e-3"), PAGE);
        assert_eq!(found, ["A, a, MSE: 1.02e-3 for 1.00e-3"]);
        assert_eq!(differences(&PAGE.replace("| b", "| c"), PAGE).1, ["A: no row c"]);
    }

    #[test]
    fn what_is_left_out_now_is_not_compared() {
        let fuller = PAGE.replace("| b | – |", "| b | 5.0 |");
        assert!(differences(PAGE, &fuller).1.is_empty());
        let more = format!("{PAGE}\n## B\n\n| x |\n|---|\n| a |\n");
        assert!(differences(PAGE, &more).1.is_empty());
        let fewer = PAGE.replace("| a | 1.00e-3 | 1.0 |\n", "").replace("–", "2");
        assert_eq!(differences(&fewer, &PAGE.replace("–", "3")).1, ["A, b, MSE: 2 for 3"]);
        assert_eq!(differences(&more, PAGE).1.len(), 1);
    }
}
