//! ASPRS LAS, and LAZ, its compressed form: scaled coordinates and classes.

mod laz;

use std::collections::BTreeMap;
use std::io::{Cursor, ErrorKind};

use las::crs::GeoTiffData;
use las::{Header, PointData, Reader};

use super::decoder::{malformed, shielded};
use super::source::Budget;
use super::{Format, Scan, rows};
use crate::error::ReadErrorKind;
use crate::model::LengthUnit;

const NAME: &str = "LAS";

/// Limit: bytes and points decoded at a time. They bound the memory reserved for an announced number of points, and for points
/// of an announced length.
const BATCH_BYTES: usize = 1 << 20;
const BATCH_POINTS: usize = 1 << 16;

/// Where the minor version stands, the place, format and length of the points, and from version 1.4 on the place and number of
/// extended records (LAS 1.4 R15, table 3).
const MINOR_VERSION: usize = 25;
const POINT_OFFSET: usize = 96;
const POINT_FORMAT: usize = 104;
const RECORD_LENGTH: usize = 105;
const EXTENDED_RECORDS: std::ops::Range<usize> = 235..247;

/// Bits of the point format that stand for compression.
const IS_COMPRESSED: u8 = 0xc0;

/// Bytes of the smallest point record.
const LEAST_RECORD: usize = 20;

/// Key of the unit of lengths among those of GeoTIFF, and its values (EPSG).
const LINEAR_UNITS: u16 = 3076;
const METRE: u16 = 9001;
const FEET: std::ops::RangeInclusive<u16> = 9002..=9003;

/// Reads the points of the given classes, all where none are given. Points marked as withheld are left out, as the
/// standard asks. Of compressed points the records are what they expand to.
pub(super) fn read(bytes: &[u8], classes: &[u8], budget: &mut Budget) -> Result<Scan, ReadErrorKind> {
    let mut bytes = bytes.to_vec();
    drop_extended_records(&mut bytes);
    let is_compressed = bytes.get(POINT_FORMAT).is_some_and(|format| format & IS_COMPRESSED != 0);
    if is_compressed {
        laz::check(&bytes, announced_chunks(&bytes))?;
    }
    let record = number(&bytes, RECORD_LENGTH).map_or(0, u16::from_le_bytes).max(1);
    let batch = (BATCH_BYTES / usize::from(record)).clamp(1, BATCH_POINTS) as u64;
    let (picked, unit) = shielded(NAME, || {
        let mut reader = Reader::new(Cursor::new(bytes)).map_err(|error| malformed(NAME, error))?;
        let unit = unit(reader.header());
        let count = reader.header().number_of_points();
        let mut picked = Picked::default();
        let mut done = 0;
        while done < count {
            let batch = reader.read_points(batch.min(count - done)).map_err(|error| match error {
                las::Error::Io(io) if io.kind() == ErrorKind::UnexpectedEof => cut_off(count),
                other => malformed(NAME, other),
            })?;
            // A reader at the end gives what it has.
            if batch.is_empty() {
                return Err(cut_off(count));
            }
            if is_compressed {
                budget.spend(batch.raw_bytes().len())?;
            }
            picked.add(&batch, classes, done as usize);
            done += batch.len() as u64;
        }
        Ok((picked, unit))
    })?;
    let found: Vec<_> = picked.classes.into_iter().collect();
    if picked.coordinates.is_empty() && !found.is_empty() {
        return Err(ReadErrorKind::NoPointsOfClass { wanted: classes.to_vec(), found });
    }
    let mut scan = Scan::new(Format::Las, rows(picked.coordinates, 3));
    (scan.rows, scan.unit) = (picked.rows, unit);
    if picked.withheld > 0 {
        scan.notes.push(format!("{} points are marked as withheld and were left out", picked.withheld));
    }
    if classes.is_empty() && found.len() > 1 {
        let list: Vec<_> = found.iter().map(|(class, points)| format!("{class} ({points} points)")).collect();
        scan.notes.push(format!("points of all classes were read: {}; --class picks some", list.join(", ")));
    }
    Ok(scan)
}

/// Points that were picked, and what there was.
#[derive(Default)]
struct Picked {
    coordinates: Vec<f64>,
    rows: Vec<u32>,
    /// Points of each class that are not withheld.
    classes: BTreeMap<u8, usize>,
    withheld: usize,
}

impl Picked {
    fn add(&mut self, batch: &PointData, classes: &[u8], first: usize) {
        // The mark stands among the class's bits in the older point formats, in a byte of its own in the newer ones.
        let (byte, bit) = if batch.format().is_extended { (15, 1 << 2) } else { (15, 1 << 7) };
        let records = batch.raw_bytes().chunks_exact(batch.record_len().max(LEAST_RECORD));
        let xyz = batch.x().zip(batch.y()).zip(batch.z());
        for (k, ((record, class), ((x, y), z))) in records.zip(batch.classification()).zip(xyz).enumerate() {
            if record[byte] & bit != 0 {
                self.withheld += 1;
                continue;
            }
            *self.classes.entry(class).or_default() += 1;
            if !classes.is_empty() && !classes.contains(&class) {
                continue;
            }
            self.coordinates.extend([x, y, z]);
            self.rows.push((first + k) as u32);
        }
    }
}

/// Extended records hold nothing that is needed, and their lengths are reserved before they are checked.
fn drop_extended_records(bytes: &mut [u8]) {
    if bytes.get(MINOR_VERSION).is_some_and(|&minor| minor >= 4)
        && let Some(records) = bytes.get_mut(EXTENDED_RECORDS)
    {
        records.fill(0);
    }
}

/// The number of chunks that the table of a LAZ file announces, for which room is reserved before it is checked.
fn announced_chunks(bytes: &[u8]) -> Option<u32> {
    // The table's place stands before the points, or, where that could not be written, at the end.
    let points = number(bytes, POINT_OFFSET).map(u32::from_le_bytes).unwrap_or_default() as usize;
    let places = [points, bytes.len().saturating_sub(8)].into_iter();
    let tables = places.filter_map(|place| usize::try_from(i64::from_le_bytes(number(bytes, place)?)).ok());
    let table = tables.into_iter().find(|&table| table > points)?;
    number(bytes, table.checked_add(4)?).map(u32::from_le_bytes)
}

fn cut_off(count: u64) -> ReadErrorKind {
    ReadErrorKind::Malformed { format: NAME, reason: format!("they end before the {count} points of the header") }
}

/// The bytes of a number in the file.
fn number<const N: usize>(bytes: &[u8], start: usize) -> Option<[u8; N]> {
    bytes.get(start..)?.first_chunk().copied()
}

/// The unit of the coordinate system, where there is one with lengths: from the keys of GeoTIFF, or from well-known text, where
/// the unit of lengths is the last one (units of angles stand within the geographic system).
fn unit(header: &Header) -> Option<LengthUnit> {
    if let Some(text) = header.get_wkt_crs_bytes() {
        let text = String::from_utf8_lossy(text).to_ascii_lowercase();
        let (_, name) = text.rsplit_once("unit[\"")?;
        return match name.split('"').next()? {
            "metre" | "meter" | "m" => Some(LengthUnit::Metre),
            name if name.contains("foot") || name.contains("feet") || name == "ft" => Some(LengthUnit::Foot),
            _ => None,
        };
    }
    let keys = header.get_geotiff_crs().ok()??;
    let unit = keys.entries.iter().find(|key| key.id == LINEAR_UNITS)?;
    match unit.data {
        GeoTiffData::U16(METRE) => Some(LengthUnit::Metre),
        GeoTiffData::U16(unit) if FEET.contains(&unit) => Some(LengthUnit::Foot),
        _ => None,
    }
}
