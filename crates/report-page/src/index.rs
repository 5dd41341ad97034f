//! The page of a batch: a row a part, failures first.

use base64::Engine;
use serde_json::json;

use crate::Tone;
use crate::html::{escaped, filled, json_in_script};

const SHELL: &str = include_str!("../assets/index.html");
const STYLE: &str = include_str!("../assets/page.css");
const SCRIPT: &str = include_str!("../assets/index.js");

/// A part of a batch.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct IndexRow {
    /// Its name.
    pub name: String,
    /// The file of its page, beside this one; empty without.
    pub page: String,
    /// What became of it in one word.
    pub verdict: String,
    /// What to think of it.
    pub tone: Tone,
    /// Control points, share within the tolerance, largest distance, tolerance and seconds; none of a part that has no surface.
    pub figures: Option<[f64; 5]>,
    /// Why it is not good, or why it has no surface.
    pub reasons: Vec<String>,
    /// A small picture, as PNG; empty without.
    pub picture: Vec<u8>,
}

/// The page of a batch, with the parts that failed first, and a line of totals.
pub fn index(title: &str, rows: &[IndexRow]) -> String {
    let mut sorted: Vec<&IndexRow> = rows.iter().collect();
    // Parts without a surface before others that failed.
    sorted.sort_by_key(|row| (std::cmp::Reverse(row.tone), row.figures.is_some()));
    let data = sorted.iter().map(|row| {
        json!({
            "name": row.name,
            "page": row.page,
            "verdict": row.verdict,
            "tone": row.tone,
            "figures": row.figures,
            "reasons": row.reasons,
            "picture": base64::engine::general_purpose::STANDARD.encode(&row.picture),
        })
    });
    let data = json_in_script(&data.collect::<Vec<_>>());
    let count = |tone: Tone| rows.iter().filter(|row| row.tone == tone).count();
    let totals = format!(
        "{} parts: {} good, {} usable, {} failed",
        rows.len(),
        count(Tone::Good),
        count(Tone::Usable),
        count(Tone::Failed)
    );
    filled(
        SHELL,
        &[
            ("title", &escaped(title)),
            ("totals", &escaped(&totals)),
            ("style", STYLE),
            ("data", &data),
            ("script", SCRIPT),
        ],
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failures_stand_first_and_totals_count_all() {
        let row = |name: &str, tone, figures| IndexRow { name: name.into(), tone, figures, ..IndexRow::default() };
        let figures = Some([100.0, 0.95, 0.1, 0.05, 2.0]);
        let rows = [
            row("a", Tone::Good, figures),
            row("b", Tone::Failed, figures),
            row("<c>", Tone::Failed, None),
            row("d", Tone::Usable, figures),
        ];
        let html = index("out", &rows);
        let places = ["\\u003cc\\u003e", "\"b\"", "\"d\"", "\"a\""].map(|name| html.find(name).unwrap());
        assert!(places.is_sorted(), "{places:?}");
        assert!(html.contains("4 parts: 1 good, 1 usable, 2 failed") && !html.contains("<c>"));
    }
}
