//! Figures, origins and options, in words.

use geom_io::LengthUnit;
use report_page::{Fact, Part};
use serde::Serialize;
use serde_json::Value;

use crate::{Report, SolidFit, SolidReport};

/// A number with four digits.
fn digits(x: f64) -> String {
    if x == 0.0 {
        "0".to_owned()
    } else if (1e-4..1e6).contains(&x.abs()) {
        let before_the_point = x.abs().log10().floor() as i32;
        let text = format!("{x:.*}", (3 - before_the_point).max(0) as usize);
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
    } else {
        format!("{x:.3e}")
    }
}

/// How a unit is written behind a number.
pub(super) fn symbol(unit: LengthUnit) -> &'static str {
    match unit {
        LengthUnit::Micrometre => "µm",
        LengthUnit::Millimetre => "mm",
        LengthUnit::Centimetre => "cm",
        LengthUnit::Metre => "m",
        LengthUnit::Inch => "in",
        LengthUnit::Foot => "ft",
    }
}

fn percent(share: f64) -> String {
    // Never 100 % of less.
    format!("{:.1} %", (1000.0 * share).floor() / 10.0)
}

/// The figures at the head of a page.
pub(super) fn figures(report: &Report) -> Vec<Fact> {
    let (result, unit) = (&report.result, symbol(report.options.units.unwrap_or_default()));
    let to_surface = &result.deviation.scan_to_surface;
    let what = if result.deviation.scan == "mesh" { "of the area within" } else { "of the points within" };
    vec![
        Fact::new(what, percent(to_surface.within)),
        Fact::new("tolerance", format!("{} {unit}", digits(result.tolerance))),
        Fact::new("largest distance", format!("{} {unit}", digits(to_surface.max))),
        Fact::new("root mean square", format!("{} {unit}", digits(to_surface.rms))),
        Fact::new("control points", result.dofs),
    ]
}

/// The same of several surfaces: sums, or the worst.
pub(super) fn figures_of_pieces(reports: &[(&Report, &Part)], pieces: usize) -> Vec<Fact> {
    let results = || reports.iter().map(|(report, _)| &report.result);
    let least = results().map(|result| result.deviation.scan_to_surface.within).fold(1.0, f64::min);
    let largest = results().map(|result| result.deviation.scan_to_surface.max).fold(0.0, f64::max);
    vec![
        Fact::new("pieces", pieces),
        Fact::new("within, of the worst piece", percent(least)),
        Fact::new(
            "largest distance",
            format!(
                "{} {}",
                digits(largest),
                reports.first().map_or("", |(report, _)| symbol(report.options.units.unwrap_or_default()))
            ),
        ),
        Fact::new("control points", results().map(|result| result.dofs).sum::<usize>()),
    ]
}

pub(super) fn figures_of_solid(report: &SolidReport, unit: LengthUnit) -> Vec<Fact> {
    let unit = symbol(unit);
    vec![
        Fact::new("of the area within", percent(report.mesh_to_surface.within)),
        Fact::new("tolerance", format!("{} {unit}", digits(report.tolerance))),
        Fact::new("largest distance", format!("{} {unit}", digits(report.mesh_to_surface.max))),
        Fact::new("faces", report.layout.faces),
        Fact::new("control points", report.functions),
    ]
}

/// What was tried where the method was left open: a head and a row each; empty otherwise.
pub(super) fn tried(report: &Report) -> Vec<Vec<String>> {
    let rows = report.result.tried.iter().map(|tried| {
        let word = |value: Value| value.as_str().unwrap_or_default().to_owned();
        let came = match (&tried.error, tried.verdict, &tried.gave_up) {
            (Some(error), ..) => error.clone(),
            (_, Some(verdict), _) => verdict.name().to_owned(),
            (.., Some(_)) => "given up".to_owned(),
            _ => String::new(),
        };
        let reason = tried.reason.as_ref().map(|reason| word(serde_json::to_value(reason).unwrap_or_default()));
        vec![
            word(serde_json::to_value(tried.candidate).unwrap_or_default()),
            tried.control_points.to_string(),
            percent(tried.within),
            came,
            if tried.kept { "kept".to_owned() } else { reason.unwrap_or_default() },
            format!("{:.1}", tried.seconds),
        ]
    });
    let rows: Vec<Vec<String>> = rows.collect();
    if rows.is_empty() {
        return rows;
    }
    let head = ["candidate", "control points", "within", "verdict", "choice", "seconds"].map(str::to_owned).to_vec();
    std::iter::once(head).chain(rows).collect()
}

/// Where a result came from.
pub(super) fn of_report(report: &Report) -> Vec<Fact> {
    let (input, result) = (&report.input, &report.result);
    let method = serde_json::to_value(result.method).unwrap_or_default();
    let mut facts =
        vec![Fact::new("program", report.program), Fact::new("input", &input.file), Fact::new("format", input.format)];
    facts.extend(input.sha256.iter().map(|hash| Fact::new("SHA-256", hash)));
    facts.push(Fact::new("points", input.points));
    facts.extend(input.triangles.map(|count| Fact::new("triangles", count)));
    facts.extend([
        Fact::new("points fitted", input.fitted_points),
        Fact::new("diagonal", digits(input.diagonal)),
        Fact::new("unit", report.options.units.unwrap_or_default().name()),
        Fact::new("parameters", input.parameterization),
        Fact::new("method", method.as_str().unwrap_or_default()),
        Fact::new("control points", result.dofs),
        Fact::new("levels", result.levels),
        Fact::new("cells", result.cells),
        Fact::new("smoothing weight", digits(result.lambda)),
        Fact::new("ended by", result.stop),
        Fact::new("seconds", format!("{:.2}", result.seconds)),
    ]);
    facts
}

pub(super) fn of_solid(fit: &SolidFit) -> Vec<Fact> {
    let report = &fit.report;
    let mut facts = vec![Fact::new("program", crate::program::PROGRAM), Fact::new("input", report.input.display())];
    facts.extend(crate::scanned::fingerprint(&report.input).map(|hash| Fact::new("SHA-256", hash)));
    facts.extend([
        Fact::new("triangles", report.triangles),
        Fact::new("diagonal", digits(report.diagonal)),
        Fact::new("unit", fit.unit.name()),
        Fact::new("faces", report.layout.faces),
        Fact::new("sharp arcs", report.layout.sharp_arcs),
        Fact::new("samples", report.samples),
        Fact::new("root mean square of the mesh", digits(report.mesh_to_surface.rms)),
        Fact::new("largest of the surface", digits(report.surface_to_mesh.max)),
        Fact::new("folded faces", report.folded_faces.len()),
    ]);
    if let Some(volume) = &report.volume {
        facts.push(Fact::new("volume of the surface", digits(volume.surface.abs())));
        facts.push(Fact::new("volume of the mesh", digits(volume.mesh.abs())));
    }
    facts.push(Fact::new("seconds", format!("{:.2}", report.seconds)));
    facts
}

/// Options as they are typed, without those that were left open.
pub(super) fn options(options: &impl Serialize) -> Vec<Fact> {
    let mut facts = Vec::new();
    flatten("", &serde_json::to_value(options).unwrap_or_default(), &mut facts);
    facts
}

fn flatten(name: &str, value: &Value, facts: &mut Vec<Fact>) {
    match value {
        Value::Object(inner) => {
            for (key, value) in inner {
                let full = if name.is_empty() { key.clone() } else { format!("{name}.{key}") };
                flatten(&full, value, facts);
            }
        }
        Value::Null => {}
        Value::Array(items) if items.is_empty() => {}
        Value::String(text) => facts.push(Fact::new(name, text)),
        other => facts.push(Fact::new(name, other)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_four_digits() {
        let texts = [0.0, 1.0, 12.3456, 0.012_345_6, 123_456.7, 1.5e-7, 2.5e9, -3.25].map(digits);
        assert_eq!(texts, ["0", "1", "12.35", "0.01235", "123457", "1.500e-7", "2.500e9", "-3.25"]);
        assert_eq!([percent(0.99999), percent(1.0)], ["99.9 %", "100.0 %"]);
    }

    #[test]
    fn options_are_flat_and_those_left_open_are_left_out() {
        let value = serde_json::json!({ "tol": "0.1%", "mesh": null, "read": { "skip": 2, "classes": [] } });
        assert_eq!(options(&value), [Fact::new("read.skip", 2), Fact::new("tol", "0.1%")]);
    }
}
