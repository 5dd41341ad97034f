//! Triangles of the parameters, and the barrier against folding them.

use thb_core::{CellSpace, SplineMap};

use crate::Error;
use crate::safeguards::{Admission, Parameters, Safeguard};
use crate::state::State;

/// A triangulation of the points, by index, whose triangles must not change their orientation in the parameter plane.
#[derive(Clone, Debug)]
pub(crate) struct Triangles {
    corners: Vec<[u32; 3]>,
    /// Orientation at the start, +1 or −1; 0 for degenerate triangles, which are not looked at.
    sign: Vec<f64>,
    /// Period of each parameter, infinite where it has none: a triangle may lie across the seam.
    periods: [f64; 2],
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
        let mut triangles = Self { corners: corners.to_vec(), sign: Vec::new(), periods: [f64::INFINITY; 2] };
        triangles.close([f64::INFINITY; 2], |i| parameters[i]);
        Ok(triangles)
    }

    /// Sets the periods, and the orientations anew, given the parameters at the start.
    pub(crate) fn close(&mut self, periods: [f64; 2], parameter: impl Fn(usize) -> [f64; 2]) {
        self.periods = periods;
        let sign = |area: f64| if area != 0.0 && area.is_finite() { area.signum() } else { 0.0 };
        self.sign = self.corners.iter().map(|c| sign(self.area(c, &parameter))).collect();
    }

    /// Triangles of points that count whose orientation differs from the one at the start, given parameters by index.
    pub(crate) fn flipped(&self, parameter: impl Fn(usize) -> [f64; 2], counts: impl Fn(usize) -> bool) -> Vec<usize> {
        let turned = |t: &usize| {
            let corners = &self.corners[*t];
            self.sign[*t] != 0.0
                && corners.iter().all(|&i| counts(i as usize))
                && self.area(corners, &parameter) * self.sign[*t] <= 0.0
        };
        (0..self.corners.len()).filter(turned).collect()
    }

    /// Twice the signed area of a triangle.
    fn area(&self, corners: &[u32; 3], parameter: impl Fn(usize) -> [f64; 2]) -> f64 {
        let [a, b, c] = corners.map(|i| parameter(i as usize));
        let way = |to: [f64; 2]| [0, 1].map(|d| nearest_image(to[d] - a[d], self.periods[d]));
        let (b, c) = (way(b), way(c));
        b[0] * c[1] - b[1] * c[0]
    }

    /// Halves the moves of the corners of flipped triangles until no further triangle flips; what is flipped before stays.
    /// `moved` are the parameters that points should get; triangles with a corner of weight 0 may flip. Returns
    /// for each point whether its move was shortened; what was may then lie a period away.
    fn hold<const D: usize, S: CellSpace<D>>(&self, from: &State<'_, D, S>, moved: &mut [[f64; D]]) -> Vec<bool> {
        let places = from.places;
        let pair = |u: [f64; D]| [u[0], u[D - 1]];
        let counts = |i: usize| from.counts(places[i]);
        let before = self.flipped(|i| pair(from.parameters[places[i]]), counts);
        let target = moved.to_vec();
        let mut halvings = vec![0_u8; moved.len()];
        loop {
            let flipped = self.flipped(|i| pair(moved[places[i]]), counts);
            let mut changed = false;
            let mut hit = vec![false; moved.len()];
            for triangle in flipped {
                if before.binary_search(&triangle).is_err() {
                    self.corners[triangle].iter().for_each(|&c| hit[places[c as usize]] = true);
                }
            }
            for at in 0..moved.len() {
                if hit[at] && halvings[at] < MAX_HALVINGS {
                    halvings[at] += 1;
                    changed = true;
                    let share = if halvings[at] == MAX_HALVINGS { 0.0 } else { 0.5_f64.powi(i32::from(halvings[at])) };
                    let start = from.parameters[at];
                    let way = |d: usize| nearest_image(target[at][d] - start[d], self.periods[usize::from(d > 0)]);
                    moved[at] = std::array::from_fn(|d| start[d] + share * way(d));
                }
            }
            if !changed {
                return halvings.iter().map(|&h| h > 0).collect();
            }
        }
    }
}

/// Makes moves shorter until no further triangle flips.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FlippingTriangles<'a>(pub(crate) &'a Triangles);

impl<const D: usize, S: CellSpace<D>> Safeguard<D, S> for FlippingTriangles<'_> {
    fn name(&self) -> &'static str {
        "flipping triangles"
    }

    fn admit_parameters(
        &self,
        from: &State<'_, D, S>,
        map: &SplineMap<D, S>,
        moved: &mut Parameters<D>,
    ) -> Result<Admission, Error> {
        let shortened = self.0.hold(from, &mut moved.values);
        let mut points = 0;
        for at in (0..shortened.len()).filter(|&at| shortened[at]) {
            moved.values[at] = map.space().to_domain(moved.values[at]);
            moved.cells[at] = map.space().locate_cell(moved.values[at])? as u32;
            points += 1;
        }
        Ok(if points == 0 { Admission::Unchanged } else { Admission::Changed(points) })
    }
}

/// A difference of parameters, less whole periods.
fn nearest_image(way: f64, period: f64) -> f64 {
    if period.is_finite() { way - period * (way / period).round() } else { way }
}
