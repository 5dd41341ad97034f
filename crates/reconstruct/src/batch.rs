//! Many parts: one after the other or several at a time; one that fails never stops the others.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use deviation::{Reason, Verdict};
use report_page::{IndexRow, Tone};
use serde::Serialize;

use crate::options::{all_shown, shown};
use crate::output::{check_no_page, check_parameter_format, is_directory, is_page, part_name, write_outputs_and_draw};
use crate::page::tone;
use crate::paths::identity;
use crate::{
    Error, Event, FitOptions, OutputPaths, ParameterOptions, PieceFits, Report, ReweightingReport, fit_file,
    fit_pieces_file, write_piece_outputs, write_text,
};

/// Where the results of a batch go, and how many parts are fitted at a time.
#[derive(Clone, Debug, Default)]
pub struct BatchOptions {
    /// Outputs; a single directory for several inputs.
    pub outputs: Vec<PathBuf>,
    /// Reports of a single input: pages (`.html`), all others JSON.
    pub reports: Vec<PathBuf>,
    /// Whether directories get a page a part, and with several inputs a page of all, `index.html`.
    pub pages: bool,
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

/// What became of a part.
#[derive(Clone, Debug, Serialize)]
pub struct PartResult {
    /// The input file.
    #[serde(serialize_with = "shown")]
    pub input: PathBuf,
    /// Files written.
    #[serde(serialize_with = "all_shown")]
    pub outputs: Vec<PathBuf>,
    /// What became of it.
    #[serde(flatten)]
    pub outcome: PartOutcome,
    /// A small picture of it, as PNG, where it has a page; else empty.
    #[serde(skip)]
    pub picture: Vec<u8>,
}

/// What became of a part.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "status", rename_all = "kebab-case")]
pub enum PartOutcome {
    /// Fitted and written; `stop` says whether the tolerance was reached.
    Fitted {
        /// Whether the verdict is better than `failed`.
        reached: bool,
        /// How good the surface is.
        verdict: Verdict,
        /// Why it is not good.
        reasons: Vec<Reason>,
        /// Why the loop ended.
        stop: &'static str,
        /// How many pieces were fitted, where each is for itself: the figures are then the sums, or those of the worst piece; absent
        /// without.
        #[serde(skip_serializing_if = "Option::is_none")]
        pieces: Option<usize>,
        /// Control points.
        dofs: usize,
        /// Levels.
        levels: usize,
        /// Largest distance.
        max: f64,
        /// Root of the mean squared distance.
        rmse: f64,
        /// Share of points within the tolerance.
        within: f64,
        /// The tolerance.
        tolerance: f64,
        /// The smoothing weight that was used.
        lambda: f64,
        /// What came of robust losses and markers; absent without.
        #[serde(skip_serializing_if = "Option::is_none")]
        reweighting: Option<Box<ReweightingReport>>,
        /// Seconds.
        seconds: f64,
        /// What the user should know.
        warnings: Vec<String>,
    },
    /// Failed; nothing was written, or only what the error does not concern.
    Failed {
        /// The error.
        error: String,
    },
}

/// What became of a batch.
#[derive(Debug)]
pub struct BatchResult {
    /// The parts that were begun, in the order of the inputs.
    pub parts: Vec<PartResult>,
    /// Whether the summary and the page of the batch could be written, the last time they were.
    pub summary: Result<(), Error>,
}

/// Fits every input and writes its outputs. The results stand in the order of the inputs. Once `on_event` answers
/// [`ControlFlow::Break`] parts that are being fitted are written as they are, and no other is begun.
///
/// # Errors
/// [`Error::NeedsDirectory`], [`Error::SameName`], [`Error::OutputFormat`], [`Error::OutputTwice`],
/// [`Error::OutputIsInput`] before anything is read. Errors of a part are part of its result.
pub fn run_batch(
    inputs: &[PathBuf],
    options: &FitOptions,
    batch: &BatchOptions,
    on_event: &(dyn Fn(BatchEvent<'_>) -> ControlFlow<()> + Sync),
) -> Result<BatchResult, Error> {
    options.check()?;
    check_outputs(inputs, batch)?;
    let outputs: Vec<OutputPaths> = inputs
        .iter()
        .map(|input| OutputPaths::of(input, &batch.outputs, &batch.reports, batch.pages))
        .collect::<Result<_, _>>()?;
    let read: Vec<PathBuf> = inputs.iter().chain(options.files()).cloned().collect();
    let index = index_of(inputs, batch);
    let taken = check_overwriting(&read, &outputs, batch.summary.iter().chain(&index))?;
    let results: Mutex<Results> = Mutex::new(Results { parts: vec![None; inputs.len()], summary: Ok(()) });
    let work = |i: usize| {
        // Within the pool: the kernels of the factorization keep buffers of twice the last cache for each thread that calls them, a GB on
        // some machines. That of a thread more for each job would not fit where the address space is bounded.
        let result = rayon::scope(|_| fit_part(&inputs[i], &outputs[i], &taken, options, on_event));
        let further = on_event(BatchEvent::Done(&result));
        if let Ok(mut results) = results.lock() {
            results.parts[i] = Some(result);
            let written = batch.summary.as_ref().map_or(Ok(()), |path| write_summary(path, &results.parts));
            let indexed = index.as_ref().map_or(Ok(()), |path| write_index(path, &results.parts));
            results.summary = written.and(indexed);
        }
        further
    };
    // Each job takes the next part that nobody has taken.
    let next = AtomicUsize::new(0);
    let job = || {
        while let Some(i) = Some(next.fetch_add(1, Ordering::Relaxed)).filter(|&i| i < inputs.len()) {
            if work(i).is_break() {
                break;
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..batch.jobs.min(inputs.len()).min(rayon::current_num_threads()) {
            scope.spawn(job);
        }
        job();
    });
    let Results { parts, summary } = results.into_inner().unwrap_or_else(PoisonError::into_inner);
    Ok(BatchResult { parts: parts.into_iter().flatten().collect(), summary })
}

/// The page of all parts: in the directory that the parts of a batch are written to.
fn index_of(inputs: &[PathBuf], batch: &BatchOptions) -> Option<PathBuf> {
    let directory = batch.outputs.iter().find(|output| is_directory(output))?;
    (batch.pages && inputs.len() > 1).then(|| directory.join("index.html"))
}

/// The parts that are done, and how the last writing of the summary went.
struct Results {
    parts: Vec<Option<PartResult>>,
    summary: Result<(), Error>,
}

fn write_summary(path: &Path, parts: &[Option<PartResult>]) -> Result<(), Error> {
    let mut lines = String::new();
    for part in parts.iter().flatten() {
        let line = serde_json::to_string(part);
        lines += &line.map_err(|source| Error::Io { path: path.to_owned(), source: source.into() })?;
        lines.push('\n');
    }
    write_text(path, &lines)
}

fn write_index(path: &Path, parts: &[Option<PartResult>]) -> Result<(), Error> {
    let rows: Vec<IndexRow> = parts.iter().flatten().map(PartResult::index_row).collect();
    let directory = path.parent().and_then(Path::file_name).unwrap_or_default();
    write_text(path, &report_page::index(&directory.to_string_lossy(), &rows))
}

impl PartResult {
    /// The row of the part in the page of a batch.
    fn index_row(&self) -> IndexRow {
        let page = self.outputs.iter().find(|path| is_page(path)).and_then(|path| path.file_name());
        let (verdict, tone, figures, reasons) = match &self.outcome {
            PartOutcome::Failed { error } => ("no surface", Tone::Failed, None, vec![error.clone()]),
            PartOutcome::Fitted { verdict, reasons, dofs, within, max, tolerance, seconds, .. } => {
                let figures = Some([*dofs as f64, *within, *max, *tolerance, *seconds]);
                let reasons = reasons.iter().map(|reason| reason.text.clone()).collect();
                (verdict.name(), tone(*verdict), figures, reasons)
            }
        };
        IndexRow {
            name: self.input.file_name().unwrap_or_default().to_string_lossy().into_owned(),
            page: page.unwrap_or_default().to_string_lossy().into_owned(),
            verdict: verdict.to_owned(),
            tone,
            figures,
            reasons,
            picture: self.picture.clone(),
        }
    }
}

fn fit_part(
    input: &Path,
    outputs: &OutputPaths,
    taken: &BTreeSet<PathBuf>,
    options: &FitOptions,
    on_event: &(dyn Fn(BatchEvent<'_>) -> ControlFlow<()> + Sync),
) -> PartResult {
    let mut watch = |event: Event<'_>| on_event(BatchEvent::Within { input, event });
    let mut fit_and_write = || -> Result<(Vec<PathBuf>, PartOutcome, Vec<u8>), Error> {
        outputs.check_writable()?;
        if options.all_pieces {
            let fits = fit_pieces_file(input, options, &mut watch)?;
            return Ok((write_piece_outputs(&fits, outputs, taken)?, PartOutcome::of_pieces(&fits), Vec::new()));
        }
        let fit = fit_file(input, options, &mut watch)?;
        let picture = write_outputs_and_draw(&fit, outputs)?;
        let written = outputs.files.iter().chain(&outputs.reports).cloned().collect();
        Ok((written, PartOutcome::of_report(fit.report), picture))
    };
    let (outputs, outcome, picture) = fit_and_write().unwrap_or_else(|error| {
        tracing::error!(input = %input.display(), %error, "failed");
        (Vec::new(), PartOutcome::Failed { error: error.to_string() }, Vec::new())
    });
    PartResult { input: input.to_owned(), outputs, outcome, picture }
}

impl PartOutcome {
    fn of_report(report: Report) -> Self {
        Self::Fitted {
            reached: report.result.reached,
            verdict: report.result.verdict,
            reasons: report.result.reasons,
            stop: report.result.stop,
            pieces: None,
            dofs: report.result.dofs,
            levels: report.result.levels,
            max: report.result.max,
            rmse: report.result.rmse,
            within: report.result.within,
            tolerance: report.result.tolerance,
            lambda: report.result.lambda,
            reweighting: report.result.reweighting.map(Box::new),
            seconds: report.result.seconds,
            warnings: report.warnings,
        }
    }

    /// Of all pieces: failed if one could not be fitted, else as bad as the worst one.
    fn of_pieces(fits: &PieceFits) -> Self {
        if let Some(error) = fits.error() {
            return Self::Failed { error };
        }
        let of_piece = |number: usize, text: &str| format!("piece {number}: {text}");
        let (mut reasons, mut warnings) = (Vec::new(), fits.warnings.clone());
        let (mut dofs, mut levels, mut points) = (0, 0, 0.0);
        let (mut within, mut squares, mut seconds) = (0.0, 0.0, 0.0);
        let mut worst: Option<&Report> = None;
        for (number, report) in fits.fitted().map(|(number, fit)| (number, &fit.report)) {
            let result = &report.result;
            reasons.extend(
                result.reasons.iter().map(|reason| Reason { text: of_piece(number, &reason.text), ..reason.clone() }),
            );
            warnings.extend(report.warnings.iter().map(|warning| of_piece(number, warning)));
            let count = report.input.fitted_points as f64;
            dofs += result.dofs;
            levels = levels.max(result.levels);
            points += count;
            within += count * result.within;
            squares += count * result.mse;
            seconds += result.seconds;
            // Of equal verdicts the piece that misses its tolerance by most.
            let rank = |report: &Report| (report.result.verdict, report.result.max / report.result.tolerance);
            let is_worse = |other: &Report| rank(other) < rank(report);
            worst = worst.filter(|other| !is_worse(other)).or(Some(report));
        }
        let Some(Report { result: worst, .. }) = worst else {
            return Self::Failed { error: "no piece is left".to_owned() };
        };
        Self::Fitted {
            reached: worst.reached,
            verdict: worst.verdict,
            reasons,
            stop: worst.stop,
            pieces: Some(fits.pieces.len()),
            dofs,
            levels,
            max: worst.max,
            rmse: (squares / points).sqrt(),
            within: within / points,
            tolerance: worst.tolerance,
            lambda: worst.lambda,
            reweighting: None,
            seconds,
            warnings,
        }
    }
}

fn check_outputs(inputs: &[PathBuf], batch: &BatchOptions) -> Result<(), Error> {
    if inputs.len() < 2 {
        return Ok(());
    }
    let files = batch.outputs.iter().filter(|output| !is_directory(output)).chain(&batch.reports);
    if let Some(path) = files.into_iter().next() {
        return Err(Error::NeedsDirectory { path: path.clone(), count: inputs.len() });
    }
    let mut seen: BTreeMap<OsString, &PathBuf> = BTreeMap::new();
    for input in inputs {
        let name = part_name(input);
        if let Some(first) = seen.insert(name.clone(), input) {
            let name = name.to_string_lossy().into_owned();
            return Err(Error::SameName { first: first.clone(), second: input.clone(), name });
        }
    }
    Ok(())
}

/// Checks the outputs of parameters before anything is read.
///
/// # Errors
/// [`Error::ParameterFormat`], [`Error::NoPage`], [`Error::OutputTwice`], [`Error::OutputIsInput`].
pub fn check_parameter_outputs(
    input: &Path,
    options: &ParameterOptions,
    outputs: &[PathBuf],
    report: Option<&Path>,
) -> Result<(), Error> {
    for path in outputs {
        check_parameter_format(path)?;
    }
    check_no_page(report)?;
    let paths = OutputPaths { files: outputs.to_vec(), reports: report.map(Path::to_owned).into_iter().collect() };
    let read: Vec<PathBuf> =
        std::iter::once(input).chain(options.files().map(PathBuf::as_path)).map(Path::to_owned).collect();
    check_overwriting(&read, &[paths], []).map(drop)
}

/// Checks that no output is an input or another output; returns what all of them are known by.
pub(crate) fn check_overwriting<'a>(
    inputs: &[PathBuf],
    outputs: &'a [OutputPaths],
    others: impl IntoIterator<Item = &'a PathBuf>,
) -> Result<BTreeSet<PathBuf>, Error> {
    let read: BTreeSet<PathBuf> = inputs.iter().map(|input| identity(input)).collect();
    let mut written = BTreeSet::new();
    for path in outputs.iter().flat_map(|paths| paths.files.iter().chain(&paths.reports)).chain(others) {
        let identity = identity(path);
        if read.contains(&identity) {
            return Err(Error::OutputIsInput { path: path.clone() });
        }
        if !written.insert(identity) {
            return Err(Error::OutputTwice { path: path.clone() });
        }
    }
    written.extend(read);
    Ok(written)
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let batch = BatchOptions { outputs: vec![out.clone()], jobs: 1, ..BatchOptions::default() };
        let options = FitOptions { tol: crate::Tolerance::Absolute(1e-9), ..FitOptions::default() };
        let observer = |event: BatchEvent<'_>| match event {
            BatchEvent::Within { event: Event::Iteration(_), .. } | BatchEvent::Done(_) => ControlFlow::Break(()),
            BatchEvent::Within { .. } => ControlFlow::Continue(()),
        };
        let results = run_batch(&inputs, &options, &batch, &observer).unwrap().parts;
        assert_eq!(results.len(), 1);
        assert!(matches!(results[0].outcome, PartOutcome::Fitted { stop: "interrupted", reached: false, .. }));
        assert!(out.join("first.step").is_file() && !out.join("second.step").exists());
    }
}
