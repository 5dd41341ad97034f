//! Mutations that get past checksums, lengths and compression: the inside of a file is changed, and what protects it is made anew.
//!
//! Without, nearly every changed file would be refused by its header, and nothing behind it would ever be tried.

mod archive;
mod e57;
mod glb;
mod las;

use crate::targets::Target;

/// What of a file is changed, and how a file comes of it again.
pub(crate) struct Opened {
    /// The inside.
    pub(crate) inner: Vec<u8>,
    /// Makes a file of a changed inside.
    pub(crate) close: Close,
}

/// Makes a file of its inside, where that can be.
pub(crate) type Close = Box<dyn Fn(&[u8]) -> Option<Vec<u8>>>;

/// How files of a target are opened.
pub(crate) type Open = fn(bytes: &[u8], seed: u32) -> Option<Opened>;

pub(crate) use self::{
    archive::open as open_archive, e57::open as open_e57, glb::open as open_glb, las::open as open_las,
};

/// Share of the mutations, one in so many, that change the file as it is.
const PLAIN: u32 = 4;

/// Changes `data[..size]` in place, to at most `max_size` bytes, and gives the new size; `change` does so with any bytes.
pub fn mutate(
    target: &Target,
    data: &mut [u8],
    size: usize,
    max_size: usize,
    seed: u32,
    change: fn(&mut [u8], usize, usize) -> usize,
) -> usize {
    repaired(target, data, size, max_size, seed, change).unwrap_or_else(|| change(data, size, max_size))
}

fn repaired(
    target: &Target,
    data: &mut [u8],
    size: usize,
    max_size: usize,
    seed: u32,
    change: fn(&mut [u8], usize, usize) -> usize,
) -> Option<usize> {
    if seed.is_multiple_of(PLAIN) {
        return None;
    }
    let Opened { mut inner, close } = (target.open?)(&data[..size], seed / PLAIN)?;
    let length = inner.len();
    inner.resize(max_size.max(length), 0);
    let most = inner.len();
    let changed = change(&mut inner, length, most);
    let closed = close(&inner[..changed])?;
    // What is too long for the target is not cut: its end would be missing.
    let room = data.get_mut(..closed.len()).filter(|_| closed.len() <= max_size)?;
    room.copy_from_slice(&closed);
    Some(closed.len())
}

/// Writes bytes at a place, where there is room for them.
fn put(bytes: &mut [u8], at: usize, value: &[u8]) {
    if let Some(place) = bytes.get_mut(at..at + value.len()) {
        place.copy_from_slice(value);
    }
}
