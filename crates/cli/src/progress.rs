//! Progress on a terminal; silence when piped.

use std::io::{IsTerminal, stderr};
use std::path::{Path, PathBuf};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use reconstruct::{BatchEvent, Event, PartOutcome, PartResult, Reason, SolidSummary, Verdict};

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
                // The summary says the same of one part.
                if self.bar.length().is_some_and(|parts| parts > 1) {
                    self.bar.println(line(result));
                }
                self.bar.inc(1);
            }
        }
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
        PartOutcome::Fitted { solid: Some(solid), dofs, rmse, max, seconds, .. } => {
            solid_line(&name, solid, [*dofs as f64, *rmse, *max, *seconds])
        }
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
fn solid_line(name: &str, solid: &SolidSummary, [dofs, rms, max, seconds]: [f64; 4]) -> String {
    let percent = |x: f64| 100.0 * x / solid.diagonal;
    let mut text = format!(
        "{name}: {} faces, {dofs} control points, RMS {:.4} %, largest {:.3} % of the diagonal, angles up to {:.3}° (p99 {:.3}°, at \
         vertices {:.3}°)",
        solid.faces,
        percent(rms),
        percent(max),
        solid.largest_angle,
        solid.p99_angle,
        solid.angle_at_vertices,
    );
    if let Some(error) = solid.volume_error {
        text += &format!(", volume {:+.3} %", 100.0 * error);
    }
    text + &format!(", {seconds:.1} s")
}

/// What became of all parts.
pub(crate) fn totals(parts: &[PartResult]) -> String {
    let count = |wanted: Option<Verdict>| {
        let of_part = |part: &PartResult| match part.outcome {
            PartOutcome::Fitted { verdict, .. } => Some(verdict),
            PartOutcome::Failed { .. } => None,
        };
        parts.iter().filter(|part| of_part(part) == wanted).count()
    };
    format!(
        "{} parts: {} good, {} usable, {} failed, {} without a surface",
        parts.len(),
        count(Some(Verdict::Good)),
        count(Some(Verdict::Usable)),
        count(Some(Verdict::Failed)),
        count(None)
    )
}

/// What became of the parts, in few words for a person: of one part its files, of several how many there are and where their page is.
pub(crate) fn summary(results: &[PartResult], outputs: &[PathBuf]) -> Vec<String> {
    match results {
        [result] => short(result).into_iter().collect(),
        several => {
            let index = outputs.iter().map(|output| output.join("index.html")).find(|index| index.is_file());
            vec![format!(
                "{}{}",
                totals(several),
                index.map_or(String::new(), |index| format!("; see {}", index.display()))
            )]
        }
    }
}

/// One line on a part that has a surface.
fn short(result: &PartResult) -> Option<String> {
    let PartOutcome::Fitted { verdict, dofs, solid, within_area, tolerance, largest, seconds, .. } = &result.outcome
    else {
        return None;
    };
    let file = result.outputs.first().map_or_else(|| name(&result.input), |output| name(output));
    let faces = solid.map_or(String::new(), |solid| format!("{} faces, ", solid.faces));
    // Rounded down: what is not all does not read as all.
    let percent = (1000.0 * within_area).floor() / 10.0;
    Some(format!(
        "{file}: {verdict}, {faces}{dofs} control points, {percent:.1} % of the area within {}, largest {}, {seconds:.1} s",
        three_digits(*tolerance),
        three_digits(*largest)
    ))
}

/// A number with as many digits as anybody reads at a glance.
fn three_digits(value: f64) -> String {
    let rounded: f64 = format!("{value:.2e}").parse().unwrap_or(value);
    if rounded == 0.0 || (1e-4..1e6).contains(&rounded.abs()) { rounded.to_string() } else { format!("{rounded:e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        for (value, text) in [
            (0.0333456, "0.0333"),
            (0.04, "0.04"),
            (1234.5, "1230"),
            (0.0, "0"),
            (1.0 / 3e7, "3.33e-8"),
            (2.5e9, "2.5e9"),
        ] {
            assert_eq!(three_digits(value), text);
        }
    }
}
