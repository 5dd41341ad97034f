//! The target `beside`.

#![no_main]

fuzz::fuzz_program!(BESIDE);
