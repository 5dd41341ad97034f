//! Triangles of the parameters, and the barrier against folding them.

use rayon::prelude::*;
use thb_core::{ParameterBox, SplineMap};

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
    /// Where the triangles around each point begin in `around`, and where the last ones end.
    offsets: Vec<usize>,
    around: Vec<u32>,
}

/// A point's share of its move after so many halvings is none at all.
const MAX_HALVINGS: u8 = 5;

/// Triangles of one parallel task.
const CHUNK: usize = 4096;

impl Triangles {
    /// Triangles with the orientations that they have at the given parameters.
    pub(crate) fn new(corners: &[[u32; 3]], parameters: &[[f64; 2]]) -> Result<Self, Error> {
        let points = parameters.len();
        for (triangle, corner) in corners.iter().enumerate() {
            if let Some(&point) = corner.iter().find(|&&c| c as usize >= points) {
                return Err(Error::Triangle { triangle, point: point as usize, points });
            }
        }
        let mut offsets = vec![0_usize; points + 1];
        corners.iter().flatten().for_each(|&c| offsets[c as usize + 1] += 1);
        for point in 0..points {
            offsets[point + 1] += offsets[point];
        }
        let (mut next, mut around) = (offsets.clone(), vec![0_u32; 3 * corners.len()]);
        for (triangle, corner) in corners.iter().enumerate() {
            for &c in corner {
                around[next[c as usize]] = triangle as u32;
                next[c as usize] += 1;
            }
        }
        let periods = [f64::INFINITY; 2];
        let mut triangles = Self { corners: corners.to_vec(), sign: Vec::new(), periods, offsets, around };
        triangles.close(periods, |i| parameters[i]);
        Ok(triangles)
    }

    /// Sets the periods, and the orientations anew, given the parameters at the start.
    pub(crate) fn close(&mut self, periods: [f64; 2], parameter: impl Fn(usize) -> [f64; 2]) {
        self.periods = periods;
        let sign = |area: f64| if area != 0.0 && area.is_finite() { area.signum() } else { 0.0 };
        self.sign = self.corners.iter().map(|c| sign(self.area(c, &parameter))).collect();
    }

    /// Whether the orientation of a triangle differs from the one at the start, given parameters by index.
    fn is_flipped(&self, triangle: usize, parameter: impl Fn(usize) -> [f64; 2]) -> bool {
        self.sign[triangle] != 0.0 && self.area(&self.corners[triangle], parameter) * self.sign[triangle] <= 0.0
    }

    /// The number of triangles of points that count whose orientation differs from the one at the start.
    pub(crate) fn count_flipped(&self, parameter: impl Fn(usize) -> [f64; 2], counts: impl Fn(usize) -> bool) -> usize {
        let flipped =
            |t: &usize| self.corners[*t].iter().all(|&i| counts(i as usize)) && self.is_flipped(*t, &parameter);
        (0..self.corners.len()).filter(flipped).count()
    }

    /// Twice the signed area of a triangle.
    fn area(&self, corners: &[u32; 3], parameter: impl Fn(usize) -> [f64; 2]) -> f64 {
        let [a, b, c] = corners.map(|i| parameter(i as usize));
        let way = |to: [f64; 2]| [0, 1].map(|d| nearest_image(to[d] - a[d], self.periods[d]));
        let (b, c) = (way(b), way(c));
        b[0] * c[1] - b[1] * c[0]
    }
}

/// Halves the moves of the corners of flipped triangles until no further triangle flips. What is flipped before stays, and triangles with a
/// corner of weight 0 may flip.
#[derive(Clone, Debug)]
pub(crate) struct FlippingTriangles<'a> {
    triangles: &'a Triangles,
    /// The triangles that may not flip, from where the step begins.
    held: Vec<bool>,
}

impl<'a> FlippingTriangles<'a> {
    /// For steps from a state.
    pub(crate) fn new<const D: usize, S: ParameterBox<D>>(triangles: &'a Triangles, from: &State<'_, D, S>) -> Self {
        let before = by_index(from.places, from.parameters);
        let counts = |i: &u32| from.counts(from.places[*i as usize]);
        let held = |t: usize| triangles.corners[t].iter().all(counts) && !triangles.is_flipped(t, |i| before[i]);
        let numbers = (0..triangles.corners.len()).into_par_iter().with_min_len(CHUNK);
        Self { triangles, held: numbers.map(held).collect() }
    }

    /// Shortens moves to new parameters, given by place; the places of the shortened ones, in the order in which they were met first. Such
    /// parameters may then lie a period away.
    fn hold<const D: usize, S: ParameterBox<D>>(&self, from: &State<'_, D, S>, moved: &mut [[f64; D]]) -> Vec<usize> {
        let Triangles { corners, periods, offsets, around, .. } = self.triangles;
        let mut parameters = by_index(from.places, moved);
        let numbers = (0..corners.len() as u32).into_par_iter().with_min_len(CHUNK);
        let mut flipped: Vec<u32> = numbers.filter(|&t| self.flips(t, &parameters)).collect();
        let (mut halvings, mut target) = (Vec::new(), Vec::new());
        let mut shortened = Vec::new();
        while !flipped.is_empty() {
            if target.is_empty() {
                (halvings, target) = (vec![0_u8; moved.len()], moved.to_vec());
            }
            let mut hit: Vec<u32> = flipped.iter().flat_map(|&t| corners[t as usize]).collect();
            hit.sort_unstable();
            hit.dedup();
            hit.retain(|&index| halvings[from.places[index as usize]] < MAX_HALVINGS);
            for &index in &hit {
                let at = from.places[index as usize];
                if halvings[at] == 0 {
                    shortened.push(at);
                }
                halvings[at] += 1;
                let share = if halvings[at] == MAX_HALVINGS { 0.0 } else { 0.5_f64.powi(i32::from(halvings[at])) };
                let start = from.parameters[at];
                let way = |d: usize| nearest_image(target[at][d] - start[d], periods[usize::from(d > 0)]);
                moved[at] = std::array::from_fn(|d| start[d] + share * way(d));
                parameters[index as usize] = ends(moved[at]);
            }
            // A triangle whose corners all stay is as it was: it asks for nothing that was not done.
            flipped =
                hit.iter().flat_map(|&i| &around[offsets[i as usize]..offsets[i as usize + 1]]).copied().collect();
            flipped.sort_unstable();
            flipped.dedup();
            flipped.retain(|&t| self.flips(t, &parameters));
        }
        shortened
    }

    fn flips(&self, triangle: u32, parameters: &[[f64; 2]]) -> bool {
        self.held[triangle as usize] && self.triangles.is_flipped(triangle as usize, |i| parameters[i])
    }
}

/// The first and the last parameter.
fn ends<const D: usize>(u: [f64; D]) -> [f64; 2] {
    [u[0], u[D - 1]]
}

/// Parameters by the index of the point.
fn by_index<const D: usize>(places: &[usize], parameters: &[[f64; D]]) -> Vec<[f64; 2]> {
    places.par_iter().with_min_len(CHUNK).map(|&at| ends(parameters[at])).collect()
}

impl<const D: usize, S: ParameterBox<D>> Safeguard<D, S> for FlippingTriangles<'_> {
    fn name(&self) -> &'static str {
        "flipping triangles"
    }

    fn admit_parameters(
        &self,
        from: &State<'_, D, S>,
        map: &SplineMap<D, S>,
        moved: &mut Parameters<D>,
    ) -> Result<Admission, Error> {
        let shortened = self.hold(from, &mut moved.values);
        for &at in &shortened {
            moved.values[at] = map.space().to_domain(moved.values[at]);
            moved.cells[at] = map.space().locate_cell(moved.values[at])? as u32;
        }
        Ok(if shortened.is_empty() { Admission::Unchanged } else { Admission::Changed(shortened.len()) })
    }
}

/// A difference of parameters, less whole periods.
fn nearest_image(way: f64, period: f64) -> f64 {
    if period.is_finite() { way - period * (way / period).round() } else { way }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::state::Snapshot;
    use crate::terms::check::Random;
    use fit_ls::SortedPoints;
    use ndarray::Array2;
    use thb_core::{HierarchicalSpace, Kind, KnotVector};

    const PER_SIDE: usize = 12;

    /// The same by sweeps over all triangles, each after all halvings of the one before.
    fn swept(
        guard: &FlippingTriangles<'_>,
        places: &[usize],
        start: &[[f64; 2]],
        target: &[[f64; 2]],
    ) -> Vec<[f64; 2]> {
        let (mut moved, mut halvings) = (target.to_vec(), vec![0_u8; target.len()]);
        loop {
            let parameters = by_index(places, &moved);
            let all = 0..guard.held.len() as u32;
            let flipped: Vec<u32> = all.filter(|&t| guard.flips(t, &parameters)).collect();
            let mut hit = vec![false; moved.len()];
            for corner in flipped.iter().flat_map(|&t| guard.triangles.corners[t as usize]) {
                hit[places[corner as usize]] = true;
            }
            let again: Vec<usize> = (0..moved.len()).filter(|&at| hit[at] && halvings[at] < MAX_HALVINGS).collect();
            if again.is_empty() {
                return moved;
            }
            for at in again {
                halvings[at] += 1;
                let share = if halvings[at] == MAX_HALVINGS { 0.0 } else { 0.5_f64.powi(i32::from(halvings[at])) };
                moved[at] = [0, 1].map(|d| start[at][d] + share * (target[at][d] - start[at][d]));
            }
        }
    }

    #[test]
    fn triangles_looked_at_again_are_enough() {
        let mut random = Random(3);
        let side = (PER_SIDE - 1) as f64;
        let on = |i: usize| [(i % PER_SIDE) as f64 / side, (i / PER_SIDE) as f64 / side];
        let parameters = Array2::from_shape_fn((PER_SIDE * PER_SIDE, 2), |(i, d)| on(i)[d]);
        let row = PER_SIDE as u32;
        let corners: Vec<[u32; 3]> = (0..row * (row - 1))
            .filter(|i| i % row != row - 1)
            .flat_map(|i| [[i, i + 1, i + row + 1], [i, i + row + 1, i + row]])
            .collect();
        let given: Vec<[f64; 2]> = (0..PER_SIDE * PER_SIDE).map(on).collect();
        let triangles = Triangles::new(&corners, &given).unwrap();
        let knots = KnotVector::uniform(2, 3).unwrap();
        let space = Arc::new(HierarchicalSpace::new(Kind::Thb, [knots.clone(), knots.clone()]).unwrap());
        let sites = knots.greville();
        let flat = Array2::from_shape_fn((25, 3), |(j, k)| [sites[j % 5], sites[j / 5], 0.0][k]);
        let map = SplineMap::new(space.clone(), flat).unwrap();
        let mut points = SortedPoints::new(parameters.view(), Array2::zeros((144, 3)).view(), None).unwrap();
        points.sort_refined(&space, None).unwrap();
        let snapshot = Snapshot::new(&map, &points, |_| 1.0).unwrap();
        let from = snapshot.start(&map, &points).state;
        let guard = FlippingTriangles::new(&triangles, &from);
        for size in [0.02, 0.1, 0.5] {
            let moves = from.parameters.iter().map(|u| u.map(|x| x + size * (random.next() - 0.5)));
            let target: Vec<[f64; 2]> = moves.collect();
            let mut moved = target.clone();
            let shortened = guard.hold(&from, &mut moved);
            assert_eq!(moved, swept(&guard, from.places, from.parameters, &target));
            assert_eq!(shortened.is_empty(), size == 0.02, "{size}: {}", shortened.len());
            let reached = by_index(from.places, &moved);
            assert_eq!(triangles.count_flipped(|i| reached[i], |_| true), 0);
        }
    }
}
