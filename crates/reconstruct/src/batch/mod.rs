//! Many parts: one after the other or several at a time; one that fails never stops the others.

mod join;
mod outcome;
mod part;
mod record;

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use crate::output::{Written, write_outputs_and_draw};
use crate::overwriting::check_overwriting;
use crate::paths::is_directory;
use crate::solid_output::write_solid_and_draw;
use crate::{
    Error, Event, LayoutChoice, OutputPaths, check_solid_outputs, fit_file, fit_pieces_file, fit_solid_file,
    step_options, write_piece_outputs,
};
pub use join::join_batch;
use join::{write_index, write_summary};
pub use outcome::{PartOutcome, PartResult, SolidSummary};
pub use part::{BatchPart, PartOptions, scans_in};
pub use record::RECORDS;
use record::{Record, of_part, record_path};

/// Where the results of a batch go, and how many parts are fitted at a time.
#[derive(Clone, Debug, Default)]
pub struct BatchOptions {
    /// Outputs; a single directory for several inputs. A directory keeps a record of each part in [`RECORDS`].
    pub outputs: Vec<PathBuf>,
    /// Reports of a single input: pages (`.html`), all others JSON.
    pub reports: Vec<PathBuf>,
    /// Whether directories get a page a part.
    pub pages: bool,
    /// Whether a directory gets a page of several parts, `index.html`; one of several runs into the same directory leaves that to
    /// [`join_batch`].
    pub index: bool,
    /// Whether parts that a directory has a record of are kept, if neither input nor options nor program have changed and all files are
    /// there.
    pub resume: bool,
    /// Summary of all parts, one JSON object a line in the order of the inputs. Written anew after each part, so that
    /// an interrupted batch leaves one of what is done.
    pub summary: Option<PathBuf>,
    /// Parts fitted at a time; at least one, and no more than there are threads in the pool.
    pub jobs: usize,
}

/// What happens to a part.
#[derive(Clone, Copy, Debug)]
pub enum BatchEvent<'a> {
    /// Something within a part.
    Within {
        /// The input.
        input: &'a Path,
        /// What happened.
        event: Event<'a>,
    },
    /// A part is done with.
    Done(&'a PartResult),
}

/// What became of a batch.
#[derive(Debug)]
pub struct BatchResult {
    /// The parts that were begun, in the order of the inputs.
    pub parts: Vec<PartResult>,
    /// Whether the summary and the page of the batch could be written, the last time they were.
    pub summary: Result<(), Error>,
}

/// A part and what it is written to.
struct Job<'a> {
    part: &'a BatchPart,
    outputs: OutputPaths,
    record: Option<PathBuf>,
}

/// What all parts of a batch share.
struct Shared<'a> {
    batch: &'a BatchOptions,
    taken: BTreeSet<PathBuf>,
    on_event: &'a (dyn Fn(BatchEvent<'_>) -> ControlFlow<()> + Sync),
}

/// Fits every part and writes its outputs. The results stand in the order of the parts. Once `on_event` answers
/// [`ControlFlow::Break`] parts that are being fitted are written as they are, and no other is begun.
///
/// # Errors
/// [`Error::NeedsDirectory`], [`Error::SameName`], [`Error::OutputFormat`], [`Error::SolidFormat`], [`Error::OutputTwice`],
/// [`Error::OutputIsInput`], [`Error::OptionRange`] before anything is read. Errors of a part are part of its result.
pub fn run_batch(
    parts: &[BatchPart],
    batch: &BatchOptions,
    on_event: &(dyn Fn(BatchEvent<'_>) -> ControlFlow<()> + Sync),
) -> Result<BatchResult, Error> {
    check(parts, batch)?;
    let jobs: Vec<Job<'_>> = parts.iter().map(|part| job_of(part, batch)).collect::<Result<_, _>>()?;
    let read: Vec<PathBuf> = parts
        .iter()
        .flat_map(|part| std::iter::once(&part.input).chain(part.options.surface.files()))
        .cloned()
        .collect();
    let index = index_of(parts, batch);
    let all_outputs: Vec<OutputPaths> = jobs.iter().map(|job| job.outputs.clone()).collect();
    let records = jobs.iter().filter_map(|job| job.record.as_ref());
    let taken = check_overwriting(&read, &all_outputs, records.chain(batch.summary.iter()).chain(&index))?;
    let shared = Shared { batch, taken, on_event };
    let results: Mutex<Results> = Mutex::new(Results { parts: vec![None; parts.len()], summary: Ok(()) });
    let work = |i: usize| {
        // Within the pool: the kernels of the factorization keep buffers of twice the last cache for each thread that calls them, a GB on
        // some machines. That of a thread more for each job would not fit where the address space is bounded.
        let result = rayon::scope(|_| result_of(&jobs[i], &shared));
        let further = on_event(BatchEvent::Done(&result));
        if let Ok(mut results) = results.lock() {
            results.parts[i] = Some(result);
            let done = || results.parts.iter().flatten();
            let written = batch.summary.as_ref().map_or(Ok(()), |path| write_summary(path, done()));
            let indexed = index.as_ref().map_or(Ok(()), |path| write_index(path, done()));
            results.summary = written.and(indexed);
        }
        further
    };
    // Each job takes the next part that nobody has taken.
    let next = AtomicUsize::new(0);
    let job = || {
        while let Some(i) = Some(next.fetch_add(1, Ordering::Relaxed)).filter(|&i| i < parts.len()) {
            if work(i).is_break() {
                break;
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..batch.jobs.min(parts.len()).min(rayon::current_num_threads()) {
            scope.spawn(job);
        }
        job();
    });
    let Results { parts, summary } = results.into_inner().unwrap_or_else(PoisonError::into_inner);
    Ok(BatchResult { parts: parts.into_iter().flatten().collect(), summary })
}

/// The parts that are done, and how the last writing of the summary went.
struct Results {
    parts: Vec<Option<PartResult>>,
    summary: Result<(), Error>,
}

/// The page of all parts: in the directory that the parts of a batch are written to.
fn index_of(parts: &[BatchPart], batch: &BatchOptions) -> Option<PathBuf> {
    let directory = batch.outputs.iter().find(|output| is_directory(output))?;
    (batch.index && parts.len() > 1).then(|| directory.join("index.html"))
}

fn job_of<'a>(part: &'a BatchPart, batch: &BatchOptions) -> Result<Job<'a>, Error> {
    let outputs = OutputPaths::of_name(&part.name, &batch.outputs, &batch.reports, batch.pages)?;
    Ok(Job { part, outputs, record: record_path(&batch.outputs, &part.name) })
}

/// Fits a part, or takes what an earlier run made of it, and keeps a record.
fn result_of(job: &Job<'_>, shared: &Shared<'_>) -> PartResult {
    let Some(record) = &job.record else { return fit_part(job, shared) };
    let depends_on = of_part(job.part, &job.outputs);
    if let Some(kept) = Some(record).filter(|_| shared.batch.resume).and_then(|path| Record::kept(path, &depends_on)) {
        return kept;
    }
    if let Err(error) = Record::of_begun(job.part).write(record) {
        return job.ended(Vec::new(), PartOutcome::failed(&error), Vec::new());
    }
    let result = fit_part(job, shared);
    // What was cut short is begun anew.
    let is_cut_short =
        matches!(&result.outcome, PartOutcome::Fitted { stop, .. } if stop == adaptive::Stop::Interrupted.name());
    let depends_on = if is_cut_short { String::new() } else { depends_on };
    match Record::of_done(depends_on, result.clone()).write(record) {
        Ok(()) => result,
        Err(error) => PartResult { outcome: PartOutcome::failed(&error), ..result },
    }
}

/// Fits a part, and writes its outputs.
fn fit_part(job: &Job<'_>, shared: &Shared<'_>) -> PartResult {
    let done = fit_and_write(job, shared);
    let (outputs, outcome, picture) = done.unwrap_or_else(|error| {
        tracing::error!(input = %job.part.input.display(), %error, "failed");
        (Vec::new(), PartOutcome::failed(&error), Vec::new())
    });
    job.ended(outputs, outcome, picture)
}

fn fit_and_write(job: &Job<'_>, shared: &Shared<'_>) -> Result<(Vec<PathBuf>, PartOutcome, Vec<u8>), Error> {
    let Job { part, outputs, .. } = job;
    let mut watch = |event: Event<'_>| (shared.on_event)(BatchEvent::Within { input: &part.input, event });
    outputs.check_writable()?;
    let written = |outputs: &OutputPaths| outputs.files.iter().chain(&outputs.reports).cloned().collect();
    if part.is_solid(&shared.batch.outputs) {
        let outputs = outputs.of_solid(&shared.batch.outputs);
        let layout = match &part.options.solid.layout {
            LayoutChoice::Auto => LayoutChoice::Patches,
            given => given.clone(),
        };
        let options = crate::SolidOptions { layout, ..part.options.solid.clone() };
        let fit = fit_solid_file(&part.input, &options, &mut watch)?;
        let step = step_options(&part.product, part.options.surface.schema);
        let Written { picture, step } = write_solid_and_draw(&fit, &outputs.files, &outputs.reports, &step)?;
        return Ok((written(&outputs), PartOutcome::of_solid(&fit, step), picture));
    }
    let options = &part.options.surface;
    if options.all_pieces {
        let mut fits = fit_pieces_file(&part.input, options, &mut watch)?;
        fits.pieces.iter_mut().filter_map(|piece| piece.fit.as_mut().ok()).for_each(|fit| part.sign(fit));
        return Ok((write_piece_outputs(&fits, outputs, &shared.taken)?, PartOutcome::of_pieces(&fits), Vec::new()));
    }
    let mut fit = fit_file(&part.input, options, &mut watch)?;
    part.sign(&mut fit);
    let Written { picture, step } = write_outputs_and_draw(&fit, outputs)?;
    Ok((written(outputs), PartOutcome::of_report(fit.report, step), picture))
}

impl Job<'_> {
    fn ended(&self, outputs: Vec<PathBuf>, outcome: PartOutcome, picture: Vec<u8>) -> PartResult {
        PartResult { input: self.part.input.clone(), outputs, outcome, kept: false, picture }
    }
}

/// Checks what can be told before anything is read.
fn check(parts: &[BatchPart], batch: &BatchOptions) -> Result<(), Error> {
    let named_files: Vec<PathBuf> = batch.outputs.iter().filter(|output| !is_directory(output)).cloned().collect();
    for part in parts {
        part.options.surface.check()?;
        if matches!(part.options.solid.layout, LayoutChoice::Patches | LayoutChoice::File(_)) {
            part.options.solid.check()?;
            check_solid_outputs(&named_files, &[])?;
        }
    }
    if parts.len() < 2 {
        return Ok(());
    }
    if let Some(path) = named_files.iter().chain(&batch.reports).next() {
        return Err(Error::NeedsDirectory { path: path.clone(), count: parts.len() });
    }
    let mut seen: BTreeMap<&OsString, &PathBuf> = BTreeMap::new();
    for part in parts {
        if let Some(first) = seen.insert(&part.name, &part.input) {
            let name = part.name.to_string_lossy().into_owned();
            return Err(Error::SameName { first: first.clone(), second: part.input.clone(), name });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::FitOptions;

    #[test]
    fn an_observer_that_breaks_gets_what_was_found_and_no_further_part() {
        let folder = tempfile::tempdir().unwrap();
        let mut text = String::from("u,v,x,y,z\n");
        for k in 0..400 {
            let (u, v) = (f64::from(k % 20) / 19.0, f64::from(k / 20) / 19.0);
            text += &format!("{u},{v},{u},{v},{}\n", (9.0 * u * v).sin());
        }
        let inputs = ["first.csv", "second.csv"].map(|name| folder.path().join(name));
        inputs.iter().for_each(|input| std::fs::write(input, &text).unwrap());
        let out = folder.path().join("out");
        let options = FitOptions { tol: crate::Tolerance::Absolute(1e-9), ..FitOptions::default() };
        let parts = inputs.map(|input| BatchPart::new(input, options.clone().into()));
        let batch = BatchOptions { outputs: vec![out.clone()], jobs: 1, ..BatchOptions::default() };
        let observer = |event: BatchEvent<'_>| match event {
            BatchEvent::Within { event: Event::Iteration(_), .. } | BatchEvent::Done(_) => ControlFlow::Break(()),
            BatchEvent::Within { .. } => ControlFlow::Continue(()),
        };
        let results = run_batch(&parts, &batch, &observer).unwrap().parts;
        assert_eq!(results.len(), 1);
        assert!(
            matches!(results[0].outcome, PartOutcome::Fitted { ref stop, reached: false, .. } if stop == "interrupted")
        );
        assert!(out.join("first.step").is_file() && !out.join("second.step").exists());
    }
}
