//! Progress on a terminal; silence when piped.

use std::io::{IsTerminal, stderr};
use std::path::Path;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use reconstruct::{BatchEvent, Event, PartOutcome, PartResult, Reason, SolidFit, Verdict};

/// Shows how far a batch is.
pub(crate) struct Progress {
    bar: ProgressBar,
    within: f64,
}

impl Progress {
    pub(crate) fn new(parts: usize, within: f64) -> Self {
        let target = if stderr().is_terminal() { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(Some(parts as u64), target);
        let template = if parts > 1 { "{spinner} {bar:20} {pos}/{len} {msg}" } else { "{spinner} {elapsed} {msg}" };
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        bar.enable_steady_tick(Duration::from_millis(120));
        Self { bar, within }
    }

    pub(crate) fn show(&self, event: BatchEvent<'_>) {
        match event {
            BatchEvent::Within { input, event: Event::Step(step) } => {
                self.bar.set_message(format!("{}: {step}", name(input)));
            }
            BatchEvent::Within { input, event: Event::Iteration(record) } => self.bar.set_message(format!(
                "{}: iteration {}, {} control points, max {:.3e}, {:.1} of {:.1} % within tolerance",
                name(input),
                record.iteration,
                record.dofs,
                record.deviation.max,
                100.0 * record.deviation.within,
                100.0 * self.within,
            )),
            BatchEvent::Done(result) => {
                self.bar.println(line(result));
                self.bar.inc(1);
            }
        }
    }

    /// Prints a line above the bar, on a terminal.
    pub(crate) fn println(&self, line: String) {
        self.bar.println(line);
    }

    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

fn name(input: &Path) -> String {
    input.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// What became of a part.
pub(crate) fn line(result: &PartResult) -> String {
    let name = name(&result.input);
    match &result.outcome {
        PartOutcome::Fitted {
            verdict,
            stop,
            pieces,
            dofs,
            max,
            within,
            tolerance,
            lambda,
            reweighting,
            seconds,
            ..
        } => {
            let verdict = if *verdict < Verdict::Failed { verdict.to_string() } else { format!("failed ({stop})") };
            format!(
                "{name}: {verdict}, {}{dofs} control points, {:.1} % within {tolerance:.4e}, max {max:.4e}, \
                 λ {lambda:.2e}{}, {seconds:.2} s",
                pieces.map_or(String::new(), |pieces| format!("{pieces} pieces, ")),
                100.0 * within,
                reweighting.as_ref().map_or(String::new(), |weights| format!(", {}", weights.summary())),
            )
        }
        PartOutcome::Failed { .. } => format!("{name}: failed"),
    }
}

/// A warning about a part.
pub(crate) fn named(input: &Path, warning: &str) -> String {
    format!("{}: {warning}", name(input))
}

/// Whether an error names a file already, as errors of reading do.
pub(crate) fn names(input: &Path, error: &str) -> bool {
    error.starts_with(&input.display().to_string())
}

/// Why a surface is not good, and where.
pub(crate) fn reason(input: &Path, reason: &Reason) -> String {
    let place = reason.place.map_or(String::new(), |[x, y, z]| format!(", worst at ({x:.6}, {y:.6}, {z:.6})"));
    format!("{}: {}: {}{place} [{}]", name(input), reason.verdict, reason.text, reason.code)
}

/// What became of a whole part.
pub(crate) fn solid_line(input: &Path, fit: &SolidFit) -> String {
    let report = &fit.report;
    let percent = |x: f64| 100.0 * x / report.diagonal;
    let mut text = format!(
        "{}: {} faces, {} control points, RMS {:.4} %, largest {:.3} % of the diagonal, angles up to {:.3}° (p99 {:.3}°, at vertices \
         {:.3}°)",
        input.display(),
        report.layout.faces,
        report.functions,
        percent(report.mesh_to_surface.rms),
        percent(report.mesh_to_surface.max),
        report.angles.max,
        report.angles.p99,
        report.angles.at_vertices,
    );
    if let Some(volume) = report.volume {
        text += &format!(", volume {:+.3} %", 100.0 * (volume.surface.abs() / volume.mesh.abs() - 1.0));
    }
    text + &format!(", {:.1} s", report.seconds)
}
