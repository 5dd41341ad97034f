//! Grids of points: lines along both directions, and where their parameters start.

use super::fit::{GridFit, SplineSpace};

/// Points of a grid, sequences being grids of one line. Coordinates beyond the dimension are 0.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Grid {
    pub(crate) xyz: Vec<[f64; 3]>,
    pub(crate) size: [usize; 2],
    pub(crate) dimension: usize,
}

/// Parameters on their way: the steps between neighbours sum to one along every line.
#[derive(Clone, Debug)]
pub(crate) struct State {
    /// Steps along each direction, line after line.
    pub(crate) steps: Vec<Vec<f64>>,
    pub(crate) uv: Vec<[f64; 2]>,
    pub(crate) fit: GridFit,
}

impl Grid {
    /// 1 for sequences, 2 for grids.
    pub(crate) fn directions(&self) -> usize {
        if self.size[1] == 1 { 1 } else { 2 }
    }

    /// Lines along a direction, and points on each.
    pub(crate) fn lines(&self, direction: usize) -> [usize; 2] {
        [self.size[1 - direction], self.size[direction]]
    }

    /// The point at a place of a line along a direction.
    pub(crate) fn index(&self, direction: usize, line: usize, place: usize) -> usize {
        if direction == 0 { place * self.size[1] + line } else { line * self.size[1] + place }
    }

    /// Distances between neighbours along a direction, line after line.
    pub(crate) fn edge_lengths(&self, direction: usize) -> Vec<f64> {
        let [lines, places] = self.lines(direction);
        let mut lengths = Vec::with_capacity(lines * (places - 1));
        for line in 0..lines {
            for place in 1..places {
                let [a, b] = [place - 1, place].map(|p| self.xyz[self.index(direction, line, p)]);
                lengths.push(distance(a, b));
            }
        }
        lengths
    }

    /// Parameters in the unit square from steps. The last of each line is 1 to the last bit.
    pub(crate) fn parameters(&self, steps: &[Vec<f64>]) -> Vec<[f64; 2]> {
        let mut uv = vec![[0.0; 2]; self.xyz.len()];
        for (direction, steps) in steps.iter().enumerate() {
            let places = self.size[direction];
            for (line, steps) in steps.chunks_exact(places - 1).enumerate() {
                let mut sum = 0.0;
                for (place, step) in steps.iter().enumerate() {
                    sum += step;
                    let value = if place + 2 == places { 1.0 } else { sum.min(1.0) };
                    uv[self.index(direction, line, place + 1)][direction] = value;
                }
            }
        }
        uv
    }

    /// The state with these steps.
    pub(crate) fn state(&self, spaces: [SplineSpace; 2], steps: Vec<Vec<f64>>) -> State {
        let uv = self.parameters(&steps);
        let fit = GridFit::new(spaces, &uv, &self.xyz);
        State { steps, uv, fit }
    }

    /// Steps in proportion to a power of the distances: 0 is uniform, ½ centripetal, 1 chord length; on grids, averaged
    /// over the lines or not.
    pub(crate) fn classical_steps(&self, power: f64, averaged: bool) -> Vec<Vec<f64>> {
        let along = |direction| {
            let [lines, places] = self.lines(direction);
            let mut steps: Vec<f64> = self.edge_lengths(direction).iter().map(|l| l.powf(power)).collect();
            for line in steps.chunks_exact_mut(places - 1) {
                let sum: f64 = line.iter().sum();
                line.iter_mut().for_each(|s| *s /= sum);
            }
            if averaged && lines > 1 {
                let mean: Vec<f64> = (0..places - 1)
                    .map(|k| steps.iter().skip(k).step_by(places - 1).sum::<f64>() / lines as f64)
                    .collect();
                steps.chunks_exact_mut(places - 1).for_each(|line| line.copy_from_slice(&mean));
            }
            steps
        };
        (0..self.directions()).map(along).collect()
    }

    /// The best of the classical parameters, by the error of their fits.
    pub(crate) fn classical_state(&self, spaces: [SplineSpace; 2]) -> State {
        let averaged: &[bool] = if self.directions() == 2 { &[true, false] } else { &[true] };
        let rules = [1.0, 0.5, 0.0].into_iter().flat_map(|power| averaged.iter().map(move |&a| (power, a)));
        let mut best: Option<State> = None;
        for (power, averaged) in rules {
            let state = self.state(spaces, self.classical_steps(power, averaged));
            if best.as_ref().is_none_or(|b| state.fit.mse < b.fit.mse) {
                best = Some(state);
            }
        }
        // The list of rules is not empty.
        best.unwrap_or_else(|| self.state(spaces, self.classical_steps(1.0, true)))
    }

    /// Centre of mass, and root mean square distance from it.
    pub(crate) fn extent(&self) -> ([f64; 3], f64) {
        let count = self.xyz.len() as f64;
        let centre: [f64; 3] = std::array::from_fn(|k| self.xyz.iter().map(|p| p[k]).sum::<f64>() / count);
        let squared: f64 = self.xyz.iter().map(|&p| distance(p, centre).powi(2)).sum();
        (centre, (squared / count).sqrt())
    }
}

pub(crate) fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    length(std::array::from_fn(|k| a[k] - b[k]))
}

pub(crate) fn length(a: [f64; 3]) -> f64 {
    dot(a, a).sqrt()
}

pub(crate) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
