//! What the program and its reports are called.

/// The program and its version.
pub(crate) const PROGRAM: &str = concat!("thb ", env!("CARGO_PKG_VERSION"));

/// The version of the report's layout.
pub(crate) const SCHEMA: u32 = 1;
