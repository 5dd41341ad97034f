//! Forward and backward passes in closed form, on rows that stand line after line.

use super::layout::{Block, Convolution, Form, Layout};
use crate::bidgcn::layers::{
    add_column_sums, add_linear, add_row, add_weight_gradient, input_gradient, linear, relu, relu_backward, zeros,
};
use crate::real::{Real, vectorized};

/// Rows of a batch: groups of lines of places, one row each; the places run first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Rows {
    pub(crate) groups: usize,
    pub(crate) lines: usize,
    pub(crate) places: usize,
}

impl Rows {
    fn count(self) -> usize {
        self.groups * self.lines * self.places
    }

    /// Row under an entry of a kernel; outside the first or the last one counts again (replicate padding).
    fn source(self, row: usize, [across, along]: [isize; 2]) -> usize {
        let (line, place) = (row / self.places, row % self.places);
        let (group, line) = (line / self.lines, line % self.lines);
        let line = line.saturating_add_signed(across).min(self.lines - 1);
        let place = place.saturating_add_signed(along).min(self.places - 1);
        (group * self.lines + line) * self.places + place
    }

    /// Row of means over the line that a row lies in.
    fn line(self, row: usize) -> usize {
        row / self.places
    }

    /// Row of means over all lines of its group at its place.
    fn place(self, row: usize) -> usize {
        row / (self.lines * self.places) * self.places + row % self.places
    }
}

/// What the forward pass leaves for the backward pass.
#[derive(Debug)]
pub(crate) struct Tape<T> {
    layers: Vec<Layer<T>>,
}

/// A convolution's input, entry by entry, what came out, and the means that went in.
#[derive(Debug)]
struct Layer<T> {
    columns: Vec<T>,
    sum: Vec<T>,
    result: Vec<T>,
    along: Vec<T>,
    across: Vec<T>,
}

/// Whether the forward pass keeps what the backward pass needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Keep {
    Everything,
    Nothing,
}

/// Output rows: one number each in the feedback form, D in the published one.
pub(crate) fn forward<T: Real>(
    layout: &Layout,
    theta: &[T],
    input: Vec<T>,
    rows: Rows,
    keep: Keep,
) -> (Vec<T>, Tape<T>) {
    let (y, mut tape) = match layout.architecture.form {
        Form::Published { .. } => forward_published(layout, theta, input, rows),
        Form::Feedback { .. } => forward_feedback(layout, theta, input, rows, keep),
    };
    if keep == Keep::Nothing {
        tape.layers.clear();
    }
    (y, tape)
}

/// The gradient by all weights from that of the output.
pub(crate) fn backward<T: Real>(layout: &Layout, theta: &[T], tape: &Tape<T>, rows: Rows, given: &[T]) -> Vec<T> {
    match layout.architecture.form {
        Form::Published { .. } => backward_published(layout, theta, tape, rows, given),
        Form::Feedback { .. } => backward_feedback(layout, theta, tape, rows, given),
    }
}

fn forward_published<T: Real>(layout: &Layout, theta: &[T], mut x: Vec<T>, rows: Rows) -> (Vec<T>, Tape<T>) {
    let mut layers = Vec::new();
    for (k, convolution) in layout.convolutions.iter().enumerate() {
        let columns = gather(&x, convolution, rows);
        x = convolve(&columns, convolution, theta);
        if k + 1 < layout.convolutions.len() {
            relu(&mut x);
        }
        let result = if k + 1 < layout.convolutions.len() { x.clone() } else { Vec::new() };
        layers.push(Layer { columns, sum: Vec::new(), result, along: Vec::new(), across: Vec::new() });
    }
    (x, Tape { layers })
}

fn backward_published<T: Real>(layout: &Layout, theta: &[T], tape: &Tape<T>, rows: Rows, given: &[T]) -> Vec<T> {
    let mut gradient = zeros(theta.len());
    let mut dy = given.to_vec();
    for (k, (convolution, layer)) in layout.convolutions.iter().zip(&tape.layers).enumerate().rev() {
        if k + 1 < layout.convolutions.len() {
            relu_backward(&mut dy, &layer.result);
        }
        add_convolution_gradient(&mut gradient, &layer.columns, convolution, &dy);
        if k > 0 {
            let mut dx = zeros(rows.count() * convolution.inputs);
            scatter(&mut dx, &columns_gradient(&dy, convolution, theta), convolution, rows);
            dy = dx;
        }
    }
    gradient
}

fn forward_feedback<T: Real>(layout: &Layout, theta: &[T], input: Vec<T>, rows: Rows, keep: Keep) -> (Vec<T>, Tape<T>) {
    let mut layers = Vec::new();
    let (first, last) = (&layout.convolutions[0], &layout.convolutions[1]);
    let mut x = convolve(&input, first, theta);
    layers.push(Layer { columns: input, sum: Vec::new(), result: Vec::new(), along: Vec::new(), across: Vec::new() });
    let width = layout.width;
    for block in &layout.blocks {
        let columns = gather(&x, &block.convolution, rows);
        let mut sum = convolve(&columns, &block.convolution, theta);
        let along = means(&x, width, rows, Rows::line);
        add_rows(&mut sum, &linear(&along, width, &theta[block.along.clone()]), width, rows, Rows::line);
        let across = if block.across.is_empty() { Vec::new() } else { means(&x, width, rows, Rows::place) };
        if !across.is_empty() {
            add_rows(&mut sum, &linear(&across, width, &theta[block.across.clone()]), width, rows, Rows::place);
        }
        let result = gated(&sum);
        add_linear(&mut x, &result, width, &theta[block.second.clone()]);
        add_row(&mut x, &theta[block.second_bias.clone()]);
        // PERF: large buffers that are given back at once are used again by the next block, while still in the cache.
        if keep == Keep::Everything {
            layers.push(Layer { columns, sum, result, along, across });
        }
    }
    let result = gated(&x);
    let y = convolve(&result, last, theta);
    layers.push(Layer { columns: Vec::new(), sum: x, result, along: Vec::new(), across: Vec::new() });
    (y, Tape { layers })
}

fn backward_feedback<T: Real>(layout: &Layout, theta: &[T], tape: &Tape<T>, rows: Rows, given: &[T]) -> Vec<T> {
    let mut gradient = zeros(theta.len());
    let (first, last) = (&layout.convolutions[0], &layout.convolutions[1]);
    let [input, layers @ .., output] = &tape.layers[..] else { return gradient };
    add_convolution_gradient(&mut gradient, &output.result, last, given);
    let mut dx = input_gradient(given, layout.width, &theta[last.weights.clone()]);
    gated_backward(&mut dx, &output.sum);
    for (block, layer) in layout.blocks.iter().zip(layers).rev() {
        backward_block(&mut gradient, &mut dx, theta, block, layer, layout.width, rows);
    }
    add_convolution_gradient(&mut gradient, &input.columns, first, &dx);
    gradient
}

/// `dx`: the gradient of the block's output in, of its input out.
fn backward_block<T: Real>(
    gradient: &mut [T],
    dx: &mut [T],
    theta: &[T],
    block: &Block,
    layer: &Layer<T>,
    width: usize,
    rows: Rows,
) {
    add_column_sums(&mut gradient[block.second_bias.clone()], dx);
    add_weight_gradient(&mut gradient[block.second.clone()], &layer.result, width, dx);
    let mut dy = input_gradient(dx, width, &theta[block.second.clone()]);
    gated_backward(&mut dy, &layer.sum);
    add_convolution_gradient(gradient, &layer.columns, &block.convolution, &dy);
    scatter(dx, &columns_gradient(&dy, &block.convolution, theta), &block.convolution, rows);
    for (means, slot, index) in [
        (&layer.along, &block.along, Rows::line as fn(Rows, usize) -> usize),
        (&layer.across, &block.across, Rows::place as fn(Rows, usize) -> usize),
    ] {
        if means.is_empty() {
            continue;
        }
        let sums = sums(&dy, width, rows, means.len() / width, index);
        add_weight_gradient(&mut gradient[slot.clone()], means, width, &sums);
        let mut back = input_gradient(&sums, width, &theta[slot.clone()]);
        let share = T::from_f64(means.len() as f64 / width as f64 / rows.count() as f64);
        back.iter_mut().for_each(|x| *x *= share);
        add_rows(dx, &back, width, rows, index);
    }
}

fn convolve<T: Real>(columns: &[T], convolution: &Convolution, theta: &[T]) -> Vec<T> {
    let inputs = convolution.taps.len() * convolution.inputs;
    let mut y = linear(columns, inputs, &theta[convolution.weights.clone()]);
    add_row(&mut y, &theta[convolution.bias.clone()]);
    y
}

fn add_convolution_gradient<T: Real>(gradient: &mut [T], columns: &[T], convolution: &Convolution, dy: &[T]) {
    let inputs = convolution.taps.len() * convolution.inputs;
    add_weight_gradient(&mut gradient[convolution.weights.clone()], columns, inputs, dy);
    add_column_sums(&mut gradient[convolution.bias.clone()], dy);
}

fn columns_gradient<T: Real>(dy: &[T], convolution: &Convolution, theta: &[T]) -> Vec<T> {
    input_gradient(dy, convolution.taps.len() * convolution.inputs, &theta[convolution.weights.clone()])
}

/// Each row's neighbours under the kernel, side by side.
fn gather<T: Real>(x: &[T], convolution: &Convolution, rows: Rows) -> Vec<T> {
    let width = convolution.inputs;
    let mut columns = Vec::with_capacity(x.len() * convolution.taps.len());
    for row in 0..rows.count() {
        for &tap in &convolution.taps {
            let source = rows.source(row, tap);
            columns.extend_from_slice(&x[source * width..(source + 1) * width]);
        }
    }
    columns
}

/// The adjoint of [`gather`]; adds.
fn scatter<T: Real>(dx: &mut [T], columns: &[T], convolution: &Convolution, rows: Rows) {
    let width = convolution.inputs;
    let mut parts = columns.chunks_exact(width);
    vectorized(
        #[inline(always)]
        || {
            for row in 0..rows.count() {
                for &tap in &convolution.taps {
                    let source = rows.source(row, tap);
                    let target = &mut dx[source * width..(source + 1) * width];
                    parts.next().into_iter().for_each(|part| target.iter_mut().zip(part).for_each(|(t, p)| *t += *p));
                }
            }
        },
    );
}

fn sums<T: Real>(x: &[T], width: usize, rows: Rows, count: usize, index: fn(Rows, usize) -> usize) -> Vec<T> {
    let mut sums: Vec<T> = zeros(count * width);
    vectorized(
        #[inline(always)]
        || {
            for (row, values) in x.chunks_exact(width).enumerate() {
                let target = index(rows, row) * width;
                sums[target..target + width].iter_mut().zip(values).for_each(|(s, v)| *s += *v);
            }
        },
    );
    sums
}

fn means<T: Real>(x: &[T], width: usize, rows: Rows, index: fn(Rows, usize) -> usize) -> Vec<T> {
    let count = index(rows, rows.count() - 1) + 1;
    let mut means = sums(x, width, rows, count, index);
    let share = T::from_f64(count as f64 / rows.count() as f64);
    means.iter_mut().for_each(|m| *m *= share);
    means
}

fn add_rows<T: Real>(x: &mut [T], added: &[T], width: usize, rows: Rows, index: fn(Rows, usize) -> usize) {
    vectorized(
        #[inline(always)]
        || {
            for (row, values) in x.chunks_exact_mut(width).enumerate() {
                let source = index(rows, row) * width;
                values.iter_mut().zip(&added[source..source + width]).for_each(|(x, a)| *x += *a);
            }
        },
    );
}

/// `x (1 + x / (1 + |x|)) / 2`: as smooth as swish, without its exponential.
fn gated<T: Real>(x: &[T]) -> Vec<T> {
    let mut y = x.to_vec();
    let (half, one, zero) = (T::from_f64(0.5), T::from_f64(1.0), T::from_f64(0.0));
    vectorized(
        #[inline(always)]
        || {
            for y in &mut y {
                let size: T = if *y > zero { *y } else { zero - *y };
                *y = half * *y * (one + *y / (one + size));
            }
        },
    );
    y
}

fn gated_backward<T: Real>(gradient: &mut [T], x: &[T]) {
    let (half, one, zero) = (T::from_f64(0.5), T::from_f64(1.0), T::from_f64(0.0));
    vectorized(
        #[inline(always)]
        || {
            for (g, x) in gradient.iter_mut().zip(x) {
                let size: T = if *x > zero { *x } else { zero - *x };
                let inverse: T = one / (one + size);
                *g *= half * (one + *x * inverse * (one + inverse));
            }
        },
    );
}

#[cfg(test)]
#[path = "network_tests.rs"]
mod tests;
