//! Tables in Markdown.

use std::fmt::Write as _;

/// A table with a header; the first column is text, the others are numbers.
pub(crate) fn table(header: &[&str], rows: &[Vec<String>]) -> String {
    let mut text = format!("| {} |\n|---|{}\n", header.join(" | "), "---:|".repeat(header.len().saturating_sub(1)));
    for row in rows {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "| {} |", row.join(" | "));
    }
    text
}

/// Three digits.
pub(super) fn figure(x: f64) -> String {
    format!("{x:.2e}")
}

/// A printed figure, ours, and how they relate.
pub(super) fn compared(printed: f64, ours: f64) -> [String; 3] {
    [figure(printed), figure(ours), format!("{:.2}", ours / printed)]
}

/// A factor, two digits however small.
pub(super) fn factor(ours: f64, printed: f64) -> String {
    let ratio = ours / printed;
    if ratio < 0.095 { format!("{ratio:.1e}") } else { format!("{ratio:.2}") }
}
