//! The target `e57`.

#![no_main]

fuzz::fuzz_program!(E57);
