//! The network: a logit for every edge from the features of all edges, and the gradient by all weights.
//!
//! Imperatore 2024, §4.2.3. With L̂ = −B A (see [`EdgeGraph`]), every power of L̂ but the zeroth has its edge rows made of
//! rows of points: L̂ⁿ = (−1)ⁿ B (A B)ⁿ⁻¹ A. So of the five matrices of a convolution only one combination acts on edges;
//! the others act on points, of which there are some thirty times fewer.

use super::edges::EdgeGraph;
use super::layout::{Convolution, FEATURES, LAYERS, Layout, POLYNOMIALS, WIDTH};
use crate::bidgcn::layers::{
    Normalized, add_column_sums, add_linear, add_row, add_weight_gradient, input_gradient, linear, relu, relu_backward,
    zeros,
};
use crate::real::Real;

/// Chebyshev's polynomials, a column each, by the factors of x ↦ x, B A x, B (A B) A x, … in them.
const IN_POWERS: [[f64; POLYNOMIALS]; POLYNOMIALS] = [
    [1.0, 0.0, -1.0, 0.0, 1.0],
    [0.0, -1.0, 0.0, 3.0, 0.0],
    [0.0, 0.0, 2.0, 0.0, -8.0],
    [0.0, 0.0, 0.0, -4.0, 0.0],
    [0.0, 0.0, 0.0, 0.0, 8.0],
];

/// Matrices of the powers from those of the polynomials, one below the other.
fn power_matrices<T: Real>(weights: &[T]) -> Vec<Vec<T>> {
    let size = weights.len() / POLYNOMIALS;
    let combine = |factors: [f64; POLYNOMIALS]| {
        let mut sum = zeros(size);
        for (factor, matrix) in factors.into_iter().zip(weights.chunks_exact(size)).filter(|(f, _)| *f != 0.0) {
            sum.iter_mut().zip(matrix).for_each(|(s, w)| *s += T::from_f64(factor) * *w);
        }
        sum
    };
    IN_POWERS.into_iter().map(combine).collect()
}

/// What the gradient needs.
#[derive(Debug)]
pub(crate) struct Tape<T> {
    /// Features of the edges, then the results of the convolutions.
    features: Vec<Vec<T>>,
    /// For each convolution `(A B)ᵏ A x` for k from 0.
    powers: Vec<Vec<Vec<T>>>,
    hidden: Normalized<T>,
}

/// A convolution, and the rows of points that it met.
fn convolve<T: Real>(slots: &Convolution, theta: &[T], graph: &EdgeGraph, x: &[T]) -> (Vec<T>, Vec<Vec<T>>) {
    let matrices = power_matrices(&theta[slots.weights.clone()]);
    let mut powers = vec![graph.gather(x, slots.inputs)];
    for k in 1..POLYNOMIALS - 1 {
        powers.push(graph.step(&powers[k - 1], slots.inputs));
    }
    let mut z = zeros(graph.interior * WIDTH);
    for (power, matrix) in powers.iter().zip(&matrices[1..]) {
        add_linear(&mut z, power, slots.inputs, matrix);
    }
    let mut y = linear(x, slots.inputs, &matrices[0]);
    graph.add_spread(&mut y, &z, WIDTH);
    add_row(&mut y, &theta[slots.bias.clone()]);
    relu(&mut y);
    (y, powers)
}

/// Logits of all edges, from features of [`FEATURES`] numbers an edge. Without a `tape` intermediate results are dropped
/// as early as may be.
pub(crate) fn forward<T: Real>(
    layout: &Layout,
    theta: &[T],
    graph: &EdgeGraph,
    features: Vec<T>,
    keep: bool,
) -> (Vec<T>, Option<Tape<T>>) {
    let hidden = &theta[layout.hidden.clone()];
    let (for_features, mut rest) = hidden.split_at(FEATURES * WIDTH);
    let mut joined = linear(&features, FEATURES, for_features);
    let (mut x, mut kept, mut powers) = (features, Vec::new(), Vec::new());
    for slots in &layout.convolutions {
        let (y, met) = convolve(slots, theta, graph, &x);
        let (matrix, others) = rest.split_at(WIDTH * WIDTH);
        rest = others;
        add_linear(&mut joined, &y, WIDTH, matrix);
        let before = std::mem::replace(&mut x, y);
        if keep {
            kept.push(before);
            powers.push(met);
        }
    }
    kept.push(x);
    if !keep {
        kept.clear();
    }
    let hidden = Normalized::new(joined, &theta[layout.norm.clone()]);
    let logits = linear(&hidden.result, WIDTH, &theta[layout.last.clone()]);
    (logits, keep.then_some(Tape { features: kept, powers, hidden }))
}

/// Gradient by all weights from that of the logits. Biases that do not act have gradient zero.
pub(crate) fn backward<T: Real>(
    layout: &Layout,
    theta: &[T],
    graph: &EdgeGraph,
    tape: &Tape<T>,
    logit_gradient: &[T],
) -> Vec<T> {
    let mut gradient: Vec<T> = zeros(layout.len());
    add_weight_gradient(&mut gradient[layout.last.clone()], &tape.hidden.result, WIDTH, logit_gradient);
    let dy = input_gradient(logit_gradient, WIDTH, &theta[layout.last.clone()]);
    let dy = tape.hidden.backward(dy, &theta[layout.norm.clone()], &mut gradient[layout.norm.clone()]);
    // Rows of the first output layer that a result of the convolutions meets.
    let part = |k: usize| {
        let start = layout.hidden.start + (FEATURES + k * WIDTH) * WIDTH;
        start..start + WIDTH * WIDTH
    };
    let first = layout.hidden.start..layout.hidden.start + FEATURES * WIDTH;
    add_weight_gradient(&mut gradient[first], &tape.features[0], FEATURES, &dy);
    let mut from_above: Option<Vec<T>> = None;
    for k in (0..LAYERS).rev() {
        add_weight_gradient(&mut gradient[part(k)], &tape.features[k + 1], WIDTH, &dy);
        let mut given = input_gradient(&dy, WIDTH, &theta[part(k)]);
        if let Some(above) = from_above.take() {
            given.iter_mut().zip(&above).for_each(|(g, a)| *g += *a);
        }
        relu_backward(&mut given, &tape.features[k + 1]);
        let slots = &layout.convolutions[k];
        from_above = convolve_backward(slots, theta, graph, tape, k, &given, &mut gradient);
    }
    gradient
}

/// Adds to the gradient by the weights of convolution k; returns that of its input, but for the first.
fn convolve_backward<T: Real>(
    slots: &Convolution,
    theta: &[T],
    graph: &EdgeGraph,
    tape: &Tape<T>,
    k: usize,
    given: &[T],
    gradient: &mut [T],
) -> Option<Vec<T>> {
    let (x, powers, inputs) = (&tape.features[k], &tape.powers[k], slots.inputs);
    let matrices = power_matrices(&theta[slots.weights.clone()]);
    add_column_sums(&mut gradient[slots.bias.clone()], given);
    let dz = graph.spread_adjoint(given, WIDTH);
    let size = inputs * WIDTH;
    for (power, factors) in IN_POWERS.iter().enumerate() {
        let mut for_matrix = zeros(size);
        match power {
            0 => add_weight_gradient(&mut for_matrix, x, inputs, given),
            _ => add_weight_gradient(&mut for_matrix, &powers[power - 1], inputs, &dz),
        }
        let targets = gradient[slots.weights.clone()].chunks_exact_mut(size);
        for (factor, target) in factors.iter().zip(targets).filter(|(f, _)| **f != 0.0) {
            target.iter_mut().zip(&for_matrix).for_each(|(t, m)| *t += T::from_f64(*factor) * *m);
        }
    }
    if k == 0 {
        return None;
    }
    // Horner's scheme on the adjoint of A B.
    let mut for_points = input_gradient(&dz, inputs, &matrices[POLYNOMIALS - 1]);
    for matrix in matrices[1..POLYNOMIALS - 1].iter().rev() {
        for_points = graph.step_adjoint(&for_points, inputs);
        let own = input_gradient(&dz, inputs, matrix);
        for_points.iter_mut().zip(&own).for_each(|(p, o)| *p += *o);
    }
    let mut dx = input_gradient(given, inputs, &matrices[0]);
    graph.add_gather_adjoint(&mut dx, &for_points, inputs);
    Some(dx)
}

#[cfg(test)]
#[path = "network_tests.rs"]
mod tests;
