//! Weights that follow the errors: markers, and robust losses.

mod loss;
mod markers;
mod neighbourhood;

use ndarray::{ArrayView1, ArrayView2};

pub use self::loss::{Loss, median_scale};
use self::markers::MarkerWeights;
pub use self::markers::{MarkerRules, Markers, Update};
use self::neighbourhood::Neighbourhoods;
use crate::Error;

/// Deviations of more scales than this are gross: such points are set aside. Derived: where [`Loss::Tukey`] reaches zero; of
/// Gaussian errors one in 3·10⁵ lies beyond.
const GROSS: f64 = 4.685;

/// Largest share of the points that is set aside unless another one is asked for. Limit: where more points disagree with their
/// neighbours than that, it is as likely that the neighbours are no measure, because there are few points or the shape is rough.
pub const MAX_SET_ASIDE: f64 = 0.1;

/// Scales that the largest deviation has that may not be gross, where more are than may be set aside: all deviations are
/// measured by a scale so much larger. Limit: below [`GROSS`], so that such a point keeps a weight (0.19 by Tukey's loss).
const LARGEST_KEPT: f64 = 0.75 * GROSS;

/// Round-off of a residual, as a share of the largest coordinate. Derived: 2⁻⁵³ for the coordinate and for each of the
/// products and sums that give a value of a spline, 16 of them for a bicubic one.
const ROUND_OFF: f64 = 16.0 * f64::EPSILON;

/// Weights that change by less than this, relative to 1 or to themselves if larger, have settled.
const SETTLED: f64 = 0.01;

/// A robust loss, and how errors are judged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Robust {
    /// The loss.
    pub loss: Loss,
    /// Neighbours in the parameter domain whose median residual a residual is measured from; 0 for none: then the residual
    /// itself is judged, by one scale for all points, as in textbook IRLS. With neighbours a space that is still too coarse
    /// for the shape does not make outliers of its features.
    pub neighbours: usize,
    /// Whether gross points, beyond 4.685 scales, lose their weight altogether, whatever the loss. The bounded pull of an
    /// outlier ([`Loss::Huber`], [`Loss::Power`]) is still a pull: where outliers cluster on one side it bends a surface
    /// away from the other points, the space is refined there, and a fine space meets them.
    pub reject: bool,
    /// Scales are at least this, in units of the points. Errors well below the tolerance of a fit need not be told apart.
    pub least_scale: f64,
    /// Largest share of the points, of those with confidence that are no markers of type II, that may be gross. Where more
    /// deviate by 4.685 scales, the scale is enlarged until no more than this share does. From 0 to 1.
    pub max_set_aside: f64,
}

impl Robust {
    /// A loss for adaptive fits with `D` parameters to a tolerance: ten neighbours per direction, gross points without
    /// weight, a tenth of the points at most, and a third of the tolerance as the least scale.
    pub fn adaptive<const D: usize>(loss: Loss, tolerance: f64) -> Self {
        let least_scale = tolerance / 3.0;
        Self { loss, neighbours: 10 * D, reject: true, least_scale, max_set_aside: MAX_SET_ASIDE }
    }

    /// The loss alone: residuals as they are, one scale, by their median, whatever share of the points is gross.
    pub fn plain(loss: Loss) -> Self {
        Self { loss, neighbours: 0, reject: false, least_scale: 0.0, max_set_aside: 1.0 }
    }

    fn check(&self) -> Result<(), Error> {
        self.loss.check()?;
        let (scale, share) = (self.least_scale, self.max_set_aside);
        if !(scale.is_finite() && scale >= 0.0) {
            return Err(Error::Scale { value: scale });
        }
        if (0.0..=1.0).contains(&share) { Ok(()) } else { Err(Error::Share { value: share }) }
    }
}

/// What the weights of a fit follow. Nothing by default.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reweighting {
    /// A robust loss, if any.
    pub robust: Option<Robust>,
    /// Markers with their rules, if any.
    pub markers: Option<(Markers, MarkerRules)>,
}

/// The weight of each point as a product: confidence, which is given, times the weight of the loss, times that of its
/// marker. All arrays are in the order in which the points were given.
///
/// A state of its own, for whatever solves: ask for [`PointWeights::weights`], solve, hand over residuals, repeat.
#[derive(Clone, Debug)]
pub struct PointWeights {
    confidence: Vec<f64>,
    robust: Vec<f64>,
    markers: MarkerWeights,
    rule: Option<Robust>,
    neighbourhoods: Option<Neighbourhoods>,
    /// Points whose residuals are gross.
    gross: Vec<bool>,
    scale: Option<f64>,
    /// Whether more points were gross than may be set aside.
    capped: bool,
}

impl PointWeights {
    /// Weights of points with parameters `(m, D)`, before anything is fitted; `confidence` `(m)` is 1 if not given.
    ///
    /// # Errors
    /// [`Error::Shape`], [`Error::Weight`], [`Error::Marker`], [`Error::MarkedTwice`], [`Error::MarkerRule`],
    /// [`Error::Exponent`], [`Error::Scale`].
    pub fn new<const D: usize>(
        parameters: ArrayView2<'_, f64>,
        confidence: Option<ArrayView1<'_, f64>>,
        reweighting: &Reweighting,
    ) -> Result<Self, Error> {
        let m = parameters.nrows();
        if parameters.ncols() != D {
            return Err(Error::Shape { what: "columns of parameters", given: parameters.ncols(), expected: D });
        }
        let confidence = confidence.map_or_else(|| vec![1.0; m], |w| w.to_vec());
        if confidence.len() != m {
            return Err(Error::Shape { what: "weights", given: confidence.len(), expected: m });
        }
        if let Some(index) = confidence.iter().position(|w| !(w.is_finite() && *w >= 0.0)) {
            return Err(Error::Weight { index, value: confidence[index] });
        }
        let (markers, rules) =
            reweighting.markers.clone().unwrap_or_else(|| (Markers::default(), MarkerRules::new(1.0, 1.0)));
        let markers = MarkerWeights::new(markers, rules, m)?;
        let mut weights = Self {
            robust: vec![1.0; m],
            gross: vec![false; m],
            neighbourhoods: None,
            scale: None,
            capped: false,
            rule: reweighting.robust,
            confidence,
            markers,
        };
        if let Some(rule) = reweighting.robust {
            rule.check()?;
            if rule.neighbours > 0 {
                let neighbourhoods = Neighbourhoods::new::<D>(parameters, &weights.speaking(), rule.neighbours)?;
                weights.neighbourhoods = Some(neighbourhoods);
            }
        }
        Ok(weights)
    }

    /// Points whose residuals tell the scale: those with some confidence that are not to be ignored.
    fn speaking(&self) -> Vec<bool> {
        let mut speaking: Vec<bool> = self.confidence.iter().map(|&w| w > 0.0).collect();
        self.markers.markers().ignored.iter().for_each(|&i| speaking[i] = false);
        speaking
    }

    /// The present weight of each point.
    pub fn weights(&self) -> Vec<f64> {
        let factors = self.confidence.iter().zip(&self.robust).zip(&self.markers.factors);
        factors.map(|((confidence, robust), marker)| confidence * robust * marker).collect()
    }

    /// For each point, the factor by which the loss changes its weight.
    pub fn robust_factors(&self) -> &[f64] {
        &self.robust
    }

    /// Whether each point counts for the error of a fit: not the gross ones, not markers of type II, not those without
    /// confidence. Where only such points are off, nothing needs to be refined.
    pub fn counted(&self) -> Vec<bool> {
        self.speaking().into_iter().zip(&self.gross).map(|(speaks, gross)| speaks && !gross).collect()
    }

    /// Whether each point was set aside for a gross residual.
    pub fn gross(&self) -> &[bool] {
        &self.gross
    }

    /// The robust loss, if it is another one than that of least squares.
    pub(crate) fn rule(&self) -> Option<Robust> {
        self.rule.filter(|rule| !rule.loss.is_least_squares())
    }

    /// Tells the largest absolute value of a coordinate: scales are then never below the round-off of residuals.
    pub(crate) fn set_largest_coordinate(&mut self, largest: f64) {
        if let Some(rule) = &mut self.rule {
            rule.least_scale = rule.least_scale.max(ROUND_OFF * largest);
        }
    }

    /// Weighs by another loss from the next update on.
    pub(crate) fn set_rule(&mut self, rule: Robust) {
        self.rule = Some(rule);
    }

    /// The scale of the residuals, once it is known: their typical size in units of the points, as a standard deviation.
    pub fn scale(&self) -> Option<f64> {
        self.scale
    }

    /// Whether more points had gross residuals than may be set aside ([`Robust::max_set_aside`]), so that the scale was enlarged.
    pub fn is_capped(&self) -> bool {
        self.capped
    }

    /// The markers.
    pub fn markers(&self) -> &Markers {
        self.markers.markers()
    }

    /// Weighs the points anew by the loss, given their residuals, one array per coordinate. Whether the weights have
    /// settled. Markers of type I keep their weight: they are to be met. The loss of least squares changes no weight.
    ///
    /// # Errors
    /// [`Error::Shape`].
    pub fn update_robust(&mut self, residuals: &[Vec<f64>]) -> Result<bool, Error> {
        let Some(rule) = self.rule() else { return Ok(true) };
        let m = self.confidence.len();
        if let Some(column) = residuals.iter().find(|column| column.len() != m) {
            return Err(Error::Shape { what: "rows of residuals", given: column.len(), expected: m });
        }
        let deviations = match &self.neighbourhoods {
            Some(neighbourhoods) => neighbourhoods.deviations(residuals, &self.gross),
            None => lengths(residuals, m),
        };
        let speaking = self.speaking();
        let mut heard: Vec<f64> = (0..m).filter(|&i| speaking[i]).map(|i| deviations[i]).collect();
        // Where most residuals vanish any scale is as good as another.
        let scale = median_scale(&mut heard).max(rule.least_scale).max(f64::MIN_POSITIVE);
        let local = self.neighbourhoods.as_ref().map(|n| n.scales(&deviations, &self.gross));
        let in_scales = |i: usize| deviations[i] / local.as_ref().map_or(scale, |local| scale.max(local[i]));
        let mut scaled: Vec<f64> = (0..m).map(in_scales).collect();
        let mut may_be_gross = speaking;
        self.markers.markers().met.iter().for_each(|&i| may_be_gross[i] = false);
        let wider = widening(&scaled, &may_be_gross, rule.max_set_aside);
        scaled.iter_mut().for_each(|u| *u /= wider);
        let mut settled = true;
        for (i, &u) in scaled.iter().enumerate() {
            self.gross[i] = u > GROSS;
            // Errors below the least scale need not be told apart.
            let u = u.max(rule.least_scale / (scale * wider));
            let weight = if rule.reject && self.gross[i] { 0.0 } else { rule.loss.weight(u) };
            settled &= (weight - self.robust[i]).abs() <= SETTLED * weight.max(1.0);
            self.robust[i] = weight;
        }
        for &i in &self.markers.markers().met {
            (self.robust[i], self.gross[i]) = (1.0, false);
        }
        (self.scale, self.capped) = (Some(scale), wider > 1.0);
        Ok(settled)
    }

    /// One update of the markers' weights, given the error of each point. Whether all markers are satisfied.
    ///
    /// # Errors
    /// [`Error::Shape`].
    pub fn update_markers(&mut self, errors: &[f64]) -> Result<bool, Error> {
        self.check_errors(errors)?;
        Ok(self.markers.update(errors))
    }

    /// The numbers of markers of type I and II that are not satisfied by errors. A marker of type II without weight is
    /// ignored and thereby satisfied.
    ///
    /// # Errors
    /// [`Error::Shape`].
    pub fn unsatisfied(&self, errors: &[f64]) -> Result<[usize; 2], Error> {
        self.check_errors(errors)?;
        Ok(self.markers.count_unsatisfied(errors))
    }

    fn check_errors(&self, errors: &[f64]) -> Result<(), Error> {
        let (given, expected) = (errors.len(), self.confidence.len());
        if given == expected { Ok(()) } else { Err(Error::Shape { what: "errors of points", given, expected }) }
    }
}

/// The factor, 1 or more, by which scales must be enlarged so that at most a share of the points that `count` has a gross deviation,
/// given the deviations in scales.
fn widening(scaled: &[f64], count: &[bool], share: f64) -> f64 {
    let mut heard: Vec<f64> = scaled.iter().zip(count).filter(|(_, counts)| **counts).map(|(u, _)| *u).collect();
    let most = (share * heard.len() as f64) as usize;
    if heard.iter().filter(|&&u| u > GROSS).count() <= most {
        return 1.0;
    }
    // The largest deviation that must not be gross. One that is not finite has no scale at all: then none is set aside.
    let (_, largest_kept, _) = heard.select_nth_unstable_by(most, |a, b| b.total_cmp(a));
    *largest_kept / LARGEST_KEPT
}

/// The length of each residual.
pub(crate) fn lengths(residuals: &[Vec<f64>], points: usize) -> Vec<f64> {
    (0..points).map(|i| residuals.iter().map(|column| column[i] * column[i]).sum::<f64>().sqrt()).collect()
}
