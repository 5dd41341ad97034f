//! The target `obj`.

#![no_main]

fuzz::fuzz_program!(OBJ);
