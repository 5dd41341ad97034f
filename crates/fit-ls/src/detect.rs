//! Markers found by a first fit (Imperatore 2024, example 3.1.9 (c)).

use std::sync::Arc;

use ndarray::{ArrayView1, ArrayView2};
use thb_core::HierarchicalSpace;

use crate::{Error, Loss, Markers, Options, Reweighted, Reweighting, Robust, median_scale};

/// Rounds of the first fit.
const ROUNDS: usize = 10;

/// Errors beyond the median by this many scales stand out from those of the rest.
const STANDING_OUT: f64 = 3.0;

/// How markers are found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detection {
    /// Errors of the first fit up to this are none of a feature, in units of the points.
    pub threshold: f64,
    /// Whether an error must also stand out from those of the other points. Without, all points beyond the threshold are of
    /// type I, as in the text; with a first fit that is far from the shape, these are most of the points.
    pub standing_out: bool,
    /// Whether points with gross residuals become markers of type II: they are then left out of type I.
    pub outliers: bool,
    /// Largest share of the points that become markers of type II ([`Robust::max_set_aside`]).
    pub max_outliers: f64,
}

/// Markers of points `(m, N)` at parameters `(m, D)` by a first fit in a space: type I where its errors say that a feature is
/// missing, type II where the residual of a point disagrees grossly with those of its neighbours.
///
/// # Errors
/// Those of [`Reweighted::new`] and [`Reweighted::fit`].
pub fn detect_markers<const D: usize>(
    parameters: ArrayView2<'_, f64>,
    points: ArrayView2<'_, f64>,
    confidence: Option<ArrayView1<'_, f64>>,
    space: &Arc<HierarchicalSpace<D>>,
    options: Options<D>,
    detection: Detection,
) -> Result<Markers, Error> {
    let m = points.nrows();
    let robust = detection.outliers.then(|| Robust {
        max_set_aside: detection.max_outliers,
        ..Robust::adaptive::<D>(Loss::Tukey, detection.threshold)
    });
    let reweighting = Reweighting { robust, markers: None };
    let mut fit = Reweighted::new(parameters, points, confidence, options, &reweighting)?;
    fit.fit(space, ROUNDS)?;
    let (errors, counted) = (fit.errors(), fit.weights().counted());
    let mut threshold = detection.threshold;
    if detection.standing_out {
        let mut heard: Vec<f64> = (0..m).filter(|&i| counted[i]).map(|i| errors[i]).collect();
        let middle = heard.len() / 2;
        if !heard.is_empty() {
            let median = *heard.select_nth_unstable_by(middle, f64::total_cmp).1;
            heard.iter_mut().for_each(|e| *e = (*e - median).abs());
            threshold = threshold.max(median + STANDING_OUT * median_scale(&mut heard));
        }
    }
    Ok(Markers {
        met: (0..m).filter(|&i| counted[i] && errors[i] > threshold).collect(),
        ignored: (0..m).filter(|&i| fit.weights().gross()[i]).collect(),
    })
}
