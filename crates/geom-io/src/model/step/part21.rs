//! The exchange structure of ISO 10303-21: numbered entities, reals, strings and lists.

use std::fmt::Write as _;
use std::io::{self, Write};

/// The name `#n` of an entity in its file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Id(u64);

impl std::fmt::Display for Id {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "#{}", self.0)
    }
}

/// Items on one line of a list. Readers take lines of any length; people, and tools that compare files, do not.
const ITEMS_PER_LINE: usize = 10;

/// Numbers entities in the order in which they are written.
pub(super) struct Part21<'a> {
    out: &'a mut dyn Write,
    last: u64,
}

impl<'a> Part21<'a> {
    pub(super) fn new(out: &'a mut dyn Write) -> Self {
        Self { out, last: 0 }
    }

    /// Writes an entity, as in `#7=CARTESIAN_POINT('',(0.,0.,0.));`.
    pub(super) fn entity(&mut self, text: std::fmt::Arguments<'_>) -> io::Result<Id> {
        self.last += 1;
        writeln!(self.out, "#{}={text};", self.last)?;
        Ok(Id(self.last))
    }

    pub(super) fn point(&mut self, point: &[f64; 3]) -> io::Result<Id> {
        self.entity(format_args!("CARTESIAN_POINT('',{})", reals(point)))
    }

    /// Anything that is no entity.
    pub(super) fn line(&mut self, text: &str) -> io::Result<()> {
        writeln!(self.out, "{text}")
    }
}

/// A real: the shortest digits that read back to the same bits, with the point that the standard asks for.
pub(super) fn real(value: f64) -> String {
    let text = format!("{value:?}");
    match text.split_once('e') {
        Some((mantissa, exponent)) if mantissa.contains('.') => format!("{mantissa}E{exponent}"),
        Some((mantissa, exponent)) => format!("{mantissa}.E{exponent}"),
        None => text,
    }
}

pub(super) fn reals(values: &[f64]) -> String {
    list(values.iter().map(|&value| real(value)))
}

/// A list in parentheses.
pub(super) fn list<T: std::fmt::Display>(items: impl IntoIterator<Item = T>) -> String {
    let mut text = "(".to_owned();
    for (i, item) in items.into_iter().enumerate() {
        if i > 0 {
            text.push(',');
            if i % ITEMS_PER_LINE == 0 {
                text.push('\n');
            }
        }
        // Writing to a string cannot fail.
        let _ = write!(text, "{item}");
    }
    text.push(')');
    text
}

/// A string in quotes. Quotes and backslashes are doubled; what is not printable ASCII becomes `\X2\` (four hexadecimal
/// digits a character) or `\X4\` (eight).
pub(super) fn string(text: &str) -> String {
    let mut quoted = "'".to_owned();
    for character in text.chars() {
        let _ = match character {
            '\'' => quoted.write_str("''"),
            '\\' => quoted.write_str("\\\\"),
            ' '..='~' => quoted.write_char(character),
            '\0'..='\u{ffff}' => write!(quoted, "\\X2\\{:04X}\\X0\\", u32::from(character)),
            _ => write!(quoted, "\\X4\\{:08X}\\X0\\", u32::from(character)),
        };
    }
    quoted.push('\'');
    quoted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reals_have_a_point_and_read_back() {
        for value in [0.0, -0.0, 1.0, 0.1, -1e-7, 1.5e-12, 1e300, f64::MIN_POSITIVE, 5e-324, 123_456_789.123_456_79] {
            let text = real(value);
            assert!(text.contains('.') && !text.contains('e'), "{text}");
            assert_eq!(text.parse::<f64>().unwrap().to_bits(), value.to_bits());
        }
        assert_eq!(real(1e-7), "1.E-7");
    }

    #[test]
    fn strings_are_printable_ascii() {
        assert_eq!(string("O'Neil\\"), "'O''Neil\\\\'");
        assert_eq!(string("Tür\n"), "'T\\X2\\00FC\\X0\\r\\X2\\000A\\X0\\'");
        assert_eq!(string("🜁"), "'\\X4\\0001F701\\X0\\'");
    }
}
