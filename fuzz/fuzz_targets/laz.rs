//! The target `laz`.

#![no_main]

fuzz::fuzz_program!(LAZ);
