//! Verdicts from figures.

use serde::Deserialize;

/// Figures of the same data and setting agree within this share.
const SAME: f64 = 0.05;

/// Means over random items agree within this factor.
const MEANS: f64 = 1.3;

/// How figures are compared. Smaller ones are better.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Rule {
    /// Of the same data: within 5 %.
    Figure,
    /// Means over random items: within a factor 1.3.
    Means,
    /// Whole numbers and words, which are equal or not.
    Exact,
    /// A test asserts it: the verdict is that of the test, which must be there.
    Tested,
    /// The printed figure is a bound from above.
    AtMost,
    /// The printed figure is a bound from below, on a cost: to stay below it is better.
    AtLeast,
    /// Ours grow from left to right in each row or, where there is one column, from row to row.
    Order,
}

/// What is said of a claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Same data and setting, same figures or order.
    Reproduced,
    /// Nowhere worse and somewhere better.
    Better,
    /// Somewhere worse.
    Worse,
    /// A stated order or number fails.
    Contradicts,
    /// On other data.
    StandIn,
    /// The print leaves the setting open or has no figures.
    TrendOnly,
    /// It cannot be repeated.
    NotReproducible,
    /// It could be, and has not been.
    NotYetComputed,
}

impl Verdict {
    /// All, in the order of the page.
    pub const ALL: [Self; 8] = [
        Self::Reproduced,
        Self::Better,
        Self::Worse,
        Self::Contradicts,
        Self::StandIn,
        Self::TrendOnly,
        Self::NotReproducible,
        Self::NotYetComputed,
    ];

    /// Its name in the list and on the page.
    pub fn name(self) -> &'static str {
        match self {
            Self::Reproduced => "reproduced",
            Self::Better => "better",
            Self::Worse => "worse",
            Self::Contradicts => "contradicts",
            Self::StandIn => "stand-in",
            Self::TrendOnly => "trend only",
            Self::NotReproducible => "not reproducible",
            Self::NotYetComputed => "not yet computed",
        }
    }

    /// What it means.
    pub(super) fn meaning(self) -> &'static str {
        match self {
            Self::Reproduced => {
                "same data and setting: within 5 %, means over random items within a factor 1.3; orders hold"
            }
            Self::Better => "at the printed setting nowhere above that and somewhere below",
            Self::Worse => "at the printed setting somewhere above that",
            Self::Contradicts => "at the printed setting a stated order or number fails",
            Self::StandIn => "computed on other data; the last but one column says how it comes out there",
            Self::TrendOnly => {
                "the print leaves the setting open, or its figures are lost; an order or a size is compared"
            }
            Self::NotReproducible => "data or method are not to be had, or the figure is a picture without numbers",
            Self::NotYetComputed => "it could be computed, and has not been",
        }
    }
}

/// The number of a cell: that in brackets where there is one.
pub(super) fn number(cell: &str) -> Option<f64> {
    let inner = cell.split_once('(').and_then(|(_, rest)| rest.split_once(')')).map_or(cell, |(inner, _)| inner);
    let first = inner.trim().split([' ', ',']).next()?;
    first.trim_end_matches('%').parse().ok()
}

/// What figures say of the printed ones; `width` figures make a row. Nothing if they are not all there.
pub(super) fn judge(rule: Rule, factor: f64, width: usize, printed: &[String], ours: &[String]) -> Option<Verdict> {
    if ours.is_empty() {
        return None;
    }
    if rule == Rule::Tested {
        return Some(Verdict::Reproduced);
    }
    if rule == Rule::Exact {
        return Some(if printed == ours { Verdict::Reproduced } else { Verdict::Contradicts });
    }
    let numbers = |cells: &[String]| cells.iter().map(|cell| number(cell)).collect::<Option<Vec<f64>>>();
    let ours = numbers(ours)?;
    if rule == Rule::Order {
        let rows: Vec<&[f64]> = if width > 1 { ours.chunks(width).collect() } else { vec![&ours] };
        let grows = |pair: &[f64]| pair[1] >= factor * pair[0] && pair[1] > pair[0];
        let holds = rows.iter().all(|row| row.windows(2).all(grows)) && ours.len() > 1;
        return Some(if holds { Verdict::Reproduced } else { Verdict::Contradicts });
    }
    let printed = numbers(printed).filter(|printed| printed.len() == ours.len())?;
    let pairs = || printed.iter().zip(&ours);
    let (worse, better): (bool, bool) = match rule {
        Rule::AtMost => (pairs().any(|(p, o)| o > p), false),
        Rule::AtLeast => (false, pairs().any(|(p, o)| o < p)),
        Rule::Means => (pairs().any(|(p, o)| *o > MEANS * p), pairs().any(|(p, o)| *o < p / MEANS)),
        _ => (pairs().any(|(p, o)| *o > (1.0 + SAME) * p), pairs().any(|(p, o)| *o < (1.0 - SAME) * p)),
    };
    Some(match (worse, better) {
        (true, _) => Verdict::Worse,
        (false, true) => Verdict::Better,
        (false, false) => Verdict::Reproduced,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(rule: Rule, printed: &[&str], ours: &[&str]) -> Option<Verdict> {
        let own = |cells: &[&str]| cells.iter().map(|cell| (*cell).to_owned()).collect::<Vec<_>>();
        judge(rule, 1.0, 1, &own(printed), &own(ours))
    }

    #[test]
    fn figures_agree_within_their_bounds_and_not_beyond() {
        for (rule, ours, verdict) in [
            (Rule::Figure, "1.04e-3", Verdict::Reproduced),
            (Rule::Figure, "1.06e-3", Verdict::Worse),
            (Rule::Figure, "9.4e-4", Verdict::Better),
            (Rule::Means, "1.29e-3", Verdict::Reproduced),
            (Rule::Means, "1.31e-3", Verdict::Worse),
            (Rule::AtMost, "1.001e-3", Verdict::Worse),
            (Rule::AtMost, "9e-4", Verdict::Reproduced),
            (Rule::AtLeast, "9e-4", Verdict::Better),
            (Rule::Exact, "1.0e-3", Verdict::Contradicts),
        ] {
            assert_eq!(of(rule, &["1e-3"], &[ours]), Some(verdict), "{rule:?} {ours}");
        }
        assert_eq!(of(Rule::Means, &["1", "1"], &["0.5", "1.5"]), Some(Verdict::Worse));
        assert_eq!(of(Rule::Means, &["1", "1"], &["0.5", "1"]), Some(Verdict::Better));
    }

    #[test]
    fn orders_hold_in_every_row_or_fail() {
        let cells = |text: &str| text.split(' ').map(str::to_owned).collect::<Vec<_>>();
        let order = |width, factor, text| judge(Rule::Order, factor, width, &[], &cells(text)).unwrap();
        assert_eq!(order(2, 1.0, "1 2 1 3"), Verdict::Reproduced);
        assert_eq!(order(2, 1.0, "1 2 3 2"), Verdict::Contradicts);
        assert_eq!(order(1, 1.0, "1 2 3"), Verdict::Reproduced);
        assert_eq!(order(2, 5.0, "1 4"), Verdict::Contradicts);
        assert_eq!(order(1, 1.0, "1"), Verdict::Contradicts, "one figure has no order");
    }

    #[test]
    fn what_is_missing_gives_no_verdict() {
        assert_eq!(of(Rule::Figure, &["1"], &[]), None);
        assert_eq!(of(Rule::Figure, &["1"], &["1", "1"]), None);
        assert_eq!(of(Rule::Figure, &["1"], &["–"]), None);
    }

    #[test]
    fn numbers_stand_in_brackets_or_alone() {
        assert_eq!(number("100 (24)"), Some(24.0));
        assert_eq!(number("8.49e-5"), Some(8.49e-5));
        assert_eq!(number("95.83 %"), Some(95.83));
        assert_eq!(number("–"), None);
    }
}
