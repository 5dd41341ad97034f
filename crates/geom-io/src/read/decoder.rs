//! Decoders of other crates, kept from taking the process with them.

use std::cell::Cell;
use std::fmt::Display;
use std::panic::{self, AssertUnwindSafe, catch_unwind};
use std::sync::Once;

use crate::error::{ReadErrorKind, plain};

thread_local! {
    /// Whether the thread runs a decoder.
    static IS_DECODING: Cell<bool> = const { Cell::new(false) };
}

/// Runs a decoder. Should it panic, which ours never do and those of others may on damaged data, that is an error like
/// any other; nothing it worked on is used afterwards. The process's panic hook does not hear of it: there would be a
/// backtrace on the terminal beside the error.
pub(super) fn shielded<T>(
    format: &'static str,
    decode: impl FnOnce() -> Result<T, ReadErrorKind>,
) -> Result<T, ReadErrorKind> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let hook = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if !IS_DECODING.get() {
                hook(info);
            }
        }));
    });
    let outer = IS_DECODING.replace(true);
    let decoded = catch_unwind(AssertUnwindSafe(decode));
    IS_DECODING.set(outer);
    decoded.map_err(|_| ReadErrorKind::Malformed { format, reason: "they are damaged".to_owned() })?
}

/// What a decoder says, shortened, and without characters that a terminal would obey: some list all that they found, or quote the file.
pub(super) fn malformed(format: &'static str, reason: impl Display) -> ReadErrorKind {
    ReadErrorKind::Malformed { format, reason: plain(&reason.to_string()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_an_error_and_says_nothing_itself() {
        let error = shielded::<()>("LAS", || panic!("not on the terminal")).unwrap_err();
        assert!(matches!(error, ReadErrorKind::Malformed { format: "LAS", .. }));
        assert!(!IS_DECODING.get());
        let inner = shielded("outer", || {
            let _ = shielded::<()>("inner", || panic!("not on the terminal"));
            Ok(IS_DECODING.get())
        });
        assert!(matches!(inner, Ok(true)));
    }

    #[test]
    fn long_reasons_are_cut() {
        let ReadErrorKind::Malformed { reason, .. } = malformed("E57", format!("\u{1b}[2J{}", "x".repeat(5000))) else {
            unreachable!("that is what it makes");
        };
        assert!((100..300).contains(&reason.chars().count()), "{reason}");
        assert!(!reason.contains('\u{1b}'));
    }
}
