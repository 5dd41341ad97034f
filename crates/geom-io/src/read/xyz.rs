//! Text with one point a line: two coordinates, or three and anything after them.

use super::text::{Lines, Separator, is_text, parse_count, parse_number};
use super::{Format, ReadOptions, Scan, csv, rows};
use crate::error::ReadErrorKind;

/// Shortest line of a point, `0 0` and its end: bounds the memory reserved for an announced number of points.
const SHORTEST_LINE: usize = 4;

/// Blanks, tabs, commas or semicolons separate, one of them throughout a file. `#` and `//` open comments.
/// The first line may hold names, or the number of points (PTS).
pub(super) fn read(bytes: &[u8], options: &ReadOptions) -> Result<Scan, ReadErrorKind> {
    let mut lines = Lines::new(bytes);
    let mut next_line = || lines.next_data(before_comment);
    let mut notes = Vec::new();
    let mut announced = None;

    let mut first = next_line().ok_or(ReadErrorKind::NoPoints)?;
    let fields: Vec<_> = Separator::of(first.text).fields(first.text).collect();
    if parse_number(fields[0]).is_none() {
        if !is_text(first.text) {
            return Err(ReadErrorKind::NotText { line: first.number });
        }
        if csv::names_coordinates(&fields, options) {
            return csv::read_lines(bytes, options, before_comment);
        }
        notes.push(format!("line {} is not a point and was skipped", first.number));
        first = next_line().ok_or(ReadErrorKind::NoPoints)?;
    } else if let [count] = fields[..]
        && let Some(second) = next_line()
    {
        announced = Some(parse_count(count).ok_or_else(|| first.row_length(2, 1))?);
        first = second;
    }

    let separator = Separator::of(first.text);
    let columns = separator.fields(first.text).count();
    let chosen = column_indices(options)?;
    let dimension = if chosen.is_empty() { columns.min(3) } else { chosen.len() };
    if chosen.is_empty() {
        if columns < 2 {
            return Err(first.row_length(2, columns));
        }
        if columns > dimension {
            notes.push(format!("columns 4 to {columns} were ignored"));
        }
    }
    let last_chosen = chosen.iter().max().map_or(0, |last| last + 1);
    let mut row = Vec::new();

    let mut values = Vec::with_capacity(announced.unwrap_or(0).min(bytes.len() / SHORTEST_LINE) * dimension);
    let mut line = Some(first);
    while let Some(current) = line {
        let mut fields = separator.fields(current.text);
        if chosen.is_empty() {
            for found in 0..dimension {
                let field = fields.next().ok_or_else(|| current.row_length(dimension, found))?;
                values.push(current.coordinate(field)?);
            }
            if dimension == 2 && fields.next().is_some() {
                return Err(current.row_length(2, 3 + fields.count()));
            }
        } else {
            row.clear();
            row.extend(fields.take(last_chosen));
            if row.len() < last_chosen {
                return Err(current.row_length(last_chosen, row.len()));
            }
            for &column in &chosen {
                values.push(current.coordinate(row[column])?);
            }
        }
        line = next_line();
    }

    let found = values.len() / dimension;
    match announced {
        Some(expected) if expected > found => {
            return Err(ReadErrorKind::Truncated { element: "point".to_owned(), expected, found });
        }
        Some(expected) if expected < found => {
            notes.push(format!("the first line announces {expected} points; all {found} were read"));
        }
        _ => {}
    }
    let mut scan = Scan::new(Format::Xyz, rows(values, dimension));
    scan.notes = notes;
    Ok(scan)
}

/// The chosen columns, counted from 0; none where the first two or three are taken.
fn column_indices(options: &ReadOptions) -> Result<Vec<usize>, ReadErrorKind> {
    let index = |column: &String| {
        let number = parse_count(column.as_bytes()).filter(|&number| number > 0);
        number.map(|number| number - 1).ok_or_else(|| ReadErrorKind::ColumnNumber { column: column.clone() })
    };
    options.columns.iter().map(index).collect()
}

fn before_comment(text: &[u8]) -> &[u8] {
    match text.iter().position(|&b| b == b'#' || b == b'/') {
        Some(start) if text[start] == b'#' || text[start..].starts_with(b"//") => &text[..start],
        _ => text,
    }
}
