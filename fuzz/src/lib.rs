//! Fuzz targets, and the bounds that every input must keep.
//!
//! A target takes bytes that nobody meant and asks that nothing panics, that what was read is sound, that an error is one line of
//! text, and that neither memory nor time passes a bound that follows from the number of bytes ([`bounds`]). libFuzzer calls the
//! targets through the programs in `fuzz_targets`; the program `replay` calls them on files and needs no libFuzzer.
//! `cargo xtask fuzz` runs both.

mod allocation;
pub mod bounds;
mod expansion;
mod random;
pub mod repair;
pub mod targets;

#[expect(dead_code, reason = "what is fuzzed only parses")]
#[path = "../../crates/cli/src/args.rs"]
mod args;
#[expect(dead_code, reason = "what is fuzzed only parses")]
#[path = "../../crates/cli/src/fit_args.rs"]
mod fit_args;
#[path = "../../crates/cli/src/scan_args.rs"]
mod scan_args;
#[expect(dead_code, reason = "what is fuzzed only parses")]
#[path = "../../crates/cli/src/solid_args.rs"]
mod solid_args;

#[global_allocator]
static ALLOCATOR: allocation::Counting = allocation::Counting;

/// Makes the calling thread the only one that works, for programs which run inputs on one thread only: each handing over of work to
/// a second thread, while this one waits, would take longer than most of the work.
///
/// # Panics
/// If work was shared among threads before.
pub fn work_on_this_thread() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread();
    pool.build_global().expect("no work was shared before");
}

/// A program of libFuzzer for one target.
#[cfg(feature = "libfuzzer")]
#[macro_export]
macro_rules! fuzz_program {
    ($target:ident) => {
        libfuzzer_sys::fuzz_target!(init: $crate::work_on_this_thread(), |bytes: &[u8]| $crate::targets::$target.check(bytes));

        libfuzzer_sys::fuzz_mutator!(|data: &mut [u8], size: usize, max_size: usize, seed: u32| {
            let change = libfuzzer_sys::fuzzer_mutate;
            $crate::repair::mutate(&$crate::targets::$target, data, size, max_size, seed, change)
        });
    };
}
