//! Corners of a sequence: points where it turns, and its neighbourhood does not.

use ndarray::ArrayView2;

use super::polygon::{Place, angle, dot, noise, norm, sub, unit};

/// Turning, in degrees, from which on a point may be a corner. Smooth curves turn less at a point unless they are sampled
/// with fewer than nine points a turn.
const SHARP: f64 = 40.0;

/// How many times as much as each of its neighbours a corner turns. The turning of a rough curve varies less regularly,
/// but then its neighbours turn sharply too.
const STANDS_OUT: f64 = 3.0;

/// Neighbours on each side that are compared.
const NEIGHBOURS: usize = 2;

/// Points between the two corners of a short edge, such as a blunt trailing edge, at most.
///
/// Limit: corners with more between them stand out by themselves.
const BETWEEN: usize = 1;

/// Steps around a short edge, in standard deviations of the noise, from which on their directions count.
///
/// Calibrated: on sections of 100 to 400 points at random angles, with noise of a tenth of their mean distance; without it some have
/// such edges.
const BEYOND_NOISE: f64 = 4.0;

/// How many times as long as the other one of the steps at a point is from which on its turning may be that of a smooth curve
/// that goes on into the longer one.
///
/// Calibrated: at 4, corners of evenly sampled outlines with some points lost stay corners.
const UNEVEN: f64 = 4.0;

/// The corners of points `(m, N)`, increasing; of a closed sequence the neighbours of the first point are the second and
/// the last one. Ends of an open sequence are no corners.
///
/// A point is one if it turns sharply and its neighbours don't, or if this holds for it and one more point nearby together, which
/// turn to the same side: the ends of a short edge.
pub(super) fn find_corners(points: ArrayView2<'_, f64>, closed: bool) -> Vec<usize> {
    let m = points.nrows();
    if m < 2 * NEIGHBOURS + 1 {
        return Vec::new();
    }
    let turns = Turns::new(points, closed);
    let mut corners: Vec<usize> = (0..m).filter(|&i| turns.is_sharp(i) && turns.stands_out(i, 0)).collect();
    for apart in 1..=1 + BETWEEN {
        for i in 0..m {
            let Some(j) = turns.after(i, apart) else { continue };
            let sharp = turns.is_sharp(i) && turns.is_sharp(j) && dot(turns.sense[i], turns.sense[j]) > 0.0;
            let clear = turns.shortest_step(i, apart) >= BEYOND_NOISE * turns.noise;
            if sharp && clear && m > 2 * NEIGHBOURS + 1 + apart && turns.stands_out(i, apart) {
                corners.extend([i, j]);
            }
        }
    }
    corners.sort_unstable();
    corners.dedup();
    corners.retain(|&i| !turns.is_smooth_bend(i));
    corners
}

/// How a sequence turns.
struct Turns {
    closed: bool,
    /// Steps from each point to the next one.
    steps: Vec<Place>,
    /// Angles in degrees between the steps that meet at a point; 0 where one has no length or there is one only.
    turning: Vec<f64>,
    /// The change of direction across the curve.
    sense: Vec<Place>,
    /// Standard deviation of the points across the curve.
    noise: f64,
}

impl Turns {
    fn new(points: ArrayView2<'_, f64>, closed: bool) -> Self {
        let m = points.nrows();
        let place = |i: usize| -> Place { std::array::from_fn(|k| points.get([i % m, k]).copied().unwrap_or(0.0)) };
        let steps: Vec<Place> = (0..m).map(|i| sub(place(i + 1), place(i))).collect();
        let (mut turning, mut sense) = (vec![0.0; m], vec![[0.0; 4]; m]);
        for i in 0..m {
            if !closed && (i == 0 || i + 1 == m) {
                continue;
            }
            let (before, after) = (steps[(i + m - 1) % m], steps[i]);
            if dot(before, before) > 0.0 && dot(after, after) > 0.0 {
                let (before, after) = (unit(before), unit(after));
                turning[i] = angle(before, after).to_degrees();
                // In the plane the cross product; in space its vector.
                sense[i] = [
                    before[1] * after[2] - before[2] * after[1],
                    before[2] * after[0] - before[0] * after[2],
                    before[0] * after[1] - before[1] * after[0],
                    0.0,
                ];
            }
        }
        let noise = noise(&(0..m).map(place).collect::<Vec<_>>());
        Self { closed, steps, turning, sense, noise }
    }

    fn len(&self) -> usize {
        self.turning.len()
    }

    fn after(&self, i: usize, k: usize) -> Option<usize> {
        let m = self.len();
        (self.closed || i + k < m).then_some((i + k) % m)
    }

    fn before(&self, i: usize, k: usize) -> Option<usize> {
        let m = self.len();
        (self.closed || i >= k).then_some((i + m - k) % m)
    }

    fn is_sharp(&self, i: usize) -> bool {
        self.turning[i] >= SHARP
    }

    /// The shortest step from the point before `i` to the one after `i + apart`.
    fn shortest_step(&self, i: usize, apart: usize) -> f64 {
        let m = self.len();
        (0..apart + 2).map(|k| norm(self.steps[(i + m - 1 + k) % m])).fold(f64::INFINITY, f64::min)
    }

    /// Whether the points from `i` to `i + apart`, of which the first and the last are sharp, stand out from all around.
    fn stands_out(&self, i: usize, apart: usize) -> bool {
        let m = self.len();
        let last = (i + apart) % m;
        let least = self.turning[i].min(self.turning[last]);
        let smooth = |other: Option<usize>| other.is_none_or(|other| least >= STANDS_OUT * self.turning[other]);
        (1..=NEIGHBOURS).all(|k| smooth(self.before(i, k)) && smooth(self.after(last, k)))
            && (1..apart).all(|k| smooth(self.after(i, k)))
    }

    /// Whether steps of very different length meet at a point, and the curvature on the side of the shorter ones would
    /// explain the turning within the longer one.
    fn is_smooth_bend(&self, i: usize) -> bool {
        let Some(before) = self.before(i, 1) else { return false };
        let length = |step: usize| norm(self.steps[step]);
        let (incoming, outgoing) = (length(before), length(i));
        let (shorter, longer) = (incoming.min(outgoing), incoming.max(outgoing));
        if longer <= UNEVEN * shorter {
            return false;
        }
        // Points of the dense side, away from the turning, and the steps between them.
        let dense: Vec<usize> = (1..=NEIGHBOURS + 1)
            .map_while(|k| if incoming < outgoing { self.before(i, k) } else { self.after(i, k) })
            .collect();
        if dense.iter().any(|&at| self.is_sharp(at)) {
            return false;
        }
        // Noise turns to and fro, a bend to one side.
        let mut sum = [0.0; 4];
        let mut along = 0.0;
        for &at in &dense {
            for k in 0..3 {
                sum[k] += self.sense[at][k];
            }
            along += length(if incoming < outgoing { at } else { (at + self.len() - 1) % self.len() });
        }
        if along > UNEVEN * shorter * dense.len() as f64 {
            return false;
        }
        let curvature = norm(sum).to_degrees() / along;
        self.turning[i] < STANDS_OUT * curvature * longer
    }
}
