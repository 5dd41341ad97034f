//! What every message to a user must be.

/// Characters of a message: a terminal shows them on some lines, and a log keeps them.
const MOST_CHARACTERS: usize = 1500;

/// Checks a message: one line, not empty, not endless, and nothing that a terminal would obey.
pub(super) fn check(message: &str) {
    assert!(!message.trim().is_empty(), "a message is empty");
    assert!(message.chars().count() <= MOST_CHARACTERS, "a message is too long: {message:?}");
    assert!(!message.chars().any(char::is_control), "a message holds characters of control: {message:?}");
}
