//! Points that are laid out, clouds that wait for it, and what the ways to lay them out have in common.

use std::array;

use ndarray::{Array2, ArrayView1};
use param_classic::{InjectiveParams, MeshMapParams, SpannedMapParams, Weights, map_quality};
use point_cloud::CornerChoice;
use serde::Serialize;

use crate::Error;
use crate::options::{ParameterChoice, ParameterOptions, Refine};

/// Fewest points of a surface: four control points of the smallest bilinear one.
pub(crate) const MIN_POINTS: usize = 4;

/// Distance from the mesh over a cloud, in spacings, from which on a point is not of the surface.
pub(super) const STRAY: f64 = 4.0;

/// A cloud to be laid out, and what the user says of it. Indices are of its points.
pub(super) struct Cloud {
    pub(super) points: Array2<f64>,
    /// The outer boundary in order.
    pub(super) boundary: Option<Vec<u32>>,
    pub(super) corners: Option<[u32; 4]>,
}

/// The rim of a hole.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct HoleReport {
    /// Points on it.
    pub points: usize,
    /// Its length, in the units of the input.
    pub length: f64,
}

/// What came of asking a network beside the classical map of a cloud.
#[derive(Clone, Debug, Serialize)]
pub struct NetworkReport {
    /// Whether its parameters were taken.
    pub taken: bool,
    /// Why, with the numbers.
    pub reason: String,
    /// Whose candidate did best: bidgcn or pargcn.
    pub network: Option<&'static str>,
    /// Share of the way from the classical parameters to the network's that the candidate went.
    pub share: Option<f64>,
    /// Root mean square errors of quick fits, coarse and fine, with the classical parameters.
    pub classical_error: Option<[f64; 2]>,
    /// The same with the candidate.
    pub error: Option<[f64; 2]>,
}

/// Points that were laid out, before their quality is known. All indices are of `points`.
#[derive(Default)]
pub(super) struct Layout {
    pub(super) points: Array2<f64>,
    pub(super) parameters: Array2<f64>,
    /// Row of each point among those that were to be laid out.
    pub(super) rows: Vec<u32>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// Triangles of the scan that were not laid out, over the same points.
    pub(super) left_out: Vec<[u32; 3]>,
    /// Whether these triangles are those of the scan.
    pub(super) is_mesh: bool,
    pub(super) boundary: Vec<u32>,
    pub(super) holes: Vec<HoleReport>,
    /// The points round each of them.
    pub(super) rims: Vec<Vec<u32>>,
    pub(super) corners: Option<[u32; 4]>,
    /// Of each end of a tube the point nearest to the seam.
    pub(super) seam: Option<[u32; 2]>,
    /// Directions that close as it was laid out by its shape.
    pub(super) closed: [bool; 2],
    pub(super) method: &'static str,
    pub(super) refined: bool,
    /// Points that were laid out at once, where not all were.
    pub(super) subset: Option<usize>,
    pub(super) spacing: Option<f64>,
    pub(super) noise: Option<f64>,
    pub(super) reversed: bool,
    pub(super) is_height_field: bool,
    pub(super) network: Option<NetworkReport>,
    pub(super) warnings: Vec<String>,
    /// Vertices that were made one with others.
    pub(super) merged: usize,
}

impl Layout {
    /// Whether most of the triangles over the `count` points that were to be laid out are clockwise in (u, v).
    pub(super) fn runs_against(&self, triangles: &[[u32; 3]], count: usize) -> bool {
        let mut place = vec![u32::MAX; count];
        self.rows.iter().enumerate().for_each(|(at, &row)| place[row as usize] = at as u32);
        let laid_out = |t: &[u32; 3]| t.map(|v| place[v as usize]);
        let triangles: Vec<[u32; 3]> = triangles.iter().map(laid_out).filter(|t| !t.contains(&u32::MAX)).collect();
        map_quality(self.points.view(), &triangles, self.parameters.view())
            .is_ok_and(|quality| 2 * quality.folded.len() > quality.triangles - quality.collapsed)
    }

    /// Takes a part of the points; triangles and the boundary have to lie within it.
    pub(super) fn of_rows(&mut self, outer: &[u32]) {
        self.rows.iter_mut().for_each(|row| *row = outer[*row as usize]);
    }
}

/// Places among points, whose rows in the file are `rows`, of those that an option names by their rows.
pub(crate) fn places_of(named: &[u64], rows: &[u32], option: &'static str) -> Result<Vec<u32>, Error> {
    // Most options name few points, and rows need not increase.
    let mut order: Vec<u32> = (0..rows.len() as u32).collect();
    order.sort_unstable_by_key(|&at| rows[at as usize]);
    let place = |&row: &u64| {
        let found = order.binary_search_by_key(&row, |&at| rows[at as usize].into());
        found.map(|k| order[k]).map_err(|_| Error::NoSuchPoint { option, row })
    };
    named.iter().map(place).collect()
}

/// The given corners as places among the points, whose rows in the file are `rows`.
pub(super) fn corners_among(rows: &[u32], options: &ParameterOptions) -> Result<Option<[u32; 4]>, Error> {
    let Some(corners) = options.corners else { return Ok(None) };
    let places = places_of(&corners.0.map(u64::from), rows, "--corners")?;
    Ok(Some(array::from_fn(|k| places[k])))
}

/// Stretches or shrinks each column of parameters that does not wrap so that it reaches from 0 to 1; one that is constant stays.
pub(crate) fn spread_over_square(parameters: &mut Array2<f64>, closed: [bool; 2]) {
    for (mut column, _) in parameters.columns_mut().into_iter().zip(closed).filter(|(_, closed)| !closed) {
        let (lower, upper) = extent(column.view());
        if upper > lower {
            column.mapv_inplace(|x| ((x - lower) / (upper - lower)).clamp(0.0, 1.0));
        }
    }
}

/// Smallest and largest number.
pub(crate) fn extent(column: ArrayView1<'_, f64>) -> (f64, f64) {
    column.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(lower, upper), &x| (lower.min(x), upper.max(x)))
}

/// How a mesh is mapped.
pub(super) fn map_params(
    choice: ParameterChoice,
    corners: Option<[u32; 4]>,
    options: &ParameterOptions,
) -> SpannedMapParams {
    let uniform = choice == ParameterChoice::Uniform;
    let refinement = InjectiveParams { slide: corners.is_none(), ..InjectiveParams::default() };
    // The map with equal weights is what was asked for, unless its refinement was too.
    let refined = options.refine == Refine::On || options.refine == Refine::Auto && !uniform;
    SpannedMapParams {
        map: MeshMapParams {
            weights: if uniform { Weights::Uniform } else { Weights::MeanValue },
            boundary: options.side_rule.rule(),
            corners: corners.map_or(CornerChoice::default(), CornerChoice::Given),
        },
        refinement: refined.then_some(refinement),
        refine_all: options.refine == Refine::On,
        ..SpannedMapParams::default()
    }
}
