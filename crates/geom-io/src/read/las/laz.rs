//! What a LAZ file makes its decoder reserve, checked before.
//!
//! The decoder trusts the sizes in the file: of a point, of its extra bytes, and in the newer formats of each layer of a
//! chunk (LAZ specification 1.4 R1). It also makes all its models of probabilities anew for each chunk.

use std::io::Cursor;

use laz::LazVlr;
use laz::laszip::ChunkTable;

use super::super::decoder::shielded;
use super::{NAME, POINT_OFFSET, RECORD_LENGTH, number};
use crate::error::ReadErrorKind;

/// Where the version stands, two bytes.
const VERSION: usize = 24;
/// Where the lengths of the file's header and the number of variable length records stand.
const HEADER_LENGTH: usize = 94;
const RECORD_COUNT: usize = 100;

/// Bytes of the header of a variable length record; in it where the user, the number and the length stand.
const RECORD_HEADER: usize = 54;
const RECORD_USER: std::ops::Range<usize> = 2..18;
const RECORD_NUMBER: usize = 18;
const RECORD_DATA_LENGTH: usize = 20;

/// The user and the number of the record that describes the compression.
const USER: &[u8] = b"laszip encoded\0";
const RECORD_ID: u16 = 22204;

/// Where in that record the compressor stands, the number of points of a chunk, and the items of a point; bytes of an item.
const COMPRESSOR: usize = 0;
const CHUNK_POINTS: usize = 12;
const ITEM_COUNT: usize = 32;
const ITEMS: usize = 34;
const ITEM: usize = 6;

/// The compressor of one chunk with all points.
const ONE_CHUNK: u16 = 1;

/// The version of items from which on they are compressed in layers.
const LAYERED_VERSION: u16 = 3;

/// The number of points of a chunk where the table tells it.
const VARIABLE: u32 = u32::MAX;

/// Limit: extra bytes of a point. The decoder keeps up to 16 kB for each. Programs write fewer than 100.
const MAX_EXTRA_BYTES: usize = 1024;

/// Limit: bytes that the chunks of a file have on the average, beyond the first few. To begin a chunk takes the decoder as long as
/// a thousand points, whose tables of probabilities it makes anew: those of every so many extra bytes take as long as those of all
/// else. Programs write 50 000 points a chunk, trees of points some thousand.
const LEAST_CHUNK: u64 = 1000;
const FEW_CHUNKS: u64 = 100;
const EXTRA_BYTES_AS_ALL_ELSE: u64 = 16;

/// What the file says of the compression.
struct Compression<'a> {
    /// The record.
    data: &'a [u8],
    compressor: u16,
    is_layered: bool,
    chunk_points: u32,
    /// Bytes of a point.
    width: usize,
    /// Those of them that are extra bytes.
    extra: usize,
    /// Layers of a chunk.
    layers: usize,
}

/// Checks that the sizes in a compressed file are possible; `table` is the number of chunks that its table announces.
///
/// # Errors
/// [`ReadErrorKind::Malformed`].
pub(super) fn check(bytes: &[u8], table: Option<u32>) -> Result<(), ReadErrorKind> {
    // What is missing the decoder complains about.
    let Some(compression) = describe(bytes) else { return Ok(()) };
    let record = number(bytes, RECORD_LENGTH).map_or(0, u16::from_le_bytes);
    if compression.width != usize::from(record) {
        return Err(damaged(format!(
            "a point has {record} bytes in the header and {} in the description of the compression",
            compression.width
        )));
    }
    if compression.extra > MAX_EXTRA_BYTES {
        return Err(damaged(format!(
            "{} extra bytes a point; up to {MAX_EXTRA_BYTES} are possible",
            compression.extra
        )));
    }
    compression.check_count(table.unwrap_or(0).into(), bytes)?;
    let points = point_count(bytes);
    if compression.chunk_points != VARIABLE && compression.compressor != ONE_CHUNK {
        compression.check_count(points / u64::from(compression.chunk_points.max(1)), bytes)?;
    }
    if compression.is_layered { compression.check_layers(bytes, points) } else { Ok(()) }
}

/// The record that describes the compression; `None` where there is none, or it is cut off.
fn describe(bytes: &[u8]) -> Option<Compression<'_>> {
    let header = usize::from(u16::from_le_bytes(number(bytes, HEADER_LENGTH)?));
    // The decoder reads the header of the version also where the file says that it is shorter.
    let least = match number(bytes, VERSION)? {
        [1, 3] => 235,
        version if version <= [1, 2] => 227,
        _ => 375,
    };
    let mut rest = bytes.get(header.max(least)..)?;
    for _ in 0..u32::from_le_bytes(number(bytes, RECORD_COUNT)?) {
        let end = RECORD_HEADER + usize::from(u16::from_le_bytes(number(rest, RECORD_DATA_LENGTH)?));
        let record = rest.get(..end)?;
        if record[RECORD_USER].starts_with(USER) && number(record, RECORD_NUMBER) == Some(RECORD_ID.to_le_bytes()) {
            return of_record(&record[RECORD_HEADER..]);
        }
        rest = &rest[end..];
    }
    None
}

fn of_record(data: &[u8]) -> Option<Compression<'_>> {
    let word = |at| number(data, at).map(u16::from_le_bytes);
    let chunk_points = u32::from_le_bytes(number(data, CHUNK_POINTS)?);
    let (mut width, mut layers, mut extra) = (0, 0, 0);
    for item in 0..usize::from(word(ITEM_COUNT)?) {
        let (kind, size) = (word(ITEMS + item * ITEM)?, usize::from(word(ITEMS + item * ITEM + 2)?));
        width += size;
        // Extra bytes, points, colours with near infrared; all else has one.
        layers += match kind {
            14 => size,
            10 => 9,
            12 => 2,
            _ => 1,
        };
        extra += if matches!(kind, 0 | 14) { size } else { 0 };
    }
    // The version of the first item decides, whatever the compressor is called.
    let is_layered = word(ITEMS + 4)? >= LAYERED_VERSION;
    Some(Compression { data, compressor: word(COMPRESSOR)?, is_layered, chunk_points, width, extra, layers })
}

fn point_count(bytes: &[u8]) -> u64 {
    let legacy = number(bytes, 107).map_or(0, u32::from_le_bytes);
    let is_new = bytes.get(super::MINOR_VERSION).is_some_and(|&minor| minor >= 4);
    match number(bytes, 247).map(u64::from_le_bytes) {
        Some(count) if is_new => count.max(u64::from(legacy)),
        _ => u64::from(legacy),
    }
}

impl Compression<'_> {
    /// Checks a number of chunks.
    fn check_count(&self, chunks: u64, bytes: &[u8]) -> Result<(), ReadErrorKind> {
        let cost = 1 + self.extra as u64 / EXTRA_BYTES_AS_ALL_ELSE;
        match chunks.saturating_mul(cost) > FEW_CHUNKS + bytes.len() as u64 / LEAST_CHUNK {
            true => Err(damaged(format!(
                "the points are in {chunks} chunks, more than a file of {} bytes needs",
                bytes.len()
            ))),
            false => Ok(()),
        }
    }

    /// Walks over the chunks as the decoder does: a first point as it is, the number of points, the sizes of the layers, the
    /// layers.
    fn check_layers(&self, bytes: &[u8], points: u64) -> Result<(), ReadErrorKind> {
        let start = number(bytes, POINT_OFFSET).map_or(0, u32::from_le_bytes) as usize;
        let sizes = self.chunk_sizes(bytes, start)?;
        // The place of the table of chunks comes first where there may be one.
        let mut at = if self.compressor == ONE_CHUNK { start } else { start.saturating_add(8) };
        let (mut done, mut chunks) = (0_u64, 0_usize);
        while done < points {
            let counts = at.saturating_add(self.width).saturating_add(4);
            at = counts.saturating_add(4 * self.layers);
            for layer in 0..self.layers {
                // At the end of the file the decoder says so.
                let Some(size) = number(bytes, counts + 4 * layer).map(u32::from_le_bytes) else { return Ok(()) };
                at = at.saturating_add(size as usize);
                if at > bytes.len() {
                    return Err(damaged(format!(
                        "chunk {chunks} (counted from 0) has layers beyond the end of the file"
                    )));
                }
            }
            let of_chunk = match &sizes {
                Some(sizes) => sizes.get(chunks).copied().unwrap_or(0),
                None if self.compressor == ONE_CHUNK => 0,
                None => u64::from(self.chunk_points),
            };
            // The decoder ends no chunk of 0 points.
            done = done.saturating_add(if of_chunk == 0 { u64::MAX } else { of_chunk });
            chunks += 1;
            self.check_count(chunks as u64, bytes)?;
        }
        Ok(())
    }

    /// The numbers of points of the chunks, where the table tells them; none where there is no table.
    fn chunk_sizes(&self, bytes: &[u8], start: usize) -> Result<Option<Vec<u64>>, ReadErrorKind> {
        if self.chunk_points != VARIABLE {
            return Ok(None);
        }
        shielded(NAME, || {
            let Ok(record) = LazVlr::from_buffer(self.data) else { return Ok(Some(Vec::new())) };
            let mut source = Cursor::new(bytes);
            source.set_position(start as u64);
            let table = ChunkTable::read_from(&mut source, &record);
            let entries = table.as_ref().map_or(&[][..], |table| table.as_ref());
            Ok(Some(entries.iter().map(|entry| entry.point_count).collect()))
        })
    }
}

fn damaged(reason: String) -> ReadErrorKind {
    ReadErrorKind::Malformed { format: NAME, reason }
}
