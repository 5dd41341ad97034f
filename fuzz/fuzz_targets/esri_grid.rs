//! The target `esri_grid`.

#![no_main]

fuzz::fuzz_program!(ESRI_GRID);
