//! Fits that end in time.

use std::ops::ControlFlow;
use std::path::Path;

use reconstruct::{Error, Event, Fit, FitOptions, fit_file};

use crate::process::Clock;

/// CPU seconds after which a fit ends with the surface of then.
const LIMIT_SECONDS: f64 = 600.0;

/// Fits a file; the CPU seconds that it took.
pub(crate) fn timed_fit(path: &Path, options: &FitOptions) -> (Result<Fit, Error>, f64) {
    let clock = Clock::start();
    let in_time =
        |_: Event<'_>| if clock.seconds() < LIMIT_SECONDS { ControlFlow::Continue(()) } else { ControlFlow::Break(()) };
    let fit = fit_file(path, options, &mut { in_time });
    (fit, clock.seconds())
}
