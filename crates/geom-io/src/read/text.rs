//! Lines, fields and numbers of text files, on bytes.

use std::borrow::Cow;

use super::number::{NumberStyle, Value, is_blank, opens_with_missing};
use crate::error::{Location, ReadErrorKind};

/// Bytes at the start of a file among which control characters tell that it is no text.
const LOOKED_AT: usize = 1 << 16;

/// Text with the blanks and the minus of typesetters as those of ASCII, and from Latin-1 where it is not UTF-8; and the line from
/// which that is known. What has control characters is no text in Latin-1 either, and stays as it is.
pub(super) fn decoded(bytes: &[u8]) -> (Cow<'_, [u8]>, Option<usize>) {
    if bytes.is_ascii() {
        return (Cow::Borrowed(bytes), None);
    }
    let is_end = |b: u8| matches!(b, b'\n' | b'\r');
    match std::str::from_utf8(bytes) {
        Ok(text) => (in_ascii_signs(text), None),
        Err(_) if bytes.iter().take(LOOKED_AT).any(|&b| b.is_ascii_control() && !is_blank(b) && !is_end(b)) => {
            (Cow::Borrowed(bytes), None)
        }
        Err(error) => {
            let text: String = bytes.iter().copied().map(char::from).collect();
            let line = Lines::new(&bytes[..=error.valid_up_to()]).count();
            (Cow::Owned(in_ascii_signs(&text).into_owned()), Some(line))
        }
    }
}

/// Blanks that do not break as ordinary ones, but between digits, where they part thousands, as nothing; and the minus sign as a
/// hyphen.
fn in_ascii_signs(text: &str) -> Cow<'_, [u8]> {
    const MINUS: char = '\u{2212}';
    let is_blank = |c: char| matches!(c, '\u{a0}' | '\u{2007}' | '\u{2009}' | '\u{202f}');
    if !text.contains(|c: char| c == MINUS || is_blank(c)) {
        return Cow::Borrowed(text.as_bytes());
    }
    let mut plain = String::with_capacity(text.len());
    let mut after = text.chars();
    while let Some(c) = after.next() {
        let is_digit = |c: Option<char>| c.is_some_and(|c| c.is_ascii_digit());
        match c {
            MINUS => plain.push('-'),
            _ if !is_blank(c) => plain.push(c),
            _ if is_digit(plain.chars().next_back()) && is_digit(after.clone().next()) => {}
            _ => plain.push(' '),
        }
    }
    Cow::Owned(plain.into_bytes())
}

/// A line without its end, and its number.
#[derive(Clone, Copy)]
pub(super) struct Line<'a> {
    /// Counted from 1.
    pub(super) number: usize,
    pub(super) text: &'a [u8],
}

/// Lines ended by LF, CR LF or CR.
#[derive(Clone)]
pub(super) struct Lines<'a> {
    rest: &'a [u8],
    number: usize,
}

impl<'a> Lines<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes, number: 0 }
    }

    /// The lines after the first `skipped` ones, which count.
    pub(super) fn after(bytes: &'a [u8], skipped: usize) -> Self {
        let mut lines = Self::new(bytes);
        lines.by_ref().take(skipped).for_each(drop);
        lines
    }

    /// What follows the lines taken so far.
    pub(super) fn rest(&self) -> &'a [u8] {
        self.rest
    }

    /// The next line that is not blank, trimmed.
    pub(super) fn next_filled(&mut self) -> Option<Line<'a>> {
        self.next_data(|text| text)
    }

    /// The next line with something before its comment; that part, trimmed.
    pub(super) fn next_data(&mut self, before_comment: impl Fn(&'a [u8]) -> &'a [u8]) -> Option<Line<'a>> {
        self.find_map(|line| {
            let text = trim(before_comment(line.text));
            (!text.is_empty()).then_some(Line { text, ..line })
        })
    }
}

/// What stands before a comment that `#` opens, at the start of a line or after a blank: `1.#QNAN` is a number without a value, not 1.
pub(super) fn before_hash(text: &[u8]) -> &[u8] {
    let opens = |&k: &usize| text[k] == b'#' && (k == 0 || is_blank(text[k - 1])) && !opens_with_missing(&text[k..]);
    &text[..(0..text.len()).find(opens).unwrap_or(text.len())]
}

impl<'a> Iterator for Lines<'a> {
    type Item = Line<'a>;

    fn next(&mut self) -> Option<Line<'a>> {
        if self.rest.is_empty() {
            return None;
        }
        let end = self.rest.iter().position(|&b| b == b'\n' || b == b'\r');
        let (text, after) = self.rest.split_at(end.unwrap_or(self.rest.len()));
        let after = after.strip_prefix(b"\r").map_or(after, |a| if a.starts_with(b"\n") { a } else { after });
        self.rest = after.get(1..).unwrap_or_default();
        self.number += 1;
        Some(Line { number: self.number, text })
    }
}

impl<'a> Line<'a> {
    /// Blank-separated fields.
    pub(super) fn fields(self) -> Fields<'a> {
        Fields { rest: self.text }
    }

    pub(super) fn location(self) -> Location {
        Location::Line(self.number)
    }

    /// The number that `field` spells, NaN where it says that there is none.
    pub(super) fn number(self, field: &[u8]) -> Result<f64, ReadErrorKind> {
        number_or_nan(field).ok_or_else(|| self.not_a_number(field))
    }

    /// The first three fields as coordinates, finite or not; further fields are left alone.
    pub(super) fn xyz(self, mut fields: Fields<'a>) -> Result<[f64; 3], ReadErrorKind> {
        let mut xyz = [0.0; 3];
        for found in 0..xyz.len() {
            let field = fields.next().ok_or_else(|| self.row_length(3, found))?;
            xyz[found] = self.number(field)?;
        }
        Ok(xyz)
    }

    pub(super) fn row_length(self, expected: usize, found: usize) -> ReadErrorKind {
        ReadErrorKind::RowLength { line: self.number, expected, found }
    }

    pub(super) fn bad_header(self, reason: &'static str) -> ReadErrorKind {
        match is_text(self.text) {
            true => ReadErrorKind::Header { line: self.number, text: quote(self.text), reason },
            false => ReadErrorKind::NotText { line: self.number },
        }
    }

    pub(super) fn not_a_number(self, field: &[u8]) -> ReadErrorKind {
        match is_text(field) {
            true => ReadErrorKind::NotANumber { location: self.location(), text: quote(field) },
            false => ReadErrorKind::NotText { line: self.number },
        }
    }

    pub(super) fn not_an_index(self, field: &[u8]) -> ReadErrorKind {
        match is_text(field) {
            true => ReadErrorKind::NotAnIndex { location: self.location(), text: quote(field) },
            false => ReadErrorKind::NotText { line: self.number },
        }
    }
}

/// The blank-separated fields of a line.
#[derive(Clone)]
pub(super) struct Fields<'a> {
    rest: &'a [u8],
}

impl<'a> Iterator for Fields<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        let rest = trim_start(self.rest);
        let end = rest.iter().position(|&b| is_blank(b)).unwrap_or(rest.len());
        self.rest = &rest[end..];
        Some(&rest[..end]).filter(|field| !field.is_empty())
    }
}

fn trim_start(text: &[u8]) -> &[u8] {
    let start = text.iter().position(|&b| !is_blank(b)).unwrap_or(text.len());
    &text[start..]
}

pub(super) fn trim(text: &[u8]) -> &[u8] {
    let end = text.iter().rposition(|&b| !is_blank(b)).map_or(0, |last| last + 1);
    trim_start(&text[..end])
}

pub(super) fn parse_number(field: &[u8]) -> Option<f64> {
    fast_float2::parse(field).ok()
}

/// A number, NaN for what says that there is none: `nan`, `1.#IND`, `null`, infinities.
pub(super) fn number_or_nan(field: &[u8]) -> Option<f64> {
    match NumberStyle::POINT.value(field) {
        Value::Number(number) => Some(number),
        Value::Missing => Some(f64::NAN),
        Value::Words => None,
    }
}

/// A count or index in decimal digits.
pub(super) fn parse_count(field: &[u8]) -> Option<usize> {
    std::str::from_utf8(field).ok()?.parse().ok()
}

/// Without control characters, and in UTF-8.
pub(super) fn is_text(bytes: &[u8]) -> bool {
    !has_control(bytes) && std::str::from_utf8(bytes).is_ok()
}

/// Whether there are control characters, which no encoding of text has.
pub(super) fn has_control(bytes: &[u8]) -> bool {
    bytes.iter().any(|&b| b.is_ascii_control() && !is_blank(b))
}

pub(super) fn quote(bytes: &[u8]) -> String {
    crate::error::quote(&String::from_utf8_lossy(bytes))
}
