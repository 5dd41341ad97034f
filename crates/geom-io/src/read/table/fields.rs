//! Lines to fields: separators, quotes, comments.

use super::super::number::is_blank;
use super::super::number::opens_with_missing;

/// A field of a line, trimmed; of a quoted one what stands between the quotes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Field<'a> {
    pub(super) text: &'a [u8],
    pub(super) quoted: bool,
}

/// What stands between two fields, throughout a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Separator {
    /// One or more blanks or tabs.
    Blanks,
    /// A run of blanks with at most one comma: `5.0, 0.0 2.6`.
    BlanksOrComma,
    /// One such byte; blanks round it do not count.
    Byte(u8),
    /// Blanks, with or without a comma before them; other commas are decimal ones: `0,5, 1,5`.
    CommaBlank,
    /// Every other comma; those between are decimal ones: `0,5,1,5`.
    CommaPairs,
}

impl Separator {
    /// Whether it is written out, so that a field may be empty.
    pub(super) fn is_explicit(self) -> bool {
        matches!(self, Self::Byte(_) | Self::CommaPairs)
    }

    /// The fields of a line.
    pub(super) fn split<'a>(self, line: &'a [u8], fields: &mut Vec<Field<'a>>) {
        fields.clear();
        match self {
            Self::Blanks => split_at_blanks(line, false, fields),
            Self::BlanksOrComma => split_at_blanks(line, true, fields),
            Self::Byte(byte) => split_at(line, byte, |_| true, fields),
            Self::CommaBlank => {
                split_at_blanks(line, false, fields);
                for field in fields.iter_mut().filter(|field| !field.quoted) {
                    field.text = field.text.strip_suffix(b",").unwrap_or(field.text);
                }
                fields.retain(|field| field.quoted || !field.text.is_empty());
            }
            Self::CommaPairs => {
                let mut odd = false;
                let mut is_second = |_: &[u8]| {
                    odd = !odd;
                    !odd
                };
                split_at(line, b',', &mut is_second, fields);
            }
        }
    }
}

/// Takes a quoted text off the front: what stands between its quotes, and what follows.
fn take_quoted(text: &[u8]) -> Option<(&[u8], &[u8])> {
    let inner = text.strip_prefix(b"\"")?;
    let mut end = 0;
    loop {
        end += inner[end..].iter().position(|&b| b == b'"')?;
        // A quote that is meant stands twice.
        if inner.get(end + 1) != Some(&b'"') {
            return Some((&inner[..end], &inner[end + 1..]));
        }
        end += 2;
    }
}

/// `ends` tells of what follows the byte whether a field ends there.
fn split_at<'a>(line: &'a [u8], byte: u8, mut ends: impl FnMut(&[u8]) -> bool, fields: &mut Vec<Field<'a>>) {
    let blank = |b: u8| is_blank(b) && b != byte;
    let trim = |text: &'a [u8]| {
        let start = text.iter().position(|&b| !blank(b)).unwrap_or(text.len());
        let end = text.iter().rposition(|&b| !blank(b)).map_or(start, |last| last + 1);
        &text[start..end]
    };
    let mut rest = line;
    loop {
        let start = rest.iter().position(|&b| !blank(b)).unwrap_or(rest.len());
        let quoted = take_quoted(&rest[start..]);
        let from = quoted.map_or(0, |(_, after)| rest.len() - after.len());
        let end = (from..rest.len()).find(|&k| rest[k] == byte && ends(&rest[k + 1..]));
        let whole = &rest[..end.unwrap_or(rest.len())];
        // What follows a closing quote up to the separator belongs to no quoted field.
        let is_quoted = quoted.is_some() && trim(&whole[from..]).is_empty();
        let text = quoted.filter(|_| is_quoted).map_or_else(|| trim(whole), |(inner, _)| trim(inner));
        fields.push(Field { text, quoted: is_quoted });
        match end {
            Some(end) => rest = &rest[end + 1..],
            None => return,
        }
    }
}

fn split_at_blanks<'a>(line: &'a [u8], or_comma: bool, fields: &mut Vec<Field<'a>>) {
    let separates = |b: u8| is_blank(b) || or_comma && b == b',';
    let skip_blanks = |text: &'a [u8]| &text[text.iter().position(|&b| !is_blank(b)).unwrap_or(text.len())..];
    let mut rest = skip_blanks(line);
    while !rest.is_empty() {
        let quoted = take_quoted(rest).filter(|(_, after)| after.first().is_none_or(|&b| separates(b)));
        let (field, after) = match quoted {
            Some((text, after)) => (Field { text, quoted: true }, after),
            None => {
                let end = rest.iter().position(|&b| separates(b)).unwrap_or(rest.len());
                (Field { text: &rest[..end], quoted: false }, &rest[end..])
            }
        };
        fields.push(field);
        rest = skip_blanks(after);
        if or_comma && let Some(after) = rest.strip_prefix(b",") {
            rest = skip_blanks(after);
        }
    }
}

/// A line as it stands before its comment, and the comment behind its sign.
pub(super) struct Parted<'a> {
    pub(super) data: &'a [u8],
    pub(super) comment: Option<&'a [u8]>,
}

/// Parts a line at its comment: `#`, `//`, `%`, `!` and, unless it separates fields, `;`, at the start or after a blank.
/// Within a word, as in `1.#QNAN`, `pt#0` or `20/3`, and within quotes they open none.
pub(super) fn part_comment(line: &[u8], semicolon_separates: bool) -> Parted<'_> {
    let is_sign = |k: usize| match line[k] {
        b'#' => !opens_with_missing(&line[k..]),
        b'%' | b'!' => true,
        b'/' => line.get(k + 1) == Some(&b'/'),
        b';' => !semicolon_separates,
        _ => false,
    };
    let mut in_quotes = false;
    let mut after_blank = true;
    for (k, &byte) in line.iter().enumerate() {
        if byte == b'"' {
            in_quotes = !in_quotes;
        } else if after_blank && !in_quotes && matches!(byte, b'#' | b'/' | b'%' | b'!' | b';') && is_sign(k) {
            let signs = line[k..].iter().take_while(|b| **b == byte).count();
            return Parted { data: &line[..k], comment: Some(&line[k + signs..]) };
        }
        after_blank = is_blank(byte);
    }
    Parted { data: line, comment: None }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fields(separator: Separator, line: &str) -> Vec<String> {
        let mut fields = Vec::new();
        separator.split(line.as_bytes(), &mut fields);
        fields.iter().map(|field| String::from_utf8_lossy(field.text).into_owned()).collect()
    }

    #[test]
    fn every_separator() {
        for (separator, line, expected) in [
            (Separator::Blanks, "  0 \t1  2 ", &["0", "1", "2"][..]),
            (Separator::Blanks, "\"P 1\" 0 \"x\"y", &["P 1", "0", "\"x\"y"]),
            (Separator::BlanksOrComma, "5.0, 0.0 2.6 ,7", &["5.0", "0.0", "2.6", "7"]),
            (Separator::Byte(b','), "1, 2 ,,4,", &["1", "2", "", "4", ""]),
            (Separator::Byte(b','), "\"P, 1\", \"a \"\"b\"\", c\" ,3", &["P, 1", "a \"\"b\"\", c", "3"]),
            (Separator::Byte(b'\t'), "0\t\t 1\t", &["0", "", "1", ""]),
            (Separator::Byte(b';'), "\"open;1", &["\"open", "1"]),
            (Separator::CommaBlank, "0,5, 1,5,\t2", &["0,5", "1,5", "2"]),
            (Separator::CommaPairs, "0,5,1,5,-2,25", &["0,5", "1,5", "-2,25"]),
            (Separator::Byte(b','), "", &[""]),
            (Separator::Blanks, "", &[]),
        ] {
            assert_eq!(fields(separator, line), expected, "{separator:?} {line}");
        }
    }

    #[test]
    fn comments_open_after_a_blank_only() {
        for (line, data) in [
            ("1 2 3 # low", "1 2 3 "),
            ("// X Y Z", ""),
            ("1 2 1.#QNAN", "1 2 1.#QNAN"),
            ("1 2 pt#0 // x", "1 2 pt#0 "),
            ("1\t2\t#N/A", "1\t2\t#N/A"),
            ("\"a # b\" 1 2", "\"a # b\" 1 2"),
            ("% 1", ""),
            ("1 2 3/4", "1 2 3/4"),
        ] {
            assert_eq!(part_comment(line.as_bytes(), false).data, data.as_bytes(), "{line}");
        }
        assert_eq!(part_comment(b"; X Y Z", false).comment, Some(&b" X Y Z"[..]));
        assert_eq!(part_comment(b"## X", false).comment, Some(&b" X"[..]));
        assert!(part_comment(b"1 ; 2", true).comment.is_none());
    }
}
