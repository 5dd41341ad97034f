//! The rows of a table.

use super::super::number::{Value, is_declared};
use super::super::text::{Line, has_control, is_text, parse_count, quote};
use super::dialect::{Dialect, filled};
use super::fields::Field;
use super::names::Names;
use super::opening::{Opening, data};
use super::roles::Roles;
use crate::error::ReadErrorKind;
use crate::read::RowLines;

/// What the rows hold, column by column.
#[derive(Default)]
pub(super) struct Rows {
    /// Row-major.
    pub(super) points: Vec<f64>,
    pub(super) parameters: Vec<f64>,
    pub(super) on_boundary: Vec<bool>,
    pub(super) weights: Vec<f64>,
    pub(super) normals: Vec<[f64; 3]>,
    /// Columns that are said to be grid indices.
    pub(super) grid: Vec<[f64; 2]>,
    /// Columns i, j and k; NaN where there is no k.
    pub(super) ijk: Vec<[f64; 3]>,
    /// Which of the rows of the file each point is.
    pub(super) rows: Vec<u32>,
    pub(super) lines: RowLines,
    pub(super) notes: Vec<String>,
}

/// How many of some lines there were, and the first.
#[derive(Clone, Copy, Default)]
struct Count {
    lines: usize,
    first: usize,
}

impl Count {
    fn add(&mut self, line: usize) {
        if self.lines == 0 {
            self.first = line;
        }
        self.lines += 1;
    }
}

/// Reads the rows.
///
/// # Errors
/// [`ReadErrorKind`] with the line.
pub(super) fn read_rows(
    opening: &Opening<'_>,
    dialect: &Dialect,
    roles: &Roles,
    names: Option<&Names>,
) -> Result<Rows, ReadErrorKind> {
    let mut reader = Reader {
        dialect,
        roles,
        needed: roles.needed(),
        expected: names.map_or(roles.needed(), |names| names.written.len()),
        most: match names {
            Some(names) => names.written.len(),
            None if roles.coordinates == [0, 1] && dialect.number_columns.len() == 2 => 2,
            None => usize::MAX,
        },
        has_names: names.is_some(),
        declared: opening.declared(dialect.style),
        rows: Rows::default(),
        left_out: Count::default(),
        words: Count::default(),
        first_words: String::new(),
        row: 0,
    };
    let (mut announced, mut clouds) = (opening.announced, 1);
    let mut fields = Vec::new();
    for line in opening.rows.clone() {
        let Some(line) = data(line, dialect.separator) else { continue };
        dialect.separator.split(line.text, &mut fields);
        // The number of points of the next of several clouds.
        if let (Some(sum), [count]) = (announced, &fields[..filled(&fields)])
            && reader.needed > 1
            && let Some(count) = parse_count(count.text)
        {
            announced = Some(sum.saturating_add(count));
            clouds += 1;
            continue;
        }
        reader.push(line, &fields)?;
    }
    reader.finish(announced, clouds)
}

struct Reader<'a> {
    dialect: &'a Dialect,
    roles: &'a Roles,
    /// Fields that a row must have.
    needed: usize,
    /// Fields that it should have, for messages.
    expected: usize,
    /// Fields that it may have.
    most: usize,
    has_names: bool,
    /// The number that stands for no data.
    declared: Option<f64>,
    rows: Rows,
    /// Rows without a value where one is needed.
    left_out: Count,
    /// Lines of words between rows.
    words: Count,
    /// The first of them.
    first_words: String,
    /// Which of the rows of the file comes next.
    row: u32,
}

impl Reader<'_> {
    fn push(&mut self, line: Line<'_>, fields: &[Field<'_>]) -> Result<(), ReadErrorKind> {
        let is_number = |field: &Field<'_>| matches!(self.dialect.style.value(field.text), Value::Number(_));
        let surplus = |fields: &[Field<'_>]| {
            filled(fields) > self.most && (self.has_names || fields[self.most..].iter().any(is_number))
        };
        // A title among the points: words where two coordinates stand, or the first one of a line of another length.
        let columns = &self.roles.coordinates;
        let is_words = |column: &usize| {
            fields.get(*column).is_some_and(|field| self.dialect.style.value(field.text) == Value::Words)
        };
        let is_short = fields.len() < self.needed;
        if is_short || surplus(fields) {
            return match !fields.iter().any(is_number) || columns.first().is_some_and(is_words) {
                true => self.skip(line),
                false => Err(line.row_length(self.expected, filled(fields))),
            };
        }
        match self.values(line, fields)? {
            Row::Words => {
                let words = columns.iter().filter(|column| is_words(column)).count();
                if words > 1 || !fields.iter().any(is_number) {
                    return self.skip(line);
                }
                let mut needed = columns.iter().chain(&self.roles.parameters).chain(&self.roles.weights);
                let column = needed.find(|column| is_words(column)).copied().unwrap_or_default();
                return Err(not_a_number(line, column, fields[column]));
            }
            Row::Missing => self.left_out.add(line.number),
            Row::Whole => self.rows.rows.push(self.row),
        }
        self.rows.lines.push(self.row, line.number);
        self.row += 1;
        Ok(())
    }

    fn skip(&mut self, line: Line<'_>) -> Result<(), ReadErrorKind> {
        if has_control(line.text) {
            return Err(ReadErrorKind::NotText { line: line.number });
        }
        if self.words.lines == 0 {
            self.first_words = quote(line.text);
        }
        self.words.add(line.number);
        Ok(())
    }

    /// Adds the values of a row, if all that are needed are there.
    fn values(&mut self, line: Line<'_>, fields: &[Field<'_>]) -> Result<Row, ReadErrorKind> {
        let Self { dialect, roles, rows, declared, .. } = self;
        let value = |column: usize| dialect.style.value(fields[column].text);
        let before = [rows.points.len(), rows.parameters.len()];
        let mut row = Row::Whole;
        // The mark of no data stands for a height: 0 and 1 may be places.
        let height = roles.coordinates.last();
        for (&column, is_coordinate) in
            roles.coordinates.iter().map(|c| (c, true)).chain(roles.parameters.iter().map(|c| (c, false)))
        {
            match value(column) {
                Value::Number(number)
                    if height == Some(&column) && declared.is_some_and(|none| is_declared(number, none)) =>
                {
                    row = Row::Missing;
                    break;
                }
                Value::Number(number) => {
                    if is_coordinate { &mut rows.points } else { &mut rows.parameters }.push(number)
                }
                Value::Missing => row = Row::Missing,
                Value::Words => {
                    row = Row::Words;
                    break;
                }
            }
        }
        let weight = match roles.weights.map(&value) {
            None => Some(1.0),
            Some(Value::Number(weight)) if weight < 0.0 => {
                return Err(ReadErrorKind::NegativeWeight { line: line.number, value: weight });
            }
            Some(Value::Number(weight)) => Some(weight),
            Some(Value::Missing) => None,
            Some(Value::Words) => {
                row = Row::Words;
                None
            }
        };
        if weight.is_none() && row == Row::Whole {
            row = Row::Missing;
        }
        if row != Row::Whole {
            rows.points.truncate(before[0]);
            rows.parameters.truncate(before[1]);
            return Ok(row);
        }
        if roles.weights.is_some() {
            rows.weights.extend(weight);
        }
        if let Some(column) = roles.boundary {
            let label = truth(fields[column].text, value(column));
            let label = label.ok_or_else(|| not_a_number(line, column, fields[column]))?;
            rows.on_boundary.push(label);
        }
        let optional = |column: usize| match fields.get(column).map(|field| dialect.style.value(field.text)) {
            Some(Value::Number(number)) => number,
            _ => f64::NAN,
        };
        rows.normals.extend(roles.normals.map(|columns| columns.map(optional)));
        rows.grid.extend(roles.grid.map(|columns| columns.map(optional)));
        rows.ijk
            .extend(roles.ijk.map(|ijk| [optional(ijk.ij[0]), optional(ijk.ij[1]), ijk.k.map_or(f64::NAN, optional)]));
        Ok(Row::Whole)
    }

    fn finish(mut self, announced: Option<usize>, clouds: usize) -> Result<Rows, ReadErrorKind> {
        let found = self.row as usize;
        match announced {
            Some(expected) if expected > found => {
                return Err(ReadErrorKind::Truncated { element: "point".to_owned(), expected, found });
            }
            Some(expected) if expected < found && clouds == 1 => {
                self.rows.notes.push(format!("the first line announces {expected} points; all {found} were read"));
            }
            Some(expected) if expected < found => {
                self.rows.notes.push(format!("the file announces {expected} points; all {found} were read"));
            }
            _ => {}
        }
        if clouds > 1 {
            self.rows.notes.push(format!("the points of {clouds} clouds were put together"));
        }
        let Count { lines, first } = self.words;
        if lines > 0 && self.row == 0 {
            return Err(ReadErrorKind::NoNumbers { line: first, text: self.first_words });
        }
        if lines > 0 {
            self.rows
                .notes
                .push(format!("{lines} lines between the points are none and were skipped, the first is line {first}"));
        }
        let Count { lines: left_out, first } = self.left_out;
        if self.rows.rows.is_empty() && left_out > 0 {
            return Err(ReadErrorKind::NoValues { rows: left_out, line: first });
        }
        if left_out > 0 {
            self.rows.notes.push(format!(
                "{left_out} of {found} points have no value in a coordinate (empty, NaN, or declared as no data) and were left out, \
                 the first on line {first}"
            ));
        }
        Ok(self.rows)
    }
}

fn not_a_number(line: Line<'_>, column: usize, field: Field<'_>) -> ReadErrorKind {
    match is_text(field.text) {
        true => ReadErrorKind::NotANumberInTable { line: line.number, column: column + 1, text: quote(field.text) },
        false => ReadErrorKind::NotText { line: line.number },
    }
}

/// What became of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Row {
    Whole,
    /// A value that is needed is missing.
    Missing,
    /// A field that must be a number is none.
    Words,
}

/// Whether a label of the boundary says yes.
fn truth(text: &[u8], value: Value) -> Option<bool> {
    let is_one_of = |words: [&str; 4]| words.iter().any(|word| text.eq_ignore_ascii_case(word.as_bytes()));
    match value {
        Value::Number(number) => Some(number != 0.0),
        Value::Missing => Some(false),
        Value::Words if is_one_of(["true", "yes", "t", "y"]) => Some(true),
        Value::Words if is_one_of(["false", "no", "f", "n"]) => Some(false),
        Value::Words => None,
    }
}
