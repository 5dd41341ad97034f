//! GeoTIFF (OGC 19-008r4): heights over a rectangle of cells, in one band.
//!
//! A cell's size and place are those of the tags for pixel scale and tie point, or of a transformation that does not turn; without
//! them cells have the size 1. GDAL's tag says which height stands for no data.

use std::fmt::Display;
use std::io::Cursor;

use tiff::ColorType;
use tiff::decoder::{ChunkType, Decoder, DecodingResult, Limits};
use tiff::tags::Tag;

use super::decoder::{self, shielded};
use super::heights::{self, Axis, Grid, NoData};
use super::number::{NumberStyle, Value};
use super::source::Budget;
use super::{Format, Scan, with_room};
use crate::error::ReadErrorKind;
use crate::model::LengthUnit;

/// Keys of the directory of geographic keys (OGC 19-008r4, annex B), and values of theirs.
const MODEL_TYPE: u16 = 1024;
const GEOGRAPHIC: u16 = 2;
const RASTER_TYPE: u16 = 1025;
const PIXEL_IS_POINT: u16 = 2;
const LINEAR_UNITS: u16 = 3076;
const METRE: u16 = 9001;
const FOOT: u16 = 9002;

type Tiff<'a> = Decoder<Cursor<&'a [u8]>>;

pub(super) fn read(bytes: &[u8], budget: &mut Budget) -> Result<Scan, ReadErrorKind> {
    shielded("GeoTIFF", || {
        // Values of tags lie in the file; what is decoded is counted. The decoder takes limits only when it has read the first directory.
        check_values(bytes)?;
        let mut limits = Limits::default();
        limits.ifd_value_size = bytes.len();
        limits.intermediate_buffer_size = budget.left();
        limits.decoding_buffer_size = budget.left();
        let mut tiff = Decoder::new(Cursor::new(bytes)).map_err(malformed)?.with_limits(limits);
        let georeference = Georeference::of(&mut tiff)?;
        let mut notes = Vec::new();
        let heights = read_heights(&mut tiff, budget, &georeference.grid, &mut notes)?;
        let mut scan = heights::scan(&heights, &georeference.grid)?;
        scan.unit = georeference.unit;
        scan.notes.extend(georeference.notes.into_iter().chain(notes));
        Ok(scan)
    })
}

/// Refuses values of the first directory that are longer than the file.
fn check_values(bytes: &[u8]) -> Result<(), ReadErrorKind> {
    // The decoder says what is wrong with a file that ends early.
    let Some(first) = Directory::of(bytes) else { return Ok(()) };
    for k in 0..first.entries {
        let Some((tag, size)) = first.entry(bytes, k) else { return Ok(()) };
        if size > bytes.len() as u64 {
            return Err(malformed(format!("tag {tag} says that it has {size} bytes, more than the file")));
        }
    }
    Ok(())
}

/// The first directory of a file of either kind: TIFF, whose numbers have up to four bytes, or BigTIFF with eight.
struct Directory {
    is_little: bool,
    is_big: bool,
    /// Where its entries begin, and how many there are.
    begin: u64,
    entries: u64,
}

impl Directory {
    /// `None` if the file ends before, or is no TIFF.
    fn of(bytes: &[u8]) -> Option<Self> {
        let is_little = bytes.starts_with(b"II");
        let is_big = number(bytes, is_little, 2, 2)? == 43;
        let at = if is_big { number(bytes, is_little, 8, 8)? } else { number(bytes, is_little, 4, 4)? };
        let length = if is_big { 8 } else { 2 };
        Some(Self { is_little, is_big, begin: at.checked_add(length)?, entries: number(bytes, is_little, at, length)? })
    }

    /// The tag of an entry and the bytes that its values take.
    fn entry(&self, bytes: &[u8], k: u64) -> Option<(u64, u64)> {
        let (length, of_count) = if self.is_big { (20, 8) } else { (12, 4) };
        let at = self.begin.checked_add(k.checked_mul(length)?)?;
        let number = |offset, length| number(bytes, self.is_little, at.checked_add(offset)?, length);
        // The types of TIFF 6.0 and BigTIFF, from 1 on: bytes, text, short and long numbers, fractions and so on.
        const SIZES: [u64; 19] = [1, 1, 1, 2, 4, 8, 1, 1, 2, 4, 8, 4, 8, 4, 1, 1, 8, 8, 8];
        let size = (number(2, 2)? as usize).checked_sub(1).and_then(|kind| SIZES.get(kind)).unwrap_or(&1);
        Some((number(0, 2)?, number(4, of_count)?.saturating_mul(*size)))
    }
}

/// An unsigned number of some bytes.
fn number(bytes: &[u8], is_little: bool, at: u64, length: u64) -> Option<u64> {
    let begin = usize::try_from(at).ok()?;
    let digits = bytes.get(begin..begin.checked_add(length as usize)?)?;
    let joined = |value: u64, &digit: &u8| value << 8 | u64::from(digit);
    Some(if is_little { digits.iter().rev().fold(0, joined) } else { digits.iter().fold(0, joined) })
}

fn malformed(reason: impl Display) -> ReadErrorKind {
    decoder::malformed("GeoTIFF", reason)
}

/// Where the cells are, and what their heights mean.
struct Georeference {
    grid: Grid,
    unit: Option<LengthUnit>,
    notes: Vec<String>,
}

impl Georeference {
    fn of(tiff: &mut Tiff<'_>) -> Result<Self, ReadErrorKind> {
        let (columns, rows) = tiff.dimensions().map_err(malformed)?;
        let counts = [columns as usize, rows as usize];
        let keys = numbers(tiff, Tag::GeoKeyDirectoryTag)?;
        // Four numbers a key, the first four are a header; of keys whose value stands there the second is 0.
        let key = |key: u16| {
            let entries = keys.as_chunks::<4>().0.iter().skip(1);
            entries.filter(|entry| entry[0] == f64::from(key) && entry[1] == 0.0).map(|entry| entry[3]).next()
        };
        let is = |number: u16, value: u16| key(number) == Some(f64::from(value));
        let mut notes = Vec::new();
        let [x, y] = match affine(tiff)? {
            Some(axes) => axes,
            None => {
                notes.push("the file does not say where its cells are: they were taken to have the size 1".to_owned());
                [(0.0, 1.0), (rows.into(), -1.0)]
            }
        };
        if is(MODEL_TYPE, GEOGRAPHIC) {
            notes.push(
                "x and y are degrees, and the heights are not: project the file to lengths before it is fitted"
                    .to_owned(),
            );
        }
        let shift = if is(RASTER_TYPE, PIXEL_IS_POINT) { 0.0 } else { 0.5 };
        let is_up = x.1 > 0.0 && y.1 != 0.0 && [x, y].iter().all(|(at, step)| at.is_finite() && step.is_finite());
        if !is_up {
            return Err(malformed(format!("cells of the size {} × {} have no place in a grid", x.1, y.1.abs())));
        }
        let from_north = y.1 < 0.0;
        // The southern row is the last one, then: its outer side is the origin, or its centres are.
        let far = if shift > 0.0 { rows } else { rows.saturating_sub(1) };
        let south = if from_north { y.0 + y.1 * f64::from(far) } else { y.0 };
        let grid = Grid {
            format: Format::GeoTiff,
            x: Axis { origin: x.0, step: x.1, shift, count: counts[0] },
            y: Axis { origin: south, step: y.1.abs(), shift, count: counts[1] },
            from_north,
            no_data: no_data(tiff)?,
        };
        grid.check()?;
        let unit = match () {
            () if is(LINEAR_UNITS, METRE) => Some(LengthUnit::Metre),
            () if is(LINEAR_UNITS, FOOT) => Some(LengthUnit::Foot),
            () => None,
        };
        Ok(Self { grid, unit, notes })
    }
}

/// The numbers of a tag; none where it is not there.
fn numbers(tiff: &mut Tiff<'_>, tag: Tag) -> Result<Vec<f64>, ReadErrorKind> {
    match tiff.find_tag(tag).map_err(malformed)? {
        None => Ok(Vec::new()),
        Some(value) if tag == Tag::GeoKeyDirectoryTag => {
            Ok(value.into_u16_vec().map_err(malformed)?.into_iter().map(f64::from).collect())
        }
        Some(value) => value.into_f64_vec().map_err(malformed),
    }
}

/// Where the grid begins and the step to the next cell, along columns and along rows; `None` where the file does not say.
fn affine(tiff: &mut Tiff<'_>) -> Result<Option<[(f64, f64); 2]>, ReadErrorKind> {
    let (scale, tie) = (numbers(tiff, Tag::ModelPixelScaleTag)?, numbers(tiff, Tag::ModelTiepointTag)?);
    if let (&[width, height, ..], &[i, j, _, x, y, ..]) = (&scale[..], &tie[..]) {
        return Ok(Some([(x - i * width, width), (y + j * height, -height)]));
    }
    match numbers(tiff, Tag::ModelTransformationTag)?[..] {
        [a, b, _, x, c, d, _, y, ..] if b == 0.0 && c == 0.0 => Ok(Some([(x, a), (y, d)])),
        [_, _, _, _, _, _, _, _, ..] => Err(malformed("the grid is turned; resample it along x and y")),
        _ => Ok(None),
    }
}

/// The mark of no data, as GDAL writes it.
fn no_data(tiff: &mut Tiff<'_>) -> Result<NoData, ReadErrorKind> {
    let Some(value) = tiff.find_tag(Tag::GdalNodata).map_err(malformed)? else { return Ok(NoData::None) };
    let text = value.into_string().map_err(malformed)?;
    Ok(match NumberStyle::POINT.value(text.trim_matches(['\0', ' ']).as_bytes()) {
        Value::Number(number) => NoData::Number(number),
        Value::Missing | Value::Words => NoData::None,
    })
}

/// All heights, row by row as in the file.
fn read_heights(
    tiff: &mut Tiff<'_>,
    budget: &mut Budget,
    grid: &Grid,
    notes: &mut Vec<String>,
) -> Result<Vec<f64>, ReadErrorKind> {
    let (columns, rows) = (grid.x.count, grid.y.count);
    let (bits, bands) = match tiff.colortype().map_err(malformed)? {
        ColorType::Gray(bits) => (bits, 1),
        ColorType::Multiband { bit_depth, num_samples } => (bit_depth, usize::from(num_samples).max(1)),
        other => return Err(malformed(format!("it is a picture ({other:?}), no grid of heights"))),
    };
    if bands > 1 {
        notes.push(format!("of {bands} bands the first was read"));
    }
    let (chunk_columns, chunk_rows) = tiff.chunk_dimensions();
    let (chunk_columns, chunk_rows) = (chunk_columns.max(1) as usize, chunk_rows.max(1) as usize);
    let across = match tiff.get_chunk_type() {
        ChunkType::Strip => 1,
        ChunkType::Tile => columns.div_ceil(chunk_columns),
    };
    let mut heights = Vec::new();
    // A band of chunks is there before room is made for the next: what the header announces may not be.
    for band in 0..rows.div_ceil(chunk_rows) {
        let first_row = band * chunk_rows;
        let here = chunk_rows.min(rows - first_row);
        budget.spend((here * columns).saturating_mul(bands * usize::from(bits).div_ceil(8)))?;
        let mut values: Vec<f64> = with_room(here * columns)?;
        values.resize(here * columns, f64::NAN);
        for k in 0..across {
            let chunk = u32::try_from(band * across + k).map_err(|_| malformed("it has too many chunks"))?;
            let width = chunk_columns.min(columns - k * chunk_columns);
            let decoded = as_numbers(tiff.read_chunk(chunk).map_err(malformed)?)?;
            // Bands that lie apart have chunks of their own.
            let stride = if decoded.len() == here * width { 1 } else { bands };
            if decoded.len() != here * width * stride {
                return Err(malformed(format!("values of {bits} bits cannot be read")));
            }
            for (row, line) in decoded.chunks_exact(width * stride).enumerate() {
                let target = &mut values[row * columns + k * chunk_columns..][..width];
                for (height, value) in target.iter_mut().zip(line.iter().step_by(stride)) {
                    *height = grid.height(*value);
                }
            }
        }
        heights.try_reserve(values.len()).map_err(|_| ReadErrorKind::Memory { bytes: 8 * values.len() })?;
        heights.append(&mut values);
    }
    Ok(heights)
}

fn as_numbers(decoded: DecodingResult) -> Result<Vec<f64>, ReadErrorKind> {
    fn all<T: Copy>(values: &[T], number: impl Fn(T) -> f64) -> Result<Vec<f64>, ReadErrorKind> {
        let mut numbers = with_room(values.len())?;
        numbers.extend(values.iter().map(|&value| number(value)));
        Ok(numbers)
    }
    match decoded {
        DecodingResult::U8(values) => all(&values, f64::from),
        DecodingResult::U16(values) => all(&values, f64::from),
        DecodingResult::U32(values) => all(&values, f64::from),
        DecodingResult::U64(values) => all(&values, |value| value as f64),
        DecodingResult::I8(values) => all(&values, f64::from),
        DecodingResult::I16(values) => all(&values, f64::from),
        DecodingResult::I32(values) => all(&values, f64::from),
        DecodingResult::I64(values) => all(&values, |value| value as f64),
        DecodingResult::F32(values) => all(&values, f64::from),
        DecodingResult::F64(values) => Ok(values),
        _ => Err(malformed("values of half precision cannot be read")),
    }
}
