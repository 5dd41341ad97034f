//! Lines, fields and numbers of text files, on bytes.

use crate::error::{Location, ReadErrorKind};

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

/// What stands before a comment that `#` opens.
pub(super) fn before_hash(text: &[u8]) -> &[u8] {
    text.split(|&b| b == b'#').next().unwrap_or_default()
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

    /// The number, finite or not, that `field` spells.
    pub(super) fn number(self, field: &[u8]) -> Result<f64, ReadErrorKind> {
        parse_number(field).ok_or_else(|| self.not_a_number(field))
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

pub(super) fn is_blank(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | 0x0b | 0x0c)
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

/// A count or index in decimal digits.
pub(super) fn parse_count(field: &[u8]) -> Option<usize> {
    std::str::from_utf8(field).ok()?.parse().ok()
}

pub(super) fn finite(value: f64, location: impl FnOnce() -> Location) -> Result<f64, ReadErrorKind> {
    match value.is_finite() {
        true => Ok(value),
        false => Err(ReadErrorKind::NonFinite { location: location(), value }),
    }
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
