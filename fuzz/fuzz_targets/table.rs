//! The target `table`.

#![no_main]

fuzz::fuzz_program!(TABLE);
