//! The verdict on a curve: whether it is near its points everywhere, and goes nowhere else.

use deviation::{Reason, Verdict};
use ndarray::{Array1, Array2};
use serde::Serialize;
use thb_core::{ClosestPoints, SplineMap};

use super::crossing::{self, Plane};
use super::polygon::{Place, Polygon, distance};
use super::sequence::{Closing, Sequence};
use super::support::Frame;
use crate::Error;

/// The limits of the verdict on curves.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CurveLimits {
    /// What the share of the points within the tolerance may lack of the asked share.
    pub share_slack: f64,
    /// Largest diagonal of the box around the curve, over that of the box around the points and what their turning explains.
    pub box_ratio: f64,
    /// Points in a row beyond the tolerance from which on they are told.
    pub missed_points: usize,
    /// Share of the length of the polygon that such points stand for at least.
    pub missed_length: f64,
}

impl Default for CurveLimits {
    fn default() -> Self {
        Self {
            share_slack: SHARE_SLACK,
            box_ratio: BOX_RATIO,
            missed_points: MISSED_POINTS,
            missed_length: MISSED_LENGTH,
        }
    }
}

/// Limit: single points of a hundred and more are left to chance, as for surfaces.
const SHARE_SLACK: f64 = 0.01;

/// Limit: a curve that is near its points has about their box; the rest is for few points on strong bends.
const BOX_RATIO: f64 = 1.05;

/// Limit: fewer in a row happen by chance where 5 % of the points may be missed.
const MISSED_POINTS: usize = 5;

/// Limit: below, what is missed is smaller than the distance of a thousand points around the curve.
const MISSED_LENGTH: f64 = 1e-3;

/// Places at which a curve is looked at in each polynomial piece between two vertices.
///
/// Derived: the largest bulge of a cubic is then underestimated by less than 2 %.
const SAMPLES_PER_PIECE: usize = 8;

/// Distance of the chords by which crossings are found from the curve, as a share of the tolerance.
///
/// Limit: smaller loops are not seen; ten times finer chords take three times as long.
const CROSSING_CHORD: f64 = 0.02;

/// The same, as a share of the extent of the points at least.
///
/// Limit: for tolerances near the round-off of coordinates.
const LEAST_CROSSING_CHORD: f64 = 1e-7;

/// Distance, in tolerances, within which a crossing of the polygon explains one of the curve.
///
/// Derived: both branches of the curve are within one tolerance of the polygon's, and cross at an angle of 40° or more.
const EXPLAINED_NEAR: f64 = 3.0;

/// A curve as it is judged.
pub(super) struct Subject<'a> {
    pub(super) map: &'a SplineMap<1>,
    pub(super) sequence: &'a Sequence,
    /// Parameters of the points.
    pub(super) parameters: &'a Array1<f64>,
    /// Distances of the points at their parameters.
    pub(super) errors: &'a Array1<f64>,
    pub(super) tolerance: f64,
    /// The share of the points that is asked for.
    pub(super) within: f64,
    /// Whether the curve is a function of its parameter.
    pub(super) is_function: bool,
}

/// What was found.
#[derive(Clone, Debug)]
pub(super) struct Judgement {
    pub(super) reasons: Vec<Reason>,
    /// Share of the points, weighed by spacing, whose closest point on the curve is within the tolerance.
    pub(super) share: f64,
    /// Largest distance of the curve from the polygon beyond what its turning explains.
    pub(super) swing: f64,
    pub(super) box_ratio: f64,
    /// None where a curve in space or a function has none.
    pub(super) crossings: Option<usize>,
    /// The larger of the distances from the points to the curve and of the swing.
    pub(super) two_sided: f64,
    /// Pairs of points between which the curve swings out.
    pub(super) swings: Vec<[usize; 2]>,
    /// Points at crossings.
    pub(super) crossed: Vec<usize>,
}

impl Judgement {
    pub(super) fn verdict(&self) -> Verdict {
        deviation::verdict(&self.reasons)
    }
}

/// Judges a curve by its points and their polygon.
pub(super) fn judge(subject: &Subject<'_>) -> Result<Judgement, Error> {
    let walk = Walk::new(subject);
    let limits = CurveLimits::default();
    let mut reasons = Vec::new();
    let (share, farthest) = walk.share_within(&limits, &mut reasons)?;
    let found = walk.swings()?;
    if let Some(worst) = &found.worst {
        reasons.push(walk.swing_reason(worst));
    }
    let box_ratio = walk.box_ratio(&found.samples);
    if box_ratio > limits.box_ratio {
        reasons.push(Reason {
            code: "box".into(),
            verdict: Verdict::Failed,
            text: format!(
                "the box around the curve has {box_ratio:.3} times the diagonal that the points explain (at most {}); raise \
                 --lambda, or add points where it leaves them",
                limits.box_ratio
            ),
            figure: box_ratio,
            limit: limits.box_ratio,
            place: None,
        });
    }
    let crossings = walk.crossings()?;
    let count = crossings.as_ref().map(Vec::len);
    if let Some(&(place, at)) = crossings.iter().flatten().next() {
        let rows = at.map(|at| walk.row(at));
        reasons.push(Reason {
            code: "crossing".into(),
            verdict: Verdict::Failed,
            text: format!(
                "the curve crosses itself where the points don't, {} at {}, near rows {} and {}; lower --tol or raise \
                 --lambda",
                times(count.unwrap_or(0)),
                shown(place),
                rows[0],
                rows[1]
            ),
            figure: count.unwrap_or(0) as f64,
            limit: 0.0,
            place: Some(place),
        });
    }
    reasons.sort_by_key(|reason| std::cmp::Reverse(reason.verdict));
    Ok(Judgement {
        reasons,
        share,
        swing: found.beyond,
        box_ratio,
        crossings: count,
        two_sided: farthest.max(found.beyond),
        swings: found.pairs,
        crossed: walk.at_crossings(crossings.as_deref().unwrap_or_default()),
    })
}

/// The points in the order of their parameters.
struct Walk<'a> {
    subject: &'a Subject<'a>,
    frame: Frame,
    /// Places of the points in the sequence.
    order: Vec<usize>,
    parameters: Vec<f64>,
    places: Vec<Place>,
    polygon: Polygon,
    period: Option<f64>,
}

/// A place of the curve that is farther from the polygon than explained.
struct Swing {
    /// Distance from the polygon.
    distance: f64,
    /// The same without what the turning of the polygon explains.
    beyond: f64,
    /// What is allowed of it: the tolerance, or the distance of the points there.
    limit: f64,
    place: Place,
    /// Points between which it happens, in the order of the walk.
    between: [usize; 2],
}

struct Swings {
    /// The largest distance from the polygon without what its turning explains.
    beyond: f64,
    /// The swing that is farthest beyond what is allowed.
    worst: Option<Swing>,
    pairs: Vec<[usize; 2]>,
    samples: Vec<Place>,
}

impl<'a> Walk<'a> {
    fn new(subject: &'a Subject<'a>) -> Self {
        let Subject { sequence, parameters, is_function, .. } = *subject;
        let mut order: Vec<usize> = (0..parameters.len()).collect();
        order.sort_by(|&a, &b| parameters[a].total_cmp(&parameters[b]));
        let frame = Frame::new(sequence, is_function);
        let walked: Vec<f64> = order.iter().map(|&i| parameters[i]).collect();
        let places: Vec<Place> =
            order.iter().zip(&walked).map(|(&i, &u)| frame.place(u, sequence.points.row(i).to_vec())).collect();
        let closed = sequence.closing == Closing::Periodic;
        let corners: Vec<usize> = (0..order.len()).filter(|&at| sequence.corners.contains(&order[at])).collect();
        let polygon = Polygon::new(places.clone(), closed, &corners);
        let period = closed.then_some(sequence.domain.1 - sequence.domain.0);
        Self { subject, frame, order, parameters: walked, places, polygon, period }
    }

    fn row(&self, at: usize) -> usize {
        self.subject.sequence.rows[self.order[at]]
    }

    /// The share of the points within the tolerance of their closest points, weighed by spacing, and the largest distance.
    fn share_within(&self, limits: &CurveLimits, reasons: &mut Vec<Reason>) -> Result<(f64, f64), Error> {
        let Subject { map, sequence, errors, tolerance, within, is_function, .. } = *self.subject;
        let m = self.order.len();
        let search = ClosestPoints::new(map.bezier().clone())?;
        let mut distances = Vec::with_capacity(m);
        for (at, &i) in self.order.iter().enumerate() {
            let at_parameter = errors[i];
            distances.push(if is_function || at_parameter <= tolerance {
                at_parameter
            } else {
                let u = [self.parameters[at]];
                let point = sequence.points.row(i).to_vec();
                search.closest_from(&point, map.space().locate_cell(u)?, u).distance.min(at_parameter)
            });
        }
        let weights = self.spacing();
        let total: f64 = weights.iter().sum();
        let met: f64 = weights.iter().zip(&distances).filter(|(_, d)| **d <= tolerance).map(|(w, _)| w).sum();
        let share = if distances.iter().all(|d| *d <= tolerance) { 1.0 } else { met / total };
        let worst = (0..m).max_by(|&a, &b| distances[a].total_cmp(&distances[b])).unwrap_or(0);
        let (farthest, place) = (distances[worst], self.frame.natural(self.places[worst]));
        if share < within {
            let failed = share < within - limits.share_slack;
            reasons.push(Reason {
                code: "share".into(),
                verdict: if failed { Verdict::Failed } else { Verdict::Usable },
                text: format!(
                    "{:.2} % of the points, weighed by their spacing, are within {tolerance:.4e}, not {:.2} %; the farthest, row \
                     {}, is {farthest:.4e} off at {}; raise --tol where the points are noisy",
                    100.0 * share,
                    100.0 * within,
                    self.row(worst),
                    shown(place)
                ),
                figure: share,
                limit: within - if failed { limits.share_slack } else { 0.0 },
                place: Some(place),
            });
        }
        self.missed_runs(&distances, &weights, total, limits, reasons);
        Ok((share, farthest))
    }

    /// Tells the longest run of points beyond the tolerance.
    fn missed_runs(
        &self,
        distances: &[f64],
        weights: &[f64],
        total: f64,
        limits: &CurveLimits,
        reasons: &mut Vec<Reason>,
    ) {
        let tolerance = self.subject.tolerance;
        let mut longest: Option<(f64, [usize; 2])> = None;
        let mut start = None;
        for at in 0..=distances.len() {
            let is_missed = distances.get(at).is_some_and(|d| *d > tolerance);
            match (is_missed, start) {
                (true, None) => start = Some(at),
                (false, Some(first)) => {
                    let length: f64 = weights[first..at].iter().sum::<f64>() / total;
                    let counts = at - first >= limits.missed_points && length > limits.missed_length;
                    if counts && longest.is_none_or(|(known, _)| length > known) {
                        longest = Some((length, [first, at - 1]));
                    }
                    start = None;
                }
                _ => {}
            }
        }
        let Some((length, [first, last])) = longest else { return };
        let worst = (first..=last).max_by(|&a, &b| distances[a].total_cmp(&distances[b])).unwrap_or(first);
        let place = self.frame.natural(self.places[worst]);
        reasons.push(Reason {
            code: "missed".into(),
            verdict: Verdict::Usable,
            text: format!(
                "{} points in a row, rows {} to {}, are beyond the tolerance: {:.2} % of the length, up to {:.4e} at {}",
                last - first + 1,
                self.row(first),
                self.row(last),
                100.0 * length,
                distances[worst],
                shown(place)
            ),
            figure: length,
            limit: limits.missed_length,
            place: Some(place),
        });
    }

    /// Half the distances to both neighbours of each point; of a function along the parameter. All 1 where all points are equal.
    fn spacing(&self) -> Vec<f64> {
        let m = self.order.len();
        let step = |i: usize| {
            if self.subject.is_function {
                self.parameters[i + 1] - self.parameters[i]
            } else {
                distance(self.places[i], self.places[i + 1])
            }
        };
        let mut weights = vec![0.0; m];
        for i in 0..m - 1 {
            let half = 0.5 * step(i);
            weights[i] += half;
            weights[i + 1] += half;
        }
        if self.period.is_some() {
            let half = 0.5 * distance(self.places[m - 1], self.places[0]);
            weights[0] += half;
            weights[m - 1] += half;
        }
        if weights.iter().sum::<f64>() > 0.0 { weights } else { vec![1.0; m] }
    }

    /// How far the curve leaves the polygon between its vertices.
    fn swings(&self) -> Result<Swings, Error> {
        let Subject { map, errors, tolerance, .. } = *self.subject;
        let m = self.order.len();
        let (lower, upper) = map.space().domain();
        let breaks = map.space().knots(0, 0)?.breaks().to_vec();
        let edges = self.polygon.edges();
        // Parts of the curve: edge, bulge that is explained, points at its ends, parameters.
        let mut parts: Vec<(usize, f64, [usize; 2], [f64; 2])> = Vec::new();
        for (k, edge) in edges.iter().enumerate() {
            let (from, mut to) = (self.parameters[edge.from], self.parameters[edge.to]);
            if edge.to <= edge.from {
                to += self.period.unwrap_or(0.0);
            }
            parts.push((k, edge.allowed, [edge.from, edge.to], [from, to]));
        }
        if let (None, Some(first), Some(last)) = (self.period, edges.first(), edges.last()) {
            // What an open curve does beyond its first and last point, where parameters have moved.
            let half = |edge: &super::polygon::Edge| 0.5 * distance(self.places[edge.from], self.places[edge.to]);
            parts.push((0, half(first), [0, 0], [lower[0], self.parameters[0]]));
            parts.push((edges.len() - 1, half(last), [m - 1, m - 1], [self.parameters[m - 1], upper[0]]));
        }
        let mut at: Vec<f64> = Vec::new();
        let mut owners: Vec<usize> = Vec::new();
        for (number, &(_, _, _, [from, to])) in parts.iter().enumerate().filter(|(_, part)| part.3[1] > part.3[0]) {
            let period = self.period.unwrap_or(0.0);
            let inner = breaks
                .iter()
                .chain(breaks.iter())
                .enumerate()
                .map(|(i, &t)| if i < breaks.len() { t } else { t + period });
            let mut ends: Vec<f64> = inner.filter(|&t| t > from && t < to).collect();
            ends.extend([from, to]);
            ends.sort_by(f64::total_cmp);
            ends.dedup();
            for piece in ends.windows(2) {
                for i in 0..=SAMPLES_PER_PIECE {
                    let u = piece[0] + (piece[1] - piece[0]) * i as f64 / SAMPLES_PER_PIECE as f64;
                    at.push(if u > upper[0] { u - period } else { u }.clamp(lower[0], upper[0]));
                    owners.push(number);
                }
            }
        }
        let columns = Array2::from_shape_vec((at.len(), 1), at.clone()).unwrap_or_default();
        let images = if at.is_empty() { Array2::zeros((0, map.dim())) } else { map.eval_batch(columns.view())? };
        let mut found = Swings { beyond: 0.0, worst: None, pairs: Vec::new(), samples: Vec::with_capacity(at.len()) };
        for ((&u, &number), image) in at.iter().zip(&owners).zip(images.outer_iter()) {
            let (k, allowed, between, _) = parts[number];
            let place = self.frame.place(u, image.to_vec());
            found.samples.push(place);
            let off = self.polygon.distance_near(k, place);
            let beyond = (off - allowed).max(0.0);
            found.beyond = found.beyond.max(beyond);
            if beyond <= tolerance {
                continue;
            }
            // Points that are missed take the curve away from the polygon; the share tells of them.
            let count = (between[1] + m - between[0]) % m;
            let missed = (0..=count).map(|i| errors[self.order[(between[0] + i) % m]]).fold(0.0, f64::max);
            let limit = tolerance.max(missed);
            if beyond <= limit {
                continue;
            }
            if found.worst.as_ref().is_none_or(|worst| worst.beyond - worst.limit < beyond - limit) {
                found.worst = Some(Swing { distance: off, beyond, limit, place, between });
            }
            let pair = between.map(|at| self.order[at]);
            if found.pairs.last() != Some(&pair) {
                found.pairs.push(pair);
            }
        }
        Ok(found)
    }

    fn swing_reason(&self, worst: &Swing) -> Reason {
        let place = self.frame.natural(worst.place);
        let where_to = match worst.between {
            [a, b] if a == b => format!("beyond row {}", self.row(a)),
            [a, b] => format!("between rows {} and {}", self.row(a), self.row(b)),
        };
        Reason {
            code: "swing".into(),
            verdict: Verdict::Failed,
            text: format!(
                "the curve swings out {where_to}: at {} it is {:.4e} off the line of the points, {:.4e} more than their turning \
                 explains; add points there, name --corners, or raise --lambda",
                shown(place),
                worst.distance,
                worst.beyond
            ),
            figure: worst.beyond,
            limit: worst.limit,
            place: Some(place),
        }
    }

    /// The diagonal of the box around the curve over that of the box around the points and the bulges of the polygon.
    fn box_ratio(&self, samples: &[Place]) -> f64 {
        let mut explained = Bounds::default();
        self.places.iter().for_each(|&place| explained.add(place, 0.0));
        for edge in self.polygon.edges() {
            let (a, b) = (self.places[edge.from], self.places[edge.to]);
            explained.add(std::array::from_fn(|i| 0.5 * (a[i] + b[i])), edge.allowed);
        }
        let mut curve = Bounds::default();
        samples.iter().for_each(|&place| curve.add(place, 0.0));
        let diagonal = explained.diagonal();
        if diagonal > 0.0 && !samples.is_empty() { curve.diagonal() / diagonal } else { 1.0 }
    }

    /// The points at crossings, as places in the sequence.
    fn at_crossings(&self, crossings: &[Crossed]) -> Vec<usize> {
        let m = self.order.len();
        let mut at = vec![false; m];
        for &(_, [a, b]) in crossings {
            if b - a <= SHORT_LOOP {
                at[a.saturating_sub(1)..(b + 3).min(m)].fill(true);
            } else {
                for middle in [a, b] {
                    at[(middle + 1).saturating_sub(AT_CROSSING)..(middle + 1 + AT_CROSSING).min(m)].fill(true);
                }
            }
        }
        (0..m).filter(|&k| at[k]).map(|k| self.order[k]).collect()
    }

    /// Crossings of a plane curve that its polygon doesn't have; none for others.
    fn crossings(&self) -> Result<Option<Vec<Crossed>>, Error> {
        let Subject { map, sequence, tolerance, is_function, .. } = *self.subject;
        if is_function {
            return Ok(None);
        }
        let points = sequence.points.as_standard_layout();
        let rows: Vec<&[f64]> = points.outer_iter().filter_map(|row| row.to_slice()).collect();
        let Some(plane) = Plane::of(&rows, tolerance) else { return Ok(None) };
        let mut bounds = Bounds::default();
        self.places.iter().for_each(|&place| bounds.add(place, 0.0));
        let extent = bounds.diagonal();
        let chord = (CROSSING_CHORD * tolerance).max(LEAST_CROSSING_CHORD * extent);
        let found = crossing::of_curve(map, &plane, chord, extent)?;
        if found.is_empty() {
            return Ok(Some(Vec::new()));
        }
        let flat: Vec<[f64; 2]> = rows.iter().map(|row| plane.project(row)).collect();
        let contacts = crossing::of_polygon(&flat, sequence.closing == Closing::Periodic, extent);
        let is_explained = |place: [f64; 2]| {
            contacts.iter().any(|(contact, edge)| {
                let away = (place[0] - contact[0]).hypot(place[1] - contact[1]);
                away <= (EXPLAINED_NEAR * tolerance).max(2.0 * edge)
            })
        };
        let before = |u: f64| self.parameters.partition_point(|&t| t <= u).saturating_sub(1);
        found
            .into_iter()
            .filter(|crossing| !is_explained(crossing.place))
            .map(|crossing| {
                let image = map.eval([crossing.parameters[0]])?;
                let place = std::array::from_fn(|k| image.get(k).copied().unwrap_or(0.0));
                Ok((place, crossing.parameters.map(before)))
            })
            .collect::<Result<Vec<_>, Error>>()
            .map(Some)
    }
}

/// Points of a loop up to which all of them are at its crossing.
///
/// Limit: in a longer one the curve has room to be right away from the crossing.
const SHORT_LOOP: usize = 12;

/// Points on each side of a crossing that are at it.
///
/// Derived: a cubic's span there has this many points around it where points determine the curve.
const AT_CROSSING: usize = 3;

/// A crossing: its place, and the points of the walk before it on both branches.
type Crossed = ([f64; 3], [usize; 2]);

/// A box of places.
struct Bounds {
    lower: Place,
    upper: Place,
}

impl Default for Bounds {
    fn default() -> Self {
        Self { lower: [f64::INFINITY; 4], upper: [f64::NEG_INFINITY; 4] }
    }
}

impl Bounds {
    fn add(&mut self, place: Place, around: f64) {
        for k in 0..4 {
            // Coordinates that no point has stay out.
            let around = if place[k] == 0.0 && self.lower[k] == 0.0 && self.upper[k] == 0.0 { 0.0 } else { around };
            self.lower[k] = self.lower[k].min(place[k] - around);
            self.upper[k] = self.upper[k].max(place[k] + around);
        }
    }

    fn diagonal(&self) -> f64 {
        distance(self.lower, self.upper)
    }
}

fn times(count: usize) -> String {
    if count == 1 { "once,".to_owned() } else { format!("{count} times, first") }
}

/// A place for people.
fn shown(place: [f64; 3]) -> String {
    format!("({:.5}, {:.5}, {:.5})", place[0], place[1], place[2])
}
