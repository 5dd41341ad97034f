//! The target `stl`.

#![no_main]

fuzz::fuzz_program!(STL);
