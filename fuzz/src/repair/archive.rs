//! Gzip and zip: what is inside is changed and compressed anew.

use std::io::{Cursor, Read, Write};

use flate2::Compression;
use flate2::bufread::MultiGzDecoder;
use flate2::write::GzEncoder;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

use super::Opened;

/// Bytes of a member that are changed at most.
const MOST: u64 = 1 << 20;

/// What is changed is what gzip holds, or a member of a zip archive, by the seed.
pub(crate) fn open(bytes: &[u8], seed: u32) -> Option<Opened> {
    if bytes.starts_with(b"\x1f\x8b") {
        let mut inner = Vec::new();
        MultiGzDecoder::new(bytes).take(MOST).read_to_end(&mut inner).ok()?;
        let close = |inner: &[u8]| {
            let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
            encoder.write_all(inner).ok()?;
            encoder.finish().ok()
        };
        return Some(Opened { inner, close: Box::new(close) });
    }
    let mut archive = ZipArchive::new(Cursor::new(bytes)).ok()?;
    let mut members = Vec::new();
    for index in 0..archive.len().min(64) {
        let mut member = archive.by_index(index).ok()?;
        let mut inner = Vec::new();
        member.by_ref().take(MOST).read_to_end(&mut inner).ok()?;
        members.push((member.name().ok()?.into_owned(), inner));
    }
    let place = (seed as usize).checked_rem(members.len())?;
    let inner = members[place].1.clone();
    let method = if seed & 64 == 0 { CompressionMethod::Stored } else { CompressionMethod::Deflated };
    let close = move |inner: &[u8]| {
        let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
        for (at, (name, kept)) in members.iter().enumerate() {
            writer.start_file(name, SimpleFileOptions::default().compression_method(method)).ok()?;
            writer.write_all(if at == place { inner } else { kept }).ok()?;
        }
        Some(writer.finish().ok()?.into_inner())
    };
    Some(Opened { inner, close: Box::new(close) })
}
