//! The target `step`.

#![no_main]

fuzz::fuzz_program!(STEP);
