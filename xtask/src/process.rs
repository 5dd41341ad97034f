//! What the system tells of this process.

use std::time::Instant;

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

/// User time of the process on Linux: the fourteenth field of its status line, in hundredths of a second.
fn computed_seconds() -> Option<f64> {
    let line = std::fs::read_to_string("/proc/self/stat").ok()?;
    let ticks: f64 = line.rsplit(')').next()?.split_whitespace().nth(11)?.parse().ok()?;
    Some(ticks / 100.0)
}

/// Largest memory that this process has had resident, in MiB, where the system tells it.
pub(crate) fn peak_memory() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.split_whitespace().next()?.parse::<f64>().ok()? / 1024.0)
}
