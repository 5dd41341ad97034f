//! Runs inputs without libFuzzer: `replay FOLDER...`, each with a folder of inputs for each target, or `replay TARGET FILE...`.
//!
//! Says for each target how many inputs there were and what share of its bounds the worst took; ends with 1 if any failed.

use std::ffi::OsStr;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use fuzz::bounds;
use fuzz::targets::{ALL, Target};

fn main() -> ExitCode {
    fuzz::work_on_this_thread();
    let arguments: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let (only, files): (Option<&OsStr>, &[PathBuf]) = match arguments.split_first() {
        Some((first, files)) if !first.is_dir() => (Some(first.as_os_str()), files),
        _ => (None, &arguments),
    };
    let mut failed = 0;
    for target in ALL {
        if only.is_some_and(|only| only != target.name) {
            continue;
        }
        let inputs: Vec<PathBuf> = match only {
            Some(_) => files.to_vec(),
            None => files.iter().flat_map(|folder| inputs(&folder.join(target.name))).collect(),
        };
        failed += replay(target, &inputs);
    }
    if failed > 0 {
        eprintln!("{failed} input(s) failed");
        return ExitCode::FAILURE;
    }
    ExitCode::SUCCESS
}

/// Times that an input is run before it has failed: on a busy machine the same work may take twice the time of the processor.
const RUNS: usize = 3;

/// Runs inputs; gives how many failed.
fn replay(target: &Target, inputs: &[PathBuf]) -> usize {
    let start = Instant::now();
    let (mut failed, mut worst) = (0, [0.0_f64; 2]);
    for path in inputs {
        let Ok(bytes) = std::fs::read(path) else {
            eprintln!("{}: cannot be read", path.display());
            failed += 1;
            continue;
        };
        bounds::name_running(&path.display().to_string());
        let mut shares = [0.0; 2];
        let is_kept = (0..RUNS).any(|_| {
            let is_kept = catch_unwind(AssertUnwindSafe(|| target.check(&bytes))).is_ok();
            shares = bounds::take_worst();
            is_kept
        });
        if !is_kept {
            eprintln!("{}: failed, as said above", path.display());
            failed += 1;
        }
        worst = [worst[0].max(shares[0]), worst[1].max(shares[1])];
    }
    println!(
        "{:12} {:5} inputs {:4} failed {:6.2} s; at most {:5.1} % of the memory and {:5.1} % of the time",
        target.name,
        inputs.len(),
        failed,
        start.elapsed().as_secs_f64(),
        100.0 * worst[0],
        100.0 * worst[1]
    );
    failed
}

/// The files of a folder, in order; none where there is no folder.
fn inputs(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.path()).filter(|path| path.is_file()).collect();
    files.sort();
    files
}
