//! An allocator that counts, so that the memory of an input is known to the byte, whatever the machine.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Bytes that are allocated now, by all threads.
static LIVE: AtomicUsize = AtomicUsize::new(0);

/// The most there have been since [`restart`].
static PEAK: AtomicUsize = AtomicUsize::new(0);

/// Bytes at which [`Counting`] ends the process: an input that asks for all memory must not take the machine with it.
static MOST: AtomicUsize = AtomicUsize::new(usize::MAX);

/// The system's allocator, which counts bytes.
pub(crate) struct Counting;

/// Begins to count anew; returns the bytes that are allocated now. Beyond `most` of them the process ends.
pub(crate) fn restart(most: usize) -> usize {
    let live = LIVE.load(Ordering::Relaxed);
    PEAK.store(live, Ordering::Relaxed);
    MOST.store(live.saturating_add(most), Ordering::Relaxed);
    live
}

/// The most bytes since [`restart`]; the process does not end any more for them.
pub(crate) fn peak() -> usize {
    MOST.store(usize::MAX, Ordering::Relaxed);
    PEAK.load(Ordering::Relaxed)
}

fn add(bytes: usize) {
    let live = LIVE.fetch_add(bytes, Ordering::Relaxed) + bytes;
    PEAK.fetch_max(live, Ordering::Relaxed);
    if live > MOST.load(Ordering::Relaxed) {
        // What is printed allocates, too.
        MOST.store(usize::MAX, Ordering::Relaxed);
        crate::bounds::give_up(&format!("{bytes} more bytes were asked for, {live} in sum"));
    }
}

fn remove(bytes: usize) {
    LIVE.fetch_sub(bytes, Ordering::Relaxed);
}

// SAFETY: every call goes to the system's allocator as it came; counting changes neither pointers nor layouts.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        add(layout.size());
        // SAFETY: the caller keeps what the trait asks for.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        add(layout.size());
        // SAFETY: as above.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        remove(layout.size());
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        // Both may be there at once.
        add(new_size);
        // SAFETY: as above.
        let moved = unsafe { System.realloc(pointer, layout, new_size) };
        remove(layout.size());
        moved
    }
}
