//! How a table is written: its separator, its decimal sign, where its rows begin and which of its columns hold numbers.

use super::super::number::{Decimal, NumberStyle, Value, is_grouped};
use super::super::text::{Line, quote};
use super::fields::{Field, Separator};
use crate::error::ReadErrorKind;

/// Share of the lines with numbers that have to fit a separator: titles may hold numbers, too.
///
/// Limit: a line of five, of a file of a few lines.
const SHARE_OF_LINES: f64 = 0.8;

/// Fewest lines from which decimal commas are told from columns by digits alone.
///
/// Limit: by chance ten lines have single digits in three columns of whole numbers once in 10³ files of three-digit numbers.
const FEWEST_LINES_OF_DIGITS: usize = 10;

/// How the lines of a table become numbers.
#[derive(Clone, Debug)]
pub(super) struct Dialect {
    pub(super) separator: Separator,
    pub(super) style: NumberStyle,
    /// Fields of most lines, with and without empty ones at the end.
    pub(super) fields: usize,
    pub(super) filled: usize,
    /// The columns that hold numbers in most lines, from 0.
    pub(super) number_columns: Vec<usize>,
    /// Most fields of a line, without empty ones at the end.
    pub(super) most_filled: usize,
    /// Whether the style of the numbers is a guess, and not that of everyone.
    pub(super) is_guess: bool,
}

/// What a separator makes of a line.
#[derive(Clone, Copy, Default)]
struct Fit {
    numbers: usize,
    /// Whether a field holds several numbers.
    is_broken: bool,
}

/// The number of a field in either way of writing it.
fn is_number(field: &Field<'_>) -> bool {
    let is_number = |style: NumberStyle| matches!(style.value(field.text), Value::Number(_));
    is_number(NumberStyle::POINT)
        || is_number(NumberStyle::COMMA)
        || is_grouped(field.text, Decimal::Point)
        || is_grouped(field.text, Decimal::Comma)
}

fn fit(line: &[u8], separator: Separator) -> Fit {
    let (mut fields, mut parts) = (Vec::new(), Vec::new());
    separator.split(line, &mut fields);
    let mut fit = Fit::default();
    for field in &fields {
        if is_number(field) {
            fit.numbers += 1;
        } else if separator.is_explicit() && !field.quoted {
            Separator::Blanks.split(field.text, &mut parts);
            fit.is_broken |= parts.len() > 1 && parts.iter().all(is_number);
        }
    }
    fit
}

impl Dialect {
    /// Finds how a sample of the lines of a table is written; `None` where none of them holds a number.
    ///
    /// # Errors
    /// [`ReadErrorKind::AmbiguousComma`], [`ReadErrorKind::GroupedNumber`].
    pub(super) fn find(sample: &[Line<'_>], decimal: Option<Decimal>) -> Result<Option<Self>, ReadErrorKind> {
        let candidates = [b';', b'|', b'\t', b',']
            .map(Separator::Byte)
            .into_iter()
            .chain([Separator::BlanksOrComma, Separator::Blanks]);
        let candidates: Vec<Separator> = candidates.collect();
        let fits_of = |line: &Line<'_>| candidates.iter().map(|&separator| fit(line.text, separator)).collect();
        let fits: Vec<Vec<Fit>> = sample.iter().map(fits_of).collect();
        let most = |fits: &[Fit]| fits.iter().map(|fit| fit.numbers).max().unwrap_or(0);
        // Lines with one number are rows where no line has more.
        let least = fits.iter().map(|fits| most(fits)).max().unwrap_or(0).min(2);
        if least == 0 {
            return Ok(None);
        }
        let rows: Vec<usize> = (0..sample.len()).filter(|&k| most(&fits[k]) >= least).collect();
        let lines: Vec<Line<'_>> = rows.iter().map(|&k| sample[k]).collect();
        let takes = |at: usize| {
            let good = rows.iter().filter(|&&k| fits[k][at].numbers >= least && !fits[k][at].is_broken).count();
            good as f64 >= SHARE_OF_LINES * rows.len() as f64
        };
        // A tab that only fills up a line is a blank.
        let titles: Vec<Line<'_>> = (0..sample.len()).filter(|k| !rows.contains(k)).map(|k| sample[k]).collect();
        let is_filled =
            |separator: Separator| separator != Separator::Byte(b'\t') || !has_empty_column(&lines, &titles);
        let at = (0..candidates.len()).find(|&at| takes(at) && is_filled(candidates[at]));
        let separator = match at.map(|at| candidates[at]) {
            Some(Separator::BlanksOrComma) if !separates_by_comma(&lines) => Separator::Blanks,
            Some(separator) => separator,
            None => Separator::Blanks,
        };
        let (separator, style, is_guess) = match separator {
            Separator::Byte(b',') => commas(&lines, decimal)?,
            Separator::BlanksOrComma if decimal == Some(Decimal::Comma) => {
                (Separator::CommaBlank, NumberStyle { decimal: Decimal::Comma, grouped: true }, false)
            }
            other => {
                let (style, guessed) = style(&lines, other, decimal)?;
                (other, style, guessed)
            }
        };
        Ok(Some(Self::of_rows(&lines, separator, style, is_guess)))
    }

    fn of_rows(lines: &[Line<'_>], separator: Separator, style: NumberStyle, is_guess: bool) -> Self {
        let mut fields = Vec::new();
        // Of each column in how many lines it holds a number, words, and nothing.
        let mut counts: Vec<[usize; 3]> = Vec::new();
        let (mut lengths, mut filled_lengths) = (Vec::new(), Vec::new());
        for line in lines {
            separator.split(line.text, &mut fields);
            lengths.push(fields.len());
            filled_lengths.push(filled(&fields));
            counts.resize(counts.len().max(fields.len()), [0; 3]);
            for (count, field) in counts.iter_mut().zip(&fields) {
                let kind = match style.value(field.text) {
                    Value::Number(_) => 0,
                    Value::Words => 1,
                    Value::Missing if field.text.is_empty() => continue,
                    Value::Missing => 2,
                };
                count[kind] += 1;
            }
        }
        let is_number = |&[numbers, words, missing]: &[usize; 3]| {
            numbers + missing > 0 && numbers + missing >= words && 2 * (numbers + missing) >= lines.len()
        };
        let number_columns = (0..counts.len()).filter(|&k| is_number(&counts[k])).collect();
        let most_filled = filled_lengths.iter().copied().max().unwrap_or(0);
        let (fields, filled) = (most_common(&lengths), most_common(&filled_lengths));
        Self { separator, style, fields, filled, number_columns, most_filled, is_guess }
    }

    /// The columns by which a row is known: the first three that hold numbers.
    pub(super) fn key_columns(&self) -> &[usize] {
        &self.number_columns[..self.number_columns.len().min(3)]
    }

    /// Whether the fields of a line have numbers, or words for none, where rows have them.
    pub(super) fn is_row(&self, fields: &[Field<'_>]) -> bool {
        let holds = |&column: &usize| fields.get(column).is_some_and(|f| self.style.value(f.text) != Value::Words);
        self.key_columns().iter().all(holds)
    }
}

/// Fields of a line without the empty ones at its end.
pub(super) fn filled(fields: &[Field<'_>]) -> usize {
    fields.iter().rposition(|field| !field.text.is_empty()).map_or(0, |last| last + 1)
}

/// The number that occurs most often; of several the largest.
fn most_common(numbers: &[usize]) -> usize {
    let count = |number: usize| numbers.iter().filter(|&&other| other == number).count();
    let mut different = numbers.to_vec();
    different.sort_unstable();
    different.dedup();
    different.into_iter().max_by_key(|&number| (count(number), number)).unwrap_or(0)
}

/// Whether a column between tabs is empty in all lines, and has no name in a title either.
fn has_empty_column(lines: &[Line<'_>], titles: &[Line<'_>]) -> bool {
    let mut fields = Vec::new();
    let mut is_empty: Vec<bool> = Vec::new();
    for line in lines {
        Separator::Byte(b'\t').split(line.text, &mut fields);
        is_empty.resize(is_empty.len().max(filled(&fields)), true);
        for (is_empty, field) in is_empty.iter_mut().zip(&fields) {
            *is_empty &= field.text.is_empty();
        }
    }
    let is_named = |title: &Line<'_>| {
        let mut fields = Vec::new();
        Separator::Byte(b'\t').split(title.text, &mut fields);
        fields.len() >= is_empty.len() && fields.iter().all(|field| !field.text.is_empty())
    };
    is_empty.contains(&true) && !titles.iter().any(is_named)
}

/// Whether commas stand before or behind blanks, and not only within numbers.
fn separates_by_comma(lines: &[Line<'_>]) -> bool {
    let mut fields = Vec::new();
    lines.iter().any(|line| {
        Separator::Blanks.split(line.text, &mut fields);
        fields.iter().any(|field| !field.quoted && (field.text.starts_with(b",") || field.text.ends_with(b",")))
    })
}

/// Numbers of a table by how they are written.
#[derive(Default)]
struct Spellings<'a> {
    point: Option<(usize, &'a [u8])>,
    comma: Option<(usize, &'a [u8])>,
    /// `1,000.5`
    groups: Option<(usize, &'a [u8])>,
    /// `1.000,5`
    comma_groups: Option<(usize, &'a [u8])>,
    /// Whether all with a comma would also do as groups of three digits, none of them `0,…`.
    all_groups: bool,
}

fn spellings<'a>(lines: &[Line<'a>], separator: Separator) -> Spellings<'a> {
    let mut found = Spellings { all_groups: true, ..Spellings::default() };
    let mut fields = Vec::new();
    for line in lines {
        separator.split(line.text, &mut fields);
        for field in fields.iter().filter(|field| is_number(field)) {
            let place = |which: &mut Option<(usize, &'a [u8])>| {
                which.get_or_insert((line.number, field.text));
            };
            let find = |byte: u8| field.text.iter().position(|&b| b == byte);
            match (find(b'.'), find(b',')) {
                (Some(point), Some(comma)) if comma < point => place(&mut found.groups),
                (Some(_), Some(_)) => place(&mut found.comma_groups),
                (Some(_), None) => place(&mut found.point),
                (None, Some(comma)) => {
                    let whole = field.text[..comma].strip_prefix(b"-").unwrap_or(&field.text[..comma]);
                    found.all_groups &= is_grouped(field.text, Decimal::Point) && !whole.starts_with(b"0");
                    place(&mut found.comma);
                }
                (None, None) => {}
            }
        }
    }
    found
}

/// How the numbers between separators other than commas are written, and whether decimal commas are a guess.
fn style(
    lines: &[Line<'_>],
    separator: Separator,
    decimal: Option<Decimal>,
) -> Result<(NumberStyle, bool), ReadErrorKind> {
    if let Some(decimal) = decimal {
        return Ok((NumberStyle { decimal, grouped: true }, false));
    }
    // Where commas separate, one within a word may be a decimal one.
    let read_as = if separator == Separator::BlanksOrComma { Separator::CommaBlank } else { separator };
    let found = spellings(lines, read_as);
    if let Some((line, text)) = found.groups.or(found.comma_groups) {
        return Err(ReadErrorKind::GroupedNumber { line, text: quote(text) });
    }
    match (found.comma, found.point) {
        (Some((line, text)), Some(_)) => Err(ReadErrorKind::AmbiguousComma { line, text: quote(text) }),
        (Some((line, text)), None) if found.all_groups || read_as != separator => {
            Err(ReadErrorKind::AmbiguousComma { line, text: quote(text) })
        }
        (Some(_), None) => Ok((NumberStyle::COMMA, true)),
        (None, _) => Ok((NumberStyle::POINT, false)),
    }
}

/// The separator and the style of lines in which commas separate numbers, or seem to.
fn commas(lines: &[Line<'_>], decimal: Option<Decimal>) -> Result<(Separator, NumberStyle, bool), ReadErrorKind> {
    let comma = Separator::Byte(b',');
    match decimal {
        Some(Decimal::Point) => return Ok((comma, NumberStyle { decimal: Decimal::Point, grouped: true }, false)),
        Some(Decimal::Comma) => {
            let style = NumberStyle { decimal: Decimal::Comma, grouped: true };
            let mut fields = Vec::new();
            let mut all = |fits: &dyn Fn(&[Field<'_>]) -> bool, separator: Separator| {
                lines.iter().all(|line| {
                    separator.split(line.text, &mut fields);
                    fits(&fields)
                })
            };
            let has_quoted_commas = !all(&|fields| !fields.iter().any(|f| f.quoted && f.text.contains(&b',')), comma);
            let numbers = |fields: &[Field<'_>]| {
                fields.len() > 1 && fields.iter().all(|field| style.value(field.text) != Value::Words)
            };
            let separator = if has_quoted_commas {
                comma
            } else if all(&numbers, Separator::CommaBlank) {
                Separator::CommaBlank
            } else {
                Separator::CommaPairs
            };
            return Ok((separator, style, false));
        }
        None => {}
    }
    // Within quotes commas are decimal ones, or part groups of digits.
    let found = spellings(lines, comma);
    if let Some((line, text)) = found.comma_groups {
        return Err(ReadErrorKind::GroupedNumber { line, text: quote(text) });
    }
    let grouped = NumberStyle { decimal: Decimal::Point, grouped: true };
    match (found.comma, found.point, found.groups) {
        (None, _, Some(_)) => return Ok((comma, grouped, true)),
        (Some(_), ..) if (found.groups.is_some() || found.point.is_some()) && found.all_groups => {
            return Ok((comma, grouped, true));
        }
        (Some((line, text)), point, groups) if point.or(groups).is_some() || found.all_groups => {
            return Err(ReadErrorKind::AmbiguousComma { line, text: quote(text) });
        }
        (Some(_), ..) => return Ok((comma, NumberStyle::COMMA, true)),
        (None, ..) => {}
    }
    if found.point.is_none() && are_halves(lines) {
        let line = lines[0];
        return Err(ReadErrorKind::AmbiguousComma { line: line.number, text: quote(line.text) });
    }
    Ok((comma, NumberStyle::POINT, false))
}

/// Whether whole numbers between commas may be the whole parts and the fractions of numbers with decimal commas: an even number
/// of columns, digits without sign in every second one, and among these some that no whole number begins with, as in `0,05`; or
/// in all three of them single digits.
fn are_halves(lines: &[Line<'_>]) -> bool {
    let mut fields = Vec::new();
    let mut columns = None;
    let (mut starts_with_zero, mut are_single) = (false, true);
    let mut last = Vec::new();
    for line in lines {
        Separator::Byte(b',').split(line.text, &mut fields);
        let count = *columns.get_or_insert(fields.len());
        if fields.len() != count || count < 4 || count % 2 != 0 {
            return false;
        }
        for (k, field) in fields.iter().enumerate() {
            let is_fraction = k % 2 == 1;
            let digits = if is_fraction { field.text } else { field.text.strip_prefix(b"-").unwrap_or(field.text) };
            let opens_with_zero = digits.len() > 1 && digits.starts_with(b"0");
            let are_digits = !digits.is_empty() && digits.iter().all(u8::is_ascii_digit);
            if !are_digits || !is_fraction && opens_with_zero {
                return false;
            }
            starts_with_zero |= opens_with_zero;
            are_single &= !is_fraction || digits.len() == 1;
        }
        last.push(fields[count - 1].text);
    }
    last.sort_unstable();
    last.dedup();
    // The last of normals and flags takes two values.
    let varies = last.len() > 2;
    starts_with_zero || are_single && columns == Some(6) && varies && lines.len() >= FEWEST_LINES_OF_DIGITS
}
