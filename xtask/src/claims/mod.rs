//! What the sources report, beside what this project reaches at the printed settings: `xtask/claims.toml`.
//!
//! A claim quotes its figures and names the cells of the pages in docs/results that show them. Verdicts follow from the figures; a
//! quoted figure that its page no longer shows, or a verdict that the figures do not bear out, is a finding.

mod again;
mod cells;
mod judge;
mod page;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::{Context, Result};
use serde::Deserialize;

pub use self::again::Again;
use self::cells::{Cells, Pages};
use self::judge::Rule;
pub use self::judge::Verdict;
pub use self::page::{PAGE, count_line, document};

/// The list.
const LIST: &str = "xtask/claims.toml";

/// All claims, and the commands of the pages that show their figures.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Claims {
    commands: BTreeMap<String, String>,
    #[serde(rename = "claim")]
    claims: Vec<Claim>,
}

/// How near our setting is to the printed one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Setting {
    /// Data and setting as printed.
    Printed,
    /// Other data.
    StandIn,
    /// The print leaves the setting open, or its figures are lost: only an order or a size can be compared.
    Unprinted,
    /// It cannot be repeated.
    Lost,
    /// It could be, and has not been.
    Pending,
}

/// One claim of the sources.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Claim {
    /// A name of its own.
    id: String,
    /// The heading it stands under.
    group: String,
    /// Where it stands in the sources.
    of: String,
    /// What it says.
    what: String,
    setting: Setting,
    /// What differs from the printed setting, or why there is nothing to compare.
    why: Option<String>,
    rule: Option<Rule>,
    /// Of orders, by how much at least a figure is above the one before.
    #[serde(default = "one")]
    factor: f64,
    #[serde(default)]
    printed: Vec<String>,
    /// Ours at that setting.
    #[serde(default)]
    ours: Vec<String>,
    cells: Option<Cells>,
    /// The verdict on record.
    verdict: String,
    /// What our own settings reach.
    best: Option<Best>,
}

fn one() -> f64 {
    1.0
}

/// A figure of our own, which no verdict rests on.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Best {
    figures: Vec<String>,
    cells: Cells,
    /// How, and at what price.
    how: String,
}

impl Claim {
    /// What the figures say, whatever the setting.
    fn outcome(&self) -> Option<Verdict> {
        let width = self.cells.as_ref().map_or(1, Cells::width);
        judge::judge(self.rule?, self.factor, width, &self.printed, &self.ours)
    }

    /// The verdict, from the setting and the figures.
    fn judged(&self) -> Option<Verdict> {
        match self.setting {
            Setting::Printed => self.outcome(),
            Setting::StandIn => self.outcome().map(|_| Verdict::StandIn),
            Setting::Unprinted => self.outcome().map(|_| Verdict::TrendOnly),
            Setting::Lost => Some(Verdict::NotReproducible),
            Setting::Pending => Some(Verdict::NotYetComputed),
        }
    }

    fn findings(&self, pages: &mut Pages<'_>) -> Vec<String> {
        let mut findings = Vec::new();
        let mut find = |what: String| findings.push(format!("{}: {what}", self.id));
        match self.judged() {
            None => find("its figures give no verdict".into()),
            Some(verdict) if verdict.name() != self.verdict => {
                find(format!("the figures say {:?}, not {:?}", verdict.name(), self.verdict));
            }
            Some(_) => {}
        }
        if self.setting != Setting::Printed && self.why.as_ref().is_none_or(String::is_empty) {
            find("the setting is not the printed one, and it does not say why".into());
        }
        if matches!(self.setting, Setting::Lost | Setting::Pending) {
            if !self.ours.is_empty() {
                find("it has figures but says that there are none".into());
            }
        } else if self.cells.is_none() {
            find("no page shows its figures".into());
        }
        if (self.rule == Some(Rule::Tested)) != self.cells.as_ref().is_some_and(Cells::is_source) {
            find("sources hold tests, pages hold figures".into());
        }
        let best = self.best.as_ref().map(|best| (&best.figures, &best.cells));
        for (figures, cells) in self.cells.as_ref().map(|cells| (&self.ours, cells)).into_iter().chain(best) {
            match pages.shown(cells) {
                Err(error) => find(format!("{error:#}")),
                Ok(shown) if shown != *figures => {
                    find(format!("{} shows {shown:?}, quoted are {figures:?}", cells.page));
                }
                Ok(_) => {}
            }
        }
        findings
    }
}

/// Writes the page and the count in README.md.
///
/// # Errors
/// A README without a line for it; what reading and writing meet.
pub fn write(root: &Path, claims: &Claims) -> Result<()> {
    std::fs::write(root.join(PAGE), document(claims))?;
    let path = root.join("README.md");
    let text = std::fs::read_to_string(&path)?;
    let is_count = |line: &str| line.split_once(" claims: ").is_some_and(|(n, _)| n.parse::<usize>().is_ok());
    let old = text.lines().find(|line| is_count(line)).context("README.md has no line that counts claims")?;
    std::fs::write(path, text.replace(old, &count_line(claims)))?;
    Ok(())
}

impl Claims {
    /// Reads the list.
    ///
    /// # Errors
    /// A file that cannot be read or is no such list.
    pub fn read(root: &Path) -> Result<Self> {
        let path = root.join(LIST);
        let text = std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
        Self::parse(&text).with_context(|| format!("{LIST} is no list of claims"))
    }

    fn parse(text: &str) -> Result<Self> {
        Ok(toml::from_str(text)?)
    }

    /// What is wrong with the list: names given twice, claims without a verdict or with another one than their figures bear
    /// out, figures that their pages do not show, and a README or a page that says something else.
    ///
    /// # Errors
    /// Files that cannot be read.
    pub fn findings(&self, root: &Path) -> Result<Vec<String>> {
        let mut findings = Vec::new();
        let mut names = BTreeSet::new();
        let mut pages = Pages::new(root);
        for claim in &self.claims {
            if !names.insert(&claim.id) {
                findings.push(format!("{}: named twice", claim.id));
            }
            findings.extend(claim.findings(&mut pages));
            let shown = claim.cells.iter().chain(claim.best.as_ref().map(|best| &best.cells));
            for page in shown.map(|cells| &cells.page).filter(|page| !self.commands.contains_key(*page)) {
                findings.push(format!("{}: no command makes {page}", claim.id));
            }
        }
        for (file, expected) in [("README.md", count_line(self)), (PAGE, document(self))] {
            let text = std::fs::read_to_string(root.join(file)).with_context(|| format!("cannot read {file}"))?;
            if !text.contains(&expected) {
                findings.push(format!("{file} does not say what the list says; see `cargo xtask claims`"));
            }
        }
        Ok(findings)
    }

    /// How many claims have each verdict.
    fn counts(&self) -> Vec<(Verdict, usize)> {
        let count = |verdict: &Verdict| self.claims.iter().filter(|c| c.judged() == Some(*verdict)).count();
        Verdict::ALL.iter().map(|verdict| (*verdict, count(verdict))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::workspace_root;

    #[test]
    fn verdicts_follow_from_the_figures_and_the_pages_show_them() {
        let root = workspace_root();
        let claims = Claims::read(&root).unwrap();
        assert!(claims.claims.len() >= 100, "{}", claims.claims.len());
        let findings = claims.findings(&root).unwrap();
        assert!(findings.is_empty(), "{}", findings.join("\n"));
    }

    const CLAIM: &str = "
        [commands]
        page = 'make page'
        [[claim]]
        id = 'a'
        group = 'g'
        of = 'Table 1'
        what = 'w'
        setting = 'printed'
        rule = 'figure'
        printed = ['1e-3']
        ours = ['1.02e-3']
        cells = { page = 'page', section = 'S', rows = ['r'], columns = [1] }
        verdict = 'reproduced'
    ";

    fn folder(name: &str, cell: &str) -> std::path::PathBuf {
        let root = std::env::temp_dir().join(format!("claims-{name}-{}", std::process::id()));
        std::fs::create_dir_all(root.join("docs/results")).unwrap();
        let page = format!("# P\n\n## S\n\n| a | b |\n|---|---:|\n| r | {cell} |\n");
        std::fs::write(root.join("docs/results/page.md"), page).unwrap();
        root
    }

    #[test]
    fn a_page_that_shows_another_figure_is_found() {
        let claims = Claims::parse(CLAIM).unwrap();
        for (name, cell, count) in [("same", "1.02e-3", 0), ("other", "1.03e-3", 1)] {
            let root = folder(name, cell);
            let findings = claims.claims[0].findings(&mut Pages::new(&root));
            assert_eq!(findings.len(), count, "{findings:?}");
            std::fs::remove_dir_all(root).unwrap();
        }
    }

    #[test]
    fn a_verdict_that_the_figures_do_not_bear_out_is_found_and_none_is_refused() {
        let root = folder("verdict", "1.02e-3");
        let wrong = Claims::parse(&CLAIM.replace("'reproduced'", "'better'")).unwrap();
        assert!(wrong.claims[0].findings(&mut Pages::new(&root))[0].contains("the figures say \"reproduced\""));
        assert!(Claims::parse(&CLAIM.replace("verdict = 'reproduced'", "")).is_err());
        // No "yes" from a setting that is not the printed one.
        let other = Claims::parse(&CLAIM.replace("'printed'\n        rule", "'stand-in'\n        rule")).unwrap();
        let findings = other.claims[0].findings(&mut Pages::new(&root));
        assert!(
            findings[0].contains("\"stand-in\", not \"reproduced\"") && findings[1].contains("why"),
            "{findings:?}"
        );
        std::fs::remove_dir_all(root).unwrap();
    }
}
