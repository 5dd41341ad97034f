//! The target `surfer_grid`.

#![no_main]

fuzz::fuzz_program!(SURFER_GRID);
