//! What a LAZ file makes its decoder reserve, checked before.
//!
//! The decoder trusts the sizes in the file: of a point, of its extra bytes, and in the newer formats of each layer of a
//! chunk (LAZ specification 1.4 R1). It also makes all its models of probabilities anew for each chunk.

use super::{NAME, POINT_OFFSET, RECORD_LENGTH, number};
use crate::error::ReadErrorKind;

/// Bytes of the header of a variable length record; in it where the user and the length stand.
const RECORD_HEADER: usize = 54;
const RECORD_USER: std::ops::Range<usize> = 2..18;
const RECORD_DATA_LENGTH: usize = 20;

/// The user of the record that describes the compression.
const USER: &[u8] = b"laszip encoded";

/// Where in that record the compressor stands, the number of points of a chunk, and the items of a point; bytes of an item.
const COMPRESSOR: usize = 0;
const CHUNK_POINTS: usize = 12;
const ITEM_COUNT: usize = 32;
const ITEMS: usize = 34;
const ITEM: usize = 6;

/// The compressor of layers.
const LAYERED: u16 = 3;

/// The number of points of a chunk where the table tells it.
const VARIABLE: u32 = u32::MAX;

/// Limit: extra bytes of a point. The decoder keeps up to 16 kB for each. Programs write fewer than 100.
const MAX_EXTRA_BYTES: usize = 1024;

/// Limit: bytes that the chunks of a file have on the average, beyond the first few. To begin a chunk takes the decoder as long as
/// a thousand points, whose tables of probabilities it makes anew. Programs write 50 000 points a chunk, trees of points some thousand.
const LEAST_CHUNK: u64 = 1000;
const FEW_CHUNKS: u64 = 100;

/// What the file says of the compression.
struct Compression {
    is_layered: bool,
    chunk_points: u32,
    /// Bytes of a point.
    width: usize,
    /// Layers of a chunk.
    layers: usize,
}

/// Checks that the sizes in a compressed file are possible.
///
/// # Errors
/// [`ReadErrorKind::Malformed`].
pub(super) fn check(bytes: &[u8]) -> Result<(), ReadErrorKind> {
    // What is missing the decoder complains about.
    let Some(compression) = describe(bytes)? else { return Ok(()) };
    let record = number(bytes, RECORD_LENGTH).map_or(0, u16::from_le_bytes);
    if compression.width != usize::from(record) {
        return Err(damaged(format!(
            "a point has {record} bytes in the header and {} in the description of the compression",
            compression.width
        )));
    }
    let points = point_count(bytes);
    if compression.chunk_points != VARIABLE {
        check_count(points / u64::from(compression.chunk_points.max(1)), bytes)?;
    }
    if compression.is_layered { check_layers(bytes, &compression, points) } else { Ok(()) }
}

/// The record that describes the compression; `None` where there is none, or it is cut off.
fn describe(bytes: &[u8]) -> Result<Option<Compression>, ReadErrorKind> {
    let header = number(bytes, 94).map(u16::from_le_bytes).unwrap_or_default();
    let records = number(bytes, 100).map(u32::from_le_bytes).unwrap_or_default();
    let mut rest = bytes.get(usize::from(header)..).unwrap_or_default();
    for _ in 0..records {
        let (Some(user), Some(length)) = (rest.get(RECORD_USER), number(rest, RECORD_DATA_LENGTH)) else { break };
        let end = RECORD_HEADER + usize::from(u16::from_le_bytes(length));
        let Some(record) = rest.get(..end) else { break };
        if user.starts_with(USER) {
            return of_record(&record[RECORD_HEADER..]);
        }
        rest = &rest[end..];
    }
    Ok(None)
}

fn of_record(data: &[u8]) -> Result<Option<Compression>, ReadErrorKind> {
    let word = |at| number(data, at).map(u16::from_le_bytes);
    let (Some(compressor), Some(chunk_points), Some(count)) =
        (word(COMPRESSOR), number(data, CHUNK_POINTS).map(u32::from_le_bytes), word(ITEM_COUNT))
    else {
        return Ok(None);
    };
    let (mut width, mut layers, mut extra) = (0, 0, 0);
    for item in 0..usize::from(count) {
        let (Some(kind), Some(size)) = (word(ITEMS + item * ITEM), word(ITEMS + item * ITEM + 2)) else {
            return Ok(None);
        };
        let size = usize::from(size);
        width += size;
        // Extra bytes, points, colours, near infrared, wave packets of the newer formats.
        layers += match kind {
            14 => size,
            10 => 9,
            12 => 2,
            _ => 1,
        };
        extra += if matches!(kind, 0 | 14) { size } else { 0 };
    }
    if extra > MAX_EXTRA_BYTES {
        return Err(damaged(format!("{extra} extra bytes a point; up to {MAX_EXTRA_BYTES} are possible")));
    }
    Ok(Some(Compression { is_layered: compressor == LAYERED, chunk_points, width, layers }))
}

fn point_count(bytes: &[u8]) -> u64 {
    let legacy = number(bytes, 107).map_or(0, u32::from_le_bytes);
    let is_new = bytes.get(super::MINOR_VERSION).is_some_and(|&minor| minor >= 4);
    match number(bytes, 247).map(u64::from_le_bytes) {
        Some(count) if is_new => count.max(u64::from(legacy)),
        _ => u64::from(legacy),
    }
}

/// Walks over the chunks: a first point as it is, the number of points, the sizes of the layers, the layers.
fn check_layers(bytes: &[u8], compression: &Compression, points: u64) -> Result<(), ReadErrorKind> {
    let start = number(bytes, POINT_OFFSET).map_or(0, u32::from_le_bytes) as usize;
    // The place of the table of chunks comes first.
    let mut at = start.saturating_add(8);
    let (mut done, mut chunks) = (0_u64, 0_u64);
    while done < points {
        let counter = at + compression.width;
        let Some(of_chunk) = number(bytes, counter).map(u32::from_le_bytes) else { return Ok(()) };
        at = counter + 4 + 4 * compression.layers;
        for layer in 0..compression.layers {
            let Some(size) = number(bytes, counter + 4 + 4 * layer).map(u32::from_le_bytes) else { return Ok(()) };
            at = at.saturating_add(size as usize);
            if at > bytes.len() {
                return Err(damaged(format!("chunk {chunks} (counted from 0) has layers beyond the end of the file")));
            }
        }
        let variable = compression.chunk_points == VARIABLE;
        done += u64::from(if variable { of_chunk.max(1) } else { compression.chunk_points.max(1) });
        chunks += 1;
        check_count(chunks, bytes)?;
    }
    Ok(())
}

/// Checks a number of chunks.
///
/// # Errors
/// [`ReadErrorKind::Malformed`].
pub(super) fn check_count(chunks: u64, bytes: &[u8]) -> Result<(), ReadErrorKind> {
    match chunks > FEW_CHUNKS + bytes.len() as u64 / LEAST_CHUNK {
        true => {
            Err(damaged(format!("the points are in {chunks} chunks, more than a file of {} bytes needs", bytes.len())))
        }
        false => Ok(()),
    }
}

fn damaged(reason: String) -> ReadErrorKind {
    ReadErrorKind::Malformed { format: NAME, reason }
}
