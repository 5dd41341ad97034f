//! What became of a part.

use std::path::PathBuf;

use deviation::{Reason, Verdict};
use geom_io::StepSize;
use multi_patch::TURNED_OVER;
use report_page::{IndexRow, Tone};
use serde::{Deserialize, Serialize};

use crate::options::{all_shown, shown};
use crate::output::is_page;
use crate::page::tone;
use crate::solid::KINK;
use crate::tolerance::hint_if_large;
use crate::{Error, PieceFits, Report, ReweightingReport, SolidFit, SolidReason};

/// What became of a part.
#[derive(Clone, Debug, Deserialize, Serialize)]
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
    /// Whether it was done before, and nothing has changed since: see [`crate::BatchOptions::resume`].
    #[serde(default, skip_serializing_if = "is_false")]
    pub kept: bool,
    /// A small picture of it, as PNG, where it has a page; else empty.
    #[serde(skip)]
    pub picture: Vec<u8>,
}

/// What became of a part.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(tag = "status", rename_all = "kebab-case")]
#[expect(clippy::large_enum_variant, reason = "there is one for each part, and most are of the large kind")]
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
        stop: String,
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
        /// Share of the scan's area, of a cloud of its points weighed by their spacing, within the tolerance: what the verdict goes by.
        within_area: f64,
        /// Largest distance of the scan from the surface, wherever its closest point lies.
        largest: f64,
        /// The tolerance.
        tolerance: f64,
        /// The smoothing weight that was used.
        lambda: f64,
        /// More of a whole part, whose other figures are those of its mesh against the surface; absent for sheets.
        #[serde(skip_serializing_if = "Option::is_none")]
        solid: Option<SolidSummary>,
        /// How large the STEP file is; absent without one, and of pieces.
        #[serde(skip_serializing_if = "Option::is_none")]
        step: Option<StepSize>,
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

/// A whole part in a few figures.
#[derive(Clone, Copy, Debug, Deserialize, Serialize)]
pub struct SolidSummary {
    /// Faces.
    pub faces: usize,
    /// Diagonal of the mesh.
    pub diagonal: f64,
    /// Largest angle between neighbouring faces along smooth arcs, in degrees.
    pub largest_angle: f64,
    /// Not exceeded at 99 % of the places along smooth arcs.
    pub p99_angle: f64,
    /// Largest angle at a vertex.
    pub angle_at_vertices: f64,
    /// Volume of the surface over that of the mesh, less 1; absent of what does not close.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub volume_error: Option<f64>,
}

/// Why no further attempt was made at a whole part that is not what was asked for.
const NO_OTHER_LAYOUT: &str = "layouts";

fn is_false(flag: &bool) -> bool {
    !flag
}

impl PartResult {
    /// The row of the part in the page of a batch.
    pub(super) fn index_row(&self) -> IndexRow {
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

impl PartOutcome {
    /// Nothing came of it.
    pub(super) fn failed(error: &Error) -> Self {
        Self::Failed { error: error.to_string() }
    }

    /// Of a whole part.
    pub(super) fn of_solid(fit: &SolidFit, step: Option<StepSize>) -> Self {
        let report = &fit.report;
        let of_volumes = |volume: &crate::SolidVolume| volume.surface.abs() / volume.mesh.abs() - 1.0;
        Self::Fitted {
            reached: fit.reached(),
            verdict: if fit.reached() { Verdict::Good } else { Verdict::Failed },
            reasons: report.reasons.iter().map(reason_of_solid).collect(),
            stop: if fit.reached() { "tolerance" } else { NO_OTHER_LAYOUT }.to_owned(),
            pieces: None,
            dofs: report.functions,
            levels: 1,
            max: report.mesh_to_surface.max,
            rmse: report.mesh_to_surface.rms,
            within: report.mesh_to_surface.within,
            tolerance: report.tolerance,
            lambda: report.options.plates,
            solid: Some(SolidSummary {
                faces: report.layout.faces,
                diagonal: report.diagonal,
                largest_angle: report.angles.max,
                p99_angle: report.angles.p99,
                angle_at_vertices: report.angles.at_vertices,
                volume_error: report.volume.as_ref().map(of_volumes),
            }),
            step,
            reweighting: None,
            within_area: report.mesh_to_surface.within,
            largest: report.mesh_to_surface.max,
            seconds: report.seconds,
            warnings: hint_if_large(report.tolerance, report.diagonal).into_iter().collect(),
        }
    }

    pub(super) fn of_report(report: Report, step: Option<StepSize>) -> Self {
        Self::Fitted {
            reached: report.result.reached,
            verdict: report.result.verdict,
            reasons: report.result.reasons,
            stop: report.result.stop.to_owned(),
            pieces: None,
            dofs: report.result.dofs,
            levels: report.result.levels,
            max: report.result.max,
            rmse: report.result.rmse,
            within: report.result.within,
            tolerance: report.result.tolerance,
            lambda: report.result.lambda,
            within_area: report.result.deviation.scan_to_surface.within,
            largest: report.result.deviation.scan_to_surface.max,
            solid: None,
            step,
            reweighting: report.result.reweighting.map(Box::new),
            seconds: report.result.seconds,
            warnings: report.warnings,
        }
    }

    /// Of all pieces: failed if one could not be fitted, else as bad as the worst one.
    pub(super) fn of_pieces(fits: &PieceFits) -> Self {
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
            stop: worst.stop.to_owned(),
            pieces: Some(fits.pieces.len()),
            dofs,
            levels,
            max: worst.max,
            rmse: (squares / points).sqrt(),
            within: within / points,
            tolerance: worst.tolerance,
            lambda: worst.lambda,
            within_area: worst.deviation.scan_to_surface.within,
            largest: worst.deviation.scan_to_surface.max,
            solid: None,
            step: None,
            reweighting: None,
            seconds,
            warnings,
        }
    }
}

fn reason_of_solid(reason: &SolidReason) -> Reason {
    let (code, figure, limit) = match *reason {
        SolidReason::NotWithin { of: "mesh", share, asked } => (deviation::SCAN_NOT_WITHIN, share, asked),
        SolidReason::NotWithin { share, asked, .. } => ("surface-not-within", share, asked),
        SolidReason::Folded { places, .. } => ("folded", places as f64, 0.0),
        SolidReason::TooFar { of: "mesh", distance, limit } => ("scan-too-far", distance, limit),
        SolidReason::TooFar { distance, limit, .. } => ("surface-too-far", distance, limit),
        SolidReason::CrossesItself { extent, .. } => ("crosses-itself", extent, 0.0),
        SolidReason::Kinked { angle } => ("kinked", angle, KINK),
        SolidReason::TurnedOver { angle } => ("turned-over", angle, TURNED_OVER),
    };
    let place = match *reason {
        SolidReason::CrossesItself { place, .. } => Some(place),
        _ => None,
    };
    Reason { code: code.into(), verdict: Verdict::Failed, text: reason.to_string(), figure, limit, place }
}
