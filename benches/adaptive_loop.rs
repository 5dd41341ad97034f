//! The whole adaptive loop on the peaks problem, with seconds per phase and memory per point.
//!
//! A million points; ten million if `LONG` is set in the environment. The peak of resident memory belongs to a whole
//! process, so each run is a process of its own: this program starts itself with the number of points as argument.
//! Criterion has no part in it, since one loop takes a second and its phases matter more than their sum.

use std::process::Command;
use std::time::Instant;

use adaptive::{Iteration, Seconds};
use fit_ls::LeastSquares;
use workspace_benches::memory::{Resident, resident};
use workspace_benches::problem::{self, Failure};

const POINTS: usize = 1_000_000;
const MANY_POINTS: usize = 10_000_000;

/// Names the argument by which the program calls itself.
const CHILD: &str = "--points";

fn main() -> Result<(), Failure> {
    let mut arguments = std::env::args().skip_while(|argument| argument != CHILD);
    if let (Some(_), Some(points)) = (arguments.next(), arguments.next()) {
        return measure(points.parse()?);
    }
    let sizes = if std::env::var_os("LONG").is_some() { vec![POINTS, MANY_POINTS] } else { vec![POINTS] };
    for points in sizes {
        for threads in [1, 2] {
            let mut child = Command::new(std::env::current_exe()?);
            child.args([CHILD, &points.to_string()]).env("RAYON_NUM_THREADS", threads.to_string());
            if !child.status()?.success() {
                return Err(format!("the run with {points} points and {threads} threads failed").into());
            }
        }
    }
    Ok(())
}

#[expect(clippy::print_stdout, reason = "a benchmark prints its result")]
fn measure(m: usize) -> Result<(), Failure> {
    let (parameters, points) = problem::points(m);
    let before = resident(Resident::Now);
    let start = Instant::now();
    let mut method = LeastSquares::new(parameters.view(), points.view(), None, problem::fitting())?;
    let outcome = problem::adapt(&mut method, 2, usize::MAX)?;
    let whole = start.elapsed().as_secs_f64();

    println!("{m} points, {} thread(s)", rayon::current_num_threads());
    println!(
        "{:>5} {:>13} {:>13} {:>9} {:>9} {:>9} {:>9}",
        "dofs", "max", "mse", "assemble", "solve", "estimate", "refine"
    );
    for Iteration { dofs, deviation, seconds, .. } in &outcome.history {
        println!("{dofs:5} {:13.6e} {:13.6e} {}", deviation.max, deviation.mse, columns(*seconds));
    }
    let total = outcome.history.iter().fold(Seconds::default(), |sum, i| Seconds {
        assemble: sum.assemble + i.seconds.assemble,
        solve: sum.solve + i.seconds.solve,
        estimate: sum.estimate + i.seconds.estimate,
        refine: sum.refine + i.seconds.refine,
    });
    println!("{:>33} {}, in all {whole:.3} s", "sum", columns(total));
    if let (Some(before), Some(peak)) = (before, resident(Resident::Peak)) {
        let per_point = peak.saturating_sub(before) as f64 / m as f64;
        println!("memory beyond the points as read: {per_point:.0} bytes a point");
    }
    Ok(())
}

fn columns(seconds: Seconds) -> String {
    let Seconds { assemble, solve, estimate, refine } = seconds;
    format!("{assemble:9.4} {solve:9.4} {estimate:9.4} {refine:9.4}")
}
