//! How good parameters are, for the report.

use ndarray::Axis;
use param_classic::{Distortion, Verdict, cloud_quality, map_quality, unroll};
use serde::Serialize;

use super::layers::LayersReport;
use super::layout::{HoleReport, Layout, NetworkReport, spread_over_square};
use crate::Error;
use crate::clean::{CleaningReport, Found};
use crate::options::{Clean, Domain};

/// Points that voids and distances are measured on, evenly taken from all. Their triangulation takes a tenth of a second.
const MEASURED: usize = 20_000;

/// How parameters were found and how good they are.
#[derive(Clone, Debug, Serialize)]
pub struct ParameterReport {
    /// How they were found.
    pub method: &'static str,
    /// Whether the map was refined towards less distortion.
    pub refined: bool,
    /// What came of asking a network beside the map of a cloud without order; `null` where none was asked.
    pub network: Option<NetworkReport>,
    /// Points of the well-spread subset through which a large cloud was laid out.
    pub subset: Option<usize>,
    /// Points of the file that have no parameters: removed, equal to others, stray.
    pub left_out: usize,
    /// What was set aside unasked.
    pub cleaning: CleaningReport,
    /// Outliers, where they were looked for: those that were set aside or, with `--clean outliers`, removed.
    pub outliers: Option<usize>,
    /// Points outside the largest piece, where they were looked for.
    pub stray: Option<usize>,
    /// Two layers of one surface, between which the points were moved to the middle; `null` where there is one.
    pub layers: Option<LayersReport>,
    /// Median distance to the nearest points, in the units of the input; of the subset of a large cloud.
    pub spacing: Option<f64>,
    /// Standard deviation of the noise along the normals, in the units of the input.
    pub noise: Option<f64>,
    /// Points on the outer boundary, where there is one.
    pub boundary_points: usize,
    /// Holes and voids, longest rim first; the surface spans them.
    pub holes: Vec<HoleReport>,
    /// Rows in the file of the points at (0,0), (1,0), (1,1), (0,1), from 0.
    pub corners: Option<[u32; 4]>,
    /// Where the seam of a tube ends that was laid out by its shape.
    pub seam: Option<SeamReport>,
    /// Triangles over the points, of a mesh or spanned over a cloud; 0 if there are none.
    pub triangles: usize,
    /// Those that are folded over in the parameter square, by an exact predicate.
    pub folded: usize,
    /// Those that have no area there.
    pub collapsed: usize,
    /// Stretch of angles, 1 for none: the ratio of the singular values on each triangle.
    pub angle_stretch: Option<Stretch>,
    /// Stretch of areas, 1 for none.
    pub area_stretch: Option<Stretch>,
    /// The largest disc in the square without a parameter in it.
    pub largest_void: VoidReport,
    /// Correlation of distances between neighbours in space and in parameters.
    pub distance_correlation: Option<f64>,
    /// even, uneven or distorted.
    pub verdict: &'static str,
    /// What limits them and what to try; empty if they are good.
    pub hint: String,
    /// Seconds from the points to the parameters.
    pub seconds: f64,
}

/// Of each end of a tube the point nearest to the seam, where the closed parameter is 0; the first at 0 of the other one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SeamReport {
    /// Their rows in the file, from 0.
    pub rows: [u32; 2],
    /// Their places.
    pub points: [[f64; 3]; 2],
}

/// Mean and largest stretch over the triangles, the mean weighted by area on the surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Stretch {
    /// Mean.
    pub mean: f64,
    /// Largest.
    pub max: f64,
}

impl From<Distortion> for Stretch {
    fn from(distortion: Distortion) -> Self {
        Self { mean: distortion.mean, max: distortion.max }
    }
}

/// A disc in the parameter square.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct VoidReport {
    /// Its centre.
    pub center: [f64; 2],
    /// Its radius.
    pub radius: f64,
}

/// Measures a layout. What concerns rows of the file is left for the caller.
pub(super) fn measure(layout: &Layout, domain: Domain, closed: [bool; 2]) -> Result<ParameterReport, Error> {
    let m = layout.rows.len();
    let step = m.div_ceil(MEASURED);
    let some: Vec<usize> = (0..m).step_by(step).collect();
    let points = layout.points.select(Axis(0), &some);
    let mut parameters = layout.parameters.select(Axis(0), &some);
    if domain == Domain::Data {
        // Voids are looked for in the unit square.
        spread_over_square(&mut parameters, [false; 2]);
    }
    let mut spread = cloud_quality(points.view(), parameters.view())?;
    if layout.is_height_field || closed != [false; 2] {
        // Heights may be in another unit than places, and places next to the two sides of a seam are neighbours.
        spread.distance_correlation = None;
    }
    let cut = unroll(&layout.triangles, layout.parameters.view(), closed);
    let map = map_quality(cut.vertices(layout.points.view()).view(), &cut.triangles, cut.parameters.view())?;
    let mut assessments = vec![spread.assessment(some.len())];
    if !layout.triangles.is_empty() {
        assessments.push(map.assessment());
    }
    let mut verdict = assessments.iter().map(|a| a.verdict).max().unwrap_or(Verdict::Good);
    if layout.triangles.is_empty() && layout.boundary.is_empty() {
        // Lines of a grid and parameters of a file may be meant as they are, however they stretch the surface.
        verdict = verdict.min(Verdict::Usable);
    }
    let mut hints: Vec<&str> = assessments.iter().map(|a| a.hint.as_str()).filter(|hint| !hint.is_empty()).collect();
    if verdict == Verdict::Poor && layout.spacing.is_some() && !layout.is_height_field {
        hints.push("a terrain, or what one direction sees whole, is better laid out by x and y (--height-field)");
    }
    Ok(ParameterReport {
        method: layout.method,
        refined: layout.refined,
        network: layout.network.clone(),
        subset: layout.subset,
        left_out: 0,
        cleaning: CleaningReport::default(),
        outliers: None,
        stray: None,
        layers: None,
        spacing: layout.spacing,
        noise: layout.noise,
        boundary_points: layout.boundary.len(),
        holes: layout.holes.clone(),
        corners: None,
        seam: None,
        triangles: layout.triangles.len(),
        folded: map.folded.len(),
        collapsed: map.collapsed,
        angle_stretch: map.angle.map(Stretch::from),
        area_stretch: map.area.map(Stretch::from),
        largest_void: VoidReport { center: spread.largest_void.center, radius: spread.largest_void.radius },
        distance_correlation: spread.distance_correlation,
        verdict: match verdict {
            Verdict::Good => "even",
            Verdict::Usable => "uneven",
            Verdict::Poor => "distorted",
        },
        hint: hints.join("; "),
        seconds: 0.0,
    })
}

impl Found {
    /// What was found but not removed.
    pub(super) fn warnings(&self, removed: &[Clean]) -> Vec<String> {
        let mut warnings = Vec::new();
        match self.stray {
            Some(stray) if stray > 0 && !removed.contains(&Clean::Stray) => {
                let advice = match self.are_parts {
                    true => "they are not stray, but rows far apart or several parts",
                    false => "--clean stray removes them",
                };
                let pieces = self.pieces.map(|pieces| format!(" of {pieces}")).unwrap_or_default();
                warnings.push(format!("{stray} points lie outside the largest piece{pieces}; {advice}"));
            }
            _ => {}
        }
        warnings
    }
}
