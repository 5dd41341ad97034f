//! How the executions and the edges of a target grew.

use std::fmt::Write as _;
use std::fs;
use std::io::ErrorKind;
use std::path::Path;

use anyhow::{Context, Result, bail};

/// A moment of the runs of a target.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Moment {
    /// Executions of all runs until then.
    executions: u64,
    /// Edges that the inputs reach.
    edges: u64,
    /// Seconds of the processor of all runs until then, at the end of a run.
    seconds: Option<f64>,
}

/// All runs of a target with a state, one after the other.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct History {
    moments: Vec<Moment>,
}

impl History {
    /// Reads a history; one that does not exist is empty.
    pub(super) fn read(path: &Path) -> Result<Self> {
        match fs::read_to_string(path) {
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(Self::default()),
            text => Self::parse(&text?).with_context(|| format!("cannot read {}", path.display())),
        }
    }

    fn parse(text: &str) -> Result<Self> {
        let mut history = Self::default();
        for line in text.lines() {
            let fields: Vec<&str> = line.split('\t').collect();
            let [executions, edges, seconds] = fields[..] else { bail!("{line:?} has not three fields") };
            let seconds = if seconds.is_empty() { None } else { Some(seconds.parse()?) };
            history.moments.push(Moment { executions: executions.parse()?, edges: edges.parse()?, seconds });
        }
        Ok(history)
    }

    /// Writes a history.
    pub(super) fn write(&self, path: &Path) -> Result<()> {
        fs::write(path, self.to_text()).with_context(|| format!("cannot write {}", path.display()))
    }

    fn to_text(&self) -> String {
        let mut text = String::new();
        for Moment { executions, edges, seconds } in &self.moments {
            let seconds = seconds.map(|seconds| format!("{seconds:.2}")).unwrap_or_default();
            let _ = writeln!(text, "{executions}\t{edges}\t{seconds}");
        }
        text
    }

    /// Executions so far.
    pub(super) fn executions(&self) -> u64 {
        self.moments.last().map_or(0, |last| last.executions)
    }

    /// Runs so far.
    pub(super) fn runs(&self) -> usize {
        self.moments.iter().filter(|moment| moment.seconds.is_some()).count()
    }

    /// Notes the edges after so many executions of all runs, if they grew.
    pub(super) fn note(&mut self, executions: u64, edges: u64) {
        if edges > self.edges() {
            self.moments.push(Moment { executions, edges, seconds: None });
        }
    }

    /// Notes the end of a run.
    pub(super) fn end_run(&mut self, executions: u64, seconds: f64) {
        let before = self.moments.iter().rev().find_map(|moment| moment.seconds).unwrap_or(0.0);
        self.moments.push(Moment { executions, edges: self.edges(), seconds: Some(before + seconds) });
    }

    /// The most edges so far.
    pub(super) fn edges(&self) -> u64 {
        self.moments.iter().map(|moment| moment.edges).max().unwrap_or(0)
    }

    /// The most edges in the first two thirds of the executions.
    pub(super) fn edges_at_two_thirds(&self) -> u64 {
        let executions = self.executions();
        let first = self.moments.iter().filter(|moment| 3 * moment.executions <= 2 * executions);
        first.map(|moment| moment.edges).max().unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_thirds_are_of_the_executions_of_all_runs() {
        let mut history = History::default();
        history.note(2, 50);
        history.note(100, 60);
        history.note(150, 60);
        history.end_run(200, 1.5);
        assert_eq!((history.edges(), history.edges_at_two_thirds(), history.runs()), (60, 60, 1));
        history.note(290, 61);
        history.end_run(300, 2.0);
        assert_eq!((history.edges(), history.edges_at_two_thirds(), history.runs()), (61, 60, 2));
        history.end_run(600, 2.0);
        assert_eq!(history.edges_at_two_thirds(), 61);
        assert!(history.to_text().ends_with("600\t61\t5.50\n"));
        assert_eq!(History::parse(&history.to_text()).unwrap(), history);
        assert!(History::parse("1\t2\n").is_err());
    }
}
