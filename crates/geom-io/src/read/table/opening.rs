//! What stands above the rows of a table: titles, names, a number of points, a declared mark of no data.

use super::super::number::NumberStyle;
use super::super::number::is_blank;
use super::super::text::{Line, Lines, has_control, parse_count};
use super::dialect::{Dialect, filled};
use super::fields::{Field, Separator, part_comment};
use super::names::{Coordinates, Names};
use crate::error::ReadErrorKind;
use crate::read::ReadOptions;
use crate::read::number::Value;

/// The lines above the first row of a table.
pub(super) struct Opening<'a> {
    /// Lines that are neither rows nor comments.
    titles: Vec<Line<'a>>,
    /// Comments of a whole line, without their sign.
    comments: Vec<Line<'a>>,
    /// The number of points, where it stands before them.
    pub(super) announced: Option<usize>,
    /// From the first row on.
    pub(super) rows: Lines<'a>,
    /// Number of the first row's line.
    pub(super) first_row: usize,
}

/// The part of a line that is data, or `None` where there is none.
pub(super) fn data<'a>(line: Line<'a>, separator: Separator) -> Option<Line<'a>> {
    let text = part_comment(line.text, separator == Separator::Byte(b';')).data;
    (!text.iter().all(|&b| is_blank(b))).then_some(Line { text, ..line })
}

impl<'a> Opening<'a> {
    /// Takes the lines up to the first row.
    ///
    /// # Errors
    /// [`ReadErrorKind::NotText`], [`ReadErrorKind::NoPoints`].
    pub(super) fn take(mut lines: Lines<'a>, dialect: &Dialect) -> Result<Self, ReadErrorKind> {
        let (mut titles, mut comments, mut announced) = (Vec::new(), Vec::new(), None);
        let mut fields: Vec<Field<'_>> = Vec::new();
        loop {
            let rows = lines.clone();
            let line = lines.next().ok_or(ReadErrorKind::NoPoints)?;
            let Some(content) = data(line, dialect.separator) else {
                let parted = part_comment(line.text, dialect.separator == Separator::Byte(b';'));
                comments.extend(parted.comment.map(|text| Line { text, ..line }));
                continue;
            };
            dialect.separator.split(content.text, &mut fields);
            let count = match &fields[..filled(&fields)] {
                [count] if dialect.number_columns.len() > 1 => parse_count(count.text),
                _ => None,
            };
            if count.is_some() {
                announced = count;
            } else if dialect.is_row(&fields) {
                return Ok(Self { titles, comments, announced, rows, first_row: line.number });
            } else if has_control(content.text) {
                return Err(ReadErrorKind::NotText { line: line.number });
            } else {
                titles.push(content);
            }
        }
    }

    /// The names of the columns: of the last title that names coordinates (those asked for by name), else of the last comment that
    /// does, else of the last title where it can only be a line of names.
    ///
    /// # Errors
    /// [`ReadErrorKind::DuplicateColumn`], [`ReadErrorKind::AmbiguousComma`].
    pub(super) fn names(&mut self, dialect: &Dialect, options: &ReadOptions) -> Result<Option<Names>, ReadErrorKind> {
        let by_name = options.columns.iter().any(|column| parse_count(column.as_bytes()).is_none());
        let fits = |names: &Names| -> Result<bool, ReadErrorKind> {
            // Names come before numbers.
            let all = |find: &dyn Fn(&str) -> Result<Option<usize>, ReadErrorKind>| -> Result<bool, ReadErrorKind> {
                let found = options.columns.iter().map(|column| find(column));
                Ok(found.collect::<Result<Vec<_>, _>>()?.iter().all(Option::is_some))
            };
            match (options.columns.is_empty(), by_name) {
                (true, _) => Ok(names.coordinates()?.is_ok()),
                (false, true) => all(&|column| names.find_or_number(column)),
                (false, false) => Ok(all(&|column| names.find(column))? || names.coordinates()?.is_ok()),
            }
        };
        let counts =
            if dialect.fields == dialect.filled { vec![dialect.fields] } else { vec![dialect.fields, dialect.filled] };
        for at in (0..self.titles.len()).rev() {
            for &count in &counts {
                let readings = Names::in_line(self.titles[at].text, dialect.separator, count);
                if let Some(names) = first_that(readings, &fits)? {
                    self.titles.remove(at);
                    return Ok(Some(names));
                }
            }
        }
        for comment in self.comments.iter().rev() {
            // Sentences name no columns: there all coordinates have to be, and no error comes of them.
            let has_all = |names: &Names| {
                let has_all = |found: Coordinates| found.columns.len() == dialect.filled.min(3);
                by_name || names.coordinates().is_ok_and(|found| found.is_ok_and(has_all))
            };
            let readings = Names::in_line(comment.text, dialect.separator, dialect.filled);
            if let Some(names) = readings.into_iter().find(|names| fits(names).is_ok_and(|fits| fits) && has_all(names))
            {
                return Ok(Some(names));
            }
        }
        let Some(last) = self.titles.last() else { return Ok(None) };
        let mut fields = Vec::new();
        dialect.separator.split(last.text, &mut fields);
        let are_words = |fields: &[Field<'_>]| {
            fields.iter().all(|field| field.text.is_empty() || NumberStyle::POINT.value(field.text) == Value::Words)
        };
        // Names of fewer or more columns than there are: the rows are wrong, and are told.
        if dialect.separator.is_explicit() {
            let names = Names::of(&fields[..filled(&fields)]);
            if fits(&names)? || fields.len() == dialect.fields && are_words(&fields) {
                if 2 * names.written.len() == dialect.fields && dialect.separator == Separator::Byte(b',') {
                    return Err(ReadErrorKind::AmbiguousComma { line: self.first_row, text: names.written.join(",") });
                }
                self.titles.pop();
                return Ok(Some(names));
            }
            return Ok(None);
        }
        let mut readings = Names::in_line(last.text, dialect.separator, dialect.filled).into_iter();
        let names = readings.find(|names| names.are_known() && names.written.len() > 1 && are_words(&fields));
        if names.is_some() {
            self.titles.pop();
        }
        Ok(names)
    }

    /// The number that titles or comments declare to stand for no data, as in `nodata = -9999`.
    pub(super) fn declared(&self, style: NumberStyle) -> Option<f64> {
        self.titles.iter().chain(&self.comments).find_map(|line| declared_in(line.text, style))
    }

    /// Says which lines are neither points nor names.
    pub(super) fn note(&self) -> Option<String> {
        match self.titles[..] {
            [] => None,
            [line] => Some(format!("line {} is not a point and was skipped", line.number)),
            [first, .., last] => {
                Some(format!("lines {} to {} are not points and were skipped", first.number, last.number))
            }
        }
    }
}

/// The first of several readings of a line that fits; where none does, what is wrong with the first of which this can be said.
fn first_that(
    readings: Vec<Names>,
    fits: &dyn Fn(&Names) -> Result<bool, ReadErrorKind>,
) -> Result<Option<Names>, ReadErrorKind> {
    let mut wrong = None;
    for names in readings {
        match fits(&names) {
            Ok(true) => return Ok(Some(names)),
            Ok(false) => {}
            Err(error) => wrong = wrong.or(Some(error)),
        }
    }
    wrong.map_or(Ok(None), Err)
}

/// The number behind the words for no data in a line: `nodata -9999`, `NODATA_value = -9999`, `no data: -1e30`.
fn declared_in(line: &[u8], style: NumberStyle) -> Option<f64> {
    let text = String::from_utf8_lossy(line).to_lowercase();
    let joined = text.replace("no data", "nodata").replace("no_data", "nodata").replace("no-data", "nodata");
    let after = joined.split_once("nodata")?.1.trim_start_matches(['_', '-', ' ']);
    let after = after.strip_prefix("values").or(after.strip_prefix("value")).unwrap_or(after);
    let after = after.trim_start_matches([' ', '\t', ':', '=', ',', ';']);
    match style.value(after.split([' ', '\t', ';']).next().unwrap_or_default().as_bytes()) {
        Value::Number(value) => Some(value),
        _ => None,
    }
}
