//! E57: pages of 1024 bytes, each with a checksum, and a header with the lengths of the file and of its description.

use super::{Opened, put};

const PAGE: usize = 1024;
const CHECKSUM: usize = 4;
const PAYLOAD: usize = PAGE - CHECKSUM;

/// Where the header has the signature, the version, the length of the file, the place and the length of the description, and the
/// length of a page (ASTM E2807, 9.2).
const VERSION: usize = 8;
const FILE_LENGTH: usize = 16;
const XML_OFFSET: usize = 24;
const XML_LENGTH: usize = 32;
const PAGE_LENGTH: usize = 40;

/// What is changed are the bytes without checksums.
pub(crate) fn open(bytes: &[u8], _seed: u32) -> Option<Opened> {
    let inner = bytes.chunks(PAGE).flat_map(|page| &page[..page.len().min(PAYLOAD)]).copied().collect();
    Some(Opened { inner, close: Box::new(|inner| Some(close(inner))) })
}

fn close(inner: &[u8]) -> Vec<u8> {
    let mut inner = inner.to_vec();
    inner.resize(inner.len().next_multiple_of(PAYLOAD).max(PAYLOAD), 0);
    put(&mut inner, 0, b"ASTM-E57");
    put(&mut inner, VERSION, &[1, 0, 0, 0, 0, 0, 0, 0]);
    put(&mut inner, PAGE_LENGTH, &(PAGE as u64).to_le_bytes());
    let length = inner.len() / PAYLOAD * PAGE;
    put(&mut inner, FILE_LENGTH, &(length as u64).to_le_bytes());
    let find = |word: &[u8]| inner.windows(word.len()).position(|window| window == word);
    if let (Some(start), Some(end)) = (find(b"<?xml"), find(b"</e57Root>")) {
        let physical = start / PAYLOAD * PAGE + start % PAYLOAD;
        let length = (end + b"</e57Root>".len()).saturating_sub(start);
        put(&mut inner, XML_OFFSET, &(physical as u64).to_le_bytes());
        put(&mut inner, XML_LENGTH, &(length as u64).to_le_bytes());
    }
    let page = |payload: &[u8]| [payload, &checksum(payload).to_be_bytes()].concat();
    inner.chunks(PAYLOAD).flat_map(page).collect()
}

/// CRC-32C (Castagnoli).
fn checksum(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0_u32, |sum, &byte| {
        (0..8).fold(sum ^ u32::from(byte), |sum, _| if sum & 1 == 1 { sum >> 1 ^ 0x82f6_3b78 } else { sum >> 1 })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_is_that_of_the_standard() {
        assert_eq!(checksum(b"123456789"), 0xe306_9283);
    }

    #[test]
    fn pages_that_are_not_changed_stay_as_they_are() {
        let file = include_bytes!("../../corpus/e57/e57_invalid_pose.e57");
        let Opened { inner, close } = open(file, 0).unwrap();
        let closed = close(&inner).unwrap();
        // Blanks behind the description are not counted, so its length in the header may differ, and the checksum of that page.
        assert!(closed[PAGE_LENGTH..PAYLOAD] == file[PAGE_LENGTH..PAYLOAD] && closed[PAGE..] == file[PAGE..]);
        assert!(closed[..XML_LENGTH] == file[..XML_LENGTH]);
    }
}
