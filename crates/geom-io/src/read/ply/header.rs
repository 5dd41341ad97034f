//! The header of a PLY file.

use super::super::text::{Line, Lines, parse_count};
use crate::error::ReadErrorKind;

/// How the values after the header are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// Type of a scalar.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Scalar {
    /// The type of a name, those of the format and of C, in upper or lower case. `long` is what 64-bit systems other than
    /// Windows mean by it.
    fn parse(name: &[u8]) -> Option<Self> {
        let name = name.to_ascii_lowercase();
        Some(match name.strip_suffix(b"_t").unwrap_or(&name) {
            b"char" | b"int8" | b"schar" => Self::I8,
            b"uchar" | b"uint8" => Self::U8,
            b"short" | b"int16" => Self::I16,
            b"ushort" | b"uint16" => Self::U16,
            b"int" | b"int32" => Self::I32,
            b"uint" | b"uint32" => Self::U32,
            b"long" | b"int64" | b"longlong" => Self::I64,
            b"ulong" | b"uint64" | b"ulonglong" => Self::U64,
            b"float" | b"float32" => Self::F32,
            b"double" | b"float64" => Self::F64,
            _ => return None,
        })
    }

    /// Width in bytes.
    pub(super) fn width(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Scalar(Scalar),
    List { length: Scalar, item: Scalar },
}

#[derive(Debug)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) kind: Kind,
}

/// A table of the file: `count` records, each with a value of every property.
#[derive(Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: usize,
    pub(super) properties: Vec<Property>,
}

impl Element {
    /// Whether the element has this name, in upper or lower case.
    pub(super) fn is_named(&self, name: &str) -> bool {
        self.name.eq_ignore_ascii_case(name)
    }

    /// The property that lists the corners of a face or strip.
    pub(super) fn corner_list(&self) -> Option<usize> {
        let is_list = |p: &Property| matches!(p.kind, Kind::List { .. });
        let names = ["vertex_indices", "vertex_index"];
        self.properties.iter().position(|p| is_list(p) && names.iter().any(|name| p.name.eq_ignore_ascii_case(name)))
    }

    /// Bytes of the shortest binary record.
    pub(super) fn least_width(&self) -> usize {
        let width = |p: &Property| match p.kind {
            Kind::Scalar(scalar) | Kind::List { length: scalar, .. } => scalar.width(),
        };
        self.properties.iter().map(width).sum()
    }
}

#[derive(Debug)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
}

impl Header {
    /// Takes the lines up to and with `end_header`.
    pub(super) fn parse(lines: &mut Lines<'_>) -> Result<Self, ReadErrorKind> {
        let first = lines.next_filled().ok_or(ReadErrorKind::Empty)?;
        if first.text != b"ply" {
            return Err(first.bad_header("a PLY file opens with `ply`"));
        }
        let mut last = first;
        let mut encoding = None;
        let mut elements: Vec<Element> = Vec::new();
        while let Some(line) = lines.next_filled() {
            last = line;
            let mut fields = line.fields();
            match fields.next() {
                Some(b"comment" | b"obj_info") => {}
                Some(b"format") => encoding = Some(parse_encoding(line)?),
                Some(b"element") => elements.push(parse_element(line)?),
                Some(b"property") => {
                    let element = elements.last_mut();
                    let element = element.ok_or_else(|| line.bad_header("a property needs an element before it"))?;
                    element.properties.push(parse_property(line)?);
                }
                Some(b"end_header") => {
                    let encoding = encoding.ok_or_else(|| line.bad_header("no line `format` stands before it"))?;
                    return Ok(Self { encoding, elements });
                }
                _ => return Err(line.bad_header("unknown keyword")),
            }
        }
        Err(last.bad_header("the file ends before `end_header`"))
    }
}

fn parse_encoding(line: Line<'_>) -> Result<Encoding, ReadErrorKind> {
    match line.fields().nth(1) {
        Some(b"ascii") => Ok(Encoding::Ascii),
        Some(b"binary_little_endian") => Ok(Encoding::LittleEndian),
        Some(b"binary_big_endian") => Ok(Encoding::BigEndian),
        _ => Err(line.bad_header("expected ascii, binary_little_endian or binary_big_endian")),
    }
}

fn parse_element(line: Line<'_>) -> Result<Element, ReadErrorKind> {
    let fields: Vec<_> = line.fields().skip(1).collect();
    match fields[..] {
        [name, count] if let Some(count) = parse_count(count) => {
            Ok(Element { name: String::from_utf8_lossy(name).into_owned(), count, properties: Vec::new() })
        }
        _ => Err(line.bad_header("expected the name of the element and its number of records")),
    }
}

fn parse_property(line: Line<'_>) -> Result<Property, ReadErrorKind> {
    let scalar = |name| Scalar::parse(name).ok_or_else(|| line.bad_header("unknown scalar type"));
    let fields: Vec<_> = line.fields().skip(1).collect();
    let (kind, name) = match fields[..] {
        [b"list", length, item, name] => (Kind::List { length: scalar(length)?, item: scalar(item)? }, name),
        [kind, name] => (Kind::Scalar(scalar(kind)?), name),
        _ => return Err(line.bad_header("expected the type and the name of the property")),
    };
    Ok(Property { name: String::from_utf8_lossy(name).into_owned(), kind })
}
