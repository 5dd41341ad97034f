//! Numbers as programs write them in text: decimal commas, exponents of Fortran, and the words for "no value".

use serde::Serialize;

/// Whether a byte is white space within a line.
pub(super) fn is_blank(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | 0x0b | 0x0c)
}

/// Longest number in bytes; beyond, a field is words. Twice what the longest shortest-form `f64` takes.
const LONGEST: usize = 64;

/// What stands between the whole part of a number and its fraction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Decimal {
    /// `1.5`
    #[default]
    Point,
    /// `1,5`
    Comma,
}

impl Decimal {
    fn bytes(self) -> (u8, u8) {
        match self {
            Self::Point => (b'.', b','),
            Self::Comma => (b',', b'.'),
        }
    }
}

/// How the numbers of a file are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct NumberStyle {
    pub(super) decimal: Decimal,
    /// Whether the other of point and comma may stand between groups of three digits: `1,000.00`.
    pub(super) grouped: bool,
}

/// What a field holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Value {
    /// A finite number.
    Number(f64),
    /// A number without a value, or the word of some program for a value that is not there.
    Missing,
    /// Anything else.
    Words,
}

impl NumberStyle {
    pub(super) const POINT: Self = Self { decimal: Decimal::Point, grouped: false };
    pub(super) const COMMA: Self = Self { decimal: Decimal::Comma, grouped: false };

    /// What a trimmed field holds.
    pub(super) fn value(self, field: &[u8]) -> Value {
        if self.decimal == Decimal::Point
            && let Ok(value) = fast_float2::parse(field)
        {
            return number(value);
        }
        if is_missing(field) { Value::Missing } else { self.translated(field).map_or(Value::Words, number) }
    }

    /// The number of a field that has to be rewritten before it can be parsed: `1,5`, `1.0D+02`, `1,000.5`.
    fn translated(self, field: &[u8]) -> Option<f64> {
        let (point, group) = self.decimal.bytes();
        if field.len() > LONGEST || field.contains(&group) && !(self.grouped && is_grouped(field, self.decimal)) {
            return None;
        }
        let mut text = [0; LONGEST];
        let mut length = 0;
        for &byte in field.iter().filter(|&&byte| byte != group) {
            text[length] = match byte {
                b'D' | b'd' if length > 0 => b'e',
                _ if byte == point => b'.',
                _ => byte,
            };
            length += 1;
        }
        // A comma after which nothing follows separates: `5, 0`.
        if field.ends_with(b",") {
            return None;
        }
        fast_float2::parse(&text[..length]).ok()
    }
}

fn number(value: f64) -> Value {
    if value.is_finite() { Value::Number(value) } else { Value::Missing }
}

/// Whether a number has groups of three digits in its whole part: `1,000.00`, or with a decimal comma `1.000,00`.
pub(super) fn is_grouped(field: &[u8], decimal: Decimal) -> bool {
    let (point, group) = decimal.bytes();
    let unsigned = field.strip_prefix(b"-").or(field.strip_prefix(b"+")).unwrap_or(field);
    let whole = unsigned.split(|&byte| byte == point).next().unwrap_or_default();
    let fraction = unsigned.get(whole.len() + 1..).unwrap_or_default();
    let mut groups = whole.split(|&byte| byte == group);
    let is_digits = |part: &[u8]| part.iter().all(u8::is_ascii_digit);
    let first = groups.next().unwrap_or_default();
    let mut others = groups.peekable();
    (1..=3).contains(&first.len())
        && is_digits(first)
        && others.peek().is_some()
        && others.all(|part| part.len() == 3 && is_digits(part))
        && is_digits(fraction)
}

/// Words for a value that is not there, in lower case.
const MISSING: [&[u8]; 14] = [
    b"null", b"none", b"nil", b"na", b"n/a", b"#n/a", b"#na", b"#value!", b"#div/0!", b"#num!", b"nodata", b"no data",
    b"missing", b"void",
];

/// Whether a trimmed field says that there is no value: it is empty, one of the words for that, `1.#QNAN` and the like of
/// Microsoft's C library, `nan(ind)` of others, dashes, or the asterisks of Fortran for a number too long for its field.
pub(super) fn is_missing(field: &[u8]) -> bool {
    let all = |byte: u8| field.iter().all(|&b| b == byte);
    let unsigned = field.strip_prefix(b"-").or(field.strip_prefix(b"+")).unwrap_or(field);
    let opens = |word: &[u8]| unsigned.get(..word.len()).is_some_and(|start| start.eq_ignore_ascii_case(word));
    all(b'-')
        || all(b'*')
        || opens(b"1.#") && unsigned[3..].first().is_some_and(u8::is_ascii_alphabetic)
        || opens(b"nan") && unsigned.get(3).is_none_or(|&b| b == b'(')
        || MISSING.iter().any(|word| field.eq_ignore_ascii_case(word))
}

/// Whether `text` opens with the word for a missing value that begins with the sign of a comment, `#N/A`.
pub(super) fn opens_with_missing(text: &[u8]) -> bool {
    MISSING.iter().filter(|word| word.starts_with(b"#")).any(|word| {
        text.get(..word.len()).is_some_and(|start| start.eq_ignore_ascii_case(word))
            && text.get(word.len()).is_none_or(|&b| is_blank(b) || matches!(b, b',' | b';' | b'"'))
    })
}

/// From this magnitude on a number that is declared to mean "no data" is not meant to the last digit.
///
/// Limit: programs write the largest `f32` as -3.4e38, -3.402823e+38 or -3.4028234663852886e+38, and no height is as large.
const HUGE: f64 = 1e30;

/// Whether a value is the one that a file declares to mean "no data": the same number, the same in the digits of an `f32`, in
/// which many programs keep it, or huge alike.
pub(super) fn is_declared(value: f64, declared: f64) -> bool {
    /// Limit: seven digits, those of an `f32`.
    const RELATIVE: f64 = 5e-7;
    let difference = (value - declared).abs();
    value as f32 == declared as f32 && value.is_finite()
        || difference <= RELATIVE * declared.abs()
        || declared.abs() >= HUGE && difference <= 1e-2 * declared.abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_every_spelling() {
        let grouped = |decimal| NumberStyle { decimal, grouped: true };
        for (style, text, value) in [
            (NumberStyle::POINT, "+3E-3", 3e-3),
            (NumberStyle::POINT, "1.0D+02", 100.0),
            (NumberStyle::POINT, "-2.5d-1", -0.25),
            (NumberStyle::COMMA, "-1,5", -1.5),
            (NumberStyle::COMMA, "7", 7.0),
            (NumberStyle::COMMA, "1,5D1", 15.0),
            (grouped(Decimal::Point), "-12,345,678.5", -12_345_678.5),
            (grouped(Decimal::Comma), "1.000,25", 1000.25),
        ] {
            assert_eq!(style.value(text.as_bytes()), Value::Number(value), "{text}");
        }
        for (style, text) in [
            (NumberStyle::POINT, "1,5"),
            (NumberStyle::POINT, "1,000.00"),
            (NumberStyle::COMMA, "1.5"),
            (NumberStyle::COMMA, "5,"),
            (grouped(Decimal::Point), "1,00.5"),
            (grouped(Decimal::Point), "1,0000"),
            (NumberStyle::POINT, "D2"),
            (NumberStyle::POINT, "2021-03-04"),
            (NumberStyle::POINT, "P1"),
        ] {
            assert_eq!(style.value(text.as_bytes()), Value::Words, "{text}");
        }
    }

    #[test]
    fn words_for_no_value() {
        for text in [
            "",
            "nan",
            "-NaN",
            "nan(ind)",
            "-nan(snan)",
            "inf",
            "-Infinity",
            "1e999",
            "1.#QNAN",
            "-1.#IND",
            "1.#INF00",
            "1.#J",
            "null",
            "N/A",
            "#N/A",
            "-",
            "---",
            "***",
        ] {
            assert_eq!(NumberStyle::POINT.value(text.as_bytes()), Value::Missing, "{text}");
            assert_eq!(NumberStyle::COMMA.value(text.as_bytes()), Value::Missing, "{text}");
        }
    }

    #[test]
    fn declared_values_are_compared_as_numbers() {
        let max = f64::from(f32::MAX);
        for (value, declared) in [
            (-9999.0, -9999.0),
            (-max, -3.4e38),
            (-3.4028235e38, -3.4028234663852886e38),
            (f64::from(-3.4e38_f32), -3.4e38),
            (f64::from(1.70141e38_f32), 1.70141e38),
            (-32767.001, -32767.0),
        ] {
            assert!(is_declared(value, declared), "{value} {declared}");
        }
        for (value, declared) in [(-9998.0, -9999.0), (0.0, -9999.0), (1e-9, 0.0), (max, -max), (-9999.1, -9999.0)] {
            assert!(!is_declared(value, declared), "{value} {declared}");
        }
    }
}
