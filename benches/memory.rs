//! Resident memory of this process.

/// A line of the process status as the kernel keeps it.
#[derive(Clone, Copy, Debug)]
pub enum Resident {
    /// What is resident now.
    Now,
    /// The largest amount since the process started; it cannot be reset, so each measurement needs its own process.
    Peak,
}

/// Resident memory in bytes; `None` where the kernel keeps no such file.
pub fn resident(which: Resident) -> Option<u64> {
    let key = match which {
        Resident::Now => "VmRSS:",
        Resident::Peak => "VmHWM:",
    };
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix(key))?;
    let kibibytes: u64 = line.split_whitespace().next()?.parse().ok()?;
    Some(1024 * kibibytes)
}
