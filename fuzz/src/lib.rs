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

#[path = "../../crates/cli/src/args.rs"]
mod args;

#[global_allocator]
static ALLOCATOR: allocation::Counting = allocation::Counting;

/// A program of libFuzzer for one target.
#[cfg(feature = "libfuzzer")]
#[macro_export]
macro_rules! fuzz_program {
    ($target:ident) => {
        libfuzzer_sys::fuzz_target!(|bytes: &[u8]| $crate::targets::$target.check(bytes));

        libfuzzer_sys::fuzz_mutator!(|data: &mut [u8], size: usize, max_size: usize, seed: u32| {
            let change = libfuzzer_sys::fuzzer_mutate;
            $crate::repair::mutate(&$crate::targets::$target, data, size, max_size, seed, change)
        });
    };
}
