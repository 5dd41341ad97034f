//! The page of all claims.

use std::collections::BTreeSet;

use super::judge::{Rule, Verdict, number};
use super::{Claim, Claims, Setting};
use crate::tables::markdown::table;

/// Where it stands.
pub const PAGE: &str = "docs/results/claims.md";

/// Claims by verdict in a sentence, as README has it.
pub fn count_line(claims: &Claims) -> String {
    let counts: Vec<String> =
        claims.counts().into_iter().map(|(verdict, count)| format!("{count} {}", verdict.name())).collect();
    format!("{} claims: {}.", claims.claims.len(), counts.join(", "))
}

/// The page.
pub fn document(claims: &Claims) -> String {
    let mut text = format!("{INTRODUCTION}{}\n\n", count_line(claims));
    let count = |(verdict, count): (Verdict, usize)| {
        vec![verdict.name().to_owned(), count.to_string(), verdict.meaning().to_owned()]
    };
    text += &table(&["verdict", "claims", "meaning"], &claims.counts().into_iter().map(count).collect::<Vec<_>>());
    let mut seen = BTreeSet::new();
    let groups = claims.claims.iter().map(|claim| &claim.group).filter(|group| seen.insert(*group));
    for group in groups {
        text += &format!("\n## {group}\n\n");
        let rows: Vec<_> = claims.claims.iter().filter(|claim| claim.group == *group).map(row).collect();
        text += &table(&HEADER, &rows);
    }
    text += COMMANDS;
    let commands: Vec<_> =
        claims.commands.iter().map(|(page, command)| vec![link(page), format!("`{command}`")]).collect();
    text += &table(&["page", "command"], &commands);
    text
}

const HEADER: [&str; 8] =
    ["where", "claim", "printed", "ours", "ours / printed", "verdict", "comes out", "our own best"];

fn link(page: &str) -> String {
    match page.contains('/') {
        true => format!("[`{page}`](../../{page})"),
        false => format!("[{page}]({page}.md)"),
    }
}

fn row(claim: &Claim) -> Vec<String> {
    let shown = claim.cells.as_ref().map_or(String::new(), |cells| {
        let section = if cells.section.is_empty() { String::new() } else { format!(", {}", cells.section) };
        match claim.rule {
            Some(Rule::Tested) => format!("a test in {}", link(&cells.page)),
            _ => format!("{} ({}{section})", claim.ours.join(", "), link(&cells.page)),
        }
    });
    let best = claim.best.as_ref().map_or(String::new(), |best| {
        format!("{}: {} ({})", best.figures.join(", "), best.how, link(&best.cells.page))
    });
    let what = match &claim.why {
        Some(why) => format!("{}. *{why}*", claim.what),
        None => claim.what.clone(),
    };
    let comes_out = match (claim.setting, claim.outcome()) {
        (Setting::Printed, _) | (_, None) => String::new(),
        (_, Some(outcome)) => comes_out(claim, outcome).to_owned(),
    };
    let verdict = claim.judged().map_or("none", Verdict::name).to_owned();
    vec![claim.of.clone(), what, claim.printed.join(", "), shown, ratios(claim), verdict, comes_out, best]
}

/// How figures come out that are not of the printed setting.
fn comes_out(claim: &Claim, outcome: Verdict) -> &'static str {
    match (claim.rule, outcome) {
        (Some(Rule::Order), Verdict::Reproduced) => "the order holds",
        (Some(Rule::Order), _) => "the order fails",
        (_, Verdict::Reproduced) => "alike",
        (_, Verdict::Better) => "smaller",
        (_, Verdict::Worse) => "larger",
        _ => "otherwise",
    }
}

/// The smallest and the largest ratio of ours to the printed figures.
fn ratios(claim: &Claim) -> String {
    if matches!(claim.rule, None | Some(Rule::Order | Rule::Exact | Rule::Tested))
        || claim.ours.len() != claim.printed.len()
    {
        return String::new();
    }
    let ratio = |(printed, ours): (&String, &String)| Some(number(ours)? / number(printed)?);
    let Some(ratios) = claim.printed.iter().zip(&claim.ours).map(ratio).collect::<Option<Vec<f64>>>() else {
        return String::new();
    };
    let low = ratios.iter().copied().fold(f64::INFINITY, f64::min);
    let high = ratios.iter().copied().fold(0.0, f64::max);
    let two = |x: f64| if x < 0.095 { format!("{x:.1e}") } else { format!("{x:.2}") };
    if ratios.len() == 1 { two(low) } else { format!("{} – {}", two(low), two(high)) }
}

const INTRODUCTION: &str = "\
# What the sources report, and what comes out here

    cargo xtask claims

writes this page from `xtask/claims.toml`. The sources are S. Imperatore's thesis *Adaptive spline approximation* (Firenze 2024,
\"the print\" below), its chapter on parameterization as printed in a book, and De Vita, Giannelli, Imperatore, Mantzaflaris 2023.
A verdict rests on the printed setting alone: data, method and options as printed, nothing tuned. What our own settings reach stands in
the last column and moves no verdict. *Ours* quotes cells of the pages named behind it, and a test fails when a page shows another figure, or when
a verdict is not what the figures say. Smaller figures are better throughout.

";

const COMMANDS: &str = "
## Commands

`cargo xtask claims --check N --seed S --data DIR` computes N claims anew, drawn at random, and compares.

";
