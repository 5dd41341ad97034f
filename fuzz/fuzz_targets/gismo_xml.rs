//! The target `gismo_xml`.

#![no_main]

fuzz::fuzz_program!(GISMO_XML);
