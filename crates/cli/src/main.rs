//! The command line `thb`: arguments to options, to one call of `reconstruct`, to an exit code.

mod args;
mod fit_args;
mod manifest;
mod plan;
mod print_config;
mod progress;
mod report_file;
mod scan_args;
mod settings;
mod solid_args;
mod toml_file;

use std::io::{self, BufWriter, IsTerminal, Write};
use std::ops::ControlFlow;
use std::process::{self, ExitCode};
use std::sync::atomic::{AtomicBool, Ordering};

use clap::{ArgMatches, FromArgMatches};
use reconstruct::{
    BatchEvent, BatchOptions, BatchResult, Error, ErrorKind, Exceeded, Limits, PartOutcome, PartResult, StepOptions,
    Verdict, run_batch,
};
use serde::Serialize;

use args::{Cli, Command, CurveArgs, ParamArgs};
use plan::{Fits, Plan, plan};
use progress::Progress;
use settings::UsageError;

const FAILED: u8 = 1;
const USAGE: u8 = 2;
const TOLERANCE_NOT_REACHED: u8 = 3;
/// What shells give for a program that Ctrl-C ended.
const INTERRUPTED: i32 = 130;

fn main() -> ExitCode {
    let matches = args::command().get_matches();
    let cli = Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    let level = match cli.verbose {
        0 => tracing::Level::ERROR,
        1 => tracing::Level::INFO,
        _ => tracing::Level::DEBUG,
    };
    // Failures are reported by `main` itself; the log is for those who ask for it.
    if cli.verbose > 0 {
        tracing_subscriber::fmt()
            .with_max_level(level)
            .with_writer(io::stderr)
            .with_ansi(io::stderr().is_terminal())
            .init();
    }
    if let Err(error) = clean_up_when_terminated() {
        complain(&format!("signals cannot be handled: {error}"));
    }
    match run(cli.command, &matches) {
        Ok(code) => ExitCode::from(code),
        Err(error) if is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            complain(&format!("{error:#}"));
            let usage = error.downcast_ref().is_some_and(|error: &Error| error.kind() == ErrorKind::Usage)
                || error.downcast_ref::<UsageError>().is_some();
            ExitCode::from(if usage { USAGE } else { FAILED })
        }
    }
}

fn run(command: Command, matches: &ArgMatches) -> anyhow::Result<u8> {
    match command {
        Command::Fit(args) => {
            let typed = matches.subcommand_matches("fit").unwrap_or(matches);
            match plan(&args, typed)? {
                Plan::Fit(fits) => return fit(&fits),
                Plan::Print(text) => write!(io::stdout().lock(), "{text}")?,
            }
        }
        Command::Index { directory, summary } => {
            let parts = reconstruct::join_batch(&directory, summary.as_deref())?;
            writeln!(io::stdout().lock(), "{}", progress::totals(&parts))?;
            return Ok(exit_code(&parts));
        }
        Command::FitCurve(args) => return fit_curve(&args),
        Command::Param(args) => param(&args)?,
        Command::Eval { model, parameters } => {
            let reconstruct::Evaluation { columns, rows, notes } = reconstruct::eval_model(&model, &parameters)?;
            notes.iter().for_each(|note| complain(&progress::named(&parameters, note)));
            let mut out = BufWriter::new(io::stdout().lock());
            writeln!(out, "{}", columns.join(","))?;
            for row in rows.outer_iter() {
                let numbers: Vec<String> = row.iter().map(f64::to_string).collect();
                writeln!(out, "{}", numbers.join(","))?;
            }
            out.flush()?;
        }
        Command::Convert { model, output, max_step_control_points, flip, name, schema } => {
            let header = reconstruct::step_options(name.as_deref().unwrap_or_default(), schema);
            let step = StepOptions { max_control_points: max_step_control_points, flip, ..header };
            reconstruct::convert(&model, &output, &step)?;
        }
        Command::Compare { model, cloud, read, tol, max, p95, points } => {
            let limits = Limits { max, p95 };
            limits.check()?;
            points.iter().try_for_each(|path| reconstruct::check_no_input(&[model.clone(), cloud.clone()], path))?;
            let compared = reconstruct::compare(&model, &cloud, &read.options(), tol)?;
            if let Some(path) = &points {
                reconstruct::write_distances(path, &compared)?;
            }
            print_json(&compared)?;
            let exceeded = limits.exceeded(&compared);
            for Exceeded { name, found, limit } in &exceeded {
                complain(&progress::named(&cloud, &format!("{name} is {found:.4e}, more than --{name} {limit:.4e}")));
            }
            return Ok(if exceeded.is_empty() { 0 } else { TOLERANCE_NOT_REACHED });
        }
        Command::Info { file, read } => print_json(&reconstruct::info(&file, &read.options())?)?,
    }
    Ok(0)
}

/// Fits the parts, says what became of each, and returns the exit code.
fn fit(fits: &Fits) -> anyhow::Result<u8> {
    let Fits { parts, run, batch, warnings } = fits;
    let threads = at_most_four_a_core("--threads", run.threads);
    rayon::ThreadPoolBuilder::new().num_threads(threads).build_global()?;
    let batch = BatchOptions { jobs: at_most_four_a_core("--jobs", batch.jobs), ..batch.clone() };
    if !run.quiet {
        warnings.iter().for_each(|warning| complain(warning));
    }
    let within = parts.first().map_or(1.0, |part| part.options.surface.within);
    let progress = Progress::new(parts.len(), within);
    static IS_INTERRUPTED: AtomicBool = AtomicBool::new(false);
    ctrlc::set_handler(|| {
        if IS_INTERRUPTED.swap(true, Ordering::Relaxed) {
            let _nothing_is_begun = reconstruct::remove_unfinished();
            process::exit(INTERRUPTED);
        }
        complain("ending after this iteration with what there is; interrupt once more to end at once");
    })?;
    let BatchResult { parts: results, summary } = run_batch(parts, &batch, &|event| {
        progress.show(event);
        if IS_INTERRUPTED.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })?;
    progress.finish();
    if io::stderr().is_terminal() {
        progress::summary(&results, &batch.outputs).iter().for_each(|line| complain(line));
    }
    results.iter().for_each(|result| tell(result, run.quiet));
    let summary = summary.map_err(|error| complain(&error.to_string()));
    if results.len() < parts.len() {
        complain(&format!("{} of {} inputs were not begun", parts.len() - results.len(), parts.len()));
        return Ok(FAILED);
    }
    if summary.is_err() {
        return Ok(FAILED);
    }
    Ok(exit_code(&results))
}

/// Says what the user should know of a part, on standard error.
fn tell(result: &PartResult, is_quiet: bool) {
    match &result.outcome {
        PartOutcome::Failed { error } => {
            let is_named = progress::names(&result.input, error);
            complain(&if is_named { error.clone() } else { format!("{}: {error}", result.input.display()) });
        }
        PartOutcome::Fitted { reached, reasons, warnings, .. } => {
            // On a terminal the line stands there already.
            if !reached && !io::stderr().is_terminal() {
                complain(&progress::line(result));
            }
            if !is_quiet {
                reasons.iter().for_each(|reason| complain(&progress::reason(&result.input, reason)));
                warnings.iter().for_each(|warning| complain(&progress::named(&result.input, warning)));
            }
        }
    }
}

fn fit_curve(args: &CurveArgs) -> anyhow::Result<u8> {
    let options = args.options();
    options.check()?;
    reconstruct::check_curve_outputs(&args.input, &args.outputs, args.report.as_deref())?;
    let fit = reconstruct::fit_curve_file(&args.input, &options)?;
    for output in &args.outputs {
        reconstruct::write_curve(output, &fit)?;
    }
    if let Some(path) = &args.report {
        reconstruct::write_report(path, &fit.report)?;
    }
    if !args.quiet {
        fit.report.sentences().for_each(|sentence| complain(&sentence));
    }
    write!(io::stdout().lock(), "{}", fit.report)?;
    Ok(if fit.verdict() == Verdict::Failed { TOLERANCE_NOT_REACHED } else { 0 })
}

fn param(args: &ParamArgs) -> anyhow::Result<()> {
    let options = args.layout.options();
    options.check()?;
    if args.layout.all_pieces() {
        let allowed = "a number here; thb fit takes all";
        return Err(Error::OptionRange { option: "--piece", given: "all".to_owned(), allowed }.into());
    }
    let threads = at_most_four_a_core("--threads", args.threads);
    rayon::ThreadPoolBuilder::new().num_threads(threads).build_global()?;
    reconstruct::check_parameter_outputs(&args.input, &options, &args.outputs, args.report.as_deref())?;
    let progress = Progress::new(1, 1.0);
    let mut watch = |event: reconstruct::Event<'_>| {
        progress.show(BatchEvent::Within { input: &args.input, event });
        ControlFlow::Continue(())
    };
    let laid_out = reconstruct::parameterize_file(&args.input, &options, &mut watch);
    progress.finish();
    let laid_out = laid_out?;
    for output in &args.outputs {
        reconstruct::write_parameters(output, &laid_out)?;
    }
    let report = reconstruct::layout_report(&args.input, &options, &laid_out);
    match &args.report {
        Some(path) => reconstruct::write_report(path, &report)?,
        None => print_json(&report)?,
    }
    Ok(())
}

/// Threads or jobs, at most four times as many as there are cores: more only take memory from each other.
fn at_most_four_a_core(option: &str, asked: usize) -> usize {
    let most = 4 * std::thread::available_parallelism().map_or(1, usize::from);
    if asked > most {
        complain(&format!("{option} {asked} is more than four times the cores; {most} are taken"));
    }
    asked.min(most)
}

/// Ends the process on SIGTERM as that does, without leaving files under temporary names behind.
#[cfg(unix)]
fn clean_up_when_terminated() -> io::Result<()> {
    let mut signals = signal_hook::iterator::Signals::new([signal_hook::consts::SIGTERM])?;
    std::thread::spawn(move || {
        if let Some(signal) = signals.forever().next() {
            let _nothing_is_begun = reconstruct::remove_unfinished();
            // What shells give for a program that a signal ended.
            process::exit(128 + signal);
        }
    });
    Ok(())
}

#[cfg(not(unix))]
fn clean_up_when_terminated() -> io::Result<()> {
    Ok(())
}

/// The worst of all parts.
fn exit_code(results: &[PartResult]) -> u8 {
    let code = |result: &PartResult| match result.outcome {
        PartOutcome::Failed { .. } => FAILED,
        PartOutcome::Fitted { reached: false, .. } => TOLERANCE_NOT_REACHED,
        PartOutcome::Fitted { .. } => 0,
    };
    let worst_first = [FAILED, TOLERANCE_NOT_REACHED];
    worst_first.into_iter().find(|&bad| results.iter().any(|r| code(r) == bad)).unwrap_or(0)
}

fn print_json(value: &impl Serialize) -> anyhow::Result<()> {
    let mut out = io::stdout().lock();
    serde_json::to_writer_pretty(&mut out, value)?;
    Ok(writeln!(out)?)
}

/// A reader that closed its end, such as `head`, has what it wanted.
fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error.chain().any(|cause| {
        cause.downcast_ref::<io::Error>().is_some_and(|e| e.kind() == io::ErrorKind::BrokenPipe)
            || cause
                .downcast_ref::<serde_json::Error>()
                .is_some_and(|e| e.io_error_kind() == Some(io::ErrorKind::BrokenPipe))
    })
}

#[expect(clippy::print_stderr, reason = "the one place where errors are shown")]
fn complain(message: &str) {
    eprintln!("thb: {message}");
}
