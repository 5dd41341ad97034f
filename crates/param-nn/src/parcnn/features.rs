//! What the feedback form reads at every edge: the points, the present parameters, and the fit at them.

use super::axes::axes;
use super::fit::SplineSpace;
use super::grid::{Grid, State, dot, length};
use crate::real::Real;

/// Relative residual, root mean square over extent, above which corrections keep their size; below it they shrink with
/// the residual, and an exact fit is left as it is.
const RESPONSE: f64 = 0.02;

/// Residuals are divided by their root mean square; below this share of the extent they count as round-off.
const ROUND_OFF: f64 = 1e-9;

/// Largest number that the network is given.
const LARGEST: f64 = 5.0;

/// Degrees that have an input of their own; others count as the nearest.
const DEGREES: [usize; 4] = [2, 3, 4, 5];

/// Inputs an edge.
pub(super) fn count(dimension: usize, directions: usize) -> usize {
    let along = 5 * dimension + 15;
    if directions == 1 { along } else { along + 2 * dimension + 4 }
}

/// Factor of the network's corrections.
pub(super) fn response(grid: &Grid, state: &State) -> f64 {
    let relative = state.fit.mse.sqrt() / grid.extent().1;
    relative / (relative + RESPONSE)
}

/// Logarithm of a ratio, in the range of the other inputs.
fn logarithm(x: f64) -> f64 {
    if x > 0.0 { 0.5 * x.ln().clamp(-7.0, 4.0) } else { -3.5 }
}

fn bounded(x: f64) -> f64 {
    if x.is_nan() { 0.0 } else { x.clamp(-LARGEST, LARGEST) }
}

/// Appends the rows of a grid seen along a direction, line after line.
pub(super) fn append<T: Real>(
    out: &mut Vec<T>,
    grid: &Grid,
    spaces: [SplineSpace; 2],
    state: &State,
    direction: usize,
) {
    let axes = axes(grid, direction);
    let (centre, extent) = grid.extent();
    let [lines, places] = grid.lines(direction);
    let edges = places - 1;
    let dimension = grid.dimension;
    let residual_scale = 1.0 / (state.fit.mse.sqrt() + ROUND_OFF * extent);
    let response_inverse = 1.0 / (response(grid, state) + ROUND_OFF);
    let relative = state.fit.mse.sqrt() / extent;
    let lengths = grid.edge_lengths(direction);
    // Foot-point steps in the direction, damped where the spline hardly moves.
    let speed = state.fit.jets.iter().map(|j| dot(j[1 + direction], j[1 + direction])).sum::<f64>()
        / state.fit.jets.len() as f64;
    let shift = |index: usize| {
        let jet = &state.fit.jets[index];
        -dot(jet[0], jet[1 + direction]) / (dot(jet[1 + direction], jet[1 + direction]) + 1e-3 * speed)
    };
    let mut put = |x: f64| out.push(T::from_f64(bounded(x)));
    for line in 0..lines {
        let own = &lengths[line * edges..(line + 1) * edges];
        let total: f64 = own.iter().sum();
        let steps = &state.steps[direction][line * edges..(line + 1) * edges];
        let mut travelled = 0.0;
        for edge in 0..edges {
            let [a, b] = [edge, edge + 1].map(|place| grid.index(direction, line, place));
            let (p, q) = (grid.xyz[a], grid.xyz[b]);
            let turned = |x: [f64; 3], k: usize| dot(axes[k], x);
            let vector: [f64; 3] = std::array::from_fn(|k| q[k] - p[k]);
            let middle: [f64; 3] = std::array::from_fn(|k| 0.5 * (p[k] + q[k]) - centre[k]);
            let (step, size) = (steps[edge], own[edge]);
            let parameter = |d: usize| 0.5 * (state.uv[a][d] + state.uv[b][d]);
            let velocity: [f64; 3] = std::array::from_fn(|k| {
                0.5 * (state.fit.jets[a][1 + direction][k] + state.fit.jets[b][1 + direction][k])
            });
            let pace = length(velocity);
            for k in 0..dimension {
                put(turned(vector, k) / size);
                put(turned(middle, k) / extent);
                put(turned(state.fit.jets[a][0], k) * residual_scale);
                put(turned(state.fit.jets[b][0], k) * residual_scale);
                put(if pace > 0.0 { turned(velocity, k) / pace } else { 0.0 });
            }
            let (left, right) = (shift(a), shift(b));
            put(logarithm(size * edges as f64 / total));
            put(2.0 * parameter(direction) - 1.0);
            put(logarithm(step * edges as f64));
            put((response_inverse * (right - left) / step).asinh());
            put((10.0 * response_inverse * left).asinh());
            put((10.0 * response_inverse * right).asinh());
            put(logarithm(pace * step / size));
            put((relative.max(1e-12).ln() + 5.0) / 3.0);
            let degree = spaces[direction].degree.clamp(DEGREES[0], DEGREES[3]);
            DEGREES.iter().for_each(|&d| put(if d == degree { 1.0 } else { 0.0 }));
            put((spaces[direction].elements as f64).ln());
            put((edges as f64 / 20.0).ln());
            travelled += size;
            put(2.0 * (travelled - 0.5 * size) / total - 1.0);
            if grid.directions() == 2 {
                let other = 1 - direction;
                let [before, after] = [line.saturating_sub(1), (line + 1).min(lines - 1)];
                let crossing: [f64; 3] = std::array::from_fn(|k| {
                    let at = |line: usize, place: usize| grid.xyz[grid.index(direction, line, place)][k];
                    0.5 * (at(after, edge) + at(after, edge + 1) - at(before, edge) - at(before, edge + 1))
                });
                let width = length(crossing);
                let drift: [f64; 3] =
                    std::array::from_fn(|k| state.fit.jets[a][1 + other][k] + state.fit.jets[b][1 + other][k]);
                let drift_size = length(drift);
                for k in 0..dimension {
                    put(if width > 0.0 { turned(crossing, k) / width } else { 0.0 });
                    put(if drift_size > 0.0 { turned(drift, k) / drift_size } else { 0.0 });
                }
                put(logarithm(width * lines as f64 / extent) - 0.5);
                put(2.0 * parameter(other) - 1.0);
                put((spaces[other].elements as f64).ln());
                put((lines as f64 / 10.0).ln());
            }
        }
    }
}
