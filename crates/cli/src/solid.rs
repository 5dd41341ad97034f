//! Whole parts: what is typed for them, and what is said of them.

use std::io::{self, IsTerminal};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use clap::Args;
use reconstruct::{BatchEvent, Error, Event, Sharp, Smoothness, SolidFit, SolidOptions};

use crate::args::FitArgs;
use crate::progress::{self, Progress};
use crate::{TOLERANCE_NOT_REACHED, complain};

#[derive(Args, Debug)]
#[command(next_help_heading = "Whole parts")]
pub(crate) struct SolidArgs {
    /// Layout of a whole part in patches of four sides, JSON (.json, .json.gz): every patch becomes a face, and a closed mesh one
    /// solid. --mesh counts the elements along each side of a patch; the tolerance is 0.3 % unless told.
    #[arg(long, value_name = "FILE")]
    pub(crate) layout: Option<PathBuf>,
    /// Weight of smooth joins between faces against distances: 1, 3 for finer ones, or off.
    #[arg(long, value_name = "OMEGA", default_value_t = Smoothness::Weight(1.0), allow_hyphen_values = true, requires = "layout")]
    pub(crate) smoothness: Smoothness,
    /// Angle, in degrees, from which on a layout's arc along an edge of the mesh stays sharp; or off, for none.
    #[arg(long, value_name = "ANGLE", default_value_t = SolidOptions::of_layout(PathBuf::new()).sharp, requires = "layout")]
    pub(crate) sharp: Sharp,
}

/// Fits a whole part and says how good it is.
pub(crate) fn fit(args: &FitArgs, options: &SolidOptions) -> anyhow::Result<u8> {
    let [input] = args.inputs.as_slice() else {
        let given = format!("with {} inputs", args.inputs.len());
        return Err(Error::OptionRange { option: "--layout", given, allowed: "with one input" }.into());
    };
    options.check()?;
    reconstruct::check_solid_outputs(&args.outputs, args.report.as_deref())?;
    let progress = Progress::new(1, options.within);
    let mut watch = |event: Event<'_>| {
        progress.show(BatchEvent::Within { input, event });
        ControlFlow::Continue(())
    };
    let fitted = reconstruct::fit_solid_file(input, options, &mut watch);
    let fitted = fitted.inspect(|fitted| progress.println(summary(input, fitted)));
    progress.finish();
    let fitted = fitted?;
    reconstruct::write_solid_outputs(&fitted, &args.outputs, args.report.as_deref())?;
    // On a terminal the line stands there already.
    if !fitted.reached() && !io::stderr().is_terminal() {
        complain(&summary(input, &fitted));
    }
    if !args.quiet {
        fitted.report.reasons.iter().for_each(|reason| complain(&progress::named(input, &reason.to_string())));
    }
    Ok(if fitted.reached() { 0 } else { TOLERANCE_NOT_REACHED })
}

/// One line on a fit.
fn summary(input: &Path, fit: &SolidFit) -> String {
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
