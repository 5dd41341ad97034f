//! How many bytes an input expands to: by its containers, and by compressed points.

use std::io::{Cursor, Read};

use flate2::bufread::MultiGzDecoder;
use geom_io::Format;
use zip::ZipArchive;

/// Containers within one another that are looked into.
const DEPTH: usize = 4;

/// Bytes that are counted at most of one container.
const MOST: u64 = 1 << 30;

/// Bytes that compressed points or pixels may always expand to.
const LEAST: usize = 1 << 20;

/// The number of bytes that an input is, or expands to.
pub(crate) fn expanded(bytes: &[u8], format: Format) -> usize {
    let inner = within(bytes, DEPTH);
    match format {
        Format::Las => inner.max(points_of_las(bytes)),
        Format::GeoTiff => inner.max(pixels_of_tiff(bytes)),
        _ => inner,
    }
}

fn within(bytes: &[u8], depth: usize) -> usize {
    let Some(depth) = depth.checked_sub(1) else { return bytes.len() };
    let mut inner = Vec::new();
    if bytes.starts_with(b"\x1f\x8b\x08") {
        // What is damaged at the end has been expanded up to there.
        let _ = MultiGzDecoder::new(bytes).take(MOST).read_to_end(&mut inner);
        return within(&inner, depth).max(inner.len()).max(bytes.len());
    }
    let Ok(mut archive) = ZipArchive::new(Cursor::new(bytes)) else { return bytes.len() };
    let mut sum = bytes.len();
    for index in 0..archive.len().min(1000) {
        inner.clear();
        if let Ok(member) = archive.by_index(index) {
            let _ = member.take(MOST).read_to_end(&mut inner);
            sum += within(&inner, depth);
        }
    }
    sum
}

/// What the pixels of a TIFF file expand to, as its header has it, but at most what a reader may take.
fn pixels_of_tiff(bytes: &[u8]) -> usize {
    let size = tiff::decoder::Decoder::new(Cursor::new(bytes)).and_then(|mut decoder| decoder.dimensions());
    let pixels = size.map_or(0, |(width, height)| (width as usize).saturating_mul(height as usize));
    pixels.saturating_mul(4).min(LEAST.max(200 * bytes.len()))
}

/// What the points of a LAZ file expand to, as its header has it, but at most what a reader may take.
fn points_of_las(bytes: &[u8]) -> usize {
    let word = |at: usize| bytes.get(at..at + 2).map_or(0, |b| usize::from(u16::from_le_bytes([b[0], b[1]])));
    let count = |at: usize| word(at) | word(at + 2) << 16;
    if bytes.get(104).is_none_or(|format| format & 0xc0 == 0) {
        return bytes.len();
    }
    let points = if bytes.get(25).is_some_and(|&minor| minor >= 4) { count(247).max(count(107)) } else { count(107) };
    points.saturating_mul(word(105)).min(LEAST.max(200 * bytes.len()))
}
