//! The header of a PCD file.

use super::super::text::{Line, Lines, before_hash, parse_count, quote};
use crate::error::ReadErrorKind;

/// Fields that must be there.
const COORDINATES: [&str; 3] = ["x", "y", "z"];

/// How the values after the header are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    Binary,
    Compressed,
}

/// Type of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    Float,
    Signed,
    Unsigned,
}

/// A field of each point: `count` numbers.
#[derive(Clone, Debug)]
pub(super) struct Field {
    pub(super) name: String,
    pub(super) scalar: Scalar,
    /// Bytes of a number.
    pub(super) size: usize,
    pub(super) count: usize,
}

impl Field {
    /// Bytes of the field in a point.
    pub(super) fn width(&self) -> usize {
        self.size.saturating_mul(self.count)
    }

    /// The number that `bytes` open with, or `None` where they are too few.
    pub(super) fn number(&self, bytes: &[u8]) -> Option<f64> {
        macro_rules! decode {
            ($number:ty) => {
                bytes.first_chunk().map(|&bytes| <$number>::from_le_bytes(bytes) as f64)
            };
        }
        match (self.scalar, self.size) {
            (Scalar::Float, 4) => decode!(f32),
            (Scalar::Float, 8) => decode!(f64),
            (Scalar::Signed, 1) => decode!(i8),
            (Scalar::Signed, 2) => decode!(i16),
            (Scalar::Signed, 4) => decode!(i32),
            (Scalar::Signed, 8) => decode!(i64),
            (Scalar::Unsigned, 1) => decode!(u8),
            (Scalar::Unsigned, 2) => decode!(u16),
            (Scalar::Unsigned, 4) => decode!(u32),
            (Scalar::Unsigned, 8) => decode!(u64),
            _ => None,
        }
    }

    fn is_possible(&self) -> bool {
        let sizes: &[usize] = if self.scalar == Scalar::Float { &[4, 8] } else { &[1, 2, 4, 8] };
        sizes.contains(&self.size)
    }
}

#[derive(Debug)]
pub(super) struct Header {
    pub(super) fields: Vec<Field>,
    /// Indices of x, y and z among the fields.
    pub(super) coordinates: [usize; 3],
    /// Indices of the components of the normal.
    pub(super) normal: Option<[usize; 3]>,
    /// Points of a row, and rows.
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) points: usize,
    pub(super) encoding: Encoding,
}

impl Header {
    /// Takes the lines up to and with `DATA`.
    pub(super) fn parse(lines: &mut Lines<'_>) -> Result<Self, ReadErrorKind> {
        let mut fields: Vec<Field> = Vec::new();
        let (mut width, mut height, mut points) = (None, 1, None);
        let mut last = None;
        while let Some(line) = lines.next_data(before_hash) {
            last = Some(line);
            let values: Vec<_> = line.fields().skip(1).collect();
            let count = || match values[..] {
                [count] => parse_count(count).ok_or_else(|| line.bad_header("expected a whole number")),
                _ => Err(line.bad_header("expected one whole number")),
            };
            match line.fields().next().unwrap_or_default() {
                b"VERSION" | b"VIEWPOINT" => {}
                b"FIELDS" => {
                    let field = |name: &&[u8]| Field { name: quote(name), scalar: Scalar::Float, size: 4, count: 1 };
                    fields = values.iter().map(field).collect();
                }
                b"SIZE" => for_each(line, &mut fields, &values, |field, value| {
                    parse_count(value).map(|size| field.size = size)
                })?,
                b"COUNT" => for_each(line, &mut fields, &values, |field, value| {
                    parse_count(value).map(|count| field.count = count)
                })?,
                b"TYPE" => for_each(line, &mut fields, &values, |field, value| {
                    field.scalar = match value {
                        b"F" => Scalar::Float,
                        b"I" => Scalar::Signed,
                        b"U" => Scalar::Unsigned,
                        _ => return None,
                    };
                    Some(())
                })?,
                b"WIDTH" => width = Some(count()?),
                b"HEIGHT" => height = count()?,
                b"POINTS" => points = Some(count()?),
                b"DATA" => {
                    let encoding = match values[..] {
                        [b"ascii"] => Encoding::Ascii,
                        [b"binary"] => Encoding::Binary,
                        [b"binary_compressed"] => Encoding::Compressed,
                        _ => return Err(line.bad_header("expected ascii, binary or binary_compressed")),
                    };
                    if !fields.iter().all(Field::is_possible) {
                        return Err(line.bad_header("a number has 1, 2, 4 or 8 bytes, one of type F 4 or 8"));
                    }
                    let points = points.or_else(|| width?.checked_mul(height));
                    let points = points.ok_or(ReadErrorKind::MissingKey { key: "WIDTH or POINTS" })?;
                    let coordinates = find_coordinates(&fields)?;
                    let normal = find_normal(&fields);
                    let width = width.unwrap_or(points);
                    return Ok(Self { fields, coordinates, normal, width, height, points, encoding });
                }
                _ => return Err(line.bad_header("unknown keyword of a PCD file")),
            }
        }
        match last {
            Some(line) => Err(line.bad_header("the file ends before `DATA`")),
            None => Err(ReadErrorKind::NoPoints),
        }
    }
}

/// The sum of a size over fields; it saturates where a header announces more than there can be.
pub(super) fn total(fields: &[Field], size: impl Fn(&Field) -> usize) -> usize {
    fields.iter().fold(0, |sum, field| sum.saturating_add(size(field)))
}

/// Sets a value of each field.
fn for_each(
    line: Line<'_>,
    fields: &mut [Field],
    values: &[&[u8]],
    set: impl Fn(&mut Field, &[u8]) -> Option<()>,
) -> Result<(), ReadErrorKind> {
    if values.len() != fields.len() {
        return Err(line.bad_header("expected one value for each of the FIELDS, which stand before"));
    }
    let set = fields.iter_mut().zip(values).try_for_each(|(field, value)| set(field, value));
    set.ok_or_else(|| line.bad_header("a value is not possible"))
}

/// The fields of a normal, as the Point Cloud Library and others name them.
fn find_normal(fields: &[Field]) -> Option<[usize; 3]> {
    let find = |names: [&str; 2]| fields.iter().position(|f| names.contains(&f.name.as_str()) && f.count > 0);
    let x = find(["normal_x", "nx"])?;
    Some([x, find(["normal_y", "ny"])?, find(["normal_z", "nz"])?])
}

fn find_coordinates(fields: &[Field]) -> Result<[usize; 3], ReadErrorKind> {
    let mut coordinates = [0; 3];
    for (index, name) in coordinates.iter_mut().zip(COORDINATES) {
        let found = fields.iter().position(|field| field.name.eq_ignore_ascii_case(name) && field.count > 0);
        *index = found.ok_or_else(|| ReadErrorKind::ColumnsNotFound {
            missing: vec![name.to_owned()],
            found: fields.iter().map(|field| field.name.clone()).collect(),
        })?;
    }
    Ok(coordinates)
}
