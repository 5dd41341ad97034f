//! The target `geo_tiff`.

#![no_main]

fuzz::fuzz_program!(GEO_TIFF);
