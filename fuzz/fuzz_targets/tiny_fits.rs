//! The target `tiny_fits`.

#![no_main]

fuzz::fuzz_program!(TINY_FITS);
