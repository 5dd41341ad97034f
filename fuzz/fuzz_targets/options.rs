//! The target `options`.

#![no_main]

fuzz::fuzz_program!(OPTIONS);
