//! The records after the header of a PLY file.

use super::super::text::{Fields, Line, Lines, parse_number};
use super::header::{Element, Encoding, Kind, Scalar};
use crate::error::{Location, ReadErrorKind};

/// Shortest line of a record, a digit and the line's end.
const SHORTEST_LINE: usize = 2;

pub(super) enum Body<'a> {
    Ascii(Lines<'a>),
    Binary(Binary<'a>),
}

/// A record's place, made a [`Location`] only where an error needs one.
pub(super) struct Place<'a> {
    element: &'a Element,
    index: usize,
    line: Option<usize>,
}

impl Place<'_> {
    pub(super) fn location(&self) -> Location {
        match self.line {
            Some(line) => Location::Line(line),
            None => Location::Record { element: self.element.name.clone(), index: self.index },
        }
    }
}

impl<'a> Body<'a> {
    /// The body follows the lines of the header.
    pub(super) fn new(lines: Lines<'a>, encoding: Encoding) -> Self {
        match encoding {
            Encoding::Ascii => Self::Ascii(lines),
            _ => Self::Binary(Binary { rest: lines.rest(), big_endian: encoding == Encoding::BigEndian }),
        }
    }

    /// How many records of an element there can be: its count, unless the file is too short for it.
    pub(super) fn at_most(&self, element: &Element) -> usize {
        let room = match self {
            Self::Ascii(lines) => lines.rest().len() / SHORTEST_LINE + 1,
            Self::Binary(binary) => binary.rest.len() / element.least_width().max(1),
        };
        room.min(element.count)
    }

    /// Bytes that no record has taken; blanks at the end of a text do not count.
    pub(super) fn bytes_left(&self) -> usize {
        match self {
            Self::Ascii(lines) => lines.rest().trim_ascii().len(),
            Self::Binary(binary) => binary.rest.len(),
        }
    }

    /// Reads all records of an element and hands the values of the wanted properties (indices in rising order;
    /// of a list its items) to `each`.
    pub(super) fn for_each(
        &mut self,
        element: &Element,
        wanted: &[usize],
        mut each: impl FnMut(&[f64], Place<'_>) -> Result<(), ReadErrorKind>,
    ) -> Result<(), ReadErrorKind> {
        // Records without values take no room in the file, however many are announced.
        if element.properties.is_empty() {
            return Ok(());
        }
        let is_wanted: Vec<_> = (0..element.properties.len()).map(|k| wanted.contains(&k)).collect();
        let mut values = Vec::new();
        // Some programs write one value a line.
        if let Self::Ascii(lines) = self
            && lines.clone().next_filled().is_some_and(|line| is_one_of_several(line, element))
        {
            return read_values(lines, element, &is_wanted, each);
        }
        for index in 0..element.count {
            values.clear();
            let truncated =
                || ReadErrorKind::Truncated { element: element.name.clone(), expected: element.count, found: index };
            let line = match self {
                Self::Ascii(lines) => {
                    let line = lines.next_filled().ok_or_else(truncated)?;
                    read_line(line, element, &is_wanted, &mut values)?;
                    Some(line.number)
                }
                Self::Binary(binary) => {
                    binary.read(element, index, &is_wanted, &mut values)?.ok_or_else(truncated)?;
                    None
                }
            };
            each(&values, Place { element, index, line })?;
        }
        Ok(())
    }
}

/// Length of a list, if `length` is one.
fn list_length(length: f64) -> Option<usize> {
    (length >= 0.0 && length.fract() == 0.0).then_some(length as usize)
}

fn read_line(
    line: Line<'_>,
    element: &Element,
    is_wanted: &[bool],
    values: &mut Vec<f64>,
) -> Result<(), ReadErrorKind> {
    let mut row = Row { line, fields: line.fields(), taken: 0, expected: element.properties.len() };
    for (property, &wanted) in element.properties.iter().zip(is_wanted) {
        let count = match property.kind {
            Kind::Scalar(_) => 1,
            Kind::List { .. } => {
                let length = line.number(row.next()?)?;
                let count = list_length(length)
                    .ok_or_else(|| ReadErrorKind::ListLength { location: line.location(), length })?;
                row.expected = row.expected.saturating_add(count);
                count
            }
        };
        for _ in 0..count {
            let field = row.next()?;
            if wanted {
                values.push(line.number(field)?);
            }
        }
    }
    match row.fields.count() {
        0 => Ok(()),
        surplus => Err(line.row_length(row.expected, row.taken + surplus)),
    }
}

/// Whether the first line of an element holds one value where its records have more.
fn is_one_of_several(line: Line<'_>, element: &Element) -> bool {
    let is_longer = || match element.properties[0].kind {
        Kind::Scalar(_) => element.properties.len() > 1,
        Kind::List { .. } => element.properties.len() > 1 || parse_number(line.text).is_some_and(|length| length > 0.0),
    };
    line.fields().count() == 1 && is_longer()
}

/// Reads the records of an element whose values stand on lines of their own.
fn read_values(
    lines: &mut Lines<'_>,
    element: &Element,
    is_wanted: &[bool],
    mut each: impl FnMut(&[f64], Place<'_>) -> Result<(), ReadErrorKind>,
) -> Result<(), ReadErrorKind> {
    let mut values = Vec::new();
    for index in 0..element.count {
        values.clear();
        let mut last = None;
        let mut next = || -> Result<f64, ReadErrorKind> {
            let line = lines.next_filled().ok_or_else(|| ReadErrorKind::Truncated {
                element: element.name.clone(),
                expected: element.count,
                found: index,
            })?;
            last = Some(line);
            match line.fields().count() {
                1 => line.number(line.text),
                found => Err(line.row_length(1, found)),
            }
        };
        for (property, &wanted) in element.properties.iter().zip(is_wanted) {
            let count = match property.kind {
                Kind::Scalar(_) => 1,
                Kind::List { .. } => {
                    let length = next()?;
                    let location = || Location::Record { element: element.name.clone(), index };
                    list_length(length).ok_or_else(|| ReadErrorKind::ListLength { location: location(), length })?
                }
            };
            for _ in 0..count {
                let value = next()?;
                if wanted {
                    values.push(value);
                }
            }
        }
        each(&values, Place { element, index, line: last.map(|line| line.number) })?;
    }
    Ok(())
}

/// The fields of a line, counted.
struct Row<'a> {
    line: Line<'a>,
    fields: Fields<'a>,
    taken: usize,
    expected: usize,
}

impl<'a> Row<'a> {
    fn next(&mut self) -> Result<&'a [u8], ReadErrorKind> {
        let field = self.fields.next().ok_or_else(|| self.line.row_length(self.expected, self.taken))?;
        self.taken += 1;
        Ok(field)
    }
}

pub(super) struct Binary<'a> {
    rest: &'a [u8],
    big_endian: bool,
}

impl Binary<'_> {
    /// One record, or `None` where the bytes end before it does.
    fn read(
        &mut self,
        element: &Element,
        index: usize,
        is_wanted: &[bool],
        values: &mut Vec<f64>,
    ) -> Result<Option<()>, ReadErrorKind> {
        for (property, &wanted) in element.properties.iter().zip(is_wanted) {
            let (count, item) = match property.kind {
                Kind::Scalar(scalar) => (1, scalar),
                Kind::List { length, item } => {
                    let Some(length) = self.scalar(length) else { return Ok(None) };
                    let count = list_length(length).ok_or_else(|| ReadErrorKind::ListLength {
                        location: Location::Record { element: element.name.clone(), index },
                        length,
                    })?;
                    (count, item)
                }
            };
            let width = count.saturating_mul(item.width());
            if width > self.rest.len() {
                return Ok(None);
            }
            if wanted {
                values.extend((0..count).map_while(|_| self.scalar(item)));
            } else {
                self.rest = &self.rest[width..];
            }
        }
        Ok(Some(()))
    }

    /// One scalar. All types but those of 64 bits are exact in `f64`; coordinates and indices of these are, up to 2⁵³.
    fn scalar(&mut self, kind: Scalar) -> Option<f64> {
        macro_rules! decode {
            ($number:ty) => {{
                let (bytes, rest) = self.rest.split_first_chunk()?;
                self.rest = rest;
                (match self.big_endian {
                    true => <$number>::from_be_bytes(*bytes),
                    false => <$number>::from_le_bytes(*bytes),
                }) as f64
            }};
        }
        Some(match kind {
            Scalar::I8 => decode!(i8),
            Scalar::U8 => decode!(u8),
            Scalar::I16 => decode!(i16),
            Scalar::U16 => decode!(u16),
            Scalar::I32 => decode!(i32),
            Scalar::U32 => decode!(u32),
            Scalar::I64 => decode!(i64),
            Scalar::U64 => decode!(u64),
            Scalar::F32 => decode!(f32),
            Scalar::F64 => decode!(f64),
        })
    }
}
