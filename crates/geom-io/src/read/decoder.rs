//! Decoders of other crates, kept from taking the process with them.

use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::error::ReadErrorKind;

/// Runs a decoder. Should it panic, which ours never do and those of others may on damaged data, that is an error like
/// any other; nothing it worked on is used afterwards. (The process's panic hook still hears of it.)
pub(super) fn shielded<T>(
    format: &'static str,
    decode: impl FnOnce() -> Result<T, ReadErrorKind>,
) -> Result<T, ReadErrorKind> {
    let gave_up = |_| ReadErrorKind::Malformed { format, reason: "they are damaged".to_owned() };
    catch_unwind(AssertUnwindSafe(decode)).map_err(gave_up)?
}
