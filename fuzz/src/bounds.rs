//! What an input may cost: memory and time of the processor, from its number of bytes.

use std::backtrace::Backtrace;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, Once};
use std::time::Duration;

use nix::time::{ClockId, clock_gettime};

use crate::allocation;

/// Memory that any input may take, and how much more for each of its bytes, expanded.
const MEMORY: usize = 64 << 20;
const MEMORY_PER_BYTE: usize = 50;

/// Time of the processor for a MiB, and what of it any input may take: an algorithm whose time grows with the square of the size
/// would be within the bound for the small inputs that fuzzing tries, and hours beyond it for a MiB.
const TIME: Duration = Duration::from_secs(2);
const TIME_OF_SMALL: Duration = Duration::from_millis(150);

/// How many times their bounds of time inputs may take. Builds as they are shipped: the same work was seen to take up to 2.3 times as much
/// time of the processor where eight processes share two cores and their memory (12 MiB of heights, 1.2 s to 2.8 s). Builds with counters
/// on all edges and the compiler's checks: as much again.
const ALLOWANCE: u32 = if cfg!(fuzzing) { 4 } else { 2 };

/// How many times its bounds an input may take before the process ends without waiting for the end of it.
const HOPELESS: u32 = 10;

/// How often the time of a running input is looked at.
const LOOK: Duration = Duration::from_millis(200);

/// Time at which the process ends, in nanoseconds; 0 while no input runs.
static DEADLINE: AtomicU64 = AtomicU64::new(0);

/// What runs, for messages.
static RUNNING: Mutex<String> = Mutex::new(String::new());

/// What an input may cost.
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    /// Bytes of memory at a time.
    pub memory: usize,
    /// Time of the processor, by all threads.
    pub time: Duration,
}

impl Bounds {
    /// For reading an input of so many bytes, which expand to so many.
    pub fn of_reading(bytes: usize, expanded: usize) -> Self {
        let share = bytes as f64 / f64::from(1 << 20);
        let small = TIME_OF_SMALL.as_secs_f64();
        let time = match expanded > bytes {
            // How much the bytes expand to follows a rule of its own, which must keep to this.
            true => TIME.mul_f64(share.max(1.0)),
            false => TIME.mul_f64(share).max(Duration::from_secs_f64(small + (TIME.as_secs_f64() - small) * share)),
        };
        Self { memory: MEMORY + MEMORY_PER_BYTE * expanded.max(bytes), time }
    }
}

/// What a piece of work has cost.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cost {
    /// Most bytes of memory at a time.
    pub memory: usize,
    /// Time of the processor.
    pub time: Duration,
}

/// The worst of what has cost most in comparison with its bounds, since [`take_worst`]: shares of the bounds.
static WORST: Mutex<[f64; 2]> = Mutex::new([0.0; 2]);

/// The largest shares of the bounds of memory and time that any work took since the last call.
pub fn take_worst() -> [f64; 2] {
    std::mem::take(&mut WORST.lock().unwrap_or_else(|poisoned| poisoned.into_inner()))
}

/// Names what runs from now on, for the message where the process ends because of it.
pub fn name_running(name: &str) {
    name.clone_into(&mut RUNNING.lock().unwrap_or_else(|poisoned| poisoned.into_inner()));
}

/// Does some work within bounds.
///
/// # Panics
/// If it took more. Far beyond the bounds the process ends at once.
pub fn bounded<T>(bounds: Bounds, work: impl FnOnce() -> T) -> T {
    static WATCH: Once = Once::new();
    WATCH.call_once(|| {
        std::thread::spawn(watch);
    });
    let limit = bounds.time * ALLOWANCE;
    let before = allocation::restart(bounds.memory * HOPELESS as usize);
    let start = processor_time();
    DEADLINE.store((start + limit * HOPELESS).as_nanos() as u64, Ordering::Relaxed);
    let done = work();
    DEADLINE.store(0, Ordering::Relaxed);
    let cost = Cost { memory: allocation::peak().saturating_sub(before), time: processor_time() - start };
    let shares = [cost.memory as f64 / bounds.memory as f64, cost.time.as_secs_f64() / bounds.time.as_secs_f64()];
    {
        let mut worst = WORST.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        *worst = [worst[0].max(shares[0]), worst[1].max(shares[1])];
    }
    assert!(
        cost.memory <= bounds.memory,
        "{}: {} bytes of memory, more than {}",
        running(),
        cost.memory,
        bounds.memory
    );
    assert!(cost.time <= limit, "{}: {:.3?} of the processor, more than {limit:.3?}", running(), cost.time);
    done
}

/// Ends the process with a reason, and where it stood: libFuzzer keeps the input.
pub(crate) fn give_up(reason: &str) -> ! {
    eprintln!("{}: {reason}\n{}", running(), Backtrace::force_capture());
    std::process::abort();
}

/// What runs, unless it is being named.
fn running() -> String {
    RUNNING.try_lock().map_or_else(|_| String::new(), |name| name.clone())
}

fn watch() {
    loop {
        std::thread::sleep(LOOK);
        let deadline = DEADLINE.load(Ordering::Relaxed);
        if deadline > 0 && processor_time().as_nanos() as u64 > deadline {
            give_up("it has taken far more time than it may and goes on");
        }
    }
}

/// Time that all threads of the process have run.
fn processor_time() -> Duration {
    let time = clock_gettime(ClockId::CLOCK_PROCESS_CPUTIME_ID)
        .expect("systems that libFuzzer runs on tell the time of a process");
    Duration::from(time)
}
