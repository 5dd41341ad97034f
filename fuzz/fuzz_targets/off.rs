//! The target `off`.

#![no_main]

fuzz::fuzz_program!(OFF);
