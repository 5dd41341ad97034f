//! Triangles of the parameters, and the barrier against folding them.

use fit_ls::SortedPoints;

use crate::Error;

/// A triangulation of the points, by index, whose triangles must not change their orientation in the parameter plane.
#[derive(Clone, Debug)]
pub(crate) struct Triangles {
    corners: Vec<[u32; 3]>,
    /// Orientation at the start, +1 or −1; degenerate triangles are not in the list.
    sign: Vec<f64>,
}

/// A point's share of its move after so many halvings is none at all.
const MAX_HALVINGS: u8 = 5;

impl Triangles {
    /// Triangles with the orientations that they have at the given parameters.
    pub(crate) fn new(corners: &[[u32; 3]], parameters: &[[f64; 2]]) -> Result<Self, Error> {
        let points = parameters.len();
        for (triangle, corner) in corners.iter().enumerate() {
            if let Some(&point) = corner.iter().find(|&&c| c as usize >= points) {
                return Err(Error::Triangle { triangle, point: point as usize, points });
            }
        }
        let signed = |c: &[u32; 3]| area(c, |i| parameters[i]);
        let oriented: Vec<([u32; 3], f64)> =
            corners.iter().map(|c| (*c, signed(c))).filter(|(_, a)| *a != 0.0 && a.is_finite()).collect();
        Ok(Self {
            corners: oriented.iter().map(|(c, _)| *c).collect(),
            sign: oriented.iter().map(|(_, a)| a.signum()).collect(),
        })
    }

    /// Triangles whose orientation differs from the one at the start, given parameters by index.
    pub(crate) fn flipped(&self, parameter: impl Fn(usize) -> [f64; 2]) -> Vec<usize> {
        let turned = |t: &usize| area(&self.corners[*t], &parameter) * self.sign[*t] <= 0.0;
        (0..self.corners.len()).filter(turned).collect()
    }

    /// Halves the moves of the corners of flipped triangles until no further triangle flips; what is flipped before stays.
    /// Parameters are those of the sorted points, `moved` the ones they should get. Returns for each point whether its
    /// move was shortened.
    pub(crate) fn hold<const D: usize>(&self, points: &SortedPoints<D>, moved: &mut [[f64; D]]) -> Vec<bool> {
        let mut at_of = vec![0; points.len()];
        points.order().iter().enumerate().for_each(|(at, &index)| at_of[index as usize] = at);
        let pair = |u: [f64; D]| [u[0], u[D - 1]];
        let before = self.flipped(|i| pair(points.parameter(at_of[i])));
        let target = moved.to_vec();
        let mut halvings = vec![0_u8; points.len()];
        loop {
            let flipped = self.flipped(|i| pair(moved[at_of[i]]));
            let mut changed = false;
            let mut hit = vec![false; points.len()];
            for triangle in flipped {
                if before.binary_search(&triangle).is_err() {
                    self.corners[triangle].iter().for_each(|&c| hit[at_of[c as usize]] = true);
                }
            }
            for at in 0..points.len() {
                if hit[at] && halvings[at] < MAX_HALVINGS {
                    halvings[at] += 1;
                    changed = true;
                    let share = if halvings[at] == MAX_HALVINGS { 0.0 } else { 0.5_f64.powi(i32::from(halvings[at])) };
                    let from = points.parameter(at);
                    moved[at] = std::array::from_fn(|d| from[d] + share * (target[at][d] - from[d]));
                }
            }
            if !changed {
                return halvings.iter().map(|&h| h > 0).collect();
            }
        }
    }
}

/// Twice the signed area of a triangle.
fn area(corners: &[u32; 3], parameter: impl Fn(usize) -> [f64; 2]) -> f64 {
    let [a, b, c] = corners.map(|i| parameter(i as usize));
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}
