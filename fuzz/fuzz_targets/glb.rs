//! The target `glb`.

#![no_main]

fuzz::fuzz_program!(GLB);
