//! Whether a sequence of points closes, and how: at its ends, or by points that go round once more.

use ndarray::ArrayView2;

use super::polygon::{Place, angle, distance, dot, sub, unit};

/// Fewest points of a sequence that is taken to be closed though its last point is not its first one.
///
/// Limit: fewer points have no typical distance.
const FEWEST_CLOSED: usize = 8;

/// Distance of the ends, in median steps, up to which a sequence is closed: steps of one length, with noise.
///
/// Calibrated: a ring of steps of 4° closes over a gap of 4° and stays open at 8°.
const ONE_STEP: f64 = 1.5;

/// Steps at each end whose lengths say what the gap may be.
///
/// Calibrated: on 400 sections of 100 to 400 random angles, with six deviations. With 12 and four deviations 33 of them stay open;
/// with 30 and six, 5. More steps of rings whose density changes belong to other places.
const LOCAL_STEPS: usize = 30;

/// Standard deviations of those steps above their mean, up to which the gap may be one of them.
///
/// Derived: steps between random places have an exponential distribution, whose standard deviation is its mean; one step in
/// `e⁷ = 1100` is longer. Steps of one length have none, and their gap is judged by the median.
const LONG_STEP: f64 = 6.0;

/// Angle, in radians, by which the curve may turn at either end of such a gap: 60°.
///
/// Calibrated: rings of 20 random points turn by up to 50° there; the open side of a channel or a slot takes 90°.
const MAX_TURN: f64 = std::f64::consts::FRAC_PI_3;

/// Distance of a point that goes round once more from the steps at the start, in the length of those steps.
///
/// Calibrated: exact repetitions of a turn are off by the sagitta, 1 % of a step and less; the next turn of a spiral is a
/// different curve where it can be told apart, from a step on.
const BESIDE: f64 = 0.5;

/// Points that go round once more from which on a sequence closes without being asked.
///
/// Limit: one point may be there by chance.
pub(super) const FEWEST_REPEATED: usize = 2;

/// Steps between the ends, in mean steps, up to which a sequence that stays open is told to do so.
///
/// Calibrated: a word where a person would ask; farther ends are seen to be open.
const NEARLY_CLOSED: f64 = 12.0;

/// What was found at the ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Meeting {
    /// They are apart.
    Apart,
    /// They are apart, but not by far: the distance in mean steps.
    Nearly(f64),
    /// They are as near as neighbours.
    Near,
    /// They are as near as the longer steps around them, and the curve goes on over the gap.
    OverGap,
}

/// How the ends of points meet whose last is not the first again.
pub(super) fn meeting(points: ArrayView2<'_, f64>) -> Meeting {
    let places = places(points);
    let m = places.len();
    if m < FEWEST_CLOSED {
        return Meeting::Apart;
    }
    let gap = distance(places[0], places[m - 1]);
    let steps: Vec<f64> = places.windows(2).map(|w| distance(w[0], w[1])).collect();
    let mut sorted = steps.clone();
    sorted.sort_by(f64::total_cmp);
    if gap <= ONE_STEP * sorted[sorted.len() / 2] {
        return Meeting::Near;
    }
    let some = LOCAL_STEPS.min(m / 3);
    let local: Vec<f64> = steps[..some].iter().chain(&steps[steps.len() - some..]).copied().collect();
    let count = local.len() as f64;
    let mean = local.iter().sum::<f64>() / count;
    let deviation = (local.iter().map(|s| (s - mean) * (s - mean)).sum::<f64>() / count).sqrt();
    let goes_on = {
        let over = unit(sub(places[0], places[m - 1]));
        let into = direction(&places, gap, true);
        let out = direction(&places, gap, false);
        angle(into, over) <= MAX_TURN && angle(over, out) <= MAX_TURN
    };
    if gap <= mean + LONG_STEP * deviation && goes_on {
        return Meeting::OverGap;
    }
    let of_all = steps.iter().sum::<f64>() / steps.len() as f64;
    if goes_on && gap <= NEARLY_CLOSED * of_all { Meeting::Nearly(gap / of_all) } else { Meeting::Apart }
}

/// The direction at the last or the first point, over about a length and at least two steps.
fn direction(places: &[Place], length: f64, at_end: bool) -> Place {
    let m = places.len();
    let at = |k: usize| if at_end { places[m - 1 - k] } else { places[k] };
    let k = (2..m / 2).find(|&k| distance(at(0), at(k)) >= length).unwrap_or(2);
    unit(if at_end { sub(at(0), at(k)) } else { sub(at(k), at(0)) })
}

/// A point beyond the end of a closed turn, on one of its steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Repeated {
    /// The point before it in the turn.
    pub(super) step: usize,
    /// Where it stands between this point and the next one.
    pub(super) share: f64,
}

impl Repeated {
    /// The first point itself, which stands in the turn already.
    pub(super) const DROPPED: Self = Self { step: 0, share: 0.0 };
}

/// The points at the end of a sequence that go round once more: beside its first steps and in their direction. `beside` is a
/// distance that counts as beside in any case, such as the tolerance. Empty if there are fewer than `fewest`.
pub(super) fn repeated(points: ArrayView2<'_, f64>, beside: f64, fewest: usize) -> Vec<Repeated> {
    let places = places(points);
    let m = places.len();
    if m < FEWEST_CLOSED {
        return Vec::new();
    }
    // A turn takes most of the points; what goes round once more lies in the first third.
    let third = m / 3;
    let mut found = Vec::new();
    for at in (m - third..m).rev() {
        match beside_start(&places, at, third, beside) {
            Some(place) => found.push(place),
            None => break,
        }
    }
    found.reverse();
    let Some(last) = found.last() else { return found };
    let first = found[0];
    let along = |r: &Repeated| r.step as f64 + r.share;
    let onward = found.len() == 1 || along(last) > along(&first);
    let from = m - found.len();
    let direct = dot(sub(places[m - 1], places[from - 1]), sub(places[last.step + 1], places[0])) > 0.0;
    if found.len() >= fewest && onward && direct { found } else { Vec::new() }
}

/// Where a point stands beside the steps at the start, if it does.
fn beside_start(places: &[Place], at: usize, steps: usize, beside: f64) -> Option<Repeated> {
    let mut nearest: Option<(f64, Repeated, f64)> = None;
    for step in 0..steps.min(places.len() - 1) {
        let (edge, to) = (sub(places[step + 1], places[step]), sub(places[at], places[step]));
        let squared = dot(edge, edge);
        if squared == 0.0 {
            continue;
        }
        let share = (dot(to, edge) / squared).clamp(0.0, 1.0);
        let away = distance(to, edge.map(|x| share * x));
        if nearest.is_none_or(|(known, _, _)| away < known) {
            nearest = Some((away, Repeated { step, share }, squared.sqrt()));
        }
    }
    let (away, found, length) = nearest?;
    // Before the first point a sequence has not come round yet; at it, it has.
    let at_first = found.step == 0 && found.share == 0.0;
    let limit = if at_first { EQUAL * length } else { (BESIDE * length).max(beside) };
    (away <= limit).then_some(found)
}

/// Distance of equal points, in steps.
///
/// Limit: round-off of files with three digits a step.
const EQUAL: f64 = 1e-3;

fn places(points: ArrayView2<'_, f64>) -> Vec<Place> {
    points.outer_iter().map(|row| std::array::from_fn(|k| row.get(k).copied().unwrap_or(0.0))).collect()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use ndarray::Array2;

    use super::*;

    fn ring(angles: &[f64]) -> Array2<f64> {
        Array2::from_shape_fn((angles.len(), 2), |(i, k)| 10.0 * [angles[i].cos(), angles[i].sin()][k])
    }

    /// Random numbers in [0, 1).
    fn random(seed: u64) -> impl FnMut() -> f64 {
        let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
        move || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 11) as f64 / (1_u64 << 53) as f64
        }
    }

    #[test]
    fn even_rings_close_over_one_step_only() {
        for count in [12, 45, 90, 360] {
            let step = TAU / count as f64;
            let with_gap = |steps: f64| -> Array2<f64> {
                let left = count - steps as usize + 1;
                ring(&(0..left).map(|i| step * i as f64).collect::<Vec<_>>())
            };
            assert_eq!(meeting(with_gap(1.0).view()), Meeting::Near, "{count}");
            for steps in [2.0, 3.0, 5.0] {
                assert!(
                    !matches!(meeting(with_gap(steps).view()), Meeting::Near | Meeting::OverGap),
                    "{count}, {steps}"
                );
            }
        }
    }

    #[test]
    fn random_rings_close_and_channels_do_not() {
        let mut closed = 0;
        for seed in 1..=100 {
            let mut next = random(seed);
            let mut angles: Vec<f64> = (0..100).map(|_| TAU * next()).collect();
            angles.sort_by(f64::total_cmp);
            closed += usize::from(matches!(meeting(ring(&angles).view()), Meeting::Near | Meeting::OverGap));
            // Three sides of a rectangle, at random places.
            let mut along: Vec<f64> = (0..60).map(|_| 3.0 * next()).collect();
            along.sort_by(f64::total_cmp);
            let channel = Array2::from_shape_fn((60, 2), |(i, k)| {
                let t = along[i];
                let place = if t < 1.0 {
                    [0.0, 1.0 - t]
                } else if t < 2.0 {
                    [t - 1.0, 0.0]
                } else {
                    [1.0, t - 2.0]
                };
                place[k] * 0.2_f64.powi(1 - k as i32)
            });
            assert!(!matches!(meeting(channel.view()), Meeting::Near | Meeting::OverGap), "seed {seed}");
        }
        assert!(closed >= 94, "{closed}");
    }

    #[test]
    fn a_turn_of_more_than_one_round_is_recognized() {
        for count in [60, 365] {
            for extra in [0, 1, 5, 17] {
                let step = TAU / count as f64;
                let points =
                    ring(&(0..count + extra).map(|i| step * (i as f64 + 0.3 * (i / count) as f64)).collect::<Vec<_>>());
                let found = repeated(points.view(), 0.0, 1);
                assert_eq!(found.len(), extra, "{count}");
                for (i, place) in found.iter().enumerate() {
                    assert_eq!(place.step, i);
                    assert!((place.share - 0.3).abs() < 0.02);
                }
            }
        }
        // Back beside itself, as around a thin plate, is no second turn.
        let plate = Array2::from_shape_fn(
            (80, 2),
            |(i, k)| {
                if i < 40 { [i as f64, 0.0][k] } else { [(79 - i) as f64, 0.1][k] }
            },
        );
        assert!(repeated(plate.view(), 0.0, 1).is_empty());
    }
}
