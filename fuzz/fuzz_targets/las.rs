//! The target `las`.

#![no_main]

fuzz::fuzz_program!(LAS);
