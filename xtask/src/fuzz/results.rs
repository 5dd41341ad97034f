//! The sums of all runs, a row a target.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::io::ErrorKind;
use std::path::Path;

use anyhow::{Context, Result, bail};

use super::history::History;
use super::session::Outcome;

/// What the columns hold.
const NAMES: &str = "target\texecutions\tcpu_seconds\tedges\tedges_at_two_thirds\tfailures";

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Row {
    executions: u64,
    seconds: f64,
    edges: u64,
    /// The edges when two thirds of the executions of this state were done.
    edges_at_two_thirds: u64,
    /// Inputs that failed, each of which has been put right or stands in the issue list.
    failures: u64,
}

/// The rows by target.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Results(BTreeMap<String, Row>);

impl Results {
    /// Reads results; those that do not exist are empty.
    pub(super) fn read(path: &Path) -> Result<Self> {
        match fs::read_to_string(path) {
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(Self::default()),
            text => Self::parse(&text?).with_context(|| format!("cannot read {}", path.display())),
        }
    }

    fn parse(text: &str) -> Result<Self> {
        let mut rows = BTreeMap::new();
        for line in text.lines().skip(1) {
            let fields: Vec<&str> = line.split('\t').collect();
            let [target, executions, seconds, edges, edges_at_two_thirds, failures] = fields[..] else {
                bail!("{line:?} has not six fields");
            };
            let row = Row {
                executions: executions.parse()?,
                seconds: seconds.parse()?,
                edges: edges.parse()?,
                edges_at_two_thirds: edges_at_two_thirds.parse()?,
                failures: failures.parse()?,
            };
            rows.insert(target.to_owned(), row);
        }
        Ok(Self(rows))
    }

    /// Writes the results.
    pub(super) fn write(&self, path: &Path) -> Result<()> {
        fs::write(path, self.to_text()).with_context(|| format!("cannot write {}", path.display()))
    }

    fn to_text(&self) -> String {
        let mut text = format!("{NAMES}\n");
        for (target, row) in &self.0 {
            let Row { executions, seconds, edges, edges_at_two_thirds, failures } = row;
            let _ = writeln!(text, "{target}\t{executions}\t{seconds:.0}\t{edges}\t{edges_at_two_thirds}\t{failures}");
        }
        text
    }

    /// Adds a run, which is the last one of a history.
    pub(super) fn add(&mut self, target: &str, run: &Outcome, history: &History) {
        let row = self.0.entry(target.to_owned()).or_default();
        row.executions += run.executions;
        row.seconds += run.seconds;
        row.failures += run.failures;
        (row.edges, row.edges_at_two_thirds) = (history.edges(), history.edges_at_two_thirds());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_add_up() {
        let mut history = History::default();
        history.note(10, 7);
        let run = Outcome { executions: 10, seconds: 2.4, edges: 7, failures: 1 };
        let mut results = Results::default();
        results.add("ply", &run, &history);
        results.add("las", &run, &history);
        results.add("ply", &run, &history);
        assert_eq!(results.to_text(), format!("{NAMES}\nlas\t10\t2\t7\t0\t1\nply\t20\t5\t7\t0\t2\n"));
        assert_eq!(Results::parse(&results.to_text()).unwrap().0["las"].edges, 7);
    }
}
