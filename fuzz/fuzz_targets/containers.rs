//! The target `containers`.

#![no_main]

fuzz::fuzz_program!(CONTAINERS);
