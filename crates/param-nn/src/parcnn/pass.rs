//! One pass of a network over a batch of grids of equal size.

use ndarray::ArrayView1;

use super::features;
use super::fit::SplineSpace;
use super::grid::{Grid, State};
use super::layout::{Form, Layout};
use super::network::{Keep, Rows, Tape, backward, forward};
use crate::gridded::GriddedCloud;
use crate::real::Real;

/// A grid and the splines that its parameters are for.
#[derive(Clone, Debug)]
pub(crate) struct Task {
    pub(crate) grid: Grid,
    pub(crate) spaces: [SplineSpace; 2],
}

impl Task {
    /// Splines of the same kind along all directions.
    pub(crate) fn new(grid: Grid, space: SplineSpace) -> Self {
        let across = if grid.directions() == 2 { space } else { super::fit::CONSTANTS };
        Self { grid, spaces: [space, across] }
    }

    /// Polynomials of a degree through a random grid.
    pub(crate) fn of_sample(sample: &GriddedCloud, degree: usize) -> Self {
        let place = |p: ArrayView1<'_, f64>| std::array::from_fn(|k| p.get(k).copied().unwrap_or(0.0));
        let xyz = sample.points.rows().into_iter().map(place).collect();
        let grid = Grid { xyz, size: sample.size, dimension: sample.points.ncols() };
        Self::new(grid, SplineSpace::polynomials(degree))
    }

    pub(crate) fn classical_state(&self) -> State {
        self.grid.classical_state(self.spaces)
    }
}

/// One run of the network, along one direction in the feedback form.
struct Run<T> {
    rows: Rows,
    tape: Tape<T>,
    output: Vec<T>,
}

/// A pass: new states, and what its gradient needs.
pub(crate) struct Pass<T> {
    runs: Vec<Run<T>>,
    /// Factors of the corrections.
    responses: Vec<f64>,
    pub(crate) states: Vec<State>,
}

impl<T: Real> Pass<T> {
    /// Corrects the parameters of all tasks, which have equal sizes. The published form does not read the states.
    pub(crate) fn new(layout: &Layout, theta: &[T], tasks: &[Task], states: &[State], keep: Keep) -> Self {
        match layout.architecture.form {
            Form::Feedback { .. } => Self::feedback(layout, theta, tasks, states, keep),
            Form::Published { .. } => Self::published(layout, theta, tasks, keep),
        }
    }

    fn feedback(layout: &Layout, theta: &[T], tasks: &[Task], states: &[State], keep: Keep) -> Self {
        let responses: Vec<f64> = tasks.iter().zip(states).map(|(t, s)| features::response(&t.grid, s)).collect();
        let along = |direction: usize| {
            let [lines, places] = tasks[0].grid.lines(direction);
            let rows = Rows { groups: tasks.len(), lines, places: places - 1 };
            let mut input = Vec::new();
            for (task, state) in tasks.iter().zip(states) {
                features::append(&mut input, &task.grid, task.spaces, state, direction);
            }
            let (output, tape) = forward(layout, theta, input, rows, keep);
            Run { rows, tape, output }
        };
        let runs = match layout.architecture.directions {
            1 => vec![along(0)],
            _ => <[Run<T>; 2]>::from(rayon::join(|| along(0), || along(1))).into(),
        };
        let mut new_states = Vec::with_capacity(tasks.len());
        for (k, (task, state)) in tasks.iter().zip(states).enumerate() {
            let steps = runs.iter().enumerate().map(|(direction, run)| {
                let per_task = run.output.len() / tasks.len();
                let output = &run.output[k * per_task..(k + 1) * per_task];
                let edges = run.rows.places;
                let mut new = Vec::with_capacity(per_task);
                for (old, y) in state.steps[direction].chunks_exact(edges).zip(output.chunks_exact(edges)) {
                    let logit = |(s, y): (&f64, &T)| s.max(f64::MIN_POSITIVE).ln() + responses[k] * y.to_f64();
                    new.extend(softmax(old.iter().zip(y).map(logit).collect()));
                }
                new
            });
            new_states.push(task.grid.state(task.spaces, steps.collect()));
        }
        Self { runs, responses, states: new_states }
    }

    fn published(layout: &Layout, theta: &[T], tasks: &[Task], keep: Keep) -> Self {
        let directions = layout.architecture.directions;
        let [places, lines] = tasks[0].grid.size;
        // Rows along the second direction of a grid run first; a sequence is one line along its only direction.
        let rows = match directions {
            1 => Rows { groups: tasks.len(), lines: 1, places: places - 1 },
            _ => Rows { groups: tasks.len(), lines: places, places: lines },
        };
        let mut input = Vec::new();
        tasks.iter().for_each(|task| append_edges(&mut input, &task.grid));
        let (output, tape) = forward(layout, theta, input, rows, keep);
        let per_task = rows.lines * rows.places * directions;
        let mut states = Vec::new();
        for (task, y) in tasks.iter().zip(output.chunks_exact(per_task)) {
            let steps = (0..directions).map(|direction| {
                let [lines, places] = task.grid.lines(direction);
                (0..lines)
                    .flat_map(|line| {
                        let logit = |edge| y[published_row(&task.grid, direction, line, edge) * directions + direction];
                        softmax((0..places - 1).map(|edge| logit(edge).to_f64()).collect())
                    })
                    .collect()
            });
            states.push(task.grid.state(task.spaces, steps.collect()));
        }
        Self { runs: vec![Run { rows, tape, output }], responses: vec![1.0; tasks.len()], states }
    }

    /// The gradient by all weights of a function of the new parameters, from its derivatives by these.
    pub(crate) fn backward(&self, layout: &Layout, theta: &[T], tasks: &[Task], given: &[Vec<[f64; 2]>]) -> Vec<T> {
        let directions = layout.architecture.directions;
        let published = matches!(layout.architecture.form, Form::Published { .. });
        let mut for_output: Vec<Vec<T>> =
            self.runs.iter().map(|run| vec![T::from_f64(0.0); run.output.len()]).collect();
        for (k, (task, given)) in tasks.iter().zip(given).enumerate() {
            for direction in 0..directions {
                let [lines, places] = task.grid.lines(direction);
                let run = &mut for_output[if published { 0 } else { direction }];
                let per_task = run.len() / tasks.len();
                let out = &mut run[k * per_task..(k + 1) * per_task];
                for line in 0..lines {
                    let steps = &self.states[k].steps[direction][line * (places - 1)..(line + 1) * (places - 1)];
                    // A step moves all points behind it.
                    let mut by_steps = vec![0.0; places - 1];
                    let mut sum = 0.0;
                    for edge in (0..places - 1).rev() {
                        sum += given[task.grid.index(direction, line, edge + 1)][direction];
                        by_steps[edge] = sum;
                    }
                    let mean: f64 = steps.iter().zip(&by_steps).map(|(s, g)| s * g).sum();
                    for (edge, (s, g)) in steps.iter().zip(&by_steps).enumerate() {
                        let place = match published {
                            true => published_row(&task.grid, direction, line, edge) * directions + direction,
                            false => line * (places - 1) + edge,
                        };
                        out[place] = T::from_f64(self.responses[k] * s * (g - mean));
                    }
                }
            }
        }
        let mut gradient = vec![T::from_f64(0.0); theta.len()];
        for (run, given) in self.runs.iter().zip(&for_output) {
            let part = backward(layout, theta, &run.tape, run.rows, given);
            gradient.iter_mut().zip(part).for_each(|(g, p)| *g += p);
        }
        gradient
    }
}

/// Row of an edge in the published form.
fn published_row(grid: &Grid, direction: usize, line: usize, edge: usize) -> usize {
    if grid.directions() == 1 { edge } else { grid.index(direction, line, edge) }
}

/// Edges along all directions; on grids the last of each line is repeated, so that every point has some.
fn append_edges<T: Real>(out: &mut Vec<T>, grid: &Grid) {
    let directions = grid.directions();
    let [first, second] = grid.size;
    let count = if directions == 1 { first - 1 } else { first * second };
    for row in 0..count {
        for direction in 0..directions {
            let (line, place) = match (directions, direction) {
                (1, _) => (0, row),
                (_, 0) => (row % second, row / second),
                _ => (row / second, row % second),
            };
            let place = place.min(grid.size[direction] - 2);
            let [a, b] = [place, place + 1].map(|p| grid.xyz[grid.index(direction, line, p)]);
            (0..grid.dimension).for_each(|k| out.push(T::from_f64(b[k] - a[k])));
        }
    }
}

fn softmax(mut logits: Vec<f64>) -> Vec<f64> {
    let largest = logits.iter().fold(f64::NEG_INFINITY, |a, &b| a.max(b));
    logits.iter_mut().for_each(|x| *x = (*x - largest).exp());
    let sum: f64 = logits.iter().sum();
    logits.iter_mut().for_each(|x| *x /= sum);
    logits
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gridded::{GriddedSpec, Shape};
    use crate::parcnn::layout::Architecture;
    use crate::synthetic::{normal, stream};

    /// The whole chain in double precision: weights, logits, softmax, sums, parameters, least squares, error.
    fn check(architecture: Architecture, shape: Shape, size: [usize; 2], space: SplineSpace) {
        let layout = Layout::new(architecture);
        let mut random = stream(7, 0);
        let theta: Vec<f64> = (0..layout.len()).map(|_| 0.1 * normal(&mut random)).collect();
        let task = |index| {
            let cloud = GriddedSpec { shape, size, noise: 0.02 }.sample(&mut stream(8, index)).unwrap();
            let xyz = cloud.points.rows().into_iter();
            let xyz = xyz.map(|p| std::array::from_fn(|k| p.get(k).copied().unwrap_or(0.0))).collect();
            Task::new(Grid { xyz, size, dimension: architecture.dimension }, space)
        };
        let tasks = [task(0), task(1)];
        let states: Vec<State> = tasks.iter().map(Task::classical_state).collect();
        let loss = |theta: &[f64]| -> f64 {
            let pass = Pass::new(&layout, theta, &tasks, &states, Keep::Nothing);
            pass.states.iter().map(|s| s.fit.mse).sum()
        };
        let pass = Pass::new(&layout, &theta, &tasks, &states, Keep::Everything);
        let given: Vec<Vec<[f64; 2]>> = pass.states.iter().map(|s| s.fit.gradient()).collect();
        let gradient = pass.backward(&layout, &theta, &tasks, &given);
        let norm = gradient.iter().map(|g| g * g).sum::<f64>().sqrt();
        let moved = |h: f64| -> Vec<f64> { theta.iter().zip(&gradient).map(|(t, g)| t + h * g / norm).collect() };
        let h = 1e-5;
        let difference = (loss(&moved(h)) - loss(&moved(-h))) / (2.0 * h);
        assert!(norm > 0.0 && (difference / norm - 1.0).abs() < 1e-6, "{architecture:?}: {difference} against {norm}");
    }

    #[test]
    fn the_gradient_of_the_error_agrees_with_differences() {
        let feedback = Form::Feedback { blocks: 2, width: 8 };
        let published = Form::Published { degree: 2, blocks: 2, width: 8 };
        let space = SplineSpace { degree: 3, elements: 2 };
        for form in [feedback, published] {
            let curve = Architecture { dimension: 2, directions: 1, form };
            check(curve, Shape::Curve { degree: 4, dimension: 2 }, [13, 1], space);
            let grid = Architecture { dimension: 3, directions: 2, form };
            check(grid, Shape::Surface { degree: 4 }, [7, 8], SplineSpace::polynomials(2));
        }
    }
}
