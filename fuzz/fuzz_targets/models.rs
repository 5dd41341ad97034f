//! The target `models`.

#![no_main]

fuzz::fuzz_program!(MODELS);
