//! Four corners on a boundary loop, which cut it into the sides of the unit square.
//!
//! A cut boundary is jagged at the size of one triangle, so the angle at a single vertex says nothing. The tangent on
//! either side of a vertex is averaged over a stretch of the loop, and the turning from one to the other is compared
//! at several scales: at a corner it stays the same, on a smooth curve it grows with the scale, at a jag it vanishes.

use std::f64::consts::{FRAC_PI_2, TAU};

use ndarray::ArrayView2;

use crate::disk::vertex_normals;
use crate::loop_curve::LoopCurve;
use crate::vec3::{cross, dot, sub, unit};
use crate::{BoundaryLoop, CloudError, DiskMesh};

/// How corners are looked for. The defaults suit scans with 30 boundary vertices or more.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CornerParams {
    /// Stretch over which a tangent is averaged, as a share of the perimeter, in (0, 0.1]. Larger overlooks corners of
    /// short sides, smaller mistakes jags for corners. At least [`EDGES_PER_TANGENT`] mean edges are taken.
    pub scale: f64,
    /// Smallest share of the perimeter between two corners, in (0, 0.25). A ship hull 15 times as long as its girth has
    /// short sides of 0.03; below that the parameter lines of the short sides would crowd.
    pub separation: f64,
}

impl Default for CornerParams {
    fn default() -> Self {
        Self { scale: 0.02, separation: 0.025 }
    }
}

/// Where the corners come from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CornerChoice {
    /// Chosen by turning angle.
    Automatic(CornerParams),
    /// These vertices of the mesh. The first becomes (0, 0); the others follow in the order of the loop, whatever
    /// the order they are given in, since the map keeps the orientation.
    Given([u32; 4]),
}

impl Default for CornerChoice {
    fn default() -> Self {
        Self::Automatic(CornerParams::default())
    }
}

/// Four corners of a loop, to be mapped to (0, 0), (1, 0), (1, 1), (0, 1) in this order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corners {
    /// Places of the corners in the loop, in loop order (cyclically increasing).
    pub positions: [usize; 4],
    /// Turning of the loop at each corner, in radians, positive to the left: π/2 at the corner of a rectangle, about
    /// 0 on a straight line. Small values say that the outline has no clear corner there.
    pub turning: [f64; 4],
    /// Length of the side that begins at each corner, in the units of the points.
    pub side_lengths: [f64; 4],
}

impl Corners {
    /// The corners as vertices of the mesh.
    pub fn vertices(&self, boundary: &BoundaryLoop) -> [u32; 4] {
        self.positions.map(|p| boundary.vertices[p])
    }

    /// The sides as places in a loop of `n` points, each from its corner to the next one, both included.
    pub fn sides(&self, n: usize) -> [Vec<usize>; 4] {
        std::array::from_fn(|k| {
            let (from, to) = (self.positions[k], self.positions[(k + 1) % 4]);
            let steps = (to + n - from) % n;
            (0..=steps).map(|step| (from + step) % n).collect()
        })
    }
}

/// The corners of the outer boundary of a mesh.
///
/// # Errors
/// Those of [`find_corners`]; for given corners [`CloudError::CornerNotOnLoop`], [`CloudError::RepeatedCorner`].
pub fn disk_corners(disk: &DiskMesh, choice: CornerChoice) -> Result<Corners, CloudError> {
    let boundary = disk.outer_loop();
    let rows: Vec<usize> = boundary.vertices.iter().map(|&v| v as usize).collect();
    let points = disk.vertices().select(ndarray::Axis(0), &rows);
    let all_normals = vertex_normals(disk.mesh());
    let normals: Vec<[f64; 3]> = rows.iter().map(|&v| all_normals[v]).collect();
    let params = match choice {
        CornerChoice::Automatic(params) => params,
        CornerChoice::Given(_) => CornerParams::default(),
    };
    let finder = CornerFinder::new(points.view(), Some(normals), params)?;
    match choice {
        CornerChoice::Automatic(_) => finder.choose(),
        CornerChoice::Given(vertices) => finder.given(vertices, boundary),
    }
}

/// Four corners of a closed loop of points, shape `(n, 2)` or `(n, 3)`, in order, the last joined to the first.
///
/// Among all quadruples of candidate points at least `separation` apart, the one with the best sum of four terms is
/// taken: sharp convex corners first, then opposite sides of like length, then four sides of like length, and where an
/// outline is so round that these leave the choice open, sides along the principal axis of the loop. u runs along the pair of opposite sides with the
/// greater length; of the
/// two corners that can then be (0, 0) it is the one with the smaller coordinates (compared x first, then y, then z).
///
/// Left and right are seen from the side from which the loop runs counter-clockwise (the direction of its vector
/// area); [`disk_corners`] uses the surface normals instead, which is right for strongly curved surfaces too.
///
/// # Errors
/// [`CloudError::LoopTooShort`], [`CloudError::LoopWithoutLength`], [`CloudError::CornersTooClose`],
/// [`CloudError::WrongDimension`], [`CloudError::BadOption`], coordinates not finite.
pub fn find_corners(points: ArrayView2<'_, f64>, params: CornerParams) -> Result<Corners, CloudError> {
    CornerFinder::new(points, None, params)?.choose()
}

/// Tangents are averaged over at least this many mean edges: the zigzag of a cut boundary has a period of two edges,
/// and each tangent is the difference of two averages, so each of these spans at least one period.
pub const EDGES_PER_TANGENT: f64 = 4.0;
/// ... but over no more than this share of the perimeter, so that on coarse loops the two sides of a corner stay apart.
const LARGEST_SCALE: f64 = 0.1;
/// A corner must also show at this multiple of the scale: jags, notches and bumps turn there and back again.
const WIDE_SCALE_RATIO: f64 = 4.0;
/// Number of stretches of the loop, of equal length, that offer one candidate each. All quadruples are compared:
/// 64 give 635 376, some ten milliseconds; a side is placed to 1/64 of the perimeter where the outline is round.
const CANDIDATES: usize = 64;
/// Turning below this is taken for noise or smooth curvature (20 degrees).
const SMALLEST_TURNING: f64 = 0.35;
/// Turning beyond a right angle is not rewarded: a spike shall not win over a corner.
const LARGEST_TURNING: f64 = FRAC_PI_2;
/// Weight of the imbalance of opposite sides against the corners (each corner counts at most 1). At 1, sides of ratio
/// 3 (imbalance 1/4) cost as much as a quarter of a right-angled corner.
const IMBALANCE_WEIGHT: f64 = 1.0;
/// Weight of the unevenness of the four sides: where an outline is round, the corners go to quarter points. Corners at
/// the ends of a long strip, the most uneven there can be, cost half as much as one of them counts.
const UNEVENNESS_WEIGHT: f64 = 0.5;
/// Weight of the misalignment with the principal axis. Sides turned by 45 degrees cost a twentieth of a corner, so the
/// axis decides only where corners and lengths leave the choice open.
const MISALIGNMENT_WEIGHT: f64 = 0.1;

struct CornerFinder {
    curve: LoopCurve,
    normals: Vec<[f64; 3]>,
    params: CornerParams,
}

impl CornerFinder {
    fn new(
        points: ArrayView2<'_, f64>,
        normals: Option<Vec<[f64; 3]>>,
        params: CornerParams,
    ) -> Result<Self, CloudError> {
        for (name, value, limit, range) in [
            ("corner scale", params.scale, LARGEST_SCALE, "in (0, 0.1]"),
            ("corner separation", params.separation, 0.249_999, "in (0, 0.25)"),
        ] {
            if !(value > 0.0 && value <= limit) {
                return Err(CloudError::BadOption { name, value, range });
            }
        }
        let curve = LoopCurve::new(points)?;
        let normals = normals.unwrap_or_else(|| vec![unit(curve.vector_area()); points.nrows()]);
        Ok(Self { curve, normals, params })
    }

    fn choose(&self) -> Result<Corners, CloudError> {
        let n = self.curve.len();
        let scale = self.scale();
        let fine = self.turning(scale);
        let sharpness = self.sharpness(scale, &fine);
        let quadruple = self
            .best_quadruple(&self.candidates(&sharpness), &sharpness)
            .ok_or(CloudError::CornersTooClose { vertices: n, separation: self.params.separation })?;
        let side = |k: usize| self.curve.arc(quadruple[k], quadruple[(k + 1) % 4]);
        let first = usize::from(side(0) + side(2) < side(1) + side(3));
        let [a, b] = [first, first + 2].map(|k| self.curve.point(quadruple[k]));
        let first = if b < a { first + 2 } else { first };
        Ok(self.corners(std::array::from_fn(|k| quadruple[(first + k) % 4]), &fine))
    }

    fn given(&self, vertices: [u32; 4], boundary: &BoundaryLoop) -> Result<Corners, CloudError> {
        let n = self.curve.len();
        let mut positions = [0; 4];
        for (k, &vertex) in vertices.iter().enumerate() {
            if vertices[..k].contains(&vertex) {
                return Err(CloudError::RepeatedCorner { vertex });
            }
            let place = boundary.vertices.iter().position(|&v| v == vertex);
            positions[k] = place.ok_or(CloudError::CornerNotOnLoop { vertex })?;
        }
        let first = positions[0];
        positions.sort_by_key(|&p| (p + n - first) % n);
        Ok(self.corners(positions, &self.turning(self.scale())))
    }

    fn scale(&self) -> f64 {
        self.params.scale.max(EDGES_PER_TANGENT / self.curve.len() as f64).min(LARGEST_SCALE)
    }

    fn corners(&self, positions: [usize; 4], turning: &[f64]) -> Corners {
        Corners {
            positions,
            turning: positions.map(|p| turning[p]),
            side_lengths: std::array::from_fn(|k| self.curve.arc(positions[k], positions[(k + 1) % 4])),
        }
    }

    /// How much of a corner each vertex is: its turning, `fine` at `scale`, as far as larger scales confirm it.
    fn sharpness(&self, scale: f64, fine: &[f64]) -> Vec<f64> {
        let double = self.turning(2.0 * scale);
        let wide = (WIDE_SCALE_RATIO * scale).min(2.0 * LARGEST_SCALE);
        let of_circle = TAU * wide;
        (0..fine.len())
            .zip(self.turning(wide))
            .map(|(i, wide)| {
                // Two corners of a short side within the stretch turn back almost fully, which reads as a right turn.
                let wide = if wide < -FRAC_PI_2 { wide + TAU } else { wide };
                // In excess of what any loop turns, scaled so that a right angle between straight sides counts in full.
                let lasting = (wide - of_circle) * FRAC_PI_2 / (FRAC_PI_2 - of_circle);
                // Extrapolated to scale zero: smooth turning, proportional to the scale, cancels; that of a corner stays.
                let at_zero = 2.0 * fine[i] - double[i];
                let sharpness = fine[i].min(at_zero).min(lasting);
                // Beside a corner the averaged tangents still turn: only the peak is the corner.
                if self.is_peak(i, fine, scale) { sharpness } else { sharpness.min(0.0) }
            })
            .collect()
    }

    /// Whether no vertex within a stretch `scale` on either side turns more than vertex `i`.
    fn is_peak(&self, i: usize, turning: &[f64], scale: f64) -> bool {
        let (n, h) = (self.curve.len(), scale * self.curve.perimeter());
        let after = (1..n).map(|k| (i + k) % n).take_while(|&j| self.curve.arc(i, j) <= h);
        let before = (1..n).map(|k| (i + n - k) % n).take_while(|&j| self.curve.arc(j, i) <= h);
        after.chain(before).all(|j| turning[j] <= turning[i])
    }

    /// The turning at every vertex between the tangents averaged over a stretch `scale` (a share of the perimeter) on
    /// either side, in the tangent plane of the surface.
    fn turning(&self, scale: f64) -> Vec<f64> {
        let h = scale * self.curve.perimeter();
        let positions = self.curve.integral_of_positions();
        let normals = self.curve.integral_of(&self.normals);
        (0..self.curve.len())
            .map(|i| {
                let s = self.curve.arc_length(i);
                let mean = |from: f64, to: f64| self.curve.mean(&positions, s + from, s + to);
                // The difference of two averages is the tangent averaged with a hat function as weight; the hat
                // vanishes at the vertex itself, so that a single vertex off the line does not count.
                let before = sub(mean(-0.5 * h, 0.0), mean(-h, -0.5 * h));
                let after = sub(mean(0.5 * h, h), mean(0.0, 0.5 * h));
                let normal = unit(self.curve.mean(&normals, s - h, s + h));
                let sine = dot(normal, cross(before, after));
                let cosine = dot(before, after) - dot(before, normal) * dot(after, normal);
                sine.atan2(cosine)
            })
            .collect()
    }

    /// The sharpest vertex of each stretch of the loop, in loop order; all vertices where they are few.
    fn candidates(&self, sharpness: &[f64]) -> Vec<usize> {
        let n = self.curve.len();
        if n <= CANDIDATES {
            return (0..n).collect();
        }
        let stretch = |i: usize| {
            let share = self.curve.arc_length(i) / self.curve.perimeter();
            ((share * CANDIDATES as f64) as usize).min(CANDIDATES - 1)
        };
        let mut best: [Option<usize>; CANDIDATES] = [None; CANDIDATES];
        for i in 0..n {
            let place = &mut best[stretch(i)];
            if place.is_none_or(|b| sharpness[i] > sharpness[b]) {
                *place = Some(i);
            }
        }
        best.into_iter().flatten().collect()
    }

    fn best_quadruple(&self, candidates: &[usize], sharpness: &[f64]) -> Option<[usize; 4]> {
        let axis = self.curve.principal_axis();
        let perimeter = self.curve.perimeter();
        let apart = self.params.separation;
        let place: Vec<f64> = candidates.iter().map(|&i| self.curve.arc_length(i) / perimeter).collect();
        let point: Vec<[f64; 3]> = candidates.iter().map(|&i| self.curve.point(i)).collect();
        let reward: Vec<f64> = candidates
            .iter()
            .map(|&i| (sharpness[i] - SMALLEST_TURNING) / (LARGEST_TURNING - SMALLEST_TURNING))
            .map(|r| r.clamp(0.0, 1.0))
            .collect();
        let m = candidates.len();
        let mut best: Option<(f64, [usize; 4])> = None;
        for a in 0..m {
            for b in a + 1..m {
                let ab = place[b] - place[a];
                if ab < apart {
                    continue;
                }
                for c in b + 1..m {
                    let bc = place[c] - place[b];
                    if bc < apart {
                        continue;
                    }
                    for d in c + 1..m {
                        let (cd, da) = (place[d] - place[c], 1.0 + place[a] - place[d]);
                        if cd < apart || da < apart {
                            continue;
                        }
                        let corners = reward[a] + reward[b] + reward[c] + reward[d];
                        let balance = imbalance(ab, cd) + imbalance(bc, da);
                        // Sums of squares run from 1/4 for four equal sides to 1/2 for two that vanish.
                        let unevenness = 4.0 * (ab * ab + bc * bc + cd * cd + da * da) - 1.0;
                        let score = corners - IMBALANCE_WEIGHT * balance - UNEVENNESS_WEIGHT * unevenness;
                        // The last term only lowers the score: skip it where it cannot matter.
                        if best.is_some_and(|(s, _)| score <= s) {
                            continue;
                        }
                        let quadruple = [a, b, c, d];
                        let score = score - MISALIGNMENT_WEIGHT * misalignment(quadruple.map(|k| point[k]), axis);
                        if best.is_none_or(|(s, _)| score > s) {
                            best = Some((score, quadruple));
                        }
                    }
                }
            }
        }
        best.map(|(_, quadruple)| quadruple.map(|k| candidates[k]))
    }
}

/// 0 for opposite sides of equal length, 1 in the limit where one vanishes.
fn imbalance(a: f64, b: f64) -> f64 {
    ((a - b) / (a + b)).powi(2)
}

/// Squared sine of the angle between `axis` and the pair of sides that runs along it on average.
fn misalignment([a, b, c, d]: [[f64; 3]; 4], axis: [f64; 3]) -> f64 {
    let along = |p: [f64; 3], q: [f64; 3], r: [f64; 3], s: [f64; 3]| {
        let sum: [f64; 3] = std::array::from_fn(|k| (q[k] - p[k]) + (s[k] - r[k]));
        dot(unit(sum), axis).powi(2)
    };
    1.0 - along(a, b, d, c).max(along(b, c, a, d))
}

#[cfg(test)]
#[path = "corners_tests.rs"]
mod tests;
