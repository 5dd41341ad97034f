//! Where bytes come from: files, standard input, gzip, zip.

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, Cursor, ErrorKind, IsTerminal, Read};
use std::path::Path;

use flate2::bufread::MultiGzDecoder;
use zip::ZipArchive;
use zip::result::ZipError;

use super::Format;
use super::decoder::shielded;
use crate::error::{ReadErrorKind, quote};

/// First bytes of a gzip member (RFC 1952, §2.3.1) with its only method, deflate.
const GZIP: &[u8] = b"\x1f\x8b\x08";

/// First bytes of a zip archive: the header of its first member.
const ZIP: &[u8] = b"PK\x03\x04";

/// Limit: bytes that compressed data may always expand to. Tiny files of few different bytes expand by any factor, and a MiB
/// harms nobody.
const EXPANSION_FLOOR: usize = 1 << 20;

/// Limit: how many times their own size compressed data may expand to, unless the options say more. Text of measured points stays
/// below 10; deflate reaches 1032 on bytes that are all equal, which no scan is.
const MAX_EXPANSION: usize = 200;

/// Limit: bytes that the first MiB of compressed data may expand to: they are read within two seconds and the memory of a small
/// program.
const MAX_OF_FIRST_MIB: usize = 12 << 20;

/// Limit: containers within one another, such as gzip in zip. Nobody needs the third; one that holds itself would never end.
const MAX_CONTAINERS: usize = 3;

/// Bytes read at a time.
const CHUNK: usize = 1 << 16;

/// Limit: zero bytes at the start of a source from which on it holds no scan. Of a binary STL file, the only format that may
/// open with zeros, that would be 21 000 triangles in one point. A device of zeros has no end.
const MAX_LEADING_ZEROS: usize = 1 << 20;

/// Limit: bytes of a pipe, which does not tell its length before and may have none.
const MAX_PIPED: usize = 1 << 32;

/// What is left of the bytes that compressed data may expand to.
pub(super) struct Budget {
    compressed: usize,
    limit: usize,
    spent: usize,
}

impl Budget {
    /// For data of so many compressed bytes; `factor` is how many times as many they may become.
    pub(super) fn new(compressed: usize, factor: Option<usize>) -> Self {
        let times = |bytes: usize, factor: usize| bytes.saturating_mul(factor);
        let limit = match factor {
            Some(factor) => times(compressed, factor),
            None => {
                let further = times(compressed.saturating_sub(1 << 20), MAX_EXPANSION);
                times(compressed, MAX_EXPANSION).min(MAX_OF_FIRST_MIB.saturating_add(further))
            }
        };
        Self { compressed, limit: limit.max(EXPANSION_FLOOR), spent: 0 }
    }

    /// Bytes that may still come.
    pub(super) fn left(&self) -> usize {
        self.limit.saturating_sub(self.spent)
    }

    /// Counts expanded bytes.
    ///
    /// # Errors
    /// [`ReadErrorKind::Expansion`] where they are too many.
    pub(super) fn spend(&mut self, bytes: usize) -> Result<(), ReadErrorKind> {
        self.spent = self.spent.saturating_add(bytes);
        match self.spent > self.limit {
            true => Err(ReadErrorKind::Expansion { compressed: self.compressed, limit: self.limit }),
            false => Ok(()),
        }
    }

    /// All that a decoder gives, counted while it does; `format` is what it decodes.
    pub(super) fn expand(&mut self, decoder: impl Read, format: &'static str) -> Result<Vec<u8>, ReadErrorKind> {
        let damaged = |error: io::Error| ReadErrorKind::Malformed {
            format,
            reason: match error.kind() {
                ErrorKind::UnexpectedEof => "they are cut off".to_owned(),
                _ => error.to_string(),
            },
        };
        read_chunks(decoder, 0, damaged, |_, chunk| self.spend(chunk.len()))
    }
}

/// Everything that a source gives, probably `expected` bytes, chunk by chunk; `admit` sees how many bytes came before, and
/// each chunk.
fn read_chunks(
    mut source: impl Read,
    expected: usize,
    failed: impl Fn(io::Error) -> ReadErrorKind,
    mut admit: impl FnMut(usize, &[u8]) -> Result<(), ReadErrorKind>,
) -> Result<Vec<u8>, ReadErrorKind> {
    let mut bytes: Vec<u8> = Vec::new();
    bytes.try_reserve_exact(expected).map_err(|_| ReadErrorKind::Memory { bytes: expected })?;
    let mut buffer = vec![0; CHUNK];
    loop {
        match source.read(&mut buffer) {
            Ok(0) => return Ok(bytes),
            Ok(found) => {
                let chunk = &buffer[..found];
                admit(bytes.len(), chunk)?;
                bytes.try_reserve(found).map_err(|_| ReadErrorKind::Memory { bytes: bytes.len() + found })?;
                bytes.extend_from_slice(chunk);
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(failed(error)),
        }
    }
}

pub(super) fn is_standard_input(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// All bytes of a file or of standard input.
///
/// # Errors
/// [`ReadErrorKind::Io`], [`ReadErrorKind::Memory`]; [`ReadErrorKind::Endless`] for sources that have no end, or hold nothing.
pub(crate) fn read(path: &Path) -> Result<Vec<u8>, ReadErrorKind> {
    if is_standard_input(path) {
        return read_stream(io::stdin().lock());
    }
    let file = File::open(path)?;
    let found = file.metadata()?;
    if found.is_dir() {
        return Err(io::Error::from(ErrorKind::IsADirectory).into());
    }
    if is_device(&found) && !file.is_terminal() {
        return Err(ReadErrorKind::Endless { what: "it is a device" });
    }
    let length = usize::try_from(found.len()).unwrap_or(usize::MAX);
    // Pipes, and files of the system's own as below /proc, tell no length.
    match found.is_file() && length > 0 {
        true => read_chunks(file, length, ReadErrorKind::Io, without_zeros(usize::MAX)),
        false => read_stream(file),
    }
}

fn read_stream(source: impl Read) -> Result<Vec<u8>, ReadErrorKind> {
    read_chunks(source, 0, ReadErrorKind::Io, without_zeros(MAX_PIPED))
}

/// Admits chunks up to a length, unless all so far are zeros.
fn without_zeros(limit: usize) -> impl FnMut(usize, &[u8]) -> Result<(), ReadErrorKind> {
    let mut only_zeros = true;
    move |before, chunk| {
        only_zeros = only_zeros && chunk.iter().all(|&byte| byte == 0);
        if only_zeros && before >= MAX_LEADING_ZEROS {
            return Err(ReadErrorKind::Endless { what: "it opens with a MiB of zero bytes" });
        }
        match before > limit {
            true => Err(ReadErrorKind::Endless { what: "more than 4 GiB came out of a pipe" }),
            false => Ok(()),
        }
    }
}

#[cfg(unix)]
fn is_device(found: &std::fs::Metadata) -> bool {
    use std::os::unix::fs::FileTypeExt;
    found.file_type().is_char_device() || found.file_type().is_block_device()
}

#[cfg(not(unix))]
fn is_device(_: &std::fs::Metadata) -> bool {
    false
}

/// What was inside gzip and zip.
pub(super) struct Unpacked<'a> {
    pub(super) bytes: Cow<'a, [u8]>,
    /// Name of the innermost member of an archive.
    pub(super) member: Option<String>,
    /// Whether the bytes are an archive that is a 3MF package.
    pub(super) is_3mf: bool,
    /// What the bytes may still expand to.
    pub(super) budget: Budget,
}

/// Takes the bytes out of gzip and of zip archives with one scan inside.
pub(super) fn unpack(bytes: &[u8], factor: Option<usize>) -> Result<Unpacked<'_>, ReadErrorKind> {
    let budget = Budget::new(bytes.len(), factor);
    let mut unpacked = Unpacked { bytes: Cow::Borrowed(bytes), member: None, is_3mf: false, budget };
    for _ in 0..=MAX_CONTAINERS {
        if unpacked.bytes.starts_with(GZIP) {
            let expanded = unpacked.budget.expand(MultiGzDecoder::new(&*unpacked.bytes), "gzip")?;
            unpacked.bytes = Cow::Owned(expanded);
        } else if unpacked.bytes.starts_with(ZIP) {
            let Some((name, inner)) = only_scan(&unpacked.bytes, &mut unpacked.budget)? else {
                unpacked.is_3mf = true;
                return Ok(unpacked);
            };
            (unpacked.member, unpacked.bytes) = (Some(name), Cow::Owned(inner));
        } else {
            return Ok(unpacked);
        }
    }
    let reason = format!("more than {MAX_CONTAINERS} archives lie in one another");
    Err(ReadErrorKind::Malformed { format: "compressed", reason })
}

/// An archive, opened.
///
/// # Errors
/// [`ReadErrorKind::Malformed`].
pub(super) fn open_archive(bytes: &[u8]) -> Result<ZipArchive<Cursor<&[u8]>>, ReadErrorKind> {
    shielded("zip", || ZipArchive::new(Cursor::new(bytes)).map_err(damaged_archive))
}

/// The names of the members of an archive, in their order.
pub(super) fn member_names(archive: &ZipArchive<Cursor<&[u8]>>) -> Vec<String> {
    archive
        .file_names()
        .map(|name| name.map_or_else(|_| "a name that is no text".to_owned(), Cow::into_owned))
        .collect()
}

/// A member of an archive by its place, expanded.
///
/// # Errors
/// [`ReadErrorKind::Malformed`], [`ReadErrorKind::Expansion`].
pub(super) fn member(
    archive: &mut ZipArchive<Cursor<&[u8]>>,
    index: usize,
    budget: &mut Budget,
) -> Result<Vec<u8>, ReadErrorKind> {
    shielded("zip", || budget.expand(archive.by_index(index).map_err(damaged_archive)?, "zip"))
}

fn damaged_archive(error: ZipError) -> ReadErrorKind {
    ReadErrorKind::Malformed { format: "zip", reason: error.to_string() }
}

/// Whether a member of an archive is the model of a 3MF package.
pub(super) fn is_3mf_model(name: &str) -> bool {
    let name = name.trim_start_matches('/').to_ascii_lowercase();
    name.starts_with("3d/") && name.ends_with(".model")
}

/// Name and bytes of the one member that can be a scan; `None` for a 3MF package, which is a format of its own.
fn only_scan(bytes: &[u8], budget: &mut Budget) -> Result<Option<(String, Vec<u8>)>, ReadErrorKind> {
    let mut archive = open_archive(bytes)?;
    let names = member_names(&archive);
    if names.iter().any(|name| is_3mf_model(name)) {
        return Ok(None);
    }
    // Folders hold no scans, nor does what archivers of some systems add.
    let is_extra = |part: &str| part.starts_with('.') || part == "__MACOSX";
    let is_file = |&at: &usize| !names[at].ends_with('/') && !names[at].split('/').any(is_extra);
    let is_scan = |&at: &usize| Format::from_path(Path::new(&names[at])).is_ok();
    // Notes, licences and metadata often lie beside a scan.
    let is_no_text = |&at: &usize| {
        let extension = Path::new(&names[at]).extension().unwrap_or_default();
        !["txt", "xml", "csv", "dat"].iter().any(|text| extension.eq_ignore_ascii_case(text))
    };
    let files: Vec<usize> = (0..names.len()).filter(is_file).collect();
    let scans: Vec<usize> = files.iter().copied().filter(is_scan).collect();
    let not_text: Vec<usize> = scans.iter().copied().filter(is_no_text).collect();
    let chosen = match (&files[..], &scans[..], &not_text[..]) {
        (&[only], ..) | (_, &[only], _) | (_, _, &[only]) => only,
        _ => {
            let named = if scans.is_empty() { &files } else { &scans };
            let files = named.iter().map(|&at| quote(&names[at])).collect();
            return Err(ReadErrorKind::Archive { scans: scans.len(), files });
        }
    };
    let inner = member(&mut archive, chosen, budget)?;
    Ok(Some((names[chosen].clone(), inner)))
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

    fn gzip(bytes: &[u8]) -> Vec<u8> {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
        encoder.write_all(bytes).unwrap();
        encoder.finish().unwrap()
    }

    #[test]
    fn expansion_is_counted_while_expanding() {
        let bytes = gzip(&[b'0'; 3 << 20]);
        let few = unpack(&bytes, None).err().unwrap();
        let limit = EXPANSION_FLOOR.max(MAX_EXPANSION * bytes.len());
        assert_eq!(limit, Budget::new(bytes.len(), None).limit);
        assert!(
            matches!(few, ReadErrorKind::Expansion { compressed, limit: l } if (compressed, l) == (bytes.len(), limit))
        );
        assert_eq!(unpack(&bytes, Some(2000)).unwrap().bytes.len(), 3 << 20);
        assert!(unpack(&gzip(&vec![b'0'; EXPANSION_FLOOR]), Some(1)).is_ok());
        assert!(unpack(&gzip(&vec![b'0'; EXPANSION_FLOOR + 1]), Some(1)).is_err());
    }

    #[test]
    fn the_first_mib_may_not_expand_as_often_as_the_others() {
        const MIB: usize = 1 << 20;
        for (compressed, limit) in [
            (0, MIB),
            (1000, MIB),
            (10_000, 2_000_000),
            (MAX_OF_FIRST_MIB / 100, MAX_OF_FIRST_MIB),
            (MIB, 12 * MIB),
            (8 * MIB, (12 + 7 * 200) * MIB),
            (usize::MAX, usize::MAX),
        ] {
            assert_eq!(Budget::new(compressed, None).limit, limit, "{compressed}");
        }
        assert_eq!(Budget::new(MIB, Some(300)).limit, 300 * MIB);
    }

    #[test]
    fn containers_do_not_lie_in_one_another_without_end() {
        let mut bytes = b"0 0 0\n".to_vec();
        for depth in 0..6 {
            assert_eq!(unpack(&bytes, None).is_ok(), depth <= MAX_CONTAINERS, "{depth}");
            bytes = gzip(&bytes);
        }
    }

    #[test]
    fn a_source_of_zeros_ends() {
        assert!(matches!(read_stream(io::repeat(0)), Err(ReadErrorKind::Endless { .. })));
        let some = [vec![0; MAX_LEADING_ZEROS], b"1".to_vec()].concat();
        assert_eq!(read_stream(&some[..]).unwrap(), some);
    }
}
