//! Decompression of LZF (Lehmann's LibLZF), as `binary_compressed` PCD data have it.

/// Control bytes below announce that many literal bytes, less one; others a copy.
const FIRST_COPY: u8 = 32;

/// The code of a copy's length behind which a byte with the rest of it follows.
const LONG: usize = 7;

/// The `length` bytes that `bytes` expand to, or `None` where they expand to fewer or more, or are damaged.
///
/// Memory grows with what is decoded, at most 88 times the input (three bytes for a copy of 264).
pub(super) fn decompress(mut bytes: &[u8], length: usize) -> Option<Vec<u8>> {
    let mut out: Vec<u8> = Vec::new();
    while let Some((&control, rest)) = bytes.split_first() {
        bytes = rest;
        if control < FIRST_COPY {
            let (literals, rest) = bytes.split_at_checked(usize::from(control) + 1)?;
            out.extend_from_slice(literals);
            bytes = rest;
        } else {
            let mut take = || {
                let (&byte, rest) = bytes.split_first()?;
                bytes = rest;
                Some(usize::from(byte))
            };
            let code = usize::from(control >> 5);
            let count = 2 + code + if code == LONG { take()? } else { 0 };
            let back = 1 + (usize::from(control & 0x1f) << 8) + take()?;
            let start = out.len().checked_sub(back)?;
            // A copy may run into what it writes.
            for k in start..start + count {
                out.push(out[k]);
            }
        }
        if out.len() > length {
            return None;
        }
    }
    (out.len() == length).then_some(out)
}

#[cfg(test)]
mod tests {
    use super::decompress;

    #[test]
    fn literals_and_copies() {
        // Three literals; a copy of 3 from 3 back; a copy of 2 + 7 + 1 from 1 back, over what it writes.
        let bytes = [2, b'a', b'b', b'c', 1 << 5, 2, 7 << 5, 1, 0];
        assert_eq!(decompress(&bytes, 16).as_deref(), Some(&b"abcabccccccccccc"[..]));
        assert_eq!(decompress(&bytes, 15), None);
        assert_eq!(decompress(&bytes, 17), None);
        assert!((0..bytes.len()).all(|end| decompress(&bytes[..end], 16).is_none()));
        assert_eq!(decompress(&[1 << 5, 0], 3), None);
        assert_eq!(decompress(&[], 0), Some(Vec::new()));
    }
}
