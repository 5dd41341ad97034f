//! GLB: lengths of the file, of its JSON and of its binary chunk.

use super::{Opened, put};

const HEADER: usize = 12;
const CHUNK_HEADER: usize = 8;

/// What is changed is all of the file, or, by the seed, one of its chunks.
pub(crate) fn open(bytes: &[u8], seed: u32) -> Option<Opened> {
    let length = |at: usize| {
        bytes.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize).unwrap_or_default()
    };
    let json = bytes.get(HEADER + CHUNK_HEADER..)?.get(..length(HEADER))?.to_vec();
    let rest = HEADER + CHUNK_HEADER + json.len();
    let binary = bytes.get(rest + CHUNK_HEADER..).unwrap_or_default().to_vec();
    let is_json = !seed.is_multiple_of(3);
    let inner = if is_json { json.clone() } else { binary.clone() };
    let close = move |inner: &[u8]| Some(if is_json { close(inner, &binary) } else { close(&json, inner) });
    Some(Opened { inner, close: Box::new(close) })
}

fn close(json: &[u8], binary: &[u8]) -> Vec<u8> {
    let mut file = b"glTF\x02\0\0\0\0\0\0\0".to_vec();
    for (chunk, kind, filling) in [(json, b"JSON", b' '), (binary, b"BIN\0", 0)] {
        if chunk.is_empty() && kind == b"BIN\0" {
            continue;
        }
        let mut chunk = chunk.to_vec();
        chunk.resize(chunk.len().next_multiple_of(4), filling);
        file.extend((chunk.len() as u32).to_le_bytes());
        file.extend(kind);
        file.extend(chunk);
    }
    let length = file.len() as u32;
    put(&mut file, 8, &length.to_le_bytes());
    file
}
