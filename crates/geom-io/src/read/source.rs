//! Where bytes come from: files, standard input, gzip.

use std::borrow::Cow;
use std::io::{ErrorKind, Read};
use std::path::Path;

use flate2::bufread::MultiGzDecoder;

use crate::error::ReadErrorKind;

/// First bytes of a gzip member (RFC 1952, §2.3.1) with its only method, deflate.
const GZIP: &[u8] = b"\x1f\x8b\x08";

/// Bytes that compressed data may always expand to: enough for any ordinary scan, little for a machine.
const EXPANSION_FLOOR: usize = 1 << 28;

/// Beyond the floor, how many times their own size compressed data may expand to. Text of measured points stays below
/// 10; deflate reaches 1032 on bytes that are all equal, which no scan of that size is.
const MAX_EXPANSION: usize = 100;

pub(super) fn is_standard_input(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// All bytes of a file or of standard input.
pub(super) fn read(path: &Path) -> std::io::Result<Vec<u8>> {
    if !is_standard_input(path) {
        return std::fs::read(path);
    }
    let mut bytes = Vec::new();
    std::io::stdin().lock().read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// The bytes, decompressed where they are compressed by gzip.
pub(super) fn decompress(bytes: &[u8]) -> Result<Cow<'_, [u8]>, ReadErrorKind> {
    decompress_within(bytes, bytes.len().saturating_mul(MAX_EXPANSION).max(EXPANSION_FLOOR))
}

fn decompress_within(bytes: &[u8], limit: usize) -> Result<Cow<'_, [u8]>, ReadErrorKind> {
    if !bytes.starts_with(GZIP) {
        return Ok(Cow::Borrowed(bytes));
    }
    let mut expanded = Vec::new();
    let decoded = MultiGzDecoder::new(bytes).take(limit as u64 + 1).read_to_end(&mut expanded);
    decoded.map_err(|error| match error.kind() {
        ErrorKind::UnexpectedEof => ReadErrorKind::Malformed { format: "gzip", reason: "they are cut off".to_owned() },
        _ => ReadErrorKind::Malformed { format: "gzip", reason: error.to_string() },
    })?;
    match expanded.len() > limit {
        true => Err(ReadErrorKind::Expansion { compressed: bytes.len(), limit }),
        false => Ok(Cow::Owned(expanded)),
    }
}

/// The bytes behind a UTF-8 mark.
///
/// # Errors
/// [`ReadErrorKind::Utf16`] for text in UTF-16, with its mark or without.
pub(super) fn without_mark(bytes: &[u8]) -> Result<&[u8], ReadErrorKind> {
    const UTF8_MARK: &[u8] = b"\xef\xbb\xbf";
    const UTF16_MARKS: [&[u8]; 2] = [b"\xff\xfe", b"\xfe\xff"];
    match UTF16_MARKS.iter().any(|mark| bytes.starts_with(mark)) || is_utf16(bytes) {
        true => Err(ReadErrorKind::Utf16),
        false => Ok(bytes.strip_prefix(UTF8_MARK).unwrap_or(bytes)),
    }
}

/// Whether every second byte is 0 and those between are ASCII, as Latin text is in UTF-16.
fn is_utf16(bytes: &[u8]) -> bool {
    /// Limit: enough that numbers in binary do not look so by chance.
    const LOOKED_AT: usize = 32;
    let start = &bytes[..bytes.len().min(LOOKED_AT) & !1];
    let is_text = |b: u8| b.is_ascii_graphic() || b.is_ascii_whitespace();
    let pairs = || start.chunks_exact(2);
    start.len() >= 6
        && (pairs().all(|pair| is_text(pair[0]) && pair[1] == 0)
            || pairs().all(|pair| pair[0] == 0 && is_text(pair[1])))
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use flate2::{Compression, write::GzEncoder};

    use super::*;

    #[test]
    fn expansion_is_bounded() {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
        encoder.write_all(&[b'0'; 5000]).unwrap();
        let bytes = encoder.finish().unwrap();
        assert_eq!(*decompress_within(&bytes, 5000).unwrap(), [b'0'; 5000]);
        let error = decompress_within(&bytes, 4999).unwrap_err();
        assert!(matches!(error, ReadErrorKind::Expansion { compressed, limit: 4999 } if compressed == bytes.len()));
    }
}
