//! What a user should know of a fit: the conditions and the words, in one place.

use std::fmt;

use deviation::Reason;
use ndarray::Axis;
use point_cloud::loop_length;
use thb_core::{CellSpace, HierarchicalSpace};

use crate::FitOptions;
use crate::attempt::Attempt;
use crate::options::{BoundaryChoice, Pair};
use crate::parameters::Parameterized;

/// Control points as a share of the points from which on the user is warned: then there are hardly more equations than
/// unknowns, in a fit with moving parameters fewer.
const CROWDED: f64 = 0.7;

/// Share of neighbouring samples between which the normal may turn by more than a right angle before the user is warned.
const MOST_CREASES: f64 = 2e-3;

/// Reasons of a verdict that parameters which are none bring about.
const TORN: [&str; 3] = ["folded", "crosses-itself", "swings-out"];

/// Width of the strip along the sides of the domain, as a share of it, and the share of the cells in it from which on the outline is
/// told to be ragged: of even cells 8 % are there. Surfaces of few control points are not told.
const RIM: f64 = 0.02;
const RIM_CELLS: f64 = 0.35;
const RIM_DOFS: usize = 100;

/// Length of a hole's rim, as a share of the outline's, from which on both may be the ends of a tube.
const LIKE: f64 = 0.5;

/// Something that a user should know of a fit.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Warning {
    /// There are fewer points than functions by default.
    FewPoints { points: usize, degree: Pair, elements: Pair },
    /// The last refinement failed.
    NotSolved(String),
    /// Moves of parameters were undone.
    Postponed { count: usize, iterations: usize },
    /// There are hardly fewer control points than points.
    Crowded { control_points: usize, points: usize },
    /// The surface leaves the points.
    FarFromPoints { farthest: f64, share: f64, tube: bool },
    /// The cells gather along the outline.
    RaggedOutline { share: f64 },
    /// The tolerance is less than what the triangles tell.
    BelowSagitta { tolerance: f64, sagitta: f64 },
    /// The surface has creases.
    Creased { share: f64 },
    /// Parameters of the file are places in a texture.
    TornParameters,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::FewPoints { points, degree, elements } => write!(
                f,
                "{points} points start with degree {degree} and {elements} elements, so that they are no fewer than the functions; \
                 --mesh starts with more"
            ),
            Self::NotSolved(failure) => write!(f, "the last refinement could not be solved: {failure}"),
            Self::Postponed { count, iterations } => {
                write!(f, "moving the parameters did harm in {count} of {iterations} iterations and was undone there")
            }
            Self::Crowded { control_points, points } => write!(
                f,
                "{control_points} control points for {points} points: the surface follows their noise; choose a larger tolerance \
                 unless the points are exact"
            ),
            Self::FarFromPoints { farthest, share, tube } => write!(
                f,
                "the surface leaves the points by up to {farthest:.4e}, {:.1} % of the diagonal: it spans a void or swings out \
                 between points; {}",
                100.0 * share,
                if *tube {
                    "two rims are of like length, as those of a tube, which --closed u goes round"
                } else {
                    "look at it, and raise --lambda if it swings"
                }
            ),
            Self::RaggedOutline { share } => write!(
                f,
                "{:.0} % of the cells lie within {:.0} % of the sides of the domain: the surface follows a ragged outline; try \
                 --boundary free, with which it need not",
                100.0 * share,
                100.0 * RIM
            ),
            Self::BelowSagitta { tolerance, sagitta } => write!(
                f,
                "the tolerance of {tolerance:.4e} is less than what the triangles of the scan tell: the surface may lie up to \
                 {sagitta:.4e} off their facets (95 % of the area)"
            ),
            Self::Creased { share } => write!(
                f,
                "the surface turns by more than a right angle between {:.2} % of its neighbouring samples: at sharp edges, or where \
                 it is folded; look at it",
                100.0 * share
            ),
            Self::TornParameters => f.write_str(
                "the parameters u, v of the file fold or tear the surface, as places in a texture do: --param mean-value lays the \
                 points out by their shape",
            ),
        }
    }
}

/// What is to be told of a surface. `given`: whether its parameters came with the points and are no coordinates.
pub(crate) fn of_surface(
    attempt: &Attempt,
    laid_out: &Parameterized,
    options: &FitOptions,
    diagonal: f64,
    given: bool,
) -> Vec<Warning> {
    let Attempt { fitted, creases, judgement, .. } = attempt;
    let (points, control_points) = (laid_out.points.nrows(), attempt.control_points());
    let deviation = &judgement.deviation;
    let mut warnings: Vec<Warning> = fitted.failure.iter().cloned().map(Warning::NotSolved).collect();
    let mut warn = |is_so: bool, warning: Warning| warnings.extend(is_so.then_some(warning));
    let count = fitted.moves.iter().filter(|moves| moves.postponed).count();
    warn(count > 0, Warning::Postponed { count, iterations: fitted.moves.len() });
    warn(control_points as f64 > CROWDED * points as f64, Warning::Crowded { control_points, points });
    let (farthest, share) = (deviation.farthest, deviation.farthest / diagonal);
    if share > options.policy.far {
        warn(true, Warning::FarFromPoints { farthest, share, tube: is_tube_like(laid_out) });
    }
    let at_rim = share_at_rim(fitted.map.space());
    let follows = options.boundary == BoundaryChoice::Kept && control_points > RIM_DOFS && at_rim > RIM_CELLS;
    warn(follows, Warning::RaggedOutline { share: at_rim });
    let (tolerance, sagitta) = (deviation.tolerance, deviation.sagitta_p95.unwrap_or(0.0));
    warn(sagitta > tolerance, Warning::BelowSagitta { tolerance, sagitta });
    warn(*creases > MOST_CREASES, Warning::Creased { share: *creases });
    let is_torn = |reason: &Reason| TORN.contains(&&*reason.code);
    warn(given && judgement.reasons.iter().any(is_torn), Warning::TornParameters);
    warnings
}

/// Share of the cells whose middle is within [`RIM`] of a side of the domain.
fn share_at_rim(space: &HierarchicalSpace<2>) -> f64 {
    let ((lower, upper), periodic) = (space.domain(), space.periodic());
    let is_at_rim = |number: &usize| {
        let cell = space.cell(*number);
        (0..2).any(|d| {
            let middle = 0.5 * (cell.lower[d] + cell.upper[d]);
            !periodic[d] && (middle - lower[d]).min(upper[d] - middle) < RIM * (upper[d] - lower[d])
        })
    };
    (0..space.n_cells()).filter(is_at_rim).count() as f64 / space.n_cells() as f64
}

/// Whether a hole is about as long as the outline.
fn is_tube_like(laid_out: &Parameterized) -> bool {
    let rows: Vec<usize> = laid_out.boundary.iter().map(|&i| i as usize).collect();
    let outline = loop_length(laid_out.points.select(Axis(0), &rows).view());
    outline > 0.0
        && laid_out.closed == [false; 2]
        && laid_out.report.holes.iter().any(|hole| hole.length > LIKE * outline)
}

#[cfg(test)]
mod tests {
    use super::*;
    use thb_core::{Kind, KnotVector, Refinement};

    #[test]
    fn cells_along_a_ragged_outline_are_many() {
        let knots = KnotVector::uniform(2, 32).unwrap();
        let even = HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots]).unwrap();
        // The outermost of 32 rows have their middles at 1/64.
        assert_eq!(share_at_rim(&even), 124.0 / 1024.0);
        let mut space = even;
        for _ in 0..3 {
            let rim: Vec<usize> = (0..space.n_cells()).filter(|&cell| space.cell(cell).lower[0] == 0.0).collect();
            space = space.refine(&rim, &Refinement::default()).unwrap();
        }
        assert!(share_at_rim(&space) > RIM_CELLS, "{}", share_at_rim(&space));
    }
}
