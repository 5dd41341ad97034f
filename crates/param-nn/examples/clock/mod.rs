//! Processor time, which other programs do not make longer by much.

use std::time::Instant;

/// Seconds over which runs are averaged: the system counts in ticks of some milliseconds.
const LONG_ENOUGH: f64 = 0.3;

/// Milliseconds that a run takes: of processor time, all threads together, or by the clock on the wall where the system does
/// not tell; and by that clock.
pub(crate) fn milliseconds<E>(mut run: impl FnMut() -> Result<(), E>) -> Result<[f64; 2], E> {
    let (before, wall) = (processor_seconds(), Instant::now());
    for runs in 1.. {
        run()?;
        let passed = wall.elapsed().as_secs_f64();
        let seconds = match (before, processor_seconds()) {
            (Some(before), Some(now)) => now - before,
            _ => passed,
        };
        if seconds > LONG_ENOUGH {
            return Ok([seconds, passed].map(|s| 1e3 * s / f64::from(runs)));
        }
    }
    Ok([f64::INFINITY; 2])
}

/// The sum over the threads of the nanoseconds that Linux counts as spent on a processor.
fn processor_seconds() -> Option<f64> {
    let mut sum = 0.0;
    for task in std::fs::read_dir("/proc/self/task").ok()? {
        let text = std::fs::read_to_string(task.ok()?.path().join("schedstat")).ok()?;
        sum += text.split_whitespace().next()?.parse::<f64>().ok()? * 1e-9;
    }
    Some(sum)
}
