//! All pieces of a mesh or cloud, each fitted for itself, and one verdict on the whole: that of the worst.

use std::path::Path;

use geom_io::{Scan, read_scan};
use point_cloud::BoundingBox;
use serde::Serialize;

use crate::clean::{Pieced, split};
use crate::error::size_of_piece;
use crate::parameters::STRAY_TRIANGLES;
use crate::scanned::fingerprint;
use crate::{Error, Event, Fit, FitOptions, Report, Verdict, Watch, fit_scan, units};

/// The pieces of a scan, as far as they were fitted.
#[derive(Debug)]
pub struct PieceFits {
    /// The file, for the report.
    pub name: String,
    /// The pieces, the largest first.
    pub pieces: Vec<PieceFit>,
    /// What the user should know of the whole.
    pub warnings: Vec<String>,
    /// The options that were asked for.
    pub options: FitOptions,
}

/// What became of a piece.
#[derive(Debug)]
pub struct PieceFit {
    /// Its number, from 1: the largest piece is the first.
    pub number: usize,
    /// Its size in triangles, of a cloud in points.
    pub size: usize,
    /// Its surface, or why there is none.
    pub fit: Result<Fit, Error>,
}

/// The report of all pieces.
#[derive(Debug, Serialize)]
pub struct PiecesReport<'a> {
    /// Version of this layout.
    pub schema: u32,
    /// The file.
    pub file: &'a str,
    /// Whether all pieces were fitted, each better than `failed`.
    pub reached: bool,
    /// The worst verdict; `failed` if a piece could not be fitted.
    pub verdict: Verdict,
    /// One section a piece.
    pub pieces: Vec<PieceReport<'a>>,
    /// All options, defaults included, as they are typed.
    pub options: &'a FitOptions,
    /// What the user should know of the whole.
    pub warnings: &'a [String],
}

/// The section of a piece.
#[derive(Debug, Serialize)]
pub struct PieceReport<'a> {
    /// Its number, from 1.
    pub piece: usize,
    /// Its size in triangles, of a cloud in points.
    pub size: usize,
    /// The report of its fit; absent where it could not be fitted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub report: Option<&'a Report>,
    /// Why it could not be fitted; absent otherwise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
}

impl PieceFits {
    /// The pieces that have a surface, with their numbers.
    pub fn fitted(&self) -> impl Iterator<Item = (usize, &Fit)> {
        self.pieces.iter().filter_map(|piece| Some((piece.number, piece.fit.as_ref().ok()?)))
    }

    /// The worst verdict; `failed` if a piece could not be fitted.
    pub fn verdict(&self) -> Verdict {
        let of_piece = |piece: &PieceFit| piece.fit.as_ref().map_or(Verdict::Failed, |fit| fit.report.result.verdict);
        self.pieces.iter().map(of_piece).max().unwrap_or(Verdict::Failed)
    }

    /// The errors of pieces that could not be fitted, in one sentence; `None` if all were.
    pub fn error(&self) -> Option<String> {
        let count = self.pieces.len();
        let wrong = |piece: &PieceFit| Some((piece.number, piece.size, piece.fit.as_ref().err()?.to_string()));
        let errors: Vec<(usize, usize, String)> = self.pieces.iter().filter_map(wrong).collect();
        let (number, size, first) = errors.first()?;
        let others = match errors.len() {
            1 => String::new(),
            more => format!("; {} other pieces could not be fitted either", more - 1),
        };
        Some(format!(
            "piece {number} of {count} ({size}): {first}{others}",
            size = size_of_piece(*size, self.is_mesh())
        ))
    }

    fn is_mesh(&self) -> bool {
        self.fitted().next().is_none_or(|(_, fit)| fit.report.input.triangles.is_some())
    }

    /// The report of all pieces.
    pub fn report(&self) -> PiecesReport<'_> {
        let pieces = self.pieces.iter().map(|piece| {
            let (report, error) = match &piece.fit {
                Ok(fit) => (Some(&fit.report), None),
                Err(error) => (None, Some(error.to_string())),
            };
            PieceReport { piece: piece.number, size: piece.size, report, error }
        });
        let verdict = self.verdict();
        PiecesReport {
            schema: 1,
            file: &self.name,
            reached: verdict < Verdict::Failed,
            verdict,
            pieces: pieces.collect(),
            options: &self.options,
            warnings: &self.warnings,
        }
    }
}

/// Reads a file, as the options say, and fits every piece of what it holds.
///
/// # Errors
/// [`Error`] of what concerns all pieces; those of one piece stand there.
pub fn fit_pieces_file(path: &Path, options: &FitOptions, watch: &mut Watch<'_>) -> Result<PieceFits, Error> {
    let _ = watch(Event::Step("reading"));
    let scan = read_scan(path, &options.parameters.read)?;
    let mut fits = fit_pieces(scan, &path.display().to_string(), options, watch)?;
    let hash = fingerprint(path);
    for fit in fits.pieces.iter_mut().filter_map(|piece| piece.fit.as_mut().ok()) {
        fit.report.input.sha256.clone_from(&hash);
    }
    Ok(fits)
}

/// Fits every piece of what a file held; `name` stands in the reports. Pieces that are stray, together no more than 2 % of the
/// triangles or points, are left out.
///
/// # Errors
/// [`Error`] of what concerns all pieces; those of one piece stand there. Once `watch` breaks, no further piece is begun, and those that
/// are left have the error [`Error::NotBegun`].
pub fn fit_pieces(scan: Scan, name: &str, options: &FitOptions, watch: &mut Watch<'_>) -> Result<PieceFits, Error> {
    options.check()?;
    let Pieced { mut scan, piece_of, sizes, what } = split(scan, &options.parameters, watch)?;
    let kept = not_stray(&sizes);
    // What is said of the file is said once, and its size is that of all pieces.
    let mut warnings = std::mem::take(&mut scan.notes);
    let diagonal = BoundingBox::of(scan.cloud.points.view())?.diagonal();
    warnings.extend(units::hint(options.units, scan.unit, diagonal));
    let of_piece = FitOptions { units: Some(units::resolve(options.units, scan.unit)), ..options.clone() };
    if kept < sizes.len() {
        warnings.push(format!(
            "{} of {} pieces of the {what} are stray, of together {} {}, and were left out; --piece {} fits the largest of them",
            sizes.len() - kept,
            sizes.len(),
            sizes[kept..].iter().sum::<usize>(),
            if what == "mesh" { "triangles" } else { "points" },
            kept + 1
        ));
    }
    let mut pieces = Vec::with_capacity(kept);
    let mut is_interrupted = false;
    for (number, &size) in (1..).zip(&sizes[..kept]) {
        if is_interrupted {
            pieces.push(PieceFit { number, size, fit: Err(Error::NotBegun) });
            continue;
        }
        let places: Vec<usize> = (0..piece_of.len()).filter(|&at| piece_of[at] == Some(number - 1)).collect();
        let mut part = scan.clone();
        part.select(&places);
        part.unit = None;
        let mut fit = fit_scan(part, name, &of_piece, watch);
        if let Ok(fit) = &mut fit {
            fit.model.metadata.insert("piece".into(), number.into());
            is_interrupted = fit.report.result.stop == adaptive::Stop::Interrupted.name();
        }
        pieces.push(PieceFit { number, size, fit });
    }
    Ok(PieceFits { name: name.to_owned(), pieces, warnings, options: options.clone() })
}

/// How many pieces, the largest first, are no stray ones.
fn not_stray(sizes: &[usize]) -> usize {
    let all: usize = sizes.iter().sum();
    let mut rest = 0;
    let is_stray = |size: &&usize| {
        rest += **size;
        rest as f64 <= STRAY_TRIANGLES * all as f64
    };
    sizes.len() - sizes.iter().rev().take_while(is_stray).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smallest_pieces_are_stray_while_they_are_few() {
        for (sizes, kept) in [
            (&[100][..], 1),
            (&[100, 100], 2),
            (&[980, 20], 1),
            (&[979, 21], 2),
            (&[960, 21, 10, 9], 2),
            (&[1, 1, 1], 3),
            (&[], 0),
        ] {
            assert_eq!(not_stray(sizes), kept, "{sizes:?}");
        }
    }
}
