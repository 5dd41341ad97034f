//! Tables of points in text: one rule for all that is written one point a line, whatever the file is called.
//!
//! The separator, the decimal sign and the columns that hold numbers are found in a sample of the lines ([`dialect`]); what stands
//! above the first row of numbers is a title, a number of points or the names of the columns ([`opening`]); names, or places,
//! tell what each column holds ([`roles`]). What cannot be told apart is an error that names the option which says it, and what
//! was guessed is noted. A point without a value is left out and counted.
//!
//! The crates for tables take one separating byte and rows of one length; files of scanners have runs of blanks, titles, comments and
//! counts between. Only quotes are as they have them (RFC 4180), within a line.

mod counter;
mod dialect;
mod fields;
mod grid;
mod names;
mod opening;
mod roles;
mod rows;

use self::dialect::Dialect;
use self::fields::{Field, Separator, part_comment};
use self::grid::{Meaning, meaning, not_indices, to_grid};
use self::names::Names;
use self::opening::{Opening, data};
use self::roles::Roles;
use self::rows::read_rows;
use super::number::Decimal;
use super::number::is_blank;
use super::text::{Line, Lines, has_control, is_text, quote};
use super::{Format, ReadOptions, Scan, rows as array};
use crate::error::ReadErrorKind;

/// Lines by which a table is known: enough for any opening, and as fast as nothing.
const SAMPLE: usize = 1000;

/// Reads a table. `format` is what it is called.
pub(super) fn read(lines: Lines<'_>, format: Format, options: &ReadOptions) -> Result<Scan, ReadErrorKind> {
    let sample = sample(lines.clone());
    if let Some(line) = sample.iter().find(|line| has_control(line.text)) {
        return Err(ReadErrorKind::NotText { line: line.number });
    }
    let dialect = Dialect::find(&sample, options.decimal)?.ok_or_else(|| no_numbers(&sample))?;
    let mut opening = Opening::take(lines, &dialect)?;
    let names = opening.names(&dialect, options)?;
    let sampled: Vec<Vec<Field<'_>>> = opening
        .rows
        .clone()
        .take(SAMPLE)
        .filter_map(|line| data(line, dialect.separator))
        .map(|line| {
            let mut fields = Vec::new();
            dialect.separator.split(line.text, &mut fields);
            fields
        })
        .collect();
    let roles = match &names {
        Some(names) => Roles::by_names(names, options)?,
        None => Roles::by_place(&dialect, &sampled, opening.first_row, options)?,
    };

    let rows = read_rows(&opening, &dialect, &roles, names.as_ref())?;
    let mut scan = Scan::new(format, array(rows.points, roles.coordinates.len()));
    scan.rows = rows.rows;
    scan.lines = rows.lines;
    scan.notes.extend(opening.note());
    if dialect.is_guess {
        scan.notes.push(match dialect.style.decimal {
            Decimal::Comma => "commas were taken as decimal ones; --decimal point takes them otherwise".to_owned(),
            Decimal::Point => {
                "commas within quotes were taken as those between thousands; --decimal comma takes them otherwise"
                    .to_owned()
            }
        });
    }
    if names.is_none() && format == Format::Csv && options.columns.is_empty() && roles.coordinates[0] == 0 {
        scan.notes.push("no line names the columns; they were taken as x, y, z".to_owned());
    }
    scan.notes.extend(roles.notes.iter().cloned());
    if !roles.parameters.is_empty() {
        scan.cloud.parameters = Some(array(rows.parameters, roles.parameters.len()));
    }
    scan.on_boundary = roles.boundary.map(|_| rows.on_boundary).filter(|labels| labels.contains(&true));
    if roles.boundary.is_some() && scan.on_boundary.is_none() {
        scan.notes.push("column boundary marks no point; it was ignored".to_owned());
    }
    scan.weights = roles.weights.map(|_| rows.weights);
    scan.normals = roles.normals.map(|_| rows.normals);
    let order = put_in_order(&mut scan, &roles, &rows.grid, rows.ijk, names.as_ref())?;
    scan.columns = roles.taken(order, names.as_ref());
    if let Some(names) = &names {
        let is_taken = |column: usize| scan.columns.iter().any(|taken| taken.number == column + 1);
        let is_ignored = |column: &usize| !is_taken(*column) && !names.written[*column].is_empty();
        let ignored = names.listed((0..names.written.len()).filter(is_ignored));
        if !ignored.is_empty() {
            scan.notes.push(format!("columns that were ignored: {}", ignored.join(", ")));
        }
    }
    scan.notes.extend(rows.notes);
    Ok(scan)
}

/// The error for text without a line of numbers.
fn no_numbers(sample: &[Line<'_>]) -> ReadErrorKind {
    match sample {
        // Nothing, or nothing but names.
        [] | [_] => ReadErrorKind::NoPoints,
        [line, ..] if is_text(line.text) => ReadErrorKind::NoNumbers { line: line.number, text: quote(line.text) },
        [line, ..] => ReadErrorKind::NotText { line: line.number },
    }
}

/// The first lines that hold data, without their comments.
fn sample(lines: Lines<'_>) -> Vec<Line<'_>> {
    // A line that a semicolon opens is a comment, unless semicolons separate, which is not known yet; others are no comments.
    fn content(line: Line<'_>) -> Option<Line<'_>> {
        let start = line.text.iter().position(|&b| !is_blank(b))?;
        data(line, if line.text[start] == b';' { Separator::Blanks } else { Separator::Byte(b';') })
    }
    let sample: Vec<Line<'_>> = lines.clone().filter_map(content).take(SAMPLE).collect();
    if !sample.is_empty() {
        return sample;
    }
    // The first field of every line is empty, then.
    lines.filter_map(|line| data(line, Separator::Byte(b';'))).take(SAMPLE).collect()
}

/// What columns of grid indices and columns i, j and k turned out to be.
#[derive(Clone, Copy, Debug)]
struct Order {
    /// Whether the points are a grid by their indices.
    is_grid: bool,
    /// What i, j and k hold.
    ijk: Option<Meaning>,
}

/// Finds what columns of grid indices and columns i, j and k hold, and puts it into the scan.
fn put_in_order(
    scan: &mut Scan,
    roles: &Roles,
    indices: &[[f64; 2]],
    ijk: Vec<[f64; 3]>,
    names: Option<&Names>,
) -> Result<Order, ReadErrorKind> {
    let called = |columns: &[usize]| {
        let name =
            |&c: &usize| names.map_or_else(|| (c + 1).to_string(), |names| crate::error::quote(&names.written[c]));
        columns.iter().map(name).collect::<Vec<_>>().join(",")
    };
    let column = |rows: &[[f64; 3]], k: usize| -> Vec<f64> { rows.iter().map(|row| row[k]).collect() };
    let ijk_mean = roles.ijk.map(|columns| {
        let k = columns.k.map(|_| column(&ijk, 2));
        meaning(&column(&ijk, 0), &column(&ijk, 1), k.as_deref())
    });
    // Rows of a grid are sorted, and all that belongs to them: normals come first.
    if let (Some(Meaning::Normals), Some(columns)) = (ijk_mean, roles.ijk) {
        scan.notes.push(format!(
            "columns {} were taken as normals; --normals none takes them for nothing",
            called(&[columns.ij[0], columns.ij[1], columns.k.unwrap_or_default()])
        ));
        scan.normals = Some(ijk.clone());
    }
    let is_grid = match (roles.grid, roles.ijk, ijk_mean) {
        (Some(columns), ..) => {
            let [i, j] = [0, 1].map(|k| indices.iter().map(|pair| pair[k]).collect::<Vec<f64>>());
            if meaning(&i, &j, None) == Meaning::Indices {
                to_grid(scan, indices, &called(&columns))
            } else if roles.grid_is_given {
                return Err(not_indices(indices, |row| scan.line(row).unwrap_or_default()));
            } else {
                scan.notes.push(format!("columns {} are no indices of a grid", called(&columns)));
                false
            }
        }
        (None, Some(columns), Some(Meaning::Indices)) => {
            let pairs: Vec<[f64; 2]> = ijk.iter().map(|&[i, j, _]| [i, j]).collect();
            to_grid(scan, &pairs, &called(&columns.ij))
        }
        (None, Some(columns), Some(Meaning::Neither)) => {
            scan.notes.push(format!("columns {} are no indices of a grid", called(&columns.ij)));
            false
        }
        _ => false,
    };
    Ok(Order { is_grid, ijk: ijk_mean })
}

/// What stands before the comment of a line whose fields semicolons do not separate.
pub(super) fn before_comment(line: &[u8]) -> &[u8] {
    part_comment(line, false).data
}

/// The decimal sign of a text of numbers between blanks.
///
/// # Errors
/// [`ReadErrorKind::AmbiguousComma`] where both signs occur.
pub(super) fn decimal_of(lines: Lines<'_>, given: Option<Decimal>) -> Result<Decimal, ReadErrorKind> {
    if let Some(decimal) = given {
        return Ok(decimal);
    }
    let lines: Vec<Line<'_>> = lines.take(SAMPLE).collect();
    let has = |byte: u8| lines.iter().find(|line| line.text.contains(&byte));
    match (has(b','), has(b'.')) {
        (Some(line), Some(_)) => {
            Err(ReadErrorKind::AmbiguousComma { line: line.number, text: super::text::quote(line.text) })
        }
        (Some(_), None) => Ok(Decimal::Comma),
        (None, _) => Ok(Decimal::Point),
    }
}
