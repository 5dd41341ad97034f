//! The target `three_mf`.

#![no_main]

fuzz::fuzz_program!(THREE_MF);
