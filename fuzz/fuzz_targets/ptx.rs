//! The target `ptx`.

#![no_main]

fuzz::fuzz_program!(PTX);
