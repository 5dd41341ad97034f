//! LAS and LAZ: a header with the places and numbers of what follows.

use super::{Opened, put};

/// Where the header has what it has (LAS 1.4 R15, table 3).
const MAJOR: usize = 24;
const MINOR: usize = 25;
const HEADER_LENGTH: usize = 94;
const POINT_OFFSET: usize = 96;
const FORMAT: usize = 104;
const RECORD_LENGTH: usize = 105;
const LEGACY_COUNT: usize = 107;
const COUNT: usize = 247;

/// Length of the header by the minor version, and of a point by its format.
const HEADERS: [u16; 5] = [227, 227, 227, 235, 375];
const RECORDS: [u16; 11] = [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67];

/// Bits of the format that stand for compression.
const COMPRESSED: u8 = 0xc0;

/// What is changed is all of the file; of the repairs a part is made, by the seed.
pub(crate) fn open(bytes: &[u8], seed: u32) -> Option<Opened> {
    Some(Opened { inner: bytes.to_vec(), close: Box::new(move |inner| close(inner, seed)) })
}

fn close(inner: &[u8], seed: u32) -> Option<Vec<u8>> {
    let mut bytes = inner.to_vec();
    put(&mut bytes, 0, b"LASF");
    put(&mut bytes, MAJOR, &[1]);
    let minor = (*bytes.get(MINOR)?).min(4);
    put(&mut bytes, MINOR, &[minor]);
    put(&mut bytes, HEADER_LENGTH, &HEADERS[usize::from(minor)].to_le_bytes());
    let format = *bytes.get(FORMAT)?;
    let (kind, compression) = (format & !COMPRESSED, format & COMPRESSED);
    let kind = kind % RECORDS.len() as u8;
    put(&mut bytes, FORMAT, &[kind | compression]);
    let word = |bytes: &[u8], at: usize| bytes.get(at..at + 2).map(|b| u16::from_le_bytes([b[0], b[1]]));
    let record = word(&bytes, RECORD_LENGTH)?.max(RECORDS[usize::from(kind)]).min(1000);
    if seed & 1 == 0 {
        put(&mut bytes, RECORD_LENGTH, &record.to_le_bytes());
    }
    if seed & 2 == 0 {
        let offset = usize::from(word(&bytes, POINT_OFFSET)?) | usize::from(word(&bytes, POINT_OFFSET + 2)?) << 16;
        let offset = offset.clamp(HEADERS[usize::from(minor)].into(), bytes.len().max(375));
        put(&mut bytes, POINT_OFFSET, &(offset as u32).to_le_bytes());
        // Of compressed points there are more than have room.
        if compression == 0 {
            let count = bytes.len().saturating_sub(offset) / usize::from(record);
            put(&mut bytes, LEGACY_COUNT, &(count as u32).to_le_bytes());
            if minor >= 4 {
                put(&mut bytes, COUNT, &(count as u64).to_le_bytes());
            }
        }
    }
    Some(bytes)
}
