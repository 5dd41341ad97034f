//! The target `ply`.

#![no_main]

fuzz::fuzz_program!(PLY);
