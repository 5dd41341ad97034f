//! A run of one program of libFuzzer.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fmt::Write as _;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use anyhow::{Context, Result, ensure};

use super::history::History;

/// Failures after which a target is left: the next ones are mostly the same.
const MOST_FAILURES: u64 = 3;

/// Seconds of an input, by the clock, after which libFuzzer ends it: the bound of the time that it runs is the target's own, but
/// an input that waits would never reach it.
const TIMEOUT: u64 = 600;

/// MiB that a program may take; the bound of the memory of an input is the target's own.
const MEMORY: u64 = 4096;

/// A folder of Linux that no disk is behind.
const MEMORY_FOLDER: &str = "/dev/shm";

/// What a run needs.
pub(super) struct Session {
    pub(super) program: PathBuf,
    /// Folders that are only read.
    pub(super) inputs: Vec<PathBuf>,
    /// The folder where inputs are kept that reach something new.
    pub(super) corpus: PathBuf,
    /// The folder for inputs that fail.
    pub(super) failures: PathBuf,
    pub(super) dictionary: Option<PathBuf>,
    /// Where a target is to count the options of its runs.
    pub(super) counts: Option<PathBuf>,
}

/// What a run did.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Outcome {
    pub(super) executions: u64,
    /// Of the processor, where the system tells.
    pub(super) seconds: f64,
    pub(super) edges: u64,
    pub(super) failures: u64,
}

impl Session {
    /// Runs for so many seconds, or until all runs have done so many executions; again after inputs that fail.
    pub(super) fn run(&self, seconds: u64, most: u64, history: &mut History) -> Result<Outcome> {
        let mut outcome = Outcome::default();
        let start = Instant::now();
        while outcome.failures < MOST_FAILURES {
            let left = seconds.saturating_sub(start.elapsed().as_secs());
            if left == 0 || history.executions() >= most {
                break;
            }
            let (before, first) = (seconds_of_children(), history.executions());
            let (executions, is_failed) = self.run_once(left, most, history)?;
            outcome.executions += executions;
            let used = match (before, seconds_of_children()) {
                (Some(before), Some(after)) => after - before,
                _ => start.elapsed().as_secs_f64(),
            };
            outcome.seconds += used;
            outcome.failures += u64::from(is_failed);
            history.end_run(first + executions, used);
            ensure!(executions > 0 || is_failed, "{} runs nothing", self.program.display());
        }
        outcome.edges = history.edges();
        Ok(outcome)
    }

    /// Runs until an input fails; gives the executions and whether one did.
    fn run_once(&self, seconds: u64, most: u64, history: &mut History) -> Result<(u64, bool)> {
        let mut program = Command::new(&self.program);
        program.arg(&self.corpus).args(&self.inputs);
        // Each run draws other numbers, which only follow from what was run before.
        program.arg(format!("-seed={}", 1 + history.runs()));
        program.args([format!("-max_total_time={seconds}"), format!("-timeout={TIMEOUT}")]);
        // libFuzzer takes 32 bits, and 0 or less for no limit.
        program.arg(format!("-runs={}", (most - history.executions()).min(i32::MAX as u64)));
        program.args([format!("-rss_limit_mb={MEMORY}"), "-print_final_stats=1".to_owned()]);
        program.arg(joined("-artifact_prefix=", &self.failures.join("")));
        program.args(self.dictionary.iter().map(|path| joined("-dict=", path)));
        program.env("RAYON_NUM_THREADS", "1").stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
        // Targets write files; in memory they do so at once.
        if Path::new(MEMORY_FOLDER).is_dir() {
            program.env("TMPDIR", MEMORY_FOLDER);
        }
        if let Some(folder) = &self.counts {
            fs::create_dir_all(folder)?;
            program.env("THB_FUZZ_COUNTS", folder.join(history.executions().to_string()));
        }
        let mut child = program.spawn().with_context(|| format!("cannot run {}", self.program.display()))?;
        let said = child.stderr.take().context("what it says is read")?;
        let (first, mut executions) = (history.executions(), 0);
        let mut log = String::new();
        for line in BufReader::new(said).split(b'\n') {
            let line = String::from_utf8_lossy(&line?).into_owned();
            if let Some((done, edges)) = status(&line) {
                executions = executions.max(done);
                history.note(first + done, edges);
            } else if let Some(done) = line.strip_prefix("stat::number_of_executed_units:") {
                executions = executions.max(done.trim().parse().unwrap_or(0));
            } else {
                log.push_str(&line);
                log.push('\n');
            }
        }
        let is_failed = !child.wait()?.success();
        if is_failed {
            // The end names the input, and what came before says what was wrong with it.
            fs::write(self.failures.join(format!("run-{}.log", history.runs())), log)?;
        }
        Ok((executions, is_failed))
    }
}

fn joined(flag: &str, path: &Path) -> OsString {
    let mut argument = OsString::from(flag);
    argument.push(path);
    argument
}

/// Executions and edges of a line such as `#8192 pulse  cov: 415 ft: 873 corp: 96/3Kb`.
fn status(line: &str) -> Option<(u64, u64)> {
    let (executions, rest) = line.strip_prefix('#')?.split_once(|c: char| !c.is_ascii_digit())?;
    let (_, edges) = rest.split_once("cov: ")?;
    Some((executions.parse().ok()?, edges.split(' ').next()?.parse().ok()?))
}

/// Keeps of the inputs in folders those that are needed to reach all that all of them reach, small ones first.
pub(super) fn merge(program: &Path, merged: &Path, folders: &[PathBuf]) -> Result<()> {
    let mut command = Command::new(program);
    command.args(["-merge=1", "-set_cover_merge=1"]).arg(merged).args(folders).env("RAYON_NUM_THREADS", "1");
    command.stdout(Stdio::null()).stderr(Stdio::null());
    let status = command.status().with_context(|| format!("cannot run {}", program.display()))?;
    ensure!(status.success(), "{} cannot merge inputs", program.display());
    Ok(())
}

/// Adds the counts of the runs in a folder to those of a file; gives a sentence about the rarest.
pub(super) fn add_counts(folder: &Path, path: &Path, least: f64) -> Result<String> {
    let mut sums: BTreeMap<(String, String), u64> = BTreeMap::new();
    let mut files: Vec<PathBuf> = fs::read_dir(folder)?.map(|entry| Ok(entry?.path())).collect::<Result<_>>()?;
    files.push(path.to_owned());
    for file in files.iter().filter(|file| file.is_file()) {
        for line in fs::read_to_string(file)?.lines() {
            let fields: Vec<&str> = line.split('\t').collect();
            if let [option, value, count] = fields[..] {
                *sums.entry((option.to_owned(), value.to_owned())).or_default() += count.parse::<u64>()?;
            }
        }
    }
    let mut text = String::new();
    sums.iter().for_each(|((option, value), count)| writeln!(text, "{option}\t{value}\t{count}").unwrap_or_default());
    fs::write(path, text)?;
    fs::remove_dir_all(folder)?;
    let runs = sums.remove(&("runs".to_owned(), String::new())).unwrap_or(0);
    Ok(match sums.iter().min_by_key(|(_, count)| **count) {
        Some(((option, value), &count)) => format!(
            "of {runs} counted runs {count} have {option} {value}, the rarest: {}",
            if count as f64 >= least * runs as f64 { "as often as asked" } else { "TOO FEW" }
        ),
        None => "no runs were counted".to_owned(),
    })
}

/// Seconds that processes have run which were waited for; where the system does not tell, `None`.
fn seconds_of_children() -> Option<f64> {
    /// Units of the times in `/proc` a second, on all of Linux.
    const TICKS: f64 = 100.0;
    let text = fs::read_to_string("/proc/self/stat").ok()?;
    // Behind the name, which may hold blanks: the state, and from field 16 of all on the times of children.
    let fields: Vec<&str> = text.rsplit_once(')')?.1.split_ascii_whitespace().collect();
    let [user, system] = [fields.get(13)?, fields.get(14)?].map(|field| field.parse::<f64>());
    Some((user.ok()? + system.ok()?) / TICKS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_status_are_read() {
        let line =
            "#12288\tNEW    cov: 415 ft: 873 corp: 96/3Kb lim: 58 exec/s: 4096 rss: 45Mb L: 9/57 MS: 1 EraseBytes-";
        assert_eq!(status(line), Some((12288, 415)));
        assert_eq!(status("#2\tINITED cov: 3 ft: 4 corp: 1/1b exec/s: 0 rss: 27Mb"), Some((2, 3)));
        for other in ["", "#", "# words", "INFO: Seed: 1", "#3 0x55d in main"] {
            assert_eq!(status(other), None, "{other}");
        }
    }

    #[test]
    fn counts_add_up_and_the_rarest_is_told() {
        let folder = std::env::temp_dir().join(format!("thb-counts-{}", std::process::id()));
        let (counts, sums) = (folder.join("counts"), folder.join("counts.tsv"));
        for (round, told) in [(1, "as often as asked"), (2, "TOO FEW")] {
            fs::create_dir_all(&counts).unwrap();
            let rare = if round == 1 { 1 } else { 0 };
            fs::write(counts.join("0"), format!("runs\t\t100\n--method\tls\t60\n--method\tqi\t{rare}\n")).unwrap();
            let sentence = add_counts(&counts, &sums, 0.01).unwrap();
            assert!(sentence.contains("--method qi") && sentence.ends_with(told), "{sentence}");
        }
        assert!(fs::read_to_string(&sums).unwrap().contains("runs\t\t200\n"));
        fs::remove_dir_all(&folder).unwrap();
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn the_time_of_children_is_told() {
        let before = seconds_of_children().unwrap();
        let status = Command::new("sh").args(["-c", "i=0; while [ $i -lt 100000 ]; do i=$((i+1)); done"]).status();
        assert!(status.unwrap().success());
        assert!(seconds_of_children().unwrap() > before);
    }
}
