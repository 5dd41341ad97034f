//! What the system tells of this process.

use std::path::Path;
use std::process::{Child, Command};
use std::time::{Duration, Instant};

/// Time that the process spent computing, over all threads, where the system tells it; else time that passed.
pub(crate) struct Clock {
    start: Instant,
    computed: Option<f64>,
}

impl Clock {
    pub(crate) fn start() -> Self {
        Self { start: Instant::now(), computed: computed_seconds() }
    }

    pub(crate) fn seconds(&self) -> f64 {
        match (self.computed, computed_seconds()) {
            (Some(before), Some(now)) => now - before,
            _ => self.start.elapsed().as_secs_f64(),
        }
    }
}

/// User time of this process on Linux.
fn computed_seconds() -> Option<f64> {
    seconds_of("self")
}

/// User time of a process on Linux: the fourteenth field of its status line, in hundredths of a second.
fn seconds_of(process: &str) -> Option<f64> {
    let line = std::fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    let ticks: f64 = line.rsplit(')').next()?.split_whitespace().nth(11)?.parse().ok()?;
    Some(ticks / 100.0)
}

/// Largest memory that this process has had resident, in MiB, where the system tells it.
pub(crate) fn peak_memory() -> Option<f64> {
    memory_of("self")
}

fn memory_of(process: &str) -> Option<f64> {
    let text = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.split_whitespace().next()?.parse::<f64>().ok()? / 1024.0)
}

/// How often a process is looked at.
const LOOK: Duration = Duration::from_millis(20);

/// How another process ended.
pub(crate) struct Ended {
    /// Exit code, where it was not killed.
    pub(crate) code: Option<i32>,
    /// User time over all threads, and largest memory in MiB, where the system tells it, as last seen.
    pub(crate) seconds: Option<f64>,
    pub(crate) memory: Option<f64>,
}

/// Waits for a process and watches what it needs.
pub(crate) fn watch(child: &mut Child) -> std::io::Result<Ended> {
    let process = child.id().to_string();
    let (mut seconds, mut memory) = (None, None);
    loop {
        // Of a process that has ended, but was not waited for, the system still tells the time.
        seconds = seconds_of(&process).or(seconds);
        memory = memory_of(&process).or(memory);
        if let Some(status) = child.try_wait()? {
            return Ok(Ended { code: status.code(), seconds, memory });
        }
        std::thread::sleep(LOOK);
    }
}

/// The last commit that changed some paths below the root of the workspace, with a plus sign if files differ from it; `unknown` without
/// Git.
pub(crate) fn commit(root: &Path, paths: &[&str]) -> String {
    let git = |arguments: &[&str]| {
        let output = Command::new("git").arg("-C").arg(root).args(arguments).arg("--").args(paths).output().ok()?;
        output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    match (git(&["log", "-1", "--format=%h", "--abbrev=10"]), git(&["status", "--porcelain"])) {
        (Some(commit), Some(changes)) => commit + if changes.is_empty() { "" } else { "+" },
        _ => "unknown".to_owned(),
    }
}
