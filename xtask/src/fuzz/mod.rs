//! Fuzzing: builds the targets of the folder `fuzz` with libFuzzer and runs them in turn, or replays the committed inputs.
//!
//! The state of long runs is a folder: inputs that reach something new, inputs that fail, and how executions and edges grew. It
//! may be lost; `docs/results/fuzz.tsv` has the sums of all runs.

mod history;
mod results;
mod session;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};

use history::History;
use results::Results;
use session::Session;

/// Where the sums of all runs are.
const RESULTS: &str = "docs/results/fuzz.tsv";

/// The profile of instrumented builds in `fuzz/Cargo.toml`.
const PROFILE: &str = "fuzzing";

/// What the compiler needs to count the edges that an input reaches. All of it is stable; cargo-fuzz sets the same.
const FLAGS: &str = "--cfg fuzzing -Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
                     -Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table";

/// The target whose runs are counted by options, and the least share of its runs with each value.
const COUNTED: &str = "tiny_fits";
const LEAST_SHARE: f64 = 0.01;

/// What is run, and for how long.
pub struct Fuzz<'a> {
    /// The folder of the workspace.
    pub root: &'a Path,
    /// Targets; none for all.
    pub targets: Vec<String>,
    /// The folder of the state, which need not exist.
    pub state: PathBuf,
    /// The folder of programs of libFuzzer that were built before; `None` to build them.
    pub programs: Option<PathBuf>,
}

impl Fuzz<'_> {
    /// Runs the targets in turn, all in so many seconds and each up to so many executions of the state, and adds what they did to
    /// the results.
    ///
    /// # Errors
    /// What building, running and writing meet; inputs that failed are no error.
    pub fn run(&self, seconds: u64, executions: u64, say: &mut dyn FnMut(&str)) -> Result<()> {
        let targets = self.chosen()?;
        let programs = self.build(&targets)?;
        let path = self.root.join(RESULTS);
        for target in &targets {
            let session = Session {
                program: programs.join(target),
                inputs: self.inputs(target),
                corpus: self.made(&["corpus", target])?,
                failures: self.made(&["failures", target])?,
                dictionary: Some(self.root.join("fuzz/dictionaries").join(format!("{target}.dict")))
                    .filter(|p| p.is_file()),
                counts: (target == COUNTED).then(|| self.state.join("counts")),
            };
            let of_history = self.made(&["history"])?.join(format!("{target}.tsv"));
            let mut history = History::read(&of_history)?;
            let outcome = session.run(seconds / targets.len() as u64, executions, &mut history)?;
            history.write(&of_history)?;
            // Another run may have written meanwhile.
            let mut results = Results::read(&path)?;
            results.add(target, &outcome, &history);
            results.write(&path)?;
            say(&format!(
                "{target}: {} executions, {:.0} s, {} edges, {} failures",
                outcome.executions, outcome.seconds, outcome.edges, outcome.failures
            ));
            if let Some(counts) = &session.counts {
                say(&session::add_counts(counts, &self.state.join("counts.tsv"), LEAST_SHARE)?);
            }
        }
        Ok(())
    }

    /// Keeps of the committed and of all found inputs those that are needed to reach all edges, small ones first, as the committed ones.
    ///
    /// # Errors
    /// What building, running and writing meet.
    pub fn minimize(&self, say: &mut dyn FnMut(&str)) -> Result<()> {
        let targets = self.chosen()?;
        let programs = self.build(&targets)?;
        for target in &targets {
            let (committed, merged) = (self.root.join("fuzz/corpus").join(target), self.made(&["merged", target])?);
            fs::remove_dir_all(&merged)?;
            fs::create_dir(&merged)?;
            let found = self.made(&["corpus", target])?;
            session::merge(&programs.join(target), &merged, &[committed.clone(), found])?;
            fs::remove_dir_all(&committed)?;
            fs::create_dir_all(&committed)?;
            let (mut count, mut bytes) = (0, 0);
            for entry in fs::read_dir(&merged)? {
                let entry = entry?;
                bytes += fs::copy(entry.path(), committed.join(entry.file_name()))?;
                count += 1;
            }
            say(&format!("{target}: {count} inputs, {bytes} bytes"));
        }
        Ok(())
    }

    /// Runs all committed inputs, on the compiler as it is and without libFuzzer, within the bounds of memory and time.
    ///
    /// # Errors
    /// If one fails, or the program cannot be built.
    pub fn replay(&self) -> Result<()> {
        let arguments = ["--release", "--no-default-features", "--bin", "replay"].map(str::to_owned);
        self.cargo(&arguments, None)?;
        let program = self.target_folder().join("release/replay");
        let folders = ["fuzz/corpus", "fuzz/regressions"].map(|folder| self.root.join(folder));
        let status = Command::new(&program).args(folders).env("RAYON_NUM_THREADS", "1").status();
        let status = status.with_context(|| format!("cannot run {}", program.display()))?;
        ensure!(status.success(), "an input failed, or ended the process");
        Ok(())
    }

    /// The targets to run, in order.
    fn chosen(&self) -> Result<Vec<String>> {
        let mut all = Vec::new();
        for entry in fs::read_dir(self.root.join("fuzz/fuzz_targets"))? {
            let path = entry?.path();
            all.extend(path.file_stem().and_then(|stem| stem.to_str()).map(str::to_owned));
        }
        all.sort();
        if let Some(unknown) = self.targets.iter().find(|target| !all.contains(target)) {
            bail!("there is no target {unknown}; there are {}", all.join(", "));
        }
        Ok(if self.targets.is_empty() { all } else { self.targets.clone() })
    }

    /// Builds programs of libFuzzer, unless they are there; gives their folder.
    fn build(&self, targets: &[String]) -> Result<PathBuf> {
        if let Some(programs) = &self.programs {
            return Ok(programs.clone());
        }
        let host = host()?;
        let mut arguments = ["--profile", PROFILE, "--target", &host].map(str::to_owned).to_vec();
        arguments.extend(targets.iter().flat_map(|target| ["--bin".to_owned(), target.clone()]));
        self.cargo(&arguments, Some(FLAGS))?;
        Ok(self.target_folder().join(host).join(PROFILE))
    }

    fn cargo(&self, arguments: &[String], flags: Option<&str>) -> Result<()> {
        let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
        cargo.args(["build", "--locked", "--manifest-path"]).arg(self.root.join("fuzz/Cargo.toml"));
        cargo.arg("--target-dir").arg(self.target_folder()).args(arguments);
        if let Some(flags) = flags {
            cargo.env("RUSTFLAGS", flags);
        }
        ensure!(cargo.status().context("cannot run cargo")?.success(), "the targets cannot be built");
        Ok(())
    }

    fn target_folder(&self) -> PathBuf {
        std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| self.root.join("target"), PathBuf::from)
    }

    /// Folders of committed inputs that are there.
    fn inputs(&self, target: &str) -> Vec<PathBuf> {
        let folders = ["fuzz/corpus", "fuzz/regressions"].map(|folder| self.root.join(folder).join(target));
        folders.into_iter().filter(|folder| folder.is_dir()).collect()
    }

    /// A folder of the state, made where it is missing.
    fn made(&self, parts: &[&str]) -> Result<PathBuf> {
        let folder = parts.iter().fold(self.state.clone(), |folder, part| folder.join(part));
        fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
        Ok(folder)
    }
}

/// The platform that the compiler runs on. Named as the one to build for, it keeps the flags from build scripts.
fn host() -> Result<String> {
    let version = Command::new("rustc").arg("-vV").output().context("cannot run rustc")?;
    let version = String::from_utf8(version.stdout)?;
    version.lines().find_map(|line| line.strip_prefix("host: ")).map(str::to_owned).context("rustc names no host")
}
