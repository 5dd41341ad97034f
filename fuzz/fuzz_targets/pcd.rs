//! The target `pcd`.

#![no_main]

fuzz::fuzz_program!(PCD);
