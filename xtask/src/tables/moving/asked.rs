//! What was to be reached, beside what is.

use super::super::markdown::table;

/// Bounds, and what came of them.
#[derive(Default)]
pub(super) struct Asked {
    rows: Vec<Vec<String>>,
}

impl Asked {
    /// A bound from above, both written as `figure` does.
    pub(super) fn at_most(&mut self, what: &str, bound: f64, here: f64, figure: impl Fn(f64) -> String) {
        self.add(what, format!("≤ {}", figure(bound)), figure(here), here <= bound);
    }

    /// Anything else.
    pub(super) fn add(&mut self, what: &str, bound: String, here: String, kept: bool) {
        self.rows.push(vec![what.into(), bound, here, if kept { "yes" } else { "no" }.into()]);
    }

    pub(super) fn text(&self) -> String {
        format!("{TEXT}{}", table(&["what", "bound", "here", "met"], &self.rows))
    }
}

const TEXT: &str = "
## In short

Bounds are figures printed in Imperatore 2024, figures of G+Smo, or margins to them that this project set itself; *ours* is one of the settings of
the joint method below, or any method for the sheet of degree 3. Rows of the hull and of Nefertiti name the row below that they are, with its
creases. None of them is the printed setting: cells are refined with one ring around them, in the thesis with two, and Nefertiti starts from the parameters of its file,
not from BIDGCN's. What the printed settings give stands in [printed.md](printed.md), verdicts in [claims.md](claims.md).

";
